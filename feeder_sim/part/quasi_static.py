"""The faces that a part comes to rest on when it is put down slowly at random, and the exact chance of each.

With the downward direction d in the part's axes, the centre of mass at the origin and the corners v of the hull, the
centre is h(d) = max v . d over the plate. A part without inertia rolls so that d goes down the steepest descent of h:
it turns about the one corner, then the edge that it stands on, until it lies on a face. The chance of a face is the
share of the sphere that leads to it (Baktash, Sharp, Zhou, Jacobson and Crane, Putting rigid bodies to rest, ACM Trans.
Graphics 44(4) (2025) 155).

All of it is straight on the polar dual of the hull, the points x = d / h(d):

    corner v         a polygon in the plane v . x = 1, in which x goes straight away from the foot v / |v|^2
    edge v w         a side between two polygons; x comes to it from that of v where v . (v - w) > 0, anywhere on it:
                     it slides along the side, away from the origin, where it comes from both, and crosses it otherwise
    face n . x = c   the point n / c, where x rests unless a side or a polygon leads on

It crosses a side only to a corner nearer to the centre. From the nearest corner outwards, the sides by which x enters a
polygon are therefore cut where the rays from its foot meet the cuts of the sides by which x leaves it. With the foot,
an interval of a side spans a triangle in either polygon. The directions that pass the interval are those of the
triangle that x comes through less, where it crosses, those of the other; their solid angles are known in closed form.
Nothing is sampled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FLAT = 1e-9  # [rad]; neighbouring triangles that differ less are one face
NEAR = 1e-3  # [rad]; faces to rest on that differ less are one
TIE = 1e-9  # [rad]; a face that rolls so near to a cut goes to either side of it in half of the cases
ROUND_OFF = 1e-12  # of a product of lengths, in units of the size of the hull


def resting_faces(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Outward normals (n, 3) of the faces that a hull rests on, and the quasi-static chance of each (n,).

    Args:
        points: corners (m, 3) about the centre of mass, which lies inside.
    """
    hull = _Hull.of(points)
    sides, rolls_to = _cut(hull)
    chance = _passing(hull, sides)
    falls = hull.offsets[rolls_to] < hull.offsets[:, None]
    rolls_to = np.where(falls, rolls_to, np.arange(len(rolls_to))[:, None])
    for face in np.argsort(-hull.offsets):
        passed, chance[face] = chance[face], 0.0
        for to in rolls_to[face]:
            chance[to] += 0.5 * passed
    return _joined(hull.normals, chance)


class _Hull(NamedTuple):
    """A hull of size 1; its sides (2 e,) are directed, i and i + e are one in either direction.

    A side goes anticlockwise round the polygon of the corner `tail`, from the face `start` to the face `end`; beyond it
    is the polygon of the corner `head`.
    """

    corners: NDArray[np.float64]
    normals: NDArray[np.float64]
    offsets: NDArray[np.float64]
    tail: NDArray[np.int64]
    head: NDArray[np.int64]
    start: NDArray[np.int64]
    end: NDArray[np.int64]

    @classmethod
    def of(cls, points: NDArray[np.float64]) -> _Hull:
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components
        from scipy.spatial import ConvexHull

        hull = ConvexHull(points / np.abs(points).max())
        normals, n = hull.equations[:, :3], len(hull.simplices)
        row, beside = np.repeat(np.arange(n), 3), hull.neighbors.ravel()
        flat = np.linalg.norm(normals[row] - normals[beside], axis=1) < FLAT
        links = coo_array((np.ones(flat.sum()), (row[flat], beside[flat])), shape=(n, n))
        face = connected_components(links, directed=False)[1]
        first = np.unique(face, return_index=True)[1]
        tail, head = hull.simplices[:, [1, 2, 0]].ravel(), hull.simplices[:, [2, 0, 1]].ravel()
        opposite = hull.simplices.ravel()  # `neighbors` has the triangle opposite each corner
        across = np.cross(hull.points[head] - hull.points[tail], hull.points[opposite] - hull.points[tail])
        clockwise = _along(across, normals[row]) < 0.0
        tail, head = np.where(clockwise, head, tail), np.where(clockwise, tail, head)
        once = (tail < head) & (face[row] != face[beside])
        ends = tail[once], head[once], face[beside][once], face[row][once]
        tail, head, start, end = (np.concatenate([ends[i], ends[i ^ 1]]) for i in range(4))
        return cls(hull.points, normals[first], -hull.equations[first, 3], tail, head, start, end)


class _Intervals(NamedTuple):
    """Of one side: from `at[i]` to `at[i + 1]` of its length it is `to[i]` that is the next face."""

    at: NDArray[np.float64]
    to: NDArray[np.int64]

    def reversed(self) -> _Intervals:
        return _Intervals(1.0 - self.at[::-1], self.to[::-1])


def _cut(hull: _Hull) -> tuple[list[_Intervals], NDArray[np.int64]]:
    """Intervals of each directed side, and the two faces (n, 2) that each face rolls to; itself where it rests."""
    corners, dual = hull.corners, hull.normals / hull.offsets[:, None]
    tail, start, end, e = hull.tail, hull.start, hull.end, len(hull.tail) // 2
    leaves = _along(corners[tail], corners[tail] - corners[hull.head]) >= -ROUND_OFF
    rolls_to = np.tile(np.arange(len(dual))[:, None], 2)
    along = dual[end] - dual[start]
    rise = _along(dual[start], along)  # of |x|^2 / 2 from the start on
    slides = leaves & np.roll(leaves, e)
    away = slides & (rise > ROUND_OFF * _along(dual[start], dual[start]))
    rolls_to[start[away]] = end[away][:, None]
    saddle = np.clip(-rise / _along(along, along), 0.0, 1.0)
    sides = [
        _Intervals(np.array([0.0, s, 1.0]), np.array([i, j]))
        if 0.0 < s < 1.0
        else _Intervals(np.array([0.0, 1.0]), np.array([i if s == 1.0 else j]))
        for s, i, j in zip(saddle.tolist(), start.tolist(), end.tolist(), strict=True)
    ]
    by_corner = np.split(np.argsort(tail, kind="stable"), np.cumsum(np.bincount(tail, minlength=len(corners)))[:-1])
    distance = np.linalg.norm(corners, axis=1)
    for corner in np.argsort(distance):
        around = by_corner[corner]
        entering, leaving = around[~leaves[around]], around[leaves[around]]
        if len(entering) == 0:
            continue
        up, foot = corners[corner] / distance[corner], corners[corner] / distance[corner] ** 2
        middle = dual[start[around]].mean(axis=0) - foot
        frame = np.column_stack([middle - (middle @ up) * up, np.cross(up, middle)])
        leaving = leaving[np.argsort(_angle((dual[start[leaving]] - foot) @ frame))]
        row = np.repeat(leaving, [len(sides[k].to) for k in leaving])
        at = np.concatenate([sides[k].at[:-1] for k in leaving])
        to = np.concatenate([sides[k].to for k in leaving])
        new = np.flatnonzero(to[1:] != to[:-1]) + 1
        cuts = np.maximum.accumulate(_angle((dual[start[row[new]]] + at[new, None] * along[row[new]] - foot) @ frame))
        to = to[np.concatenate([[0], new])]
        a, b = (dual[start[entering]] - foot) @ frame, (dual[end[entering]] - foot) @ frame
        low, high = np.searchsorted(cuts, _angle(b), "right"), np.searchsorted(cuts, _angle(a))
        for i, k in enumerate(entering):  # clockwise about the foot
            ray = cuts[low[i] : high[i]][::-1]
            x, y = np.cos(ray), np.sin(ray)
            from_a, from_b = a[i, 0] * y - a[i, 1] * x, b[i, 0] * y - b[i, 1] * x
            at = np.clip(from_a / (from_a - from_b), 0.0, 1.0)
            sides[k] = _Intervals(np.concatenate([[0.0], at, [1.0]]), to[low[i] : max(high[i], low[i]) + 1][::-1])
            sides[(k + e) % (2 * e)] = sides[k].reversed()
        through = np.isin(start[entering], end[entering])  # faces whose ray goes on within the polygon
        ray = _angle(a[through])
        rolls_to[start[entering][through]] = np.column_stack(
            [to[np.searchsorted(cuts, ray - TIE)], to[np.searchsorted(cuts, ray + TIE)]]
        )
    return sides, rolls_to


def _passing(hull: _Hull, sides: list[_Intervals]) -> NDArray[np.float64]:
    """Share of the sphere that comes to each face first (n,)."""
    e = len(sides) // 2
    row = np.repeat(np.arange(e), [len(side.to) for side in sides[:e]])
    dual = hull.normals / hull.offsets[:, None]
    start, along = dual[hull.start[row]], (dual[hull.end] - dual[hull.start])[row]
    a = start + np.concatenate([side.at[:-1] for side in sides[:e]])[:, None] * along
    b = start + np.concatenate([side.at[1:] for side in sides[:e]])[:, None] * along
    angles = _solid_angle(hull.corners[hull.tail[row]], a, b) - _solid_angle(hull.corners[hull.head[row]], a, b)
    return np.bincount(np.concatenate([side.to for side in sides[:e]]), angles, len(dual)) / (4.0 * np.pi)


def _joined(
    normals: NDArray[np.float64], chance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The faces that have a chance, those that are all but one as one."""
    from scipy.spatial import cKDTree

    likely = np.argsort(-chance)[: np.count_nonzero(chance > ROUND_OFF)]
    first = [int(min(near)) for near in cKDTree(normals[likely]).query_ball_point(normals[likely], NEAR)]
    down, chance = normals[likely], np.asarray(np.bincount(first, chance[likely], len(likely)), float)
    down, chance = down[chance > 0.0], chance[chance > 0.0]
    order = np.lexsort(down.T.round(6))  # the side as drawn comes first
    return down[order], chance[order]


def _angle(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Polar angle of vectors (n, 2), shape (n,)."""
    return np.asarray(np.arctan2(vectors[:, 1], vectors[:, 0]))


def _along(vectors: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scalar product of each of n vectors with a vector of its own, shape (n,)."""
    return np.asarray((vectors * directions).sum(axis=1))


def _solid_angle(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of triangles seen from the origin, positive where anticlockwise, (n,) (Van Oosterom and Strackee 1983)."""
    x, y, z = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    below = x * y * z + _along(a, b) * z + _along(b, c) * x + _along(c, a) * y
    return np.asarray(2.0 * np.arctan2(_along(a, np.cross(b, c)), below))
