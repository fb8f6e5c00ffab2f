"""Rates and accelerations of the gaps of one part without a step, against differences of the gaps themselves.

Each row of points says how fast its gap grows, RATE, and how fast both sides are accelerated together, PUSH. A part
flies freely through a moment from which it is looked at; what its gaps are just before and after says both again. And
after an impact the rates are renewed without a look: they are those that a look finds.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from invariants import quiet
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from test_invariants import swing

from feeder_sim.engines.impulse.kinds import read_kinds
from feeder_sim.engines.impulse.lone.contact import strike
from feeder_sim.engines.impulse.lone.edge_piece import BALL, FACE, LINES
from feeder_sim.engines.impulse.lone.engine import exactness_of
from feeder_sim.engines.impulse.lone.plate_points import look, look_at_edge, renew_rates
from feeder_sim.engines.impulse.lone.state import (
    AT,
    AT_EDGE,
    EDGE,
    FALL,
    GAP,
    KNOWN,
    MOVES,
    OWN,
    PUSH,
    RATE,
    SWING,
    TOWARDS,
    WITH,
    Bounds,
    Scratch,
    fly_to,
    new_part,
    new_scratch,
)
from feeder_sim.engines.impulse.lone.window import bound
from feeder_sim.engines.impulse.state import Kinds, new_parts, spin_of
from feeder_sim.engines.impulse.window import acting_terms
from feeder_sim.engines.surface_arrays import SurfaceArrays, surface_arrays
from feeder_sim.scenario import Scenario
from feeder_sim.scene.scene import build_scene

PARTS: dict[str, dict[str, Any]] = {
    "box": {"shape": "box", "size_mm": [9.0, 7.0, 5.0]},
    "nut": {"shape": "hex_nut", "size": "M5"},
    "ball": {"shape": "ball", "diameter_mm": 4.0},
}
PLATES = {
    "still": {"kind": "still", "length_mm": 40.0, "width_mm": 20.0},
    "piston": {"kind": "piston", "length_mm": 40.0, "width_mm": 20.0},
}
HALF = np.array([20e-3, 10e-3])  # of both plates [m]
FREQUENCY, AMPLITUDE = 200.0, 18.6  # of the piston [Hz] and [um]: 3 g
MOMENT = 1.7e-2  # [s]
MOMENTS = 1e-2 + 5e-3 * np.array([0.5, 0.6, 0.72, 0.8, 0.95, 1.0])  # [s]; the piston is well below its crest
STEP = 2e-6  # [s] between gaps
LEAPS = 45.0  # 1 / sine of the angle between two lines, at most: the normal of nearly parallel ones is limited
SORTS = {BALL: "ball", LINES: "lines", FACE: "face"}

Floats = NDArray[np.float64]


class Place(NamedTuple):
    """What compiled functions need: the part, its kind, the plate and what it can do, and scratch space."""

    parts: NDArray[Any]
    kinds: Kinds
    surface: SurfaceArrays
    bounds: Bounds
    work: Scratch

    def row(self, n: int) -> Floats:
        return self.work.point[:n].copy()


@njit
def _look(parts: Any, kinds: Any, surface: Any, bounds: Any, t: float, work: Any) -> Any:
    part = parts[0]
    kind = kinds.record[part.kind]
    corners = kinds.corners[kind.corner_from : kind.corner_to]
    _, moved = look(part, kind, corners, surface, bounds, t, work)
    return look_at_edge(part, kind, kinds, corners.shape[0], surface, bounds, t, moved, work)[0]


@njit
def _fly(parts: Any, kinds: Any, t: float) -> None:
    fly_to(parts[0], kinds.record[0], t)


@njit
def _renew(parts: Any, kinds: Any, n: int, work: Any) -> None:
    renew_rates(parts[0], kinds.record[0], n, work)


@njit
def _strike(parts: Any, kinds: Any, n: int, bounds: Any, work: Any) -> Any:
    return strike(parts[0], kinds.record[0], n, 0.0, True, bounds, work)


@njit
def _spin(parts: Any, kinds: Any) -> Any:
    return spin_of(parts[0], kinds.record[0])


@njit
def _bounds(surface: Any, extremes: Any, start: float, end: float, exact: Any) -> Any:
    acting = acting_terms(surface, start, end)
    return acting, bound(acting, extremes, start, end, exact)


@cache
def scene_of(name: str, plate: str) -> Any:
    given: dict[str, Any] = {"plate": PLATES[plate], "part": [PARTS[name]], "run": {"duration_s": 1.0}}
    drive = () if plate == "still" else (swing(FREQUENCY, AMPLITUDE),)
    contact = quiet(restitution=0.4, friction=0.3)
    return build_scene(Scenario.model_validate(given | {"drive": drive, "contact": contact}))


def place_of(
    name: str, plate: str, position: Any, turn: Rotation, velocity: Any, spin: Any, time: float = MOMENT
) -> Place:
    """A part in flight at a time [s], over a plate; spin in world axes [rad/s]."""
    scene = scene_of(name, plate)
    kinds, attitude = read_kinds(scene), turn.as_matrix()
    momentum = attitude @ (kinds.record["inertia"][0] * (attitude.T @ np.asarray(spin)))
    parts = new_part(new_parts([position], [attitude], [0], [velocity], [momentum]), np.ones(1, np.uint64))
    parts["clock"] = time
    surface, bounds = _bounds(
        surface_arrays(scene.surface, scene.scenario.run), scene.surface.extremes, 0.0, 0.04, exactness_of(scene)
    )
    return Place(parts, kinds, surface, bounds, new_scratch(kinds, scene.surface.n_shapes))


def looked_at(place: Place) -> int:
    """Number of rows that a look at the part as it is fills."""
    time = float(place.parts["clock"][0])
    return int(_look(place.parts, place.kinds, place.surface, place.bounds, time, place.work))


def seen_at(place: Place, time: float) -> tuple[Floats, NDArray[Any]]:
    """Rows and points on the edge at a time [s], to which the part flies backwards too; it is left as it is."""
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
    return there.row(n), there.work.edge.copy()


def same_row(row: Floats, rows: Floats) -> Floats | None:
    """The row of the same feature a moment before or after."""
    off = np.abs(rows[:, AT : AT + 3] - row[AT : AT + 3]).max(axis=1) * 1e3
    off += np.abs(rows[:, TOWARDS : TOWARDS + 3] - row[TOWARDS : TOWARDS + 3]).max(axis=1)
    off[(rows[:, KNOWN] == AT_EDGE) != (row[KNOWN] == AT_EDGE)] = np.inf
    k = int(off.argmin())
    return rows[k] if off[k] < 0.05 else None


class Found(NamedTuple):
    """Of one row: sort, RATE and PUSH as it says, and as differences of gaps say, each with how far they may be off."""

    sort: str
    rate: tuple[float, float, float]
    push: tuple[float, float, float]


def compared(place: Place) -> Iterator[Found]:
    """All rows that are known, where the same feature is seen at four moments around."""
    time = float(place.parts["clock"][0])
    now, edge = seen_at(place, time)
    others = {k: seen_at(place, time + k * STEP)[0] for k in (-2, -1, 1, 2)}
    for i, row in enumerate(now):
        if row[KNOWN] == 0.0 or not np.isfinite(row[GAP]):
            continue
        sort = "corner"
        if row[KNOWN] == AT_EDGE:
            point = edge[int(row[EDGE])]
            if point["turns"] == LINES and np.linalg.norm(point["axis"]) > LEAPS:
                continue
            sort = SORTS[int(point["turns"])]
            if point["turns"] == BALL:
                sort += " at a vertex" if not point["axis"].any() else " at an edge"
            same = {k: same_row(row, rows) for k, rows in others.items()}
        else:
            same = {k: rows[i] for k, rows in others.items()}
        if any(other is None or not np.isfinite(other[GAP]) for other in same.values()):
            continue  # at a limit
        gap = {k: float(other[GAP]) for k, other in same.items() if other is not None} | {0: float(row[GAP])}
        first = [(gap[k] - gap[-k]) / (2 * k * STEP) for k in (1, 2)]
        second = [-(gap[k] - 2.0 * gap[0] + gap[-k]) / (k * STEP) ** 2 for k in (1, 2)]
        yield Found(
            sort,
            (float(row[RATE]), (4.0 * first[0] - first[1]) / 3.0, abs(first[0] - first[1]) + 1e-11),
            (float(row[PUSH]), (4.0 * second[0] - second[1]) / 3.0, abs(second[0] - second[1]) + 2e-5),
        )


def motion(rng: np.random.Generator) -> tuple[Floats, Floats]:
    return rng.normal(0.0, 0.2, 3), rng.normal(0.0, 100.0, 3)


def lowest(name: str, turn: Rotation) -> float:
    """Of a part under its centre of mass [m]."""
    kinds = read_kinds(scene_of(name, "still"))
    return float(-turn.apply(kinds.corners)[:, 2].min() + kinds.record["radius"][0])


def height_at(name: str, plate: str, time: float) -> float:
    """Of the plate [m]."""
    if plate == "still":
        return 0.0
    return float(scene_of(name, plate).surface.terms.phasor(np.array([time]), 1)[0, 0].real)


def over(name: str, plate: str, rng: np.random.Generator, gap: float) -> Place:
    """A part that its lowest point brings as near to the plate as `gap` [m]."""
    turn, (velocity, spin), time = Rotation.random(rng=rng), motion(rng), float(rng.choice(MOMENTS))
    position = *rng.uniform(-2e-3, 2e-3, 2), height_at(name, plate, time) + gap + lowest(name, turn)
    return place_of(name, plate, position, turn, velocity, spin, time)


def checked(found: list[Found]) -> dict[str, int]:
    """How many rows of each sort were right; differences have to be exact enough to say so."""
    counts: dict[str, int] = {}
    for sort, (rate, rate_found, rate_off), (push, push_found, push_off) in found:
        if push_off > max(1.0, 0.01 * abs(push_found)):
            continue  # the normal turns too fast for the differences
        assert rate == pytest.approx(rate_found, abs=rate_off, rel=1e-9), sort
        assert push == pytest.approx(push_found, abs=push_off, rel=1e-9), sort
        counts[sort] = counts.get(sort, 0) + 1
    return counts


@pytest.mark.parametrize("plate", PLATES)
@pytest.mark.parametrize("name", PARTS)
def test_gaps_over_a_plate_change_as_their_rows_say(name: str, plate: str) -> None:
    """A corner or a ball that is just above it or just inside."""
    rng = np.random.default_rng([list(PARTS).index(name), list(PLATES).index(plate)])
    found = [row for _ in range(200) for row in compared(over(name, plate, rng, float(rng.uniform(-1e-6, 9e-7))))]
    assert checked(found)["corner"] >= 200


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
    [("box", {"lines", "face"}), ("nut", {"lines", "face"}), ("ball", {"ball at an edge", "ball at a vertex"})],
)


@AT_EDGES
def test_gaps_at_the_edge_change_as_their_rows_say(name: str, sorts: set[str]) -> None:
    rng = np.random.default_rng([list(PARTS).index(name), 7])
    counts = checked([row for _ in range(1000) for row in compared(at_edge(name, rng))])
    assert min(counts.get(sort, 0) for sort in sorts) > 20


@AT_EDGES
def test_gaps_at_the_edge_of_a_piston_change_as_their_rows_say(name: str, sorts: set[str]) -> None:
    rng = np.random.default_rng([list(PARTS).index(name), 8])
    counts = checked([row for _ in range(1000) for row in compared(at_edge(name, rng, "piston"))])
    assert min(counts.get(sort, 0) for sort in sorts) > 20


@pytest.mark.parametrize("plate", PLATES)
@pytest.mark.parametrize("name", PARTS)
def test_no_point_falls_by_itself_faster_than_its_bound(name: str, plate: str) -> None:
    rng = np.random.default_rng([list(PARTS).index(name), list(PLATES).index(plate), 6])
    for i in range(400):
        place = at_edge(name, rng, plate) if i % 2 else over(name, plate, rng, 5e-7)
        rows = place.row(looked_at(place))
        rows = rows[rows[:, KNOWN] != 0.0]
        assert (np.abs(rows[:, FALL]) <= rows[:, OWN] * (1.0 + 1e-12)).all()
        assert (np.abs(rows[:, PUSH] - rows[:, FALL]) <= rows[:, MOVES] * (1.0 + 1e-12)).all()


# After an impact

RENEWED = {"RATE": RATE, "PUSH": PUSH, "FALL": FALL, "OWN": OWN}


def assert_as_a_fresh_look(place: Place, n: int) -> int:
    """The first n rows are those that a look finds now; returns how many of them are known."""
    had = place.row(n)
    fresh = place._replace(work=new_scratch(place.kinds, place.work.under.shape[1]))
    assert looked_at(fresh) == n
    known = 0
    for row, again in zip(had, fresh.row(n), strict=True):
        assert row[GAP] == again[GAP] and row[KNOWN] == again[KNOWN] and row[MOVES] == again[MOVES]
        np.testing.assert_allclose(row[WITH : WITH + 3], again[WITH : WITH + 3], atol=1e-15)
        seen = dict(RENEWED)
        if row[KNOWN] == 0.0:  # how it falls is not asked for
            del seen["PUSH"], seen["FALL"]
        for column, k in seen.items():
            assert row[k] == pytest.approx(again[k], rel=1e-9, abs=1e-9), (column, row[KNOWN])
        if row[KNOWN] == AT_EDGE:
            np.testing.assert_allclose(row[SWING : SWING + 3], again[SWING : SWING + 3], rtol=1e-9, atol=1e-9)
        known += row[KNOWN] != 0.0
    return known


def changed(place: Place, rng: np.random.Generator) -> None:
    """Give the part another velocity and spin."""
    place.parts["velocity"] = rng.normal(0.0, 0.2, 3)
    spin, attitude = rng.normal(0.0, 100.0, 3), place.parts["attitude"][0]
    place.parts["momentum"] = attitude @ (place.kinds.record["inertia"][0] * (attitude.T @ spin))


@pytest.mark.parametrize("plate", PLATES)
@pytest.mark.parametrize("name", PARTS)
def test_rates_renewed_over_a_plate_are_those_of_a_fresh_look(name: str, plate: str) -> None:
    rng = np.random.default_rng([list(PARTS).index(name), list(PLATES).index(plate), 1])
    known = 0
    for _ in range(50):
        place = over(name, plate, rng, float(rng.uniform(-1e-6, 9e-7)))
        n = looked_at(place)
        for _ in range(3):
            changed(place, rng)
            _renew(place.parts, place.kinds, n, place.work)
            known += assert_as_a_fresh_look(place, n)
    assert known >= 150


@pytest.mark.parametrize("name", PARTS)
def test_rates_renewed_at_the_edge_are_those_of_a_fresh_look(name: str) -> None:
    """Again and again: no bound grows with the number of times."""
    rng = np.random.default_rng([list(PARTS).index(name), 2])
    known = 0
    for _ in range(200):
        place = at_edge(name, rng)
        n = looked_at(place)
        for _ in range(5):
            changed(place, rng)
            _renew(place.parts, place.kinds, n, place.work)
            known += assert_as_a_fresh_look(place, n)
    assert known > 100


def closed(place: Place) -> Place:
    """Moved along the normal of its nearest point until that touches, to round-off."""
    for _ in range(6):
        rows = place.row(looked_at(place))
        if not rows[:, KNOWN].any():
            break
        row = rows[np.where(rows[:, KNOWN] != 0.0, rows[:, GAP], np.inf).argmin()]
        place.parts["position"][0] -= row[GAP] * row[TOWARDS : TOWARDS + 3]
    return place


@pytest.mark.parametrize("where", ["still", "piston", "edge"])
@pytest.mark.parametrize("name", PARTS)
def test_rates_after_an_impact_are_those_of_a_fresh_look(name: str, where: str) -> None:
    rng = np.random.default_rng([list(PARTS).index(name), len(where), 3])
    hits = 0
    for _ in range(200):
        place = at_edge(name, rng) if where == "edge" else over(name, where, rng, 1e-7)
        closed(place)
        n, before = looked_at(place), place.parts.copy()
        if not _strike(place.parts, place.kinds, n, place.bounds, place.work):
            continue
        assert np.abs(place.parts["velocity"] - before["velocity"]).max() > 1e-6
        assert_as_a_fresh_look(place, n)
        touching = (place.row(n)[:, KNOWN] != 0.0) & (place.row(n)[:, GAP] <= place.bounds.exact.touch)
        assert place.row(n)[touching, RATE].min() > -1e-8
        hits += 1
    assert hits > 20


@pytest.mark.parametrize("name", PARTS)
def test_what_is_below_the_crest_and_not_near_is_renewed_as_a_fresh_look_has_it(name: str) -> None:
    """Its slopes are not known, but how it falls is."""
    rng = np.random.default_rng([list(PARTS).index(name), 4])
    below = 0
    for _ in range(50):
        place = over(name, "piston", rng, 4e-6)
        n = looked_at(place)
        changed(place, rng)
        _renew(place.parts, place.kinds, n, place.work)
        had = place.row(n)
        looked_at(place)
        for row, again in zip(had, place.row(n), strict=True):
            if row[KNOWN] == 0.0 and row[MOVES] > 0.0:
                for column in (RATE, PUSH, FALL):
                    assert row[column] == pytest.approx(again[column], rel=1e-9, abs=1e-9), column
                below += 1
    assert below >= 50
