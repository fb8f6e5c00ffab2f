"""A free cylinder without steps: energy, rolling, and a coin that precesses, against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from invariants import attitudes, energy, growth, recorded
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.part.rigid_part import CORNER_RADIUS
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Scenario
from feeder_sim.scene.scene import Scene

WIDE = {"kind": "still", "length_mm": 4000.0, "width_mm": 4000.0}
SIZES = ((4.0, 7.0), (6.0, 1.0), (3.0, 3.0))  # diameter and height [mm]


def thrown(size: tuple[float, float], contact: dict[str, float], seconds: float, **state: Any) -> tuple[Scene, Frames]:
    """What is recorded of a cylinder that begins in a state over a plate at rest."""
    shape = {"shape": "cylinder", "diameter_mm": size[0], "height_mm": size[1]}
    part = shape | {"start": {"kind": "state", "position_mm": [0.0, 0.0, 12.0]} | state}
    run = {"duration_s": seconds, "seeds": 1, "frames_per_second": 500.0}
    scene, (frames,) = recorded(
        Scenario.model_validate({"plate": WIDE, "part": [part], "contact": contact, "run": run})
    )
    return scene, frames


def any_state(seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    return {
        "quaternion": Rotation.random(rng=rng).as_quat(scalar_first=True).tolist(),
        "velocity_mm_s": [*rng.uniform(-100.0, 100.0, 2).tolist(), -50.0],
        "angular_velocity_rad_s": (50.0 * rng.normal(size=3)).tolist(),
    }


@pytest.mark.parametrize("size", SIZES)
def test_an_elastic_cylinder_keeps_its_energy(size: tuple[float, float]) -> None:
    """For 4 s, over a hundred impacts, without friction."""
    for seed in range(4):
        scene, frames = thrown(size, {"restitution": 1.0, "friction": 0.0}, 4.0, **any_state(seed))
        total = energy(scene, frames)[:, 0]
        assert total == pytest.approx(total[0], rel=1e-9)


@pytest.mark.parametrize("contact", [(0.9, 0.3), (0.5, 1.0), (0.0, 0.1)])
@pytest.mark.parametrize("size", SIZES)
def test_a_cylinder_that_falls_rolls_or_claps_down_gains_no_energy(
    size: tuple[float, float], contact: tuple[float, float]
) -> None:
    for seed in range(3):
        law = {"restitution": contact[0], "friction": contact[1]}
        assert growth(*thrown(size, law, 1.0, **any_state(seed))) < 1e-7


def test_a_cylinder_on_its_side_rolls_on_at_its_speed() -> None:
    scene, frames = thrown(
        (4.0, 6.0),
        {"restitution": 0.2, "friction": 0.3},
        2.0,
        position_mm=[0.0, 0.0, 2.0 + 1e3 * CORNER_RADIUS],
        quaternion=Rotation.from_euler("x", 90.0, degrees=True).as_quat(scalar_first=True).tolist(),
        velocity_mm_s=[100.0, 0.0, 0.0],
        angular_velocity_rad_s=[0.0, 0.1 / (2e-3 + CORNER_RADIUS), 0.0],
    )
    assert frames.velocity[:, 0, 0] == pytest.approx(0.1, rel=1e-6)
    assert frames.position[:, 0, 2] == pytest.approx(2e-3 + CORNER_RADIUS, abs=1e-8)
    assert growth(scene, frames) < 1e-7


@pytest.mark.parametrize("tilt", [0.2, 0.5, 0.9])
def test_a_coin_precesses_as_rolling_says(tilt: float) -> None:
    """Its centre stands still, and its angular velocity passes through centre and contact.

    With R and h the radius and half the height, I and J the moments of inertia across and along the axis, its contact
    goes around by W^2 = m g R (R cos a - h sin a) / (sin a (I R cos a - J h sin a)), a the tilt of the axis.
    """
    radius, half = 3e-3, 0.4e-3
    # The contact is on a sphere of a micrometre around the circle, which is left out here: it goes around by less.
    scene, _ = thrown((2e3 * radius, 2e3 * half), {}, 0.01, **any_state(0))
    across, _, along = np.sort(scene.parts[0].inertia)
    c, s = np.cos(tilt), np.sin(tilt)
    arm = radius * c - half * s
    around = np.sqrt(scene.parts[0].mass * GRAVITY * radius * arm / (s * (across * radius * c - along * half * s)))
    contact = np.array([arm, 0.0, -radius * s - half * c])
    spin = -around * s / radius * contact
    _, frames = thrown(
        (2e3 * radius, 2e3 * half),
        {"restitution": 0.0, "friction": 5.0},
        0.3,
        position_mm=[0.0, 0.0, 1e3 * (-contact[2] + CORNER_RADIUS)],
        quaternion=Rotation.from_euler("y", tilt).as_quat(scalar_first=True).tolist(),
        angular_velocity_rad_s=spin.tolist(),
    )
    axis = attitudes(frames, 0)[:, :, 2]
    assert np.arccos(axis[:, 2]) == pytest.approx(tilt, abs=3e-3)
    assert np.abs(frames.position[:, 0, :2]).max() < 1e-5
    turned = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
    rate = np.polyfit(frames.time, turned, 1)[0]
    assert rate == pytest.approx(around, rel=2e-3)
