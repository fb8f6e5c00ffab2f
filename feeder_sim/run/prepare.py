"""Scenario -> everything that is decided before a run: scene, engine, cell, cautions."""

from __future__ import annotations

from feeder_sim.run.advice import cautions
from feeder_sim.run.plausibility import check_plausible, doubts
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.cell import check_stop_rule, transport_cell
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import build_scene
from feeder_sim.single_thread import single_threaded


@single_threaded
def prepare(scenario: Scenario) -> Prepared:
    """Resolve a scenario.

    Raises:
        InputError: the plate, a drive, a part or a start cannot be had, the start does not suit the stop rule, or
            nobody can mean it.
    """
    scene, engine = build_scene(scenario), choose_engine(scenario)
    check_plausible(scene)
    cell = transport_cell(scene)
    check_stop_rule(scene, cell)
    return Prepared(scene, engine, cell, (*cautions(scene, engine), *doubts(scene)))
