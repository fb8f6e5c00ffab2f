"""Contact corners: the few points of a hull that stand for all of it, to a given error.

The hull of the kept corners lies inside the full hull and nowhere deeper below it than the error. The kept ones are
chosen greedily: from four that span a body, always the vertex farthest outside of the hull so far; then those that turn
out to be needless are dropped again. Where the hull has an axis of symmetry of order N, whole orbits under a rotation
of some order that divides N are kept or dropped together, so that a round part does not become lopsided.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Orbits = list[NDArray[np.int64]]

MOST_CORNERS = 128
MOST_LOOKED_AT = 5000  # vertices of a finer hull: those farthest along as many directions
ALIKE = 1e-4  # of the size: how far a turned vertex may be from another one (single precision of STL files)
ROUND_OFF = 1e-9  # of the size: what is no farther outside is not outside
DOUBTFUL = 0.3  # of the error wanted: points less far over the planes of a hull are not farther from it than wanted
WORST = 200  # vertices that stand out farthest, whose distance is computed exactly
ROUNDS = 3  # of looking at more vertices of a fine hull
UNEVEN = 1.5  # times the error is what it takes to prefer corners that are not lopsided
LEAST_ORDER = 3  # of a rotation that keeps a part from becoming lopsided


def contact_corners(points: Floats, error: float) -> tuple[Floats, float]:
    """Corners for contact, out of the vertices of a convex hull.

    Args:
        points: the vertices, shape (n, 3) [m], about the centre of mass.
        error: how deep the hull of the corners may lie below that of all [m].

    Returns:
        The corners, in the order of the points, shape (m, 3), and the error that they leave [m]. It is larger than
        asked for where `MOST_CORNERS` are not enough.
    """
    size = float(np.abs(points).max())
    unit, tolerance = points / size, error / size
    if len(unit) <= MOST_LOOKED_AT:
        selected = _fewest(unit, tolerance)
        return points[selected], size * _error(unit, selected)
    looked_at = _farthest_along_directions(unit)
    for _ in range(ROUNDS):  # what was not looked at may stand out a little
        selected = looked_at[_fewest(unit[looked_at], tolerance)]
        out = _over(unit, _hull_of(unit[selected])) > tolerance
        if not out.any() or len(selected) == MOST_CORNERS:
            break
        looked_at = np.union1d(looked_at, np.flatnonzero(out)[:MOST_LOOKED_AT])
    return points[selected], size * _error(unit, selected)


def _fewest(points: Floats, tolerance: float) -> NDArray[np.int64]:
    """Numbers, in order, of the fewest points that some way of choosing whole orbits finds for an error.

    Where none is enough, those at most `MOST_CORNERS` that leave the smallest error.
    """
    candidates = [_greedy(points, orbits, tolerance) for orbits in _symmetries(points)]
    enough = [selected for selected in candidates if selected is not None and len(selected) <= MOST_CORNERS]
    if enough:
        return np.sort(min(enough, key=len))
    single = _single(points)
    choices = []
    for orbits in (*_symmetries(points), single):
        selected = _greedy(points, orbits, 0.0, most=True)
        if selected is not None and len(selected) <= MOST_CORNERS:
            choices.append((_error(points, selected) * (UNEVEN if len(orbits) == len(single) else 1.0), selected))
    return np.sort(min(choices, key=lambda choice: choice[0])[1])


def _farthest_along_directions(points: Floats) -> NDArray[np.int64]:
    """Vertices that are the farthest along some of many directions spread evenly (a Fibonacci lattice)."""
    i = np.arange(MOST_LOOKED_AT)
    z, turn = 1.0 - (2.0 * i + 1.0) / MOST_LOOKED_AT, np.pi * (3.0 - np.sqrt(5.0)) * i
    flat = np.sqrt(1.0 - z * z)
    directions = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    parts = np.array_split(directions, 1 + len(points) * MOST_LOOKED_AT // 20_000_000)
    return np.unique(np.concatenate([(points @ part.T).argmax(axis=0) for part in parts]))


def _symmetries(points: Floats) -> list[Orbits]:
    """Ways to divide vertices into orbits: one for each order of rotation about the axis; single ones without any."""
    best: tuple[int, list[NDArray[np.int64]]] = (1, [])
    for axis in np.linalg.eigh(points.T @ points)[1].T:
        order, images = _order_about(points, axis)
        if order > best[0]:
            best = order, images
    order, images = best
    if order == 1:
        return [_single(points)]
    allowed = [k for k in range(2, order + 1) if order % k == 0 and (k >= LEAST_ORDER or k == order)]
    return [_orbits(images[order // k - 1], k) for k in allowed]


def _single(points: Floats) -> Orbits:
    return [np.array([i]) for i in range(len(points))]


def _order_about(points: Floats, axis: Floats) -> tuple[int, list[NDArray[np.int64]]]:
    """Largest order of a rotation about an axis that takes points to each other, and its powers as permutations."""
    from scipy.spatial import KDTree
    from scipy.spatial.transform import Rotation

    tree, along = KDTree(points), points @ axis
    radius = np.linalg.norm(points - along[:, None] * axis, axis=1)
    reference = int(radius.argmax())
    ring = int(((np.abs(radius - radius[reference]) < ALIKE) & (np.abs(along - along[reference]) < ALIKE)).sum())
    for order in range(ring, 1, -1):
        if ring % order:
            continue
        turned = Rotation.from_rotvec(2.0 * np.pi / order * axis).apply(points)
        distance, image = tree.query(turned)
        if distance.max() < ALIKE and len(np.unique(image)) == len(points):
            powers = [image]
            for _ in range(order - 1):
                powers.append(image[powers[-1]])
            return order, powers
    return 1, []


def _orbits(image: NDArray[np.int64], order: int) -> Orbits:
    """The orbits of a permutation of some order."""
    remaining, orbits = np.ones(len(image), bool), []
    for i in range(len(image)):
        if remaining[i]:
            orbit = [i]
            while len(orbit) < order and image[orbit[-1]] != i:
                orbit.append(int(image[orbit[-1]]))
            remaining[orbit] = False
            orbits.append(np.array(orbit))
    return orbits


def _greedy(points: Floats, orbits: Orbits, tolerance: float, *, most: bool = False) -> NDArray[np.int64] | None:
    """Numbers of kept points; with `most` as many as are allowed, else None where these are not enough."""
    tolerance = max(tolerance, ROUND_OFF)
    of = np.empty(len(points), np.int64)
    for number, orbit in enumerate(orbits):
        of[orbit] = number
    chosen = list(dict.fromkeys(int(of[i]) for i in _spanning(points)))
    while True:
        depth = _depths(points, _joined(orbits, chosen), tolerance)
        farthest = int(depth.argmax())
        if depth[farthest] <= tolerance:
            break
        if len(_joined(orbits, chosen)) + len(orbits[of[farthest]]) > MOST_CORNERS:
            return _joined(orbits, chosen) if most else None
        chosen.append(int(of[farthest]))
    for number in list(chosen):
        fewer = _joined(orbits, [other for other in chosen if other != number])
        if _spans(points, fewer) and _depths(points, fewer, tolerance).max() <= tolerance:
            chosen.remove(number)
    return _joined(orbits, chosen)


def _joined(orbits: Orbits, chosen: Sequence[int]) -> NDArray[np.int64]:
    return np.concatenate([orbits[number] for number in chosen]) if chosen else np.empty(0, np.int64)


def _spanning(points: Floats) -> list[int]:
    """Four vertices that span a body: far apart, far from the line, far from the plane."""
    first = int(np.linalg.norm(points, axis=1).argmax())
    away = points - points[first]
    second = int(np.linalg.norm(away, axis=1).argmax())
    along = away[second] / np.linalg.norm(away[second])
    third = int(np.linalg.norm(away - (away @ along)[:, None] * along, axis=1).argmax())
    normal = np.cross(along, away[third])
    return [first, second, third, int(np.abs(away @ normal).argmax())]


def _spans(points: Floats, selected: NDArray[np.int64]) -> bool:
    """Whether some of the points span a body that is not all but flat."""
    if len(selected) < 4:
        return False
    some = points[selected]
    return bool(np.linalg.svd(some - some.mean(axis=0), compute_uv=False)[-1] > ALIKE)


def _hull_of(points: Floats) -> Any:
    from scipy.spatial import ConvexHull

    return ConvexHull(points)


def _over(points: Floats, hull: Any) -> Floats:
    """How far points are over the planes of a hull, shape (n,); at most the distance to it, negative inside."""
    parts = np.array_split(points, 1 + len(points) * len(hull.equations) // 5_000_000)
    return np.concatenate([(p @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1) for p in parts])


def _depths(points: Floats, selected: NDArray[np.int64], tolerance: float) -> Floats:
    """How far points are outside of the hull of the kept ones, shape (n,); 0 inside.

    Over the planes only, as long as that is more than the tolerance somewhere: the distance itself, which is larger
    over an edge, takes long.
    """
    hull = _hull_of(points[selected])
    depth = np.maximum(_over(points, hull), 0.0)
    doubtful = np.argsort(depth)[-WORST:]
    doubtful = doubtful[depth[doubtful] > DOUBTFUL * tolerance]
    if depth.max() <= tolerance and len(doubtful):
        depth[doubtful] = _distances(points[doubtful], points[selected][hull.simplices])
    return depth


def _error(points: Floats, selected: NDArray[np.int64]) -> float:
    """The error that the kept ones leave; only those that stand out farthest are looked at exactly."""
    hull = _hull_of(points[selected])
    over = _over(points, hull)
    worst = np.argsort(over)[-WORST:]
    worst = worst[over[worst] > ALIKE**2]
    return float(_distances(points[worst], points[selected][hull.simplices]).max()) if len(worst) else 0.0


def _distances(points: Floats, triangles: Floats) -> Floats:
    """Distance of points (n, 3) to the nearest of triangles (m, 3, 3), shape (n,)."""
    from trimesh.triangles import closest_point

    nearest = np.empty(len(points))
    for some in np.array_split(np.arange(len(points)), 1 + len(points) * len(triangles) // 500_000):
        pairs = np.repeat(points[some], len(triangles), axis=0)
        on = closest_point(np.tile(triangles, (len(some), 1, 1)), pairs)
        nearest[some] = np.linalg.norm(pairs - on, axis=1).reshape(len(some), -1).min(axis=1)
    return nearest
