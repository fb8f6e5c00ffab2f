"""The steps of a lone part in the air are MuJoCo's own, and none is taken where it could touch the plate."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import from_python, strip_scenario

from feeder_sim.engines.mujoco import free_flight
from feeder_sim.engines.mujoco.engine import MujocoEngine
from feeder_sim.engines.mujoco.free_flight import flight_of
from feeder_sim.scenario import Cylinder, HexNut, MujocoSettings, Start
from feeder_sim.scene.scene import build_scene

leap = from_python(free_flight.leap)


def hopping(part: Any) -> Any:
    """A part near the antinode, that starts tilted and hops."""
    scenario = strip_scenario(frequency_hz=8775.0, amplitude_um=2.0, duration_s=1.0, engine="mujoco")
    return build_scene(scenario.model_copy(update={"part": (part,)}))


@pytest.mark.parametrize("shape", ["nut", "cylinder"])
def test_a_part_hops_as_with_steps_of_mujoco_alone(shape: str) -> None:
    start = Start(position_mm=(2.0, 0.0), tilt_deg=(10.0, 10.0), drop_height_mm=(0.3, 0.3))
    nut, cylinder = (
        HexNut(size="M2.5", start=start),
        Cylinder(shape="cylinder", diameter_mm=3.0, height_mm=5.0, start=start),
    )
    scene = hopping(nut if shape == "nut" else cylinder)
    engines = [MujocoEngine(scene, np.random.default_rng(1)) for _ in range(2)]
    engines[1]._flight = engines[1]._flight._replace(corners=np.empty((0, 3)))
    for engine in engines:
        engine.data.qvel[engine._part_qvel[0] + 3 : engine._part_qvel[0] + 6] = (30.0, -20.0, 10.0)
    ours, theirs = (engine.advance(60) for engine in engines)
    assert np.ptp(theirs.velocity[:, 0, 2]) > 0.1  # it has hopped
    assert ours.position == pytest.approx(theirs.position, abs=1e-10)
    assert ours.quaternion == pytest.approx(theirs.quaternion, abs=1e-7)
    assert ours.velocity == pytest.approx(theirs.velocity, abs=1e-7)
    assert engines[0].data.time == pytest.approx(engines[1].data.time, rel=1e-9)


def test_a_part_is_left_to_mujoco_where_it_could_touch() -> None:
    scene = hopping(HexNut(size="M2.5"))
    flight, step = flight_of(scene), scene.timestep
    height = flight.crest + flight.radius + 1e-3  # of the centre of a level nut whose corners are at the crest
    falls, lies = np.zeros(6), np.array([0.0, 0.0, height - 1e-9, 1.0, 0.0, 0.0, 0.0])
    assert flight.crest > 2e-6 and leap(lies, falls, flight, step, 100) == 0
    place, motion = np.array([0.0, 0.0, height + 1e-4, 1.0, 0.0, 0.0, 0.0]), np.array([0.1, 0.0, -0.2, 5.0, 5.0, 5.0])
    steps = leap(place, motion, flight, step, 100_000)
    assert 0 < steps * step < 1e-4 / 0.2
    assert place[0] == pytest.approx(0.1 * steps * step) and motion[2] == pytest.approx(-0.2 - 9.81 * steps * step)
    assert place[2] - 1e-3 > flight.crest + flight.radius
    tilted = np.array([0.0, 0.0, height + 1e-4, np.cos(0.1), np.sin(0.1), 0.0, 0.0])  # a corner is below the crest
    assert leap(tilted, motion, flight, step, 100) == 0


def test_scenes_in_which_other_things_can_be_touched_are_left_to_mujoco() -> None:
    scenario = strip_scenario(engine="mujoco")
    assert len(flight_of(build_scene(scenario)).corners)
    second = HexNut(size="M2.5", start=Start(position_mm=(20.0, 0.0)))
    changes: tuple[dict[str, Any], ...] = (
        {"mujoco": MujocoSettings(integrator="implicitfast")},
        {"part": (*scenario.part, second)},
    )
    for change in changes:
        other = build_scene(scenario.model_copy(update=change))
        assert not len(flight_of(other).corners)
