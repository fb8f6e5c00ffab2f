"""Starts of parts: nothing overlaps, all is where it was asked for; whole states, weighed parts, plates at rest."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from conftest import piston_scenario, refusal
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.protocol import engine_class
from feeder_sim.errors import InputError
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.solids import hex_nut
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Ball, Box, Drive, GivenState, Heap, HexNut, MeshPart, Placed, Scattered, Scenario, Start
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.overlap import parts_overlap
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.scene.start import Pose, start_poses


def plate_with(*parts: Any, side_mm: float = 60.0) -> Scene:
    side = {"length_mm": side_mm, "width_mm": side_mm}
    return build_scene(piston_scenario(frequency_hz=500.0, plate=side, part=parts, duration_s=0.1))


def scattered(count: int, **start: Any) -> HexNut:
    return HexNut(size="M2.5", count=count, start=Scattered(kind="scattered", **start))


def heap(count: int, **start: Any) -> HexNut:
    return HexNut(size="M2.5", count=count, start=Heap(kind="heap", **({"diameter_mm": 30.0} | start)))


def nut(start: Any, **more: Any) -> HexNut:
    return HexNut(size="M2.5", start=start, **more)


def at(x: float, y: float, **more: Any) -> Start:
    return Start(position_mm=(x, y), **more)


def placed(*places: tuple[float, float, float]) -> Placed:
    return Placed(kind="placed", places_mm_deg=places)


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


def test_parts_are_dropped_from_their_height_turned_as_told() -> None:
    """Anywhere, or one at a point."""
    drawn: Any = {"drop_height_mm": (0.3, 0.4), "tilt_deg": (2.0, 5.0)}
    point = HexNut(size="M2.5", start=Start(position_mm=(1.0, -2.0), **drawn))
    for part, seeds in ((scattered(20, **drawn), 1), (point, 20)):
        scene, poses = plate_with(part), list[Pose]()
        for seed in range(seeds):
            poses += start_poses(scene, np.random.default_rng(seed))
        lowest = [pose.position[2] + scene.parts[0].lowest(pose.quaternion) for pose in poses]
        assert 0.3e-3 <= min(lowest) < max(lowest) <= 0.4e-3
        tilts = np.degrees(np.arccos(upward(poses)))
        assert 2.0 <= tilts.min() < tilts.max() <= 5.0
    assert centres(poses)[:, :2] == pytest.approx(np.tile([1e-3, -2e-3], (20, 1)))


def test_parts_laid_down_one_by_one_are_where_the_scenario_says() -> None:
    places = ((0.0, 0.0, 0.0), (0.0, 5.2, 0.0), (-20.0, 10.0, 77.0))  # the first two all but touch with their flats
    poses = start_poses(plate_with(nut(placed(*places))), np.random.default_rng(3))
    for (x, y, yaw), pose in zip(places, poses, strict=True):
        assert pose.position * 1e3 == pytest.approx(np.array([x, y, 1.01]))
        turned = Rotation.from_quat(pose.quaternion, scalar_first=True).as_euler("xyz", degrees=True)
        assert turned == pytest.approx(np.array([0.0, 0.0, yaw]))


def test_hulls_that_reach_into_each_other_are_said(tmp_path: Path) -> None:
    trimesh.creation.box(extents=[4.0, 4.0, 2.0]).export(tmp_path / "box.stl")
    start = placed((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (10.0, 0.0, 0.0))
    mesh = MeshPart(shape="mesh", file=tmp_path / "box.stl", start=start)
    warnings = prepare(piston_scenario(frequency_hz=500.0, part=mesh)).warnings
    assert [line for line in warnings if "the hulls of part_0 and part_1 overlap by" in line]


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


def rim_scenario(part: Any, phase_deg: float = 0.0) -> Scenario:
    """A plate of 60 mm with a wall around it, off its rest at the start by up to 20 um."""
    rimmed = {"length_mm": 60.0, "width_mm": 60.0, "rim": True}
    drive = Drive(frequency_hz=500.0, amplitude_um=20.0, ring_up=False, phase_deg=phase_deg)
    return piston_scenario(plate=rimmed, drive=(drive,), part=part, duration_s=0.1, seeds=4)


def box(start: Any) -> Box:
    return Box(shape="box", size_mm=(6.0, 4.0, 2.0), start=start)


UPRIGHT: Any = {"yaw_deg": (0.0, 0.0), "tilt_deg": (0.0, 0.0)}
STATES = [GivenState(kind="state", position_mm=(x, 0.0, 1.0)) for x in (0.0, 5.0)]
BELOW = Ball(shape="ball", diameter_mm=20.0, start=at(0.0, 0.0))


@pytest.mark.parametrize(
    ("parts", "line"),
    [
        ((Ball(shape="ball", diameter_mm=2.0), scattered(500)), "part[1].start: ... no room ... 500 parts ... must be"),
        ((nut(at(0.0, 0.0)), nut(at(20.0, 0.0)), nut(at(1.0, 0.0))), "part[2].start.position_mm: overlaps another"),
        ((BELOW, heap(5)), "part[1].start: overlaps"),
        ((box(STATES[0]), box(STATES[1])), "part[1].start.position_mm: overlaps part_0"),
        ((nut(placed((0, 0, 0), (5.0, 0, 0))),), "places_mm_deg[1]: overlaps part_0"),
        ((nut(placed((0, 0, 0), (80.0, 0, 0))),), "places_mm_deg[1]: is [80, 0], must be +-30"),
    ],
)
def test_starts_without_room_are_refused_with_the_key(parts: Any, line: str) -> None:
    message = refusal(lambda: start_poses(plate_with(*parts), np.random.default_rng(0)))
    assert all(text in message for text in line.split(" ... ")), message


@pytest.mark.parametrize(
    ("start", "line"),
    [
        (at(-28.0, 0.0, **UPRIGHT), "position_mm: is [-28, 0], 1 mm in the wall of the rim, must be -27 to 27 "),
        (at(1.0, 28.5, **UPRIGHT), "0.5 mm in the wall of the rim, must be -28 to 28 along y"),
        (placed((0.0, 28.5, 0.0)), "places_mm_deg[0]: is [0, 28.5], 0.5 mm in"),
    ],
)
def test_a_part_in_the_wall_of_a_rim_is_refused_with_what_is_allowed(start: Any, line: str) -> None:
    assert line in refusal(start_poses, build_scene(rim_scenario(box(start))), np.random.default_rng(0))


def test_as_many_places_as_parts() -> None:
    raw = nut(placed((0, 0, 0))).model_dump()
    for changes in ({"count": 2}, {"start": {"kind": "placed", "places_mm_deg": []}}):
        assert "places" in refusal(validated, raw | changes, HexNut, Path())


def test_a_part_that_touches_the_wall_is_not_refused() -> None:
    prepared = prepare(rim_scenario(box(Start(position_mm=(-27.0, 28.0), **UPRIGHT))))
    assert len(start_poses(prepared.scene, np.random.default_rng(0))) == 1
    assert not prepared.warnings


@pytest.mark.parametrize(
    "start",
    [
        at(28.5, 0.0),
        GivenState(kind="state", position_mm=(28.5, 0.0, 1.0)),
        Scattered(kind="scattered", centre_mm=(28.5, 0.0), size_mm=(1.0, 1.0)),
    ],
    ids=["attitude drawn", "state", "scattered"],
)
def test_a_start_in_the_wall_that_nobody_wrote_down_is_warned_of_with_its_depth(start: Any) -> None:
    (line,) = prepare(rim_scenario(box(start))).warnings
    said = r"part.start: part_0 starts ([\d.]+) mm in the wall of the rim: contact will push it out"
    found = re.fullmatch(said, line)
    assert found is not None
    assert 0.5 < float(found[1]) < 2.2


def test_a_part_that_the_plate_reaches_at_the_start_is_warned_of() -> None:
    low = box(Start(drop_height_mm=(0.005, 0.005), **UPRIGHT))
    (line,) = prepare(rim_scenario(low, phase_deg=90.0)).warnings
    assert "part_0 starts 0.015 mm in the plate" in line
    assert not prepare(rim_scenario(low, phase_deg=0.0)).warnings


def hook() -> RigidPart:
    """A U out of three boxes, open along y."""
    nut = hex_nut(5e-3, 2e-3, 2.5e-3, 7850.0, "hook")
    boxes = [((-4.0, 0.0), (1.0, 8.0)), ((4.0, 0.0), (1.0, 8.0)), ((0.0, -3.5), (8.0, 1.0))]
    pieces = tuple(
        1e-3 * np.array([[x + i * a / 2, y + j * b / 2, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        for (x, y), (a, b) in boxes
    )
    corners = np.concatenate(pieces)
    return RigidPart("hook", 1e-3, nut.inertia, corners, 0.0, corners, nut.faces, pieces=pieces)


@pytest.mark.parametrize(
    ("place_mm", "yaw_deg", "overlaps"),
    [
        ((3.0, 1.2, 0.0), 180.0, False),  # a leg of each stands in the other
        ((0.9, 1.2, 0.0), 180.0, True),  # the legs meet
        ((3.0, 0.0, 0.0), 0.0, True),
        ((3.0, 0.0, 2.1), 0.0, False),  # above
        ((0.0, 7.6, 0.0), 0.0, True),
        ((0.0, 8.1, 0.0), 0.0, False),
    ],
)
def test_overlap_is_that_of_the_pieces(place_mm: Any, yaw_deg: float, overlaps: bool) -> None:
    turned = Rotation.from_euler("z", yaw_deg, degrees=True).as_quat(scalar_first=True)
    a, b = hook(), hook()
    place, level = 1e-3 * np.array(place_mm), np.array([1.0, 0.0, 0.0, 0.0])
    assert parts_overlap(a, (np.zeros(3), level), b, (place, turned)) == overlaps


EDGE = 6.0  # [mm] of a cube


def cubes(x_mm: float, y_mm: float, start: str) -> dict[str, Any]:
    """Two cubes, the second at a place."""
    cube = {"shape": "box", "size_mm": [EDGE] * 3, "material": "steel"}
    level = {"tilt_deg": [0.0, 0.0], "drop_height_mm": [0.0, 0.0]}
    if start == "placed":
        parts = [cube | {"count": 2, "start": {"kind": start, "places_mm_deg": [[0, 0, 0], [x_mm, y_mm, 0]]} | level}]
    elif start == "state":
        places = ([0.0, 0.0, EDGE / 2], [x_mm, y_mm, EDGE / 2])
        parts = [cube | {"start": {"kind": start, "position_mm": place}} for place in places]
    else:
        level |= {"yaw_deg": [0.0, 0.0]}
        parts = [cube | {"start": {"position_mm": place} | level} for place in ([0.0, 0.0], [x_mm, y_mm])]
    return {"plate": {"kind": "still"}, "part": parts, "run": {"seeds": 1, "duration_s": 0.05}}


@pytest.mark.parametrize("start", ["placed", "state", "point"])
@pytest.mark.parametrize(("x_mm", "y_mm"), [(EDGE, 0.0), (0.0, -EDGE), (EDGE, EDGE), (EDGE, 5.9), (EDGE - 1e-5, 1.0)])
def test_cubes_may_touch_at_the_start(x_mm: float, y_mm: float, start: str) -> None:
    scene = build_scene(validated(cubes(x_mm, y_mm, start), Scenario, Path("scenario.toml")))
    assert len(start_poses(scene, np.random.default_rng(0))) == 2


@pytest.mark.parametrize("start", ["placed", "state", "point"])
@pytest.mark.parametrize(("x_mm", "y_mm"), [(EDGE - 1e-3, 0.0), (EDGE - 1e-3, 5.9), (0.0, 3.0), (0.0, 0.0)])
def test_cubes_may_not_overlap_at_the_start(x_mm: float, y_mm: float, start: str) -> None:
    scene = build_scene(validated(cubes(x_mm, y_mm, start), Scenario, Path("scenario.toml")))
    assert "overlaps" in refusal(start_poses, scene, np.random.default_rng(0))


@pytest.mark.parametrize("corner_mm", [0.2, 3.0, 60.0])
def test_edges_and_thin_plates_may_touch(corner_mm: float) -> None:
    level = np.array([1.0, 0.0, 0.0, 0.0])
    corners = 1e-3 * corner_mm * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    edge_up, across = (Rotation.from_euler(axes, [45.0, 90.0][: len(axes)], degrees=True) for axes in ("x", "xz"))
    above = np.array([0.0, 0.0, 2.0 * math.sqrt(2.0) * 1e-3 * corner_mm])
    thin = corners * [1.0, 1.0, 0.025]
    slid = np.array([1.95e-3 * corner_mm, 0.0, 2.0 * thin.max(axis=0)[2]])
    nut = hex_nut(5e-3, 2e-3, 2.5e-3, 7850.0, "nut")
    for points, places in (
        (corners, [(np.zeros(3), edge_up), (above, across)]),  # an edge lies across another
        (thin, [(np.zeros(3), Rotation.identity()), (slid, Rotation.identity())]),
    ):
        kind = replace(nut, corners=points, vertices=points)
        (first, a), (second, b) = [(place, turn.as_quat(scalar_first=True)) for place, turn in places]
        assert not parts_overlap(kind, (first, a), kind, (second, b))
        deeper = second - [0.0, 0.0, 1e-6]
        assert parts_overlap(kind, (first, a), kind, (deeper, b))
    assert parts_overlap(nut, (np.zeros(3), level), nut, (np.zeros(3), level))


TURN = Rotation.from_euler("xyz", [0.3, -0.8, 1.9])
SPIN = np.array([3.0, -20.0, 11.0])  # [rad/s]
STATE = {
    "kind": "state",
    "position_mm": [10.0, -20.0, 60.0],
    "quaternion": TURN.as_quat(scalar_first=True).tolist(),
    "velocity_mm_s": [300.0, 100.0, 200.0],
    "angular_velocity_rad_s": SPIN.tolist(),
}
BOX = {"shape": "box", "size_mm": [6.0, 6.0, 15.0], "material": "steel"}


def scenario(part: dict[str, Any] | None = None, start: dict[str, Any] | None = None, **tables: Any) -> Scenario:
    raw = {
        "plate": {"kind": "still"},
        "part": [BOX | (part or {}) | {"start": STATE | (start or {})}],
        "run": {"seeds": 1, "duration_s": 0.1, "frames_per_second": 1000.0},
    }
    return validated(raw | tables, Scenario, Path("scenario.toml"))


def frames_of(one: Scenario, n: int) -> Any:
    prepared = prepare(one)
    engine = engine_class(prepared.engine)(prepared.scene, np.random.default_rng(0))
    return prepared.scene, engine.current(), engine.advance(n)


@pytest.mark.parametrize("engine", ["impulse", "mujoco"])
def test_it_flies_from_its_state_as_a_free_body_does(engine: str) -> None:
    run = {"seeds": 1, "duration_s": 0.1, "frames_per_second": 1000.0, "engine": engine}
    scene, first, frames = frames_of(scenario(run=run), 50)
    assert first.position[0, 0] == pytest.approx([0.01, -0.02, 0.06])
    assert first.velocity[0, 0] == pytest.approx([0.3, 0.1, 0.2])
    assert first.angular_velocity[0, 0] == pytest.approx(SPIN)
    assert (Rotation.from_quat(first.quaternion[0, 0], scalar_first=True) * TURN.inv()).magnitude() < 1e-9
    t = frames.time[-1]
    flown = np.array([0.01 + 0.3 * t, -0.02 + 0.1 * t, 0.06 + 0.2 * t - 0.5 * GRAVITY * t**2])
    assert frames.position[-1, 0] == pytest.approx(flown, abs=GRAVITY * t * scene.timestep)
    momentum = []
    for seen in (first, frames):  # stays, while body and angular velocity turn about it
        turn = Rotation.from_quat(seen.quaternion[-1, 0], scalar_first=True).as_matrix()
        momentum.append(turn @ np.diag(scene.kinds[0].inertia) @ turn.T @ seen.angular_velocity[-1, 0])
    assert np.linalg.norm(momentum[1] - momentum[0]) < 1e-3 * np.linalg.norm(momentum[0])  # MuJoCo is first order
    assert np.linalg.norm(frames.angular_velocity[-1, 0] - SPIN) > 1.0


def test_a_block_slides_to_rest_where_coulomb_stops_it() -> None:
    still = {"quaternion": [1.0, 0.0, 0.0, 0.0], "angular_velocity_rad_s": [0.0, 0.0, 0.0]}
    start = still | {"position_mm": [0.0, 0.0, 7.5015], "velocity_mm_s": [400.0, 0.0, 0.0]}
    run = {"seeds": 1, "duration_s": 0.3, "frames_per_second": 1000.0}
    _, _, frames = frames_of(scenario(start=start, contact={"restitution": 0.0, "friction": 0.2}, run=run), 300)
    assert frames.position[-1, 0, 0] == pytest.approx(0.4**2 / (2.0 * 0.2 * GRAVITY), rel=2e-3)
    assert (frames.velocity[-1] == 0.0).all()  # asleep


def test_the_guard_knows_the_energy_of_a_spin() -> None:
    fast = {"position_mm": [0.0, 0.0, 8.0], "angular_velocity_rad_s": [1500.0, 0.0, 0.0]}
    run = {"seeds": 1, "duration_s": 0.05, "frames_per_second": 1000.0}
    assert not simulate(scenario(start=fast | {"quaternion": [1.0, 0.0, 0.0, 0.0]}, run=run)).failures


def test_a_weighed_part_has_the_mass_and_the_moments_it_is_given() -> None:
    solid = prepare(scenario()).scene.kinds[0]
    weighed = prepare(scenario({"mass_g": 2.0})).scene.kinds[0]
    assert weighed.mass == pytest.approx(2e-3)
    assert weighed.inertia == pytest.approx(solid.inertia * 2e-3 / solid.mass)
    measured = prepare(scenario({"mass_g": 2.0, "inertia_g_mm2": [30.0, 30.0, 20.0]})).scene.kinds[0]
    assert measured.inertia == pytest.approx([3e-8, 3e-8, 2e-8])


@pytest.mark.parametrize(
    ("part", "start", "tables", "line"),
    [
        ({}, {"quaternion": [0.9, 0.0, 0.0, 0.0]}, {}, r"start: .*quaternion has length 0\.9, must be 1"),
        ({}, {"position_mm": [0.0, 0.0, 1.0]}, {}, r"position_mm: puts its lowest point .* mm into the plate, must be"),
        ({}, {"position_mm": [0.0, 200.0, 60.0]}, {}, r"position_mm: is \[0, 200\], must be \+-90"),
        ({"count": 2}, {}, {}, r'start.kind is "state", must be "scattered", "heap" or "placed" with count = 2'),
        ({"inertia_g_mm2": [1.0, 1.0, 3.0]}, {}, {}, "above the sum of the other two"),
        ({}, {}, {"drive": [{"frequency_hz": 50.0, "amplitude_um": 1.0}]}, r'plate.kind is "still", must be no'),
        ({}, {}, {"plate": {"kind": "piston"}}, r"exactly one of \[\[drive\]\] and \[schedule\] is needed"),
    ],
)
def test_what_cannot_be_is_one_line(part: Any, start: Any, tables: Any, line: str) -> None:
    with pytest.raises(InputError, match=line):
        frames_of(scenario(part, start, **tables), 1)
