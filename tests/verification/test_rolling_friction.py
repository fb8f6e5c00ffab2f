"""Rolling friction: a moment against rolling, of an arm b times the normal force; what rolls slows down evenly.

A part of mass m and moment of inertia I that rolls on a radius R loses speed at m g b R / (I + m R^2), and lies still.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from invariants import growth, recorded
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.part.rigid_part import CORNER_RADIUS
from feeder_sim.scenario import Scenario

SPEED, ARM = 0.05, 10e-6  # [m/s], [m]
RADIUS = 2e-3
ON_ITS_SIDE = Rotation.from_euler("x", 90.0, degrees=True).as_quat(scalar_first=True).tolist()
ROUND: dict[str, tuple[dict[str, Any], list[float], float]] = {
    "ball": ({"shape": "ball", "diameter_mm": 2e3 * RADIUS}, [1.0, 0.0, 0.0, 0.0], RADIUS),
    "cylinder": (
        {"shape": "cylinder", "diameter_mm": 2e3 * RADIUS, "height_mm": 5.0},
        ON_ITS_SIDE,
        RADIUS + CORNER_RADIUS,
    ),
}


def rolling(name: str, arm_um: float, seconds: float, **more: Any) -> Any:
    """A round part that rolls along x."""
    shape, attitude, radius = ROUND[name]
    state = {
        "kind": "state",
        "position_mm": [0.0, 0.0, 1e3 * radius],
        "quaternion": attitude,
        "velocity_mm_s": [1e3 * SPEED, 0.0, 0.0],
        "angular_velocity_rad_s": [0.0, SPEED / radius, 0.0],
    }
    scenario = {
        "plate": {"kind": "still", "length_mm": 400.0, "width_mm": 400.0},
        "part": [shape | {"start": state}],
        "contact": {"friction": 0.3, "rolling_friction_um": arm_um},
        "run": {"duration_s": seconds, "seeds": 1, "frames_per_second": 1000.0} | more,
    }
    scene, (frames,) = recorded(Scenario.model_validate(scenario))
    return scene, frames


def loss(name: str, scene: Any) -> float:
    """Of speed in time [m/s^2]."""
    part, radius = scene.parts[0], ROUND[name][2]
    rolls = part.inertia.min() + part.mass * radius**2  # the least is that about the axis
    return float(part.mass * GRAVITY * ARM * radius / rolls)


@pytest.mark.parametrize("name", ROUND)
def test_what_rolls_slows_down_evenly_and_stops(name: str) -> None:
    scene, frames = rolling(name, 1e6 * ARM, 2.5)
    slows = loss(name, scene)
    expected = np.maximum(SPEED - slows * frames.time, 0.0)
    assert frames.velocity[:, 0, 0] == pytest.approx(expected, abs=1e-3 * SPEED)
    assert np.abs(frames.velocity[-100:]).max() == 0.0
    assert np.abs(frames.angular_velocity[-100:]).max() == 0.0
    assert frames.position[-1, 0, 0] == pytest.approx(0.5 * SPEED**2 / slows, rel=2e-3)
    assert growth(scene, frames) < 1e-8


@pytest.mark.parametrize("name", ROUND)
def test_steps_say_the_same(name: str) -> None:
    scene, frames = rolling(name, 1e6 * ARM, 0.5, steps_per_period=40)
    assert frames.velocity[-1, 0, 0] == pytest.approx(SPEED - 0.5 * loss(name, scene), abs=0.02 * SPEED)


@pytest.mark.parametrize("name", ROUND)
def test_without_it_nothing_slows_down(name: str) -> None:
    assert rolling(name, 0.0, 0.5)[1].velocity[-1, 0, 0] == pytest.approx(SPEED, rel=1e-5)


@pytest.mark.parametrize("steps", [{}, {"steps_per_period": 40}])
def test_it_does_nothing_to_what_flies_or_slides_without_friction(steps: dict[str, int]) -> None:
    """A ball that slides without friction, and does not turn, has no rolling that could be opposed."""
    shape, _, radius = ROUND["ball"]
    state = {"kind": "state", "position_mm": [0.0, 0.0, 1e3 * radius + 1.0], "velocity_mm_s": [50.0, 0.0, 0.0]}
    scenario = {
        "plate": {"kind": "still", "length_mm": 400.0, "width_mm": 400.0},
        "part": [shape | {"start": state}],
        "contact": {"friction": 0.0, "rolling_friction_um": 10.0},
        "run": {"duration_s": 0.5, "seeds": 1, "frames_per_second": 1000.0} | steps,
    }
    _, (frames,) = recorded(Scenario.model_validate(scenario))
    assert frames.velocity[:, 0, 0] == pytest.approx(0.05, rel=1e-9)
    assert np.abs(frames.angular_velocity).max() < 1e-9
