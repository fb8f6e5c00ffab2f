"""Rates and accelerations of the gaps of one part without a step, against differences of the gaps themselves.

Each point says how fast its gap grows, how fast both sides are accelerated together, and how that changes. A part flies
freely through a moment from which it is looked at; what its gaps are just before and after says all that again. And
after an impact the points are moved without a evaluate_points: as a evaluate_points finds them.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from invariants import quiet
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from test_invariants import swing

from feeder_sim.engines.impulse.free_part.edge_piece import BALL, FACE, LINES
from feeder_sim.engines.impulse.free_part.edge_piece import ROUND as ROUND_FACE
from feeder_sim.engines.impulse.free_part.impact import strike
from feeder_sim.engines.impulse.free_part.leap import first_contact, remainder_bounds
from feeder_sim.engines.impulse.free_part.path import turning_of
from feeder_sim.engines.impulse.free_part.points import evaluate_points, move_points
from feeder_sim.engines.impulse.kinds import read_kinds
from feeder_sim.engines.impulse.scratch import (
    ABOVE,
    AT_EDGE,
    ON_CIRCLE,
    ON_WALL,
    Scratch,
    new_scratch,
)
from feeder_sim.engines.impulse.state import Kinds, fly_to, new_parts
from feeder_sim.engines.impulse.surroundings import Plate, exactness_of, read_walls
from feeder_sim.engines.impulse.window import Drive as MovingPlate
from feeder_sim.engines.impulse.window import acting_terms, bound_window
from feeder_sim.engines.surface_arrays import surface_arrays
from feeder_sim.scenario import Drive, Scenario
from feeder_sim.scene.scene import build_scene

pytestmark = pytest.mark.slow  # each kind of part and plate is compiled in a way of its own, for these functions
MODES = Path(__file__).parents[2] / "models/plate_180/modes.h5"
PARTS: dict[str, dict[str, Any]] = {
    "box": {"shape": "box", "size_mm": [9.0, 7.0, 5.0]},
    "nut": {"shape": "hex_nut", "size": "M5"},
    "ball": {"shape": "ball", "diameter_mm": 4.0},
    "rod": {"shape": "cylinder", "diameter_mm": 4.0, "height_mm": 7.0},
    "coin": {"shape": "cylinder", "diameter_mm": 6.0, "height_mm": 2.0},
}
ROUND = ("rod", "coin")
PLATES: dict[str, dict[str, Any]] = {
    "still": {"kind": "still", "length_mm": 40.0, "width_mm": 20.0},
    "piston": {"kind": "piston", "length_mm": 40.0, "width_mm": 20.0},
    "tube": {"kind": "piston", "length_mm": 40.0, "width_mm": 20.0},
    "rim": {"kind": "piston", "width_mm": 24.0, "rim": True},
    "bending": {"kind": "modes", "mode_file": str(MODES)},
}
BETWEEN = {"box": 16.8, "nut": 14.0, "ball": 7.8, "rod": 12.4, "coin": 10.6}  # walls [mm]: parts come near them
TUBE = {"kind": "tube", "inner_diameter_mm": 21.0, "tilt_deg": 20.0, "friction": 0.2}
HALF = np.array([20e-3, 10e-3])  # of the plates that do not bend [m]
FREQUENCY, AMPLITUDE = 200.0, 18.6  # of the piston [Hz] and [um]: 3 g
BENDS = Drive(frequency_hz=2646.0, voltage_vpp=120.0, ring_up=False)
MOMENT = 1.7e-2  # [s]
MOMENTS = 1e-2 + 5e-3 * np.array([0.5, 0.6, 0.72, 0.8, 0.95, 1.0])  # [s]; the piston is well below its crest
STEP = 2e-6  # [s] between gaps
ROUGH = 0.02  # of a third derivative, by differences
LEAPS = 45.0  # 1 / sine of the angle between two lines, at most: the normal of nearly parallel ones is limited
EACH_PLATE, EACH_PART = (pytest.mark.parametrize("plate", PLATES), pytest.mark.parametrize("name", PARTS))
SORTS = {BALL: "ball", LINES: "lines", FACE: "face", ROUND_FACE: "round face"}

Floats = NDArray[np.float64]


class Place(NamedTuple):
    """What compiled functions need: the part, its kind, the plate and what it can do, and scratch space."""

    parts: NDArray[Any]
    kinds: Kinds
    plate: Plate
    work: Scratch

    def points(self, n: int) -> NDArray[Any]:
        return self.work.point[:n].copy()


@njit
def _look(parts: Any, kinds: Any, plate: Any, t: float, work: Any) -> Any:
    part = parts[0]
    return evaluate_points(part, kinds, plate, t, work).n


@njit
def _fly(parts: Any, kinds: Any, t: float) -> None:
    fly_to(parts[0], kinds.record[0], t)


@njit
def _renew(parts: Any, kinds: Any, plate: Any, n: int, work: Any) -> None:
    move_points(parts[0], kinds.record[0], plate, n, work)


class Struck(NamedTuple):
    """What `strike` takes of a part."""

    parts: Any
    kinds: Any
    work: Any


@njit
def _strike(parts: Any, kinds: Any, plate: Any, t: float, work: Any) -> Any:
    strike(Struck(parts, kinds, work), evaluate_points(parts[0], kinds, plate, t, work), True, plate)


@njit
def _first_contact(parts: Any, kinds: Any, n: int, limit: float, plate: Any, t: float, work: Any) -> Any:
    part, kind = parts[0], kinds.record[0]
    jerk_bound = remainder_bounds(part, kind, plate.bounds, turning_of(part, kind))
    return first_contact(n, limit, plate, t, jerk_bound, work)


@njit
def _remainder(parts: Any, kinds: Any, bounds: Any) -> Any:
    part, kind = parts[0], kinds.record[0]
    return remainder_bounds(part, kind, bounds, turning_of(part, kind))


@njit
def _bounds(drive: Any, start: float, end: float) -> Any:
    acting = acting_terms(drive.surface, start, end)
    return acting, bound_window(acting, drive, start, end)


@cache
def scene_of(name: str, plate: str) -> Any:
    part = PARTS[name] | ({"guide": TUBE} if plate == "tube" else {})
    around = PLATES[plate] | ({"length_mm": BETWEEN[name]} if plate == "rim" else {})
    given: dict[str, Any] = {"plate": around, "part": [part], "run": {"duration_s": 1.0}}
    drive = {"still": (), "bending": (BENDS,)}.get(plate, (swing(FREQUENCY, AMPLITUDE),))
    contact = quiet(restitution=0.4, friction=0.3)
    return build_scene(Scenario.model_validate(given | {"drive": drive, "contact": contact}))


def place_of(
    name: str, plate: str, position: Any, turn: Rotation, velocity: Any, spin: Any, time: float = MOMENT
) -> Place:
    """A part in flight at a time [s], over a plate; spin in world axes [rad/s]."""
    scene = scene_of(name, plate)
    kinds, attitude = read_kinds(scene), turn.as_matrix()
    momentum = attitude @ (kinds.record["inertia"][0] * (attitude.T @ np.asarray(spin)))
    parts = new_parts([position], [attitude], [0], [velocity], [momentum])
    parts["clock"], parts["draws"] = time, 1
    surface = surface_arrays(scene)
    drive = MovingPlate(surface, scene.surface.extremes, exactness_of(scene), scene.timestep, 0.04)
    surface, bounds = _bounds(drive, 0.0, 0.04)
    plate_and_wall = Plate(surface, bounds, read_walls(scene))
    return Place(parts, kinds, plate_and_wall, new_scratch(kinds, scene.surface.n_shapes))


def looked_at(place: Place) -> int:
    """Number of points that a evaluate_points at the part as it is fills."""
    time = float(place.parts["clock"][0])
    return int(_look(place.parts, place.kinds, place.plate, time, place.work))


def seen_at(place: Place, time: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Points, and where those on the edge are, at a time [s], to which the part flies, backwards too; it stays."""
    parts = place.parts.copy()
    if time < parts["clock"][0]:  # the way back is that of the reversed motion
        parts["velocity"] *= -1.0
        parts["momentum"] *= -1.0
        now = float(parts["clock"][0])
        _fly(parts, place.kinds, 2.0 * now - time)
        parts["velocity"] *= -1.0
        parts["momentum"] *= -1.0
        parts["clock"] = time
    else:
        _fly(parts, place.kinds, time)
    there = place._replace(parts=parts, work=new_scratch(place.kinds, place.work.under.shape[1]))
    n = looked_at(there)
    return there.points(n), there.work.edge.copy()


def same_point(point: Any, points: NDArray[Any]) -> Any:
    """The same feature a moment before or after."""
    off = np.abs(points["arm"] - point["arm"]).max(axis=1) * 1e3
    off += np.abs(points["normal"] - point["normal"]).max(axis=1)
    off[(points["sort"] == AT_EDGE) != (point["sort"] == AT_EDGE)] = np.inf
    k = int(off.argmin())
    return points[k] if off[k] < 0.05 else None


class Found(NamedTuple):
    """A number that a point of some sort says, what differences of gaps say, and how far both may be apart."""

    sort: str
    name: str
    said: float
    found: float
    off: float


def compared(place: Place) -> Iterator[Found]:
    """All points below the crest, where the same feature is seen at four moments around."""
    time = float(place.parts["clock"][0])
    now, edge = seen_at(place, time)
    curving = float(_remainder(place.parts, place.kinds, place.plate.bounds).curving)
    others = {k: seen_at(place, time + k * STEP)[0] for k in (-2, -1, 1, 2)}
    for i, point in enumerate(now):
        if point["sort"] == ABOVE or not np.isfinite(point["gap"]):
            continue
        sort = {ON_WALL: "wall", ON_CIRCLE: "circle"}.get(int(point["sort"]), "corner")
        if point["sort"] == AT_EDGE:
            where = edge[point["edge"]]
            if where["turns"] == LINES and np.linalg.norm(where["axis"]) > LEAPS:
                continue
            sort = SORTS[int(where["turns"])]
            if where["turns"] == BALL:
                sort += " at a vertex" if not where["axis"].any() else " at an edge"
            same = {k: same_point(point, points) for k, points in others.items()}
        else:
            same = {k: points[i] if len(points) == len(now) else None for k, points in others.items()}
        if any(other is None or other["sort"] != point["sort"] for other in same.values()):
            continue  # at a limit
        gap = {k: float(other["gap"]) for k, other in same.items()} | {0: float(point["gap"])}
        first = [(gap[k] - gap[-k]) / (2 * k * STEP) for k in (1, 2)]
        second = [-(gap[k] - 2.0 * gap[0] + gap[-k]) / (k * STEP) ** 2 for k in (1, 2)]
        bent = 2.0 * curving  # `curving` is half of it
        if sort == "circle":  # slides
            bent += 2.0 * place.plate.bounds.curvature * float(point["swing"] @ point["swing"])
        off = abs(second[0] - second[1]) + bent + 2e-5
        if off > max(1.0, 0.01 * abs(second[0])):
            continue  # the normal turns too fast for the differences
        rate, rough = (4.0 * first[0] - first[1]) / 3.0, 1e-11
        if sort == "circle" and place.plate.bounds.curvature:  # whose lowest point is that over a plane
            rough = 1e-6
        yield Found(sort, "rate", point["rate"], rate, abs(first[0] - first[1]) + rough)
        yield Found(sort, "closing", point["closing"], (4.0 * second[0] - second[1]) / 3.0, off)
        if sort in {"corner", "wall"}:
            third = -(gap[2] - 2.0 * gap[1] + 2.0 * gap[-1] - gap[-2]) / (2.0 * STEP**3)
            off = ROUGH * abs(third) + 10.0 * curving * place.plate.bounds.fastest + 30.0
            yield Found(sort, "closing_rate", point["closing_rate"], third, off)


def motion(rng: np.random.Generator) -> tuple[Floats, Floats]:
    return rng.normal(0.0, 0.2, 3), rng.normal(0.0, 100.0, 3)


def lowest(name: str, turn: Rotation) -> float:
    """Of a part under its centre of mass [m]."""
    kinds = read_kinds(scene_of(name, "still"))
    if name in ROUND:
        kind, axis = kinds.record[0], turn.as_matrix()[2]
        across = np.hypot(axis[0], axis[1])
        return float(kind["circle_radius"] * across + kind["circle_height"] * abs(axis[2]) + kind["radius"])
    return float(-turn.apply(kinds.corners)[:, 2].min() + kinds.record["radius"][0])


def height_at(name: str, plate: str, time: float) -> float:
    """Of the middle of the plate [m]."""
    return float(scene_of(name, plate).surface.displacement(np.zeros((1, 2)), time)[0, 2])


def over(name: str, plate: str, rng: np.random.Generator, gap: float) -> Place:
    """A part that its lowest point brings as near to the plate as `gap` [m]."""
    turn, (velocity, spin), time = Rotation.random(rng=rng), motion(rng), float(rng.choice(MOMENTS))
    position = *rng.uniform(-2e-3, 2e-3, 2), height_at(name, plate, time) + gap + lowest(name, turn)
    return place_of(name, plate, position, turn, velocity, spin, time)


def checked(found: list[Found]) -> dict[str, int]:
    """How many points of each sort were right."""
    counts: dict[str, int] = {}
    for one in found:
        assert one.said == pytest.approx(one.found, abs=one.off, rel=1e-7), one
        counts[one.sort] = counts.get(one.sort, 0) + (one.name == "closing")
    return counts


@EACH_PLATE
@EACH_PART
def test_gaps_over_a_plate_change_as_their_points_say(name: str, plate: str) -> None:
    """A corner or a ball that is just above it or just inside."""
    rng = np.random.default_rng([list(PARTS).index(name), list(PLATES).index(plate)])
    found = [one for _ in range(400) for one in compared(over(name, plate, rng, float(rng.uniform(-1e-6, 9e-7))))]
    counts = checked(found)
    assert counts["circle" if name in ROUND and plate != "tube" else "corner"] >= 200
    assert (counts.get("wall", 0) >= 200) == (plate in {"tube", "rim"})


def at_edge(name: str, rng: np.random.Generator, plate: str = "still") -> Place:
    """A part with a point of its surface within 0.1 mm of the edge of the plate, or of a vertex of it."""
    kinds = read_kinds(scene_of(name, "still"))
    turn, (velocity, spin) = Rotation.random(rng=rng), motion(rng)
    if name == "ball":
        away = rng.normal(size=3)
        body = kinds.record["radius"][0] * away / np.linalg.norm(away)
    else:
        corners, faces = kinds.corners, kinds.planes
        if rng.uniform() < 0.5:
            on = corners[kinds.edges[rng.integers(len(kinds.edges))]]
        else:
            face = faces[rng.integers(len(faces))]
            on = corners[np.abs(corners @ face[:3] + face[3]) < 1e-9]
        body = rng.dirichlet(np.ones(len(on))) @ on
    edge = np.array([[1.0, rng.uniform(-1.0, 1.0)], [rng.uniform(-1.0, 1.0), 1.0], [1.0, 1.0]])[rng.integers(3)]
    time = float(rng.choice(MOMENTS))
    place = np.array([*(HALF * edge * rng.choice([-1.0, 1.0], 2)), height_at(name, plate, time)])
    centre = place - turn.apply(body) + 1e-4 * rng.uniform(-1.0, 1.0, 3)
    return place_of(name, plate, centre, turn, velocity, spin, time)


AT_EDGES = pytest.mark.parametrize(
    ("name", "sorts"),
    [
        ("box", {"lines", "face"}),
        ("nut", {"lines", "face"}),
        ("rod", {"lines"}),
        ("coin", {"lines"}),
        ("ball", {"ball at an edge", "ball at a vertex"}),
    ],
)


@AT_EDGES
def test_gaps_at_the_edge_change_as_their_points_say(name: str, sorts: set[str]) -> None:
    rng = np.random.default_rng([list(PARTS).index(name), 7])
    counts = checked([one for _ in range(1000) for one in compared(at_edge(name, rng))])
    assert min(counts.get(sort, 0) for sort in sorts) > 20


@AT_EDGES
def test_gaps_at_the_edge_of_a_piston_change_as_their_points_say(name: str, sorts: set[str]) -> None:
    rng = np.random.default_rng([list(PARTS).index(name), 8])
    counts = checked([one for _ in range(1000) for one in compared(at_edge(name, rng, "piston"))])
    assert min(counts.get(sort, 0) for sort in sorts) > 20


@EACH_PLATE
@EACH_PART
def test_no_point_falls_by_itself_faster_than_its_bound(name: str, plate: str) -> None:
    rng = np.random.default_rng([list(PARTS).index(name), list(PLATES).index(plate), 6])
    for i in range(400):
        place = (
            at_edge(name, rng, plate)
            if i % 2 and plate not in {"bending", "tube", "rim"}
            else over(name, plate, rng, 5e-7)
        )
        points = place.points(looked_at(place))
        points = points[points["sort"] != ABOVE]
        slack = _remainder(place.parts, place.kinds, place.plate.bounds).slack
        assert (np.abs(points["closing"] - points["push"]) <= points["most_own"] * (1.0 + 1e-12) + slack).all()
        assert (np.abs(points["push"]) <= points["most_push"] * (1.0 + 1e-12)).all()


# After an impact

KEPT = ("gap", "sort", "most_push", "push", "arm", "normal", "surface_velocity")
RENEWED = ("rate", "most_own")
AND_PATH = ("closing", "closing_rate", "path_velocity", "path_acceleration", "path_jerk")  # of points below the crest


def assert_as_a_fresh_look(place: Place, n: int) -> int:
    """The first n points are as a evaluate_points finds them now; returns how many of them are below the crest."""
    had = place.points(n)
    fresh = place._replace(work=new_scratch(place.kinds, place.work.under.shape[1]))
    assert looked_at(fresh) == n
    below = 0
    for point, again in zip(had, fresh.points(n), strict=True):
        if not np.isfinite(again["gap"]):
            continue
        for name in KEPT:
            np.testing.assert_array_equal(point[name], again[name], err_msg=name)
        names = RENEWED + (AND_PATH if point["sort"] != ABOVE else ())
        names += ("swing", "jerk_bound", "snap_bound") if point["sort"] in {AT_EDGE, ON_WALL} else ()
        for name in names:
            np.testing.assert_allclose(point[name], again[name], rtol=1e-9, atol=1e-9, err_msg=name)
        below += point["sort"] != ABOVE
    return below


def changed(place: Place, rng: np.random.Generator) -> None:
    """Give the part another velocity and spin."""
    place.parts["velocity"] = rng.normal(0.0, 0.2, 3)
    spin, attitude = rng.normal(0.0, 100.0, 3), place.parts["attitude"][0]
    place.parts["momentum"] = attitude @ (place.kinds.record["inertia"][0] * (attitude.T @ spin))


@EACH_PLATE
@EACH_PART
def test_rates_renewed_over_a_plate_are_those_of_a_fresh_look(name: str, plate: str) -> None:
    rng = np.random.default_rng([list(PARTS).index(name), list(PLATES).index(plate), 1])
    known = 0
    for _ in range(50):
        place = over(name, plate, rng, float(rng.uniform(-1e-6, 9e-7)))
        n = looked_at(place)
        for _ in range(3):
            changed(place, rng)
            _renew(place.parts, place.kinds, place.plate, n, place.work)
            known += assert_as_a_fresh_look(place, n)
    assert known >= 150


@EACH_PART
def test_rates_renewed_at_the_edge_are_those_of_a_fresh_look(name: str) -> None:
    """Again and again: no bound grows with the number of times."""
    rng = np.random.default_rng([list(PARTS).index(name), 2])
    known = 0
    for _ in range(200):
        place = at_edge(name, rng)
        n = looked_at(place)
        for _ in range(5):
            changed(place, rng)
            _renew(place.parts, place.kinds, place.plate, n, place.work)
            known += assert_as_a_fresh_look(place, n)
    assert known > 100


def closed(place: Place) -> Place:
    """Moved along the normal of its nearest point until that touches, to round-off."""
    for _ in range(6):
        points = place.points(looked_at(place))
        below = points["sort"] != ABOVE
        if not below.any():
            break
        point = points[np.where(below, points["gap"], np.inf).argmin()]
        place.parts["position"][0] -= point["gap"] * point["normal"]
    return place


@pytest.mark.parametrize("where", ["tube", "rim", "still", "piston", "edge"])
@EACH_PART
def test_rates_after_an_impact_are_those_of_a_fresh_look(name: str, where: str) -> None:
    rng = np.random.default_rng([list(PARTS).index(name), len(where), 3])
    hits = 0
    for _ in range(200):
        place = at_edge(name, rng) if where == "edge" else over(name, where, rng, 1e-7)
        closed(place)
        n, before = looked_at(place), place.parts.copy()
        _strike(place.parts, place.kinds, place.plate, float(place.parts["clock"][0]), place.work)
        if not np.abs(place.parts["velocity"] - before["velocity"]).max() > 1e-6:
            continue
        assert_as_a_fresh_look(place, n)
        points = place.points(n)
        touching = (points["sort"] != ABOVE) & (points["gap"] <= place.plate.bounds.exact.touch)
        assert points["rate"][touching].min() > -1e-8
        hits += 1
    assert hits > 20


# Leaps

LIMIT = 4e-4  # [s]
AT_MOST = 1e-11  # [m]; by a tenth of the tolerance a point may be inside since its time of contact is not known better


@EACH_PLATE
@EACH_PART
def test_nothing_touches_before_the_first_contact(name: str, plate: str) -> None:
    """And most leaps that end before their limit end in a touch."""
    rng = np.random.default_rng([list(PARTS).index(name), list(PLATES).index(plate), 9])
    touch, ended, touched = exactness_of(scene_of(name, plate)).touch, 0, 0
    for _ in range(60):
        place = over(name, plate, rng, 10.0 ** rng.uniform(-9.0, -6.1))
        time, n = float(place.parts["clock"][0]), looked_at(place)
        if not np.isfinite(place.points(n)["gap"]).all() or place.points(n)["gap"].min() < touch:
            continue
        found = float(_first_contact(place.parts, place.kinds, n, LIMIT, place.plate, time, place.work))
        before = [lowest_gap(place, time + found * share) for share in rng.uniform(0.0, 1.0, 40)]
        assert min(before) > -AT_MOST
        if found < LIMIT:
            last = lowest_gap(place, time + found)
            assert last > -AT_MOST
            ended, touched = ended + 1, touched + (last <= touch)
    assert ended > 20
    assert touched > (0.4 if name in ROUND and plate == "tube" else 0.5) * ended  # 64 corners spin along that wall


def lowest_gap(place: Place, time: float) -> float:
    return float(seen_at(place, time)[0]["gap"].min())
