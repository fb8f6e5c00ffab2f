"""Starts of many parts: nothing overlaps, everything is where it was asked for, and a seed decides all of it."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from conftest import piston_scenario, refusal
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Ball, Box, Drive, GivenState, Heap, HexNut, Placed, Scattered, Scenario, Start
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.scene.start import Pose, start_poses


def plate_with(*parts: Any, side_mm: float = 60.0) -> Scene:
    side = {"length_mm": side_mm, "width_mm": side_mm}
    return build_scene(piston_scenario(frequency_hz=500.0, plate=side, part=parts, duration_s=0.1))


def scattered(count: int, **start: Any) -> HexNut:
    return HexNut(size="M2.5", count=count, start=Scattered(kind="scattered", **start))


def heap(count: int, **start: Any) -> HexNut:
    return HexNut(size="M2.5", count=count, start=Heap(kind="heap", **({"diameter_mm": 30.0} | start)))


def corners(scene: Scene, poses: list[Pose]) -> list[np.ndarray]:
    """Corners (n, 3) of every part in space [m]."""
    return [
        Rotation.from_quat(pose.quaternion, scalar_first=True).apply(part.corners) + pose.position
        for part, pose in zip(scene.parts, poses, strict=True)
    ]


def upward(poses: list[Pose]) -> np.ndarray:
    """How far the axis z of every part points upward, -1 to 1."""
    return np.array([Rotation.from_quat(pose.quaternion, scalar_first=True).as_matrix()[2, 2] for pose in poses])


def centres(poses: list[Pose]) -> np.ndarray:
    return np.array([pose.position for pose in poses])


def test_scattered_parts_do_not_overlap_and_lie_in_their_rectangle() -> None:
    scene = plate_with(scattered(25, centre_mm=(-5.0, 8.0), size_mm=(48.0, 40.0)))
    low, high = np.array([-29e-3, -12e-3]), np.array([19e-3, 28e-3])
    for seed in range(5):
        poses = start_poses(scene, np.random.default_rng(seed))
        assert len(poses) == 25
        assert pdist(centres(poses)).min() > 2 * scene.kinds[0].size  # not even their bounding spheres
        for points in corners(scene, poses):
            assert (points[:, :2] > low).all() and (points[:, :2] < high).all()


def test_scattered_parts_fill_the_whole_plate_by_default() -> None:
    scene = plate_with(scattered(40), side_mm=100.0)
    places = np.concatenate([centres(start_poses(scene, np.random.default_rng(seed)))[:, :2] for seed in range(10)])
    reach = 50e-3 - scene.kinds[0].size
    assert np.abs(places).max() <= reach
    assert places.max(axis=0) == pytest.approx(reach, rel=0.05)
    assert places.min(axis=0) == pytest.approx(-reach, rel=0.05)
    assert np.abs(places.mean(axis=0)).max() < 5e-3


def test_scattered_parts_are_dropped_from_their_height_turned_as_told() -> None:
    scene = plate_with(scattered(20, drop_height_mm=(0.3, 0.4), tilt_deg=(2.0, 5.0)))
    poses = start_poses(scene, np.random.default_rng(0))
    lowest = np.array([points[:, 2].min() for points in corners(scene, poses)])
    assert 0.3e-3 <= lowest.min() < lowest.max() <= 0.4e-3
    tilts = np.degrees(np.arccos(upward(poses)))
    assert 2.0 <= tilts.min() < tilts.max() <= 5.0


def test_heap_of_99_nuts_does_not_overlap_and_stands_in_its_column() -> None:
    scene = plate_with(heap(99, centre_mm=(4.0, -6.0)))
    poses = start_poses(scene, np.random.default_rng(0))
    points = corners(scene, poses)
    assert len(poses) == 99
    assert pdist(centres(poses)).min() > 2 * scene.kinds[0].size
    everything = np.concatenate(points)
    assert np.hypot(everything[:, 0] - 4e-3, everything[:, 1] + 6e-3).max() <= 15e-3
    assert everything[:, 2].min() >= 0.2e-3  # the drop height is over the layer below, or the plate
    # Random attitudes, not the few degrees of parts that are set down.
    ups = upward(poses)
    assert ups.min() < -0.8 and ups.max() > 0.8


def test_a_narrower_heap_is_higher() -> None:
    tops = [
        centres(start_poses(plate_with(heap(30, diameter_mm=d)), np.random.default_rng(0)))[:, 2].max()
        for d in (5.8, 20.0, 50.0)
    ]
    assert tops[0] > 2 * tops[1] > 4 * tops[2]


def test_parts_of_several_tables_keep_their_distance() -> None:
    ball = Ball(shape="ball", diameter_mm=8.0, start=Start(position_mm=(0.0, 0.0)))
    balls = Ball(shape="ball", diameter_mm=3.0, count=10, start=Scattered(kind="scattered"))
    scene = plate_with(ball, scattered(10), balls)
    poses = start_poses(scene, np.random.default_rng(1))
    size = np.array([kind.size for kind in scene.kinds])[scene.kind_of]
    assert list(scene.kind_of) == [0] + [1] * 10 + [2] * 10
    at = centres(poses)
    for i in range(len(at)):
        for j in range(i):
            assert np.linalg.norm(at[i] - at[j]) > size[i] + size[j]


@pytest.mark.parametrize("part", [scattered(12), heap(12)])
def test_same_seed_same_poses(part: HexNut) -> None:
    scene = plate_with(part)
    one, same, other = (start_poses(scene, np.random.default_rng(seed)) for seed in (7, 7, 8))
    for a, b, c in zip(one, same, other, strict=True):
        assert a.position.tobytes() == b.position.tobytes()
        assert a.quaternion.tobytes() == b.quaternion.tobytes()
        assert a.quaternion.tobytes() != c.quaternion.tobytes()


def refused(scene: Scene) -> str:
    return refusal(start_poses, scene, np.random.default_rng(0))


def test_no_room_is_refused_with_the_key() -> None:
    crowded = plate_with(Ball(shape="ball", diameter_mm=2.0), scattered(200), side_mm=40.0)
    message = refused(crowded)
    assert message.startswith("part[1].start: ")
    assert "no room" in message and "200 parts" in message and "allowed" in message


def test_point_starts_that_overlap_are_refused_with_the_key() -> None:
    near, far = (HexNut(size="M2.5", start=Start(position_mm=(x, 0.0))) for x in (1.0, 20.0))
    first = HexNut(size="M2.5", start=Start(position_mm=(0.0, 0.0)))
    assert refused(plate_with(first, far, near)).startswith("part[2].start.position_mm: overlaps another part")
    assert len(start_poses(plate_with(first, far), np.random.default_rng(0))) == 2


def test_heap_on_a_part_is_refused_with_the_key() -> None:
    below = Ball(shape="ball", diameter_mm=20.0, start=Start(position_mm=(0.0, 0.0)))
    assert refused(plate_with(below, heap(5))).startswith("part[1].start: overlaps")


def rim_scenario(part: Any, phase_deg: float = 0.0) -> Scenario:
    """A plate of 60 mm with a wall around it, off its rest at the start by up to 20 um."""
    rimmed = {"length_mm": 60.0, "width_mm": 60.0, "rim": True}
    drive = Drive(frequency_hz=500.0, amplitude_um=20.0, ring_up=False, phase_deg=phase_deg)
    return piston_scenario(plate=rimmed, drive=(drive,), part=part, duration_s=0.1, seeds=4)


def box(start: Any) -> Box:
    return Box(shape="box", size_mm=(6.0, 4.0, 2.0), start=start)


UPRIGHT: Any = {"yaw_deg": (0.0, 0.0), "tilt_deg": (0.0, 0.0)}


@pytest.mark.parametrize(
    ("part", "line"),
    [
        (
            box(Start(position_mm=(-28.0, 0.0), **UPRIGHT)),
            "position_mm: is [-28, 0], 1 mm in the wall of the rim, allowed is -27 to 27 along x",
        ),
        (Ball(shape="ball", diameter_mm=5.0, start=Start(position_mm=(1.0, 28.0))), "allowed is -27.5 to 27.5 along y"),
        (box(Placed(kind="placed", places_mm_deg=((0.0, 28.5, 0.0),))), "places_mm_deg[0]: is [0, 28.5], 0.5 mm in"),
    ],
)
def test_a_part_in_the_wall_of_a_rim_is_refused_with_what_is_allowed(part: Any, line: str) -> None:
    assert line in refused(build_scene(rim_scenario(part)))


def test_a_part_that_touches_the_wall_is_not_refused() -> None:
    prepared = prepare(rim_scenario(box(Start(position_mm=(-27.0, 28.0), **UPRIGHT))))
    assert len(start_poses(prepared.scene, np.random.default_rng(0))) == 1
    assert not prepared.cautions


@pytest.mark.parametrize(
    "start",
    [
        Start(position_mm=(28.5, 0.0)),
        GivenState(kind="state", position_mm=(28.5, 0.0, 1.0)),
        Scattered(kind="scattered", centre_mm=(28.5, 0.0), size_mm=(1.0, 1.0)),
    ],
    ids=["attitude drawn", "state", "scattered"],
)
def test_a_start_in_the_wall_that_nobody_wrote_down_is_warned_of_with_its_depth(start: Any) -> None:
    (line,) = prepare(rim_scenario(box(start))).cautions
    said = r"part.start: part_0 starts ([\d.]+) mm in the wall of the rim: contact will push it out"
    found = re.fullmatch(said, line)
    assert found is not None
    assert 0.5 < float(found[1]) < 2.2


def test_a_part_that_the_plate_reaches_at_the_start_is_warned_of() -> None:
    low = box(Start(drop_height_mm=(0.005, 0.005), **UPRIGHT))
    (line,) = prepare(rim_scenario(low, phase_deg=90.0)).cautions
    assert "part_0 starts 0.015 mm in the plate" in line
    assert not prepare(rim_scenario(low, phase_deg=0.0)).cautions


def test_states_that_overlap_are_refused_with_their_own_key() -> None:
    one, other = (GivenState(kind="state", position_mm=(x, 0.0, 1.0)) for x in (0.0, 5.0))
    assert refused(plate_with(box(one), box(other))).startswith("part[1].start.position_mm: overlaps part_0, allowed")
