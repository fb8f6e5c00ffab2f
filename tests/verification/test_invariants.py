"""Laws of mechanics that hold whatever the shapes, the restitution and the friction, and however long it takes.

Each is a statement about recorded motion (tests/invariants.py): energy that nothing can grow from, bodies
that do not enter each other, rest that stays rest, and the symmetries of a scene.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from invariants import (
    DEEPEST,
    depth_under,
    energy,
    growth,
    quiet,
    recorded,
    speeds_from_poses,
    unexplained_speeds,
)
from own_modes import circle, flat_plate, on_plate
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import (
    Ball,
    Box,
    Contact,
    Cylinder,
    Drive,
    GivenState,
    HexNut,
    MeshPart,
    RigidPlate,
    Run,
    Scenario,
    Start,
)

BRACKET, SCREW = (REPOSITORY / f"models/{name}/{name}.stl" for name in ("bracket", "screw"))
FOUR = ("nut", "box", "ball")
GAINED = 1e-7  # [m] of height
EDGED = ("nut", "box", "bracket")  # what does not roll
ALL = (*FOUR, "bracket")
PISTON = RigidPlate(kind="piston", length_mm=300.0, width_mm=300.0)
LARGE = RigidPlate(kind="still", length_mm=1000.0, width_mm=1000.0)

Rng = np.random.Generator


def a_part(name: str, rng: Rng, start: Any) -> Any:
    """A part of a shape, with random dimensions where it has any."""
    if name == "nut":
        return HexNut(size=str(rng.choice(["M2", "M2.5", "M3", "M4", "M5"])), start=start)  # type: ignore[arg-type]
    if name == "box":
        x, y, z = map(float, 10.0 ** rng.uniform(0.2, 1.0, 3))
        return Box(shape="box", size_mm=(x, y, z), start=start)
    if name == "cylinder":
        diameter, height = map(float, rng.uniform([2.0, 1.0], [8.0, 9.0]))
        return Cylinder(shape="cylinder", diameter_mm=diameter, height_mm=height, start=start)
    if name == "ball":
        return Ball(shape="ball", diameter_mm=float(rng.uniform(1.5, 8.0)), start=start)
    file = SCREW if name == "screw" else BRACKET
    return MeshPart(shape="mesh", file=file, contact="hull" if name == "screw" else "parts", start=start)


def quaternion(rng: Rng) -> tuple[float, float, float, float]:
    w, x, y, z = map(float, Rotation.random(rng=rng).as_quat(scalar_first=True))
    return w, x, y, z


def state(
    rng: Rng, position_mm: Any, velocity_mm_s: Any = (0.0, 0.0, 0.0), spin_rad_s: float = 0.0, **more: Any
) -> GivenState:
    """A random attitude and a random spin of about this size."""
    return GivenState.model_validate(
        {
            "kind": "state",
            "position_mm": tuple(map(float, position_mm)),
            "quaternion": quaternion(rng),
            "velocity_mm_s": tuple(map(float, velocity_mm_s)),
            "angular_velocity_rad_s": tuple(map(float, spin_rad_s * rng.normal(size=3))),
        }
        | more
    )


def scenario(
    *parts: Any, plate: Any = LARGE, contact: Contact | None = None, drive: Drive | None = None, **run: Any
) -> Scenario:
    """Parts over a plate, which is at rest unless it is a piston with a drive."""
    run = {"duration_s": 0.5, "seeds": 1, "frames_per_second": 2000.0, "tolerance_nm": 0.1} | run
    drives = () if drive is None else (drive,)
    return Scenario(plate=plate, drive=drives, part=parts, contact=contact or quiet(), run=Run(**run))


def swing(frequency_hz: float, amplitude_um: float) -> Drive:
    return Drive(frequency_hz=frequency_hz, amplitude_um=amplitude_um, ring_up=False)


def random_contact(rng: Rng) -> Contact:
    e, part_e = (float(rng.choice([0.0, rng.random(), 1.0])) for _ in range(2))
    mu, part_mu = map(float, rng.uniform(0.0, 0.6, 2))
    return Contact(restitution=e, friction=mu, part_restitution=part_e, part_friction=part_mu)


# Energy


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 20))])
@pytest.mark.parametrize("name", ALL)
def test_nothing_gains_energy_on_a_plate_at_rest(name: str, seed: int) -> None:
    """A part thrown onto it, which tumbles, slides and rolls."""
    rng = np.random.default_rng([seed, ALL.index(name)])
    part = a_part(name, rng, state(rng, (0.0, 0.0, 15.0), rng.uniform(-300.0, 300.0, 3), 40.0))
    scene, (frames,) = recorded(scenario(part, contact=random_contact(rng)))
    assert growth(scene, frames) < GAINED
    assert depth_under(scene, frames).max() < DEEPEST


def test_a_block_that_tips_over_the_edge_gains_no_energy() -> None:
    """Without friction and restitution it can only lose some: it starts 4.43 mm above where its weight is counted."""
    start = GivenState(
        kind="state",
        position_mm=(14.05, 0.0, 12.0),
        quaternion=(-0.8979824, 0.11859228, 0.19455142, 0.37644816),
        velocity_mm_s=(32.0, 0.0, -100.0),
    )
    part = Box(shape="box", size_mm=(9.87, 7.39, 8.76), start=start)
    plate = RigidPlate(kind="still", length_mm=40.0, width_mm=200.0)
    scene, (frames,) = recorded(scenario(part, plate=plate, contact=Contact(restitution=0.0, friction=0.0)))
    height = energy(scene, frames)[:, 0] / (GRAVITY * scene.parts[0].mass)
    row = int(np.searchsorted(frames.time, 0.2))
    assert height[row] == pytest.approx(4.43e-3, abs=0.02e-3) and frames.position[-1, 0, 2] < -0.05
    assert height[row:].max() - height[row] < DEEPEST
    assert growth(scene, frames) < DEEPEST


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 10))])
@pytest.mark.parametrize("name", ALL)
def test_nothing_gains_energy_at_an_edge(name: str, seed: int) -> None:
    """Pushed over the edge of a small plate, with any friction and restitution."""
    rng = np.random.default_rng([seed, ALL.index(name), 1])
    part = a_part(name, rng, state(rng, (10.0, 5.0, 12.0), (150.0, 20.0, 0.0)))
    plate = RigidPlate(kind="still", length_mm=30.0, width_mm=40.0)
    scene, (frames,) = recorded(scenario(part, plate=plate, contact=random_contact(rng)))
    assert growth(scene, frames) < GAINED


@pytest.mark.parametrize("name", ["ball", "nut", "screw"])
def test_without_loss_the_energy_stays(name: str) -> None:
    """Restitution 1 and no friction, for 4 s."""
    rng = np.random.default_rng([7, 4])
    start = Start(drop_height_mm=(3.0, 3.0), tilt_deg=(20.0, 20.0), velocity_mm_s=(20.0, 10.0, 0.0))
    contact = quiet(restitution=1.0, friction=0.0)
    run: dict[str, Any] = {"duration_s": 4.0, "frames_per_second": 200.0}
    scene, (frames,) = recorded(scenario(a_part(name, rng, start), contact=contact, **run))
    total = energy(scene, frames)[:, 0]
    assert total == pytest.approx(np.full(len(total), total[0]), rel=1e-6)


# Rest

RESTING = 1e-9  # [m/s] and [rad/s]


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 6))])
@pytest.mark.parametrize("e", [0.4, 0.6, 0.8, 0.9])
@pytest.mark.parametrize("name", EDGED)
def test_a_part_that_was_dropped_comes_to_rest_and_lies_still(name: str, e: float, seed: int) -> None:
    rng = np.random.default_rng([seed, EDGED.index(name), round(10 * e)])
    start = Start(drop_height_mm=(0.5, 5.0), tilt_deg=(0.0, 180.0))
    contact = Contact(restitution=e, friction=0.3)
    run: dict[str, Any] = {"duration_s": 6.0, "frames_per_second": 100.0, "seed": seed}
    _, (frames,) = recorded(scenario(a_part(name, rng, start), contact=contact, **run))
    last = frames[slice(500, None)]
    assert np.linalg.norm(last.velocity, axis=2).max() < RESTING
    assert np.linalg.norm(last.angular_velocity, axis=2).max() < RESTING
    assert np.abs(last.position - last.position[0]).max() < 1e-12
    assert max(np.abs(found).max() for found in speeds_from_poses(last)) < RESTING


@pytest.mark.parametrize("name", EDGED)
def test_recorded_speeds_are_those_of_the_recorded_motion(name: str) -> None:
    """All the way from the drop to rest: a part moves and turns as its recorded velocity and spin say."""
    rng = np.random.default_rng([EDGED.index(name), 5])
    start = Start(drop_height_mm=(1.0, 1.0), tilt_deg=(10.0, 10.0))
    contact = quiet(restitution=0.4, friction=0.3)
    _, (frames,) = recorded(scenario(a_part(name, rng, start), contact=contact, frames_per_second=10_000.0))
    assert np.abs(np.diff(frames.velocity[..., 2], axis=0)).max() > 0.05  # there was an impact
    speed, spin = unexplained_speeds(frames)
    # Chatter of more than one impact in an interval is slower than g times it, 1 mm/s.
    assert np.quantile(speed, 0.99) < 1e-3 and np.quantile(spin, 0.99) < 1.0
    assert speed.mean() < 1e-4 and spin.mean() < 0.1


# Symmetries of a scene

TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
MIRROR = np.diag([-1.0, 1.0, 1.0])
SHIFT_MM = np.array([13.7, -8.3, 0.0])


def seen(start: GivenState, change: np.ndarray, shift_mm: Any = 0.0) -> GivenState:
    """A start in a scene that is turned, mirrored or moved; spin and attitude of a mirrored part follow from both."""
    attitude = change @ Rotation.from_quat(start.quaternion, scalar_first=True).as_matrix()
    hand = float(np.linalg.det(change))
    if hand < 0.0:  # the part is its own mirror image, x to -x in its own axes
        attitude = attitude @ MIRROR
    changed = {
        "position_mm": change @ start.position_mm + shift_mm,
        "quaternion": Rotation.from_matrix(attitude).as_quat(scalar_first=True),
        "velocity_mm_s": change @ start.velocity_mm_s,
        "angular_velocity_rad_s": hand * (change @ start.angular_velocity_rad_s),
    }
    return GivenState.model_validate({"kind": "state"} | {key: value.tolist() for key, value in changed.items()})


CHANGES = {"mirror": (MIRROR, 0.0 * SHIFT_MM), "quarter turn": (TURN, 0.0 * SHIFT_MM), "shift": (np.eye(3), SHIFT_MM)}


@pytest.mark.parametrize("driven", [False, True], ids=["at rest", "driven"])
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("names", [("nut",), ("box",), ("ball",)])
def test_a_scene_that_is_moved_gives_the_same_motion_moved(names: tuple[str, ...], change: str, driven: bool) -> None:
    """For a few impacts; later round-off grows, as in any chaos."""
    matrix, shift = CHANGES[change]
    starts = [
        state(rng_of(names), (sign * 8.0, 1.0, 5.0), (-150.0 * sign, 30.0, 0.0), 20.0)
        for sign, _ in zip((-1.0, 1.0), names, strict=False)
    ]
    found = []
    for there in (starts, [seen(start, matrix, shift) for start in starts]):
        rng = rng_of(names)
        parts = [a_part(name, rng, start) for name, start in zip(names, there, strict=True)]
        contact = quiet(restitution=0.5, part_restitution=0.5)
        place: dict[str, Any] = {"plate": PISTON, "drive": swing(500.0, 20.0)} if driven else {}
        found.append(recorded(scenario(*parts, contact=contact, duration_s=0.05, **place))[1][0])
    plain, moved = found
    assert np.abs(np.diff(plain.velocity[..., 2], axis=0)).max() > 0.05  # there was an impact
    hand = float(np.linalg.det(matrix))
    assert np.abs(moved.position - 1e-3 * shift - plain.position @ matrix.T).max() < 1e-9
    assert np.abs(moved.velocity - plain.velocity @ matrix.T).max() < 1e-7
    assert np.abs(moved.angular_velocity - hand * plain.angular_velocity @ matrix.T).max() < 1e-5


def rng_of(names: tuple[str, ...]) -> Rng:
    return np.random.default_rng([len(name) for name in names])


# What is solid


def plate_height(scene: Any, frames: Frames) -> np.ndarray:
    """Of a piston at the frames [m], shape (n,)."""
    return np.asarray(scene.surface.terms.phasor(frames.time, 1)[:, 0].real)


@pytest.mark.parametrize("seeds", [60, pytest.param(600, marks=pytest.mark.slow)], ids=lambda seeds: f"{seeds} seeds")
@pytest.mark.parametrize("frequency_hz", [27.0, 50.0])
def test_no_ball_passes_through_a_slow_piston(frequency_hz: float, seeds: int) -> None:
    part = Ball(shape="ball", diameter_mm=3.0, start=Start(drop_height_mm=(20.0, 25.0)))
    plate = RigidPlate(kind="piston", length_mm=100.0, width_mm=100.0)
    run: dict[str, Any] = {"duration_s": 0.1, "seeds": seeds, "frames_per_second": 1000.0}
    driven = scenario(part, plate=plate, drive=swing(frequency_hz, 20.0), **run)
    scene, runs = recorded(driven)
    assert max(depth_under(scene, frames, plate_height(scene, frames)).max() for frames in runs) < DEEPEST


@pytest.mark.parametrize(("x_mm", "speed"), [(18.8, 10.0), (15.0, 30.0), (5.0, 250.0)])
def test_a_ball_does_not_fall_through_a_hole_smaller_than_itself(x_mm: float, speed: float, tmp_path: Path) -> None:
    """8 mm over a hole of 2 mm, 20 mm off the centre: where it sits in the hole it has sunk by 0.13 mm."""
    plate = flat_plate(tmp_path / "plate.h5", circle(0.02, 0.0, 1e-3))
    start = Start(position_mm=(x_mm, 0.3), velocity_mm_s=(speed, 0.0, 0.0), drop_height_mm=(0.0, 0.0))
    ball = Ball(shape="ball", diameter_mm=8.0, start=start)
    duration = min(0.5, 30.0 / speed)
    scene, (frames,) = recorded(
        on_plate(plate, part=ball, duration_s=duration, frames_per_second=2000.0, tolerance_nm=0.1)
    )
    assert np.abs(frames.position[:, 0, 0] - 0.02).min() < 1e-3  # it has come over the hole
    sunk = 4e-3 - frames.position[:, 0, 2]
    assert sunk.max() < 4e-3 - np.sqrt(4e-3**2 - 1e-3**2) + DEEPEST
    assert growth(scene, frames) < GAINED
