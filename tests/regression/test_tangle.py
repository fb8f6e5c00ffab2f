"""A tangle of concave parts: it stays one with their true shape, and falls apart with their hulls."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hooks import piece_distances

from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run
from feeder_sim.scene.overlap import parts_overlap

SCENARIO = Path(__file__).parents[2] / "scenarios" / "tangle.toml"
HOOKED = 0.95  # parts are hooked into each other where their hulls overlap, even if shrunk to this


def tangle(contact: str) -> Scenario:
    scenario = with_run(load_scenario(SCENARIO), seeds=1, duration_s=0.3)
    hooks = scenario.part[0].model_copy(update={"contact": contact})
    return scenario.model_copy(update={"part": (hooks,)})


def hooked_pairs(result: Result, row: int) -> int:
    """Pairs of parts that are hooked into each other in a frame."""
    frames, scene = result.seeds[0].frames, result.scene
    hull = replace(scene.kinds[0], pieces=(), corners=HOOKED * scene.kinds[0].corners)
    places = list(zip(frames.position[row], frames.quaternion[row], strict=True))
    return sum(parts_overlap(hull, a, hull, b) for a, b in itertools.combinations(places, 2))


@pytest.mark.slow
def test_hooks_stay_hooked_by_their_shape_and_not_by_their_hulls() -> None:
    shapes, hulls = (simulate(tangle(contact)) for contact in ("parts", "hull"))
    assert hooked_pairs(shapes, 0) == hooked_pairs(hulls, 0) == 9
    assert hooked_pairs(shapes, -1) == 9
    assert hooked_pairs(hulls, -1) == 0
    assert piece_distances(shapes.scene, shapes.seeds[0].frames).min() > -50e-6
    assert np.ptp(shapes.seeds[0].frames.position[:, :, 2], axis=0).max() > 5e-5  # it does shake them


@pytest.mark.slow
def test_a_tangle_holds_in_mujoco() -> None:
    shapes = simulate(with_run(tangle("parts"), engine="mujoco", duration_s=0.1))
    assert hooked_pairs(shapes, -1) == 9
    assert piece_distances(shapes.scene, shapes.seeds[0].frames).min() > -50e-6
