"""Motion of one part on a plate that can be written down: rolling, sliding, rocking, riding and lying still."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from invariants import DEEPEST, attitudes, depth_under, quiet, recorded
from scipy.integrate import quad
from scipy.spatial.transform import Rotation
from test_invariants import PISTON, plate_height, scenario, swing

from feeder_sim.constants import GRAVITY
from feeder_sim.part.rigid_part import CORNER_RADIUS
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Ball, Box, GivenState
from feeder_sim.scene.scene import Scene

Triple = tuple[float, float, float]
LEVEL = 1e-9  # [m] that a face which lies on a plate may be off


def start_at(position_mm: Triple, velocity_mm_s: Triple = (0.0, 0.0, 0.0), **more: Any) -> GivenState:
    given = {"kind": "state", "position_mm": position_mm, "velocity_mm_s": velocity_mm_s}
    return GivenState.model_validate(given | more)


def box(size_mm: Triple, start: GivenState) -> Box:
    return Box(shape="box", size_mm=size_mm, start=start)


# Friction


@pytest.mark.parametrize("speed", [50.0, 300.0])
@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_a_ball_that_slides_rolls_in_the_end_at_five_sevenths_of_its_speed(friction: float, speed: float) -> None:
    part = Ball(shape="ball", diameter_mm=4.0, start=start_at((0.0, 0.0, 2.0), (speed, 0.0, 0.0)))
    _, (frames,) = recorded(scenario(part, contact=quiet(friction=friction)))
    rolls_after = 2.0 * 1e-3 * speed / (7.0 * friction * GRAVITY)
    assert rolls_after < 0.3
    rolling = frames[slice(int(np.searchsorted(frames.time, rolls_after + 1e-3)), None)]
    expected = 5.0 / 7.0 * 1e-3 * speed
    rolls = np.tile([expected, 0.0, 0.0, 0.0, expected / 2e-3, 0.0], (len(rolling), 1))
    np.testing.assert_allclose(np.hstack([rolling.velocity[:, 0], rolling.angular_velocity[:, 0]]), rolls, atol=1e-9)
    # and while it slid, its speed fell by mu g t
    sliding = frames[slice(None, int(np.searchsorted(frames.time, 0.9 * rolls_after)))]
    fallen = 1e-3 * speed - friction * GRAVITY * sliding.time
    np.testing.assert_allclose(sliding.velocity[:, 0, 0], fallen, atol=1e-9)


@pytest.mark.parametrize("speed", [50.0, 200.0])
@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_a_box_that_slides_flat_stops_after_the_way_that_friction_leaves_it(friction: float, speed: float) -> None:
    size = (12.0, 10.0, 4.0)
    start = start_at((0.0, 0.0, 2.0 + 1e3 * CORNER_RADIUS), (speed, 0.0, 0.0))
    _, (frames,) = recorded(scenario(box(size, start), contact=quiet(friction=friction)))
    way = (1e-3 * speed) ** 2 / (2.0 * friction * GRAVITY)
    assert frames.position[-1, 0, 0] == pytest.approx(way, rel=1e-8)
    assert np.abs(frames.position[:, 0, 1]).max() < 1e-9
    assert np.linalg.norm(frames.velocity[-1]) < 1e-9 and np.linalg.norm(frames.angular_velocity[-1]) < 1e-9
    stops = 1e-3 * speed / (friction * GRAVITY)
    sliding = frames[slice(None, int(np.searchsorted(frames.time, 0.95 * stops)))]
    expected = 1e-3 * speed * sliding.time - 0.5 * friction * GRAVITY * sliding.time**2
    np.testing.assert_allclose(sliding.position[:, 0, 0], expected, atol=1e-9)


# Rocking

HALF_WIDTH, HALF_HEIGHT = 2.5e-3, 7.5e-3  # of the block [m]
RADIUS, SLENDER = math.hypot(HALF_WIDTH, HALF_HEIGHT), math.atan(HALF_WIDTH / HALF_HEIGHT)
GYRATION = RADIUS / math.sqrt(3.0)


def angular_speed(tilt: float, released: float) -> float:
    """Of the block after it was released at a tilt [rad/s], by its energy; its corners roll on their small spheres."""
    fallen = RADIUS * (math.cos(SLENDER - released) - math.cos(SLENDER - tilt))
    from_contact = RADIUS**2 + CORNER_RADIUS**2 + 2.0 * RADIUS * CORNER_RADIUS * math.cos(SLENDER - tilt)
    return math.sqrt(2.0 * GRAVITY * fallen / (GYRATION**2 + from_contact))


def time_of_fall(released: float) -> float:
    """From rest until it stands on its face [s]; over x, with tilt = released - x^2, the integrand has no pole."""
    return float(quad(lambda x: 2.0 * x / angular_speed(released - x * x, released), 0.0, math.sqrt(released))[0])


def kept_of_spin() -> float:
    """Angular momentum about the edge that comes down is kept; Housner's 1 - 1.5 sin^2 but for the spheres."""
    height, own = HALF_HEIGHT + CORNER_RADIUS, GYRATION**2
    return (own + height**2 - HALF_WIDTH**2) / (own + height**2 + HALF_WIDTH**2)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_block_that_rocks_falls_and_loses_speed_as_housner_says(side: float) -> None:
    released = 0.5 * SLENDER
    turn = Rotation.from_euler("y", side * released)
    # it touches with the spheres around two of its corners, and turns on them
    height = RADIUS * math.cos(SLENDER - released) + CORNER_RADIUS
    attitude = tuple(turn.as_quat(scalar_first=True).tolist())
    start = start_at((0.0, 0.0, 1e3 * height), quaternion=attitude)
    part = box((2e3 * HALF_WIDTH, 20.0, 2e3 * HALF_HEIGHT), start)
    contact = quiet(restitution=0.0, friction=1.0)
    run: dict[str, Any] = {"duration_s": 0.08, "frames_per_second": 10_000.0}
    scene, (frames,) = recorded(scenario(part, contact=contact, **run))
    spin, tilt = frames.angular_velocity[:, 0, 1], side * np.arcsin(attitudes(frames, 0)[:, 0, 2])
    row = int(np.argmax(np.abs(np.diff(spin)) > 0.5))  # the last frame before the impact
    assert row > 10 and np.abs(np.diff(spin[: row + 1])).max() < 0.05
    near = slice(row - 3, row + 1)
    before = np.polynomial.Polynomial.fit(frames.time[near], spin[near], 3)
    hits = frames.time[row] + tilt[row] / abs(before(frames.time[row] + 0.5 * tilt[row] / abs(spin[row])))
    assert frames.time[row] <= hits <= frames.time[row + 1]
    assert hits == pytest.approx(time_of_fall(released), rel=1e-6)
    assert abs(before(hits)) == pytest.approx(angular_speed(0.0, released), rel=1e-6)
    near = slice(row + 1, row + 5)
    kept = np.polynomial.Polynomial.fit(frames.time[near], spin[near], 3)(hits) / before(hits)
    assert kept == pytest.approx(1.0 - 1.5 * math.sin(SLENDER) ** 2, rel=2e-3)
    assert kept == pytest.approx(kept_of_spin(), rel=1e-6)
    # it neither slips nor leaves the plane in which it rocks
    assert np.abs(frames.angular_velocity[:, 0, [0, 2]]).max() < 1e-6  # contacts are solved to 1e-7 m/s
    assert np.abs(frames.position[:, 0, 1]).max() < 1e-9
    assert depth_under(scene, frames).max() < DEEPEST - CORNER_RADIUS


# Riding


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_ball_that_spins_stays_on_a_piston_that_throws_it(axis: str) -> None:
    """Driven at 200 Hz and 3 g, from 8 heights: it walks as it spins, and is never in the plate."""
    frequency = 200.0
    amplitude = 3.0 * GRAVITY / (2.0 * math.pi * frequency) ** 2
    spin = tuple(300.0 * np.array([axis == "x", axis == "y", axis == "z"]))
    deepest, lowest = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        start = start_at((0.0, 0.0, float(rng.uniform(2.1, 4.0))), angular_velocity_rad_s=spin)
        part = Ball(shape="ball", diameter_mm=4.0, start=start)
        run: dict[str, Any] = {"plate": PISTON, "drive": swing(frequency, 1e6 * amplitude)}
        scene, (frames,) = recorded(scenario(part, contact=quiet(), **run))
        depth = depth_under(scene, frames, plate_height(scene, frames))[:, 0]
        deepest.append(depth.max())
        lowest.append(depth[len(depth) // 2 :].min())
        walks = 2.0 / 7.0 * 2e-3 * np.cross(spin, [0.0, 0.0, 1.0])  # once it rolls
        np.testing.assert_allclose(frames.velocity[-1, 0, :2], walks[:2], atol=1e-9)
    assert max(deepest) < DEEPEST
    assert min(lowest) < -1e-5  # it is thrown


# Rest


def height_of_face(scene: Scene, frames: Frames) -> np.ndarray:
    """Of the lower face as drawn over the plate at rest [m], shape (n,)."""
    return -depth_under(scene, frames)[:, 0]


def lies_at(above_um: float) -> float:
    """Where the lower face of a block lies after 0.1 s that started at rest at a height over the plate [m]."""
    start = start_at((0.0, 0.0, 2.0 + 1e-3 * above_um))
    scene, (frames,) = recorded(scenario(box((12.0, 10.0, 4.0), start), duration_s=0.1))
    assert np.linalg.norm(frames.velocity[-1]) < 1e-9 and np.linalg.norm(frames.angular_velocity[-1]) < 1e-9
    return float(height_of_face(scene, frames)[-1])


@pytest.mark.parametrize("above_um", [-0.3, 0.0, 0.5, 1.0, 1.3, 20.0])
def test_a_block_lies_on_the_spheres_around_its_corners(above_um: float) -> None:
    """They have a radius of a micrometre, by which its face is over the plate wherever it started."""
    assert lies_at(above_um) == pytest.approx(CORNER_RADIUS, abs=LEVEL)
