"""Points of parts on the edge of a plate: gaps and their rates, against geometry by other means."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray
from own_modes import circle
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from feeder_sim.engines.impulse.free_part.edge_piece import BESIDE, EDGE_POINT, UPRIGHT
from feeder_sim.engines.impulse.free_part.edge_points import edge_points
from feeder_sim.engines.impulse.kinds import read_kinds
from feeder_sim.engines.impulse.state import Kinds, new_parts
from feeder_sim.engines.surface_arrays import SurfaceArrays, outline_arrays
from feeder_sim.part.rigid_part import CORNER_RADIUS
from feeder_sim.plate.outline import checked_outline
from feeder_sim.scenario import Scenario
from feeder_sim.scene.scene import build_scene

HALF = np.array([20e-3, 10e-3])  # [m]
BOX, NUT, ROD, BALL, DIMER = range(5)
SIZE = np.array([9e-3, 7e-3, 5e-3])  # of the box
RADIUS, HEIGHT, BALL_RADIUS = 2e-3, 3e-3, 4e-3  # of the rod, half of it; of the ball
PARTS: list[dict[str, Any]] = [
    {"shape": "box", "size_mm": (1e3 * SIZE).tolist()},
    {"shape": "hex_nut", "size": "M5"},
    {"shape": "cylinder", "diameter_mm": 2e3 * RADIUS, "height_mm": 2e3 * HEIGHT},
    {"shape": "ball", "diameter_mm": 2e3 * BALL_RADIUS},
    {"shape": "dimer", "ball_diameter_mm": 4.0, "length_mm": 10.0},
]
ABOUT_X = Rotation.from_euler("x", 90.0, degrees=True)
LEVEL = Rotation.identity()


@njit
def _find(parts: Any, kinds: Any, surface: Any, reach: Any, points: Any) -> Any:
    return edge_points(parts[0], kinds.record[parts[0].kind], kinds, surface, reach, points)


@cache
def kinds_of(*which: int) -> Kinds:
    plate = {"kind": "still", "length_mm": 200.0, "width_mm": 40.0}
    parts = [PARTS[k] | {"start": {"position_mm": [30.0 * i - 60.0, 0.0]}} for i, k in enumerate(which)]
    return read_kinds(build_scene(Scenario.model_validate({"plate": plate, "part": parts, "run": {"duration_s": 1.0}})))


def together(kind: int) -> Kinds:
    """A dimer is alone in its scene, which has no cylinders."""
    return kinds_of(DIMER) if kind == DIMER else kinds_of(BOX, NUT, ROD, BALL)


@cache
def rectangle() -> SurfaceArrays:
    return plate_with(None)


@cache
def cut_plate() -> SurfaceArrays:
    """With a tongue of 1 mm at its right end, a hole of 2 mm and a slot of 1.5 mm; drawn clockwise."""
    x, y = 1e3 * HALF
    outer = [(-x, -y), (-x, y), (x - 6.0, y), (x - 6.0, 0.5), (x, 0.5), (x, -0.5), (x - 6.0, -0.5), (x - 6.0, -y)]
    slot = np.array([(-15.0, -0.75), (-5.0, -0.75), (-5.0, 0.75), (-15.0, 0.75)])
    return plate_with([1e-3 * np.array(outer), circle(5e-3, 0.0, 1e-3, 32), 1e-3 * slot])


def plate_with(rings: list[NDArray[np.float64]] | None) -> SurfaceArrays:
    x, y = (np.linspace(-half, half, 9) for half in HALF)
    none: Any = np.zeros(0)
    outline = outline_arrays(None if rings is None else checked_outline(rings))
    return SurfaceArrays(
        x, y, np.zeros((0, 9, 9, 3)), none.astype(int), none, none, none + 0j, none + 0j, 1.5e-3, 0.0, False, outline
    )


def edges_of(plate: SurfaceArrays) -> NDArray[np.float64]:
    """Pieces of its edge (m, 4) [m]."""
    if plate.outline is not None:
        return plate.outline.edges
    ring = HALF * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.hstack([ring, np.roll(ring, -1, axis=0)])


def found(
    kind: int, position: Any, turn: Rotation = LEVEL, plate: Any = None, reach: float = 1e-4, room: int = 64
) -> NDArray[Any]:
    """Points of a part with its centre at a position [m]."""
    kinds, points = together(kind), np.zeros(room, EDGE_POINT)
    parts = new_parts([position], [turn.as_matrix()], [0 if kind == DIMER else kind])
    return points[: _find(parts, kinds, plate or rectangle(), reach, points)]


def surface_points(kind: int, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Points (n, 3) on a part's surface, in body axes [m]; on edges and circles many of them."""
    if kind in (BALL, DIMER):
        way = rng.normal(size=(n, 3))
        way *= (BALL_RADIUS if kind == BALL else 2e-3) / np.linalg.norm(way, axis=1, keepdims=True)
        return way if kind == BALL else way + np.array([3e-3, 0.0, 0.0]) * rng.choice([-1.0, 1.0], (n, 1))
    if kind == ROD:
        angle, share = rng.uniform(0.0, 2.0 * np.pi, n), rng.integers(0, 3, n)
        z = np.where(share == 0, rng.uniform(-HEIGHT, HEIGHT, n), rng.choice([-HEIGHT, HEIGHT], n))
        rho = np.where(share == 2, RADIUS * np.sqrt(rng.uniform(0.0, 1.0, n)), RADIUS)
        return np.column_stack([rho * np.cos(angle), rho * np.sin(angle), z])
    kinds = together(kind)
    of, piece = kinds.record[kind], kinds.piece[kind]
    corners, planes = (
        kinds.corners[slice(*of[["corner_from", "corner_to"]])],
        kinds.planes[slice(*piece[["plane_from", "plane_to"]])],
    )
    result = np.empty((n, 3))
    for i in range(n):
        face = planes[rng.integers(len(planes))]
        on = corners[np.abs(corners @ face[:3] + face[3]) < 1e-9]
        weight = rng.dirichlet(np.ones(len(on)))
        if rng.uniform() < 0.5:
            pair = kinds.edges[rng.integers(of["edge_from"], of["edge_to"]), :2]
            on, weight = corners[pair], rng.dirichlet(np.ones(2))
        result[i] = weight @ on
    return result


def poses_at_edge(kind: int, plate: SurfaceArrays, n: int, rng: np.random.Generator) -> Any:
    """Random poses in which some point of the part is within 0.1 mm of some point of the plate's edge."""
    edges, turns = edges_of(plate), Rotation.random(n, rng)
    for body, turn in zip(surface_points(kind, n, rng), turns, strict=True):
        edge = edges[rng.integers(len(edges))]
        share = rng.choice([0.0, rng.uniform()])
        place = np.array([*(edge[:2] + share * (edge[2:] - edge[:2])), 0.0])
        yield place - turn.apply(body) + 1e-4 * rng.uniform(-1.0, 1.0, 3), turn


def features(kind: int, points: NDArray[Any], turn: Rotation, plate: SurfaceArrays) -> list[str]:
    """What each point is of."""
    vertices = cKDTree(edges_of(plate)[:, :2])
    names = []
    for point in points:
        where = "vertex" if vertices.query(point["foot"])[0] < 1e-12 else "piece"
        if kind == ROD:
            x, y, z = turn.inv().apply(point["arm"] + CORNER_RADIUS * point["normal"])
            rim, end = abs(math.hypot(x, y) - RADIUS) < 1e-9, abs(abs(z) - HEIGHT) < 1e-9
            where = ("circle " if rim and end else "round " if rim else "cap ") + where
        names.append(where)
    return names


@pytest.mark.parametrize(
    ("kind", "kept"),
    [
        (BOX, {"piece", "vertex"}),
        (NUT, {"piece", "vertex"}),
        (ROD, {"circle piece", "round piece", "round vertex", "cap vertex"}),
        (BALL, {"piece", "vertex"}),
        (DIMER, {"piece", "vertex"}),
    ],
)
@pytest.mark.parametrize("plate", [rectangle, cut_plate])
def test_gaps_change_as_the_points_move_along_their_normals(kind: int, kept: set[str], plate: Any) -> None:
    rng, surface, dt = np.random.default_rng(kind), plate(), 1e-7
    seen, signs = [], []
    for position, turn in poses_at_edge(kind, surface, 900, rng):
        velocity, spin = rng.normal(0.0, 0.2, 3), rng.normal(0.0, 50.0, 3)
        now, *moved = (
            found(kind, position + t * velocity, Rotation.from_rotvec(t * spin) * turn, surface, 2e-4)
            for t in (0.0, -dt, dt)
        )
        np.testing.assert_allclose(np.linalg.norm(now["normal"], axis=1), 1.0, rtol=1e-12)
        assert (now["normal"][:, 2] >= UPRIGHT).all() and (now["gap"] < 2e-4).all() and (now["gap"] >= -BESIDE).all()
        for point, name in zip(now, features(kind, now, turn, surface), strict=True):
            rates = []
            for t, others in zip((-dt, dt), moved, strict=True):
                same = [o for o in others if np.abs(o["normal"] - point["normal"]).max() < 1e-3]
                same = [o for o in same if np.abs(o["arm"] - point["arm"]).max() < 1e-5]
                rates += [(o["gap"] - point["gap"]) / t for o in same if np.abs(o["foot"] - point["foot"]).max() < 1e-5]
            if len(rates) != 2:  # at a limit, or two that are nearly one
                continue
            expected = point["normal"] @ (velocity + np.cross(spin, point["arm"]))
            assert np.mean(rates) == pytest.approx(expected, abs=1e-5), name
            seen.append(name)
            signs.append(point["gap"] > 0.0)
            if abs(point["gap"]) > 0.0:  # both points are a gap apart along the normal
                apart = position + point["arm"] - [*point["foot"], 0.0] - point["gap"] * point["normal"]
                assert np.abs(apart).max() < max(1e-12, 1.5 * point["gap"])  # open ones may lie beyond an end
    assert kept <= set(seen)
    assert min(seen.count(name) for name in kept) > 3
    assert 0.1 < np.mean(signs) < 0.95


def on_level_plate(points: NDArray[Any], gap: float) -> None:
    """All with this gap [m] and an upright normal."""
    np.testing.assert_allclose(points["gap"], gap, atol=1e-12)
    np.testing.assert_allclose(points["normal"], [[0.0, 0.0, 1.0]] * len(points), atol=1e-9)


def test_a_box_half_over_the_edge_rests_on_two_points_of_it() -> None:
    points = found(BOX, (HALF[0], 1e-3, 0.5 * SIZE[2] + CORNER_RADIUS + 1e-6))
    on_level_plate(points, 1e-6)
    np.testing.assert_allclose(points["foot"][:, 0], HALF[0])
    assert points["foot"][:, 1].min() == pytest.approx(1e-3 - 0.5 * SIZE[1])
    assert points["foot"][:, 1].max() == pytest.approx(1e-3 + 0.5 * SIZE[1])
    assert (points["arm"][:, 2] == pytest.approx(-0.5 * SIZE[2] - CORNER_RADIUS)) and len(points) == 2


@pytest.mark.parametrize("degrees", [5.0, 40.0, 85.0])
def test_a_box_that_tips_over_the_edge_is_held_across_its_face(degrees: float) -> None:
    turn = Rotation.from_euler("zy", [0.3, degrees], degrees=True)
    normal = turn.apply([0.0, 0.0, 1.0])
    points = found(BOX, [HALF[0], 0.0, 0.0] + (0.5 * SIZE[2] + CORNER_RADIUS) * normal, turn)
    held = points[np.abs(points["gap"]) < 1e-9]
    assert held["foot"][:, 1].min() < -0.49 * SIZE[1] and held["foot"][:, 1].max() > 0.49 * SIZE[1]
    np.testing.assert_allclose(held["normal"], [normal] * len(held), atol=1e-9)


@pytest.mark.parametrize("below", [0.0, 3e-3, 6e-3])
def test_a_part_beside_the_plate_is_not_caught(below: float) -> None:
    """Upright or leaning away, however far its side has come into that of the plate; nor under the plate."""
    for inside in (-1e-6, 1e-6, 1e-4, 1e-3):
        x = HALF[0] + 0.5 * SIZE[0] - inside
        for away in (0.0, 3.0):
            assert len(found(BOX, (x, 1e-3, -below), Rotation.from_euler("y", away, degrees=True))) == 0
        assert len(found(BALL, (HALF[0] + BALL_RADIUS - inside, 1e-3, -below))) == 0
        assert len(found(ROD, (HALF[0] + RADIUS - inside, 1e-3, -below))) == 0
    if below:
        assert len(found(BOX, (HALF[0], 0.0, -below))) == 0


def test_a_corner_of_the_plate_under_a_nut() -> None:
    turn = Rotation.from_rotvec([-0.05, 0.05, 0.0]) * Rotation.from_euler("z", 20.0, degrees=True)  # down beyond it
    lowest = together(NUT).corners[slice(*together(NUT).record[NUT][["corner_from", "corner_to"]])][:, 2].min()
    normal = turn.apply([0.0, 0.0, 1.0])
    gap = 2e-6
    centre = np.array([*HALF, 0.0]) + (gap + CORNER_RADIUS - lowest) * normal
    points = found(NUT, centre, turn, reach=1e-5)
    point = points[np.argmin(points["gap"])]
    np.testing.assert_allclose(point["foot"], HALF)
    np.testing.assert_allclose(point["normal"], normal, atol=1e-9)
    assert point["gap"] == pytest.approx(gap, abs=1e-12)
    assert len(found(NUT, centre - [1e-3, 1e-3, 0.0], Rotation.from_rotvec([0.3, -0.3, 0.0]), reach=1e-5)) == 0


def test_a_ball_over_a_hole_rests_on_its_rim() -> None:
    """All around it; on the plate beside it there is no point of the edge."""
    apothem = 1e-3 * math.cos(math.pi / 32)
    depth = math.sqrt(BALL_RADIUS**2 - apothem**2)
    points = found(BALL, (5e-3, 0.0, depth), plate=cut_plate())
    np.testing.assert_allclose(points["gap"], 0.0, atol=1e-9)
    np.testing.assert_allclose(points["normal"][:, 2], depth / BALL_RADIUS, atol=1e-9)
    assert len(points) > 6 and np.abs(points["normal"][:, :2].mean(axis=0)).max() < 0.05
    off_centre = found(BALL, (5e-3, 0.4e-3, depth), plate=cut_plate())
    assert off_centre[np.argmin(off_centre["gap"])]["normal"][1] < 0.0
    assert len(found(BALL, (5e-3, 1.1e-3, BALL_RADIUS), plate=cut_plate(), reach=1e-6)) == 0
    assert len(found(BALL, (-10e-3, 0.0, BALL_RADIUS), plate=cut_plate())) == 2  # both sides of a slot


def test_a_ball_over_a_tongue() -> None:
    tip, plate = HALF[0], cut_plate()
    assert len(found(BALL, (tip - 2e-3, 0.0, BALL_RADIUS), plate=plate, reach=1e-6)) == 0  # on it
    for x, y, foot in ((-2e-3, 2e-3, (-2e-3, 0.5e-3)), (1e-3, 0.2e-3, (0.0, 0.2e-3)), (1e-3, 2e-3, (0.0, 0.5e-3))):
        way = np.array([x - foot[0], y - foot[1]])
        up = math.sqrt(BALL_RADIUS**2 - way @ way)
        points = found(BALL, (tip + x, y, up), plate=plate)
        assert len(points) == 1
        np.testing.assert_allclose(points[0]["foot"], [tip + foot[0], foot[1]], atol=1e-12)
        np.testing.assert_allclose(points[0]["normal"], np.array([*way, up]) / BALL_RADIUS, atol=1e-12)
        np.testing.assert_allclose(points[0]["arm"], -BALL_RADIUS * points[0]["normal"], atol=1e-12)
        assert points[0]["gap"] == pytest.approx(0.0, abs=1e-12)


def test_a_cylinder_across_an_edge_lies_on_its_round_face_and_tips_over_it() -> None:
    size = RADIUS + CORNER_RADIUS
    for degrees in (0.0, 10.0, 60.0):
        turn = Rotation.from_euler("y", 90.0 + degrees, degrees=True)  # axis across the right side
        normal = Rotation.from_euler("y", degrees, degrees=True).apply([0.0, 0.0, 1.0])
        points = found(ROD, [HALF[0], 2e-3, 0.0] + (size + 1e-6) * normal + 1e-3 * turn.apply([0.0, 0.0, 1.0]), turn)
        assert len(points) == 1
        np.testing.assert_allclose(points[0]["normal"], normal, atol=1e-12)
        np.testing.assert_allclose(points[0]["foot"], [HALF[0], 2e-3], atol=1e-12)
        assert points[0]["gap"] == pytest.approx(1e-6, abs=1e-12)


def test_a_cylinder_along_an_edge_rolls_over_it_on_both_circles() -> None:
    size = RADIUS + CORNER_RADIUS
    for angle in (0.1, 0.7, 1.4):
        across = np.array([math.sin(angle), 0.0, math.cos(angle)])
        points = found(ROD, [HALF[0], 0.0, 0.0] + (size + 1e-6) * across, ABOUT_X)
        assert sorted(points["foot"][:, 1]) == pytest.approx([-HEIGHT, HEIGHT])
        np.testing.assert_allclose(points["normal"], [across, across], atol=2e-6)  # of the circle within its micrometre
        np.testing.assert_allclose(points["gap"], 1e-6, atol=1e-11)


def test_a_cylinder_that_stands_over_the_edge_has_the_ends_of_a_chord() -> None:
    points = found(ROD, (HALF[0] + 0.5 * RADIUS, 0.0, HEIGHT + CORNER_RADIUS))
    on_level_plate(points, 0.0)
    assert sorted(points["foot"][:, 1]) == pytest.approx([-math.sqrt(0.75) * RADIUS, math.sqrt(0.75) * RADIUS])


def test_where_there_are_too_many_the_farthest_is_left_out() -> None:
    turn = Rotation.from_euler("x", 1e-4)
    position = (HALF[0], 0.0, 0.5 * SIZE[2] + CORNER_RADIUS)
    every, two = found(BOX, position, turn), found(BOX, position, turn, room=1)
    assert len(two) == 1 < len(every)
    assert two["gap"][0] == every["gap"].min()
    assert len(found(BOX, position, turn, room=0)) == 0


@pytest.mark.parametrize("kind", [BOX, NUT, ROD])
def test_gaps_agree_with_distances_between_samples(kind: int) -> None:
    """Samples are never nearer than the part and the edge are, and hardly farther; but for what the side would meet."""
    rng = np.random.default_rng(kind)
    body = surface_points(kind, 20_000, rng)
    edges, share = edges_of(rectangle()), np.arange(0.0, 1.0, 1e-3)[:, None]
    places = np.concatenate([edge[:2] + share * (edge[2:] - edge[:2]) for edge in edges])
    places = np.column_stack([places, np.zeros(len(places))])
    line, apart = cKDTree(places), []
    for position, turn in poses_at_edge(kind, rectangle(), 600, rng):
        points = found(kind, position, turn, reach=2e-4)
        if len(points) == 0 or points["gap"].min() < 2e-5:
            continue
        samples = turn.apply(body) + position
        distance, which = line.query(samples, distance_upper_bound=1e-3)
        nearest = distance.argmin()
        if samples[nearest, 2] - places[which[nearest], 2] > 0.1 * distance[nearest]:
            apart.append(distance[nearest] - CORNER_RADIUS - points["gap"].min())
    assert len(apart) > 20
    assert min(apart) > -1e-9
    assert np.median(apart) < 1e-5
