"""A scenario that is ready to run. `feeder_sim.run.prepare` makes it, once for all seeds and measures."""

from __future__ import annotations

from dataclasses import dataclass

from feeder_sim.scenario import Scenario
from feeder_sim.scenario.engine_choice import Choice
from feeder_sim.scene.cell import Cell
from feeder_sim.scene.scene import Scene


@dataclass(frozen=True)
class Prepared:
    """Everything that is decided before a run.

    Attributes:
        scene: the scenario in SI units.
        engine: the engine, its method, and the reason for the choice.
        cell: the transport cell in which the only part of the scene starts; None where no transport is measured.
        cautions: settings that are known to mislead, a line each.
    """

    scene: Scene
    engine: Choice
    cell: Cell | None
    cautions: tuple[str, ...]

    @property
    def scenario(self) -> Scenario:
        """The scenario from which the scene was built."""
        return self.scene.scenario
