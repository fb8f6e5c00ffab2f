"""Whether the facets of a mesh cross each other: a mesh that intersects itself has no sure volume.

Two facets cross where an edge of one passes through the inside of the other, away from its rim by more than round-off.
So facets that share an edge or a corner, or just touch, do not cross. Pairs whose boxes overlap are found by going down
a tree of boxes, on all pairs of a level at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Pairs = NDArray[np.int64]

MOST_PAIRS = 30_000_000  # whose boxes overlap, looked at; a million facets of an even mesh have half as many
TOGETHER = 500_000  # pairs looked at at once
DEEP = 1e-5  # of the size: a crossing less deep may be round-off of single precision


def first_crossing(triangles: Floats) -> tuple[int, int, Floats] | None:
    """Two facets (n, 3, 3) that cross, by number, and a point of both (3,); None if none is found."""
    low = triangles.min(axis=(0, 1))
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    unit = (triangles - low) / size
    order = _in_space(unit)
    sorted_facets = unit[order]
    boxes = _tree(sorted_facets)
    waiting: list[tuple[int, Pairs]] = [(0, np.zeros((1, 2), np.int64))]
    looked_at = 0
    while waiting and looked_at < MOST_PAIRS:  # deepest first, so that few pairs wait
        level, pairs = waiting.pop()
        pairs = pairs[_overlap(boxes[level], pairs)]
        if level == len(boxes) - 1:
            looked_at += len(pairs)
            found = _cross(sorted_facets, pairs[pairs[:, 0] < pairs[:, 1]])
            if found is not None:
                i, j, place = found
                first, second = sorted((int(order[i]), int(order[j])))
                return first, second, place * size + low
            continue
        a, b = 2 * pairs[:, 0], 2 * pairs[:, 1]
        below = np.concatenate([np.column_stack([a + i, b + j]) for i in (0, 1) for j in (0, 1)])
        below = below[below[:, 0] <= below[:, 1]]
        waiting += [(level + 1, part) for part in np.array_split(below, 1 + len(below) // TOGETHER)]
    return None


def _in_space(triangles: Floats) -> NDArray[np.int64]:
    """An order of facets in which neighbours in the list are neighbours in space (Morton's)."""
    cell = np.clip(triangles.mean(axis=1) * 1023.0, 0, 1023).astype(np.int64)
    code = np.zeros(len(cell), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _tree(triangles: Floats) -> list[Floats]:
    """Boxes (2^level, 2, 3), low and high, of ever smaller runs of facets; those of no facet overlap nothing."""
    depth = max(1, int(np.ceil(np.log2(len(triangles)))))
    leaves = np.empty((2**depth, 2, 3))
    leaves[:, 0], leaves[:, 1] = np.inf, -np.inf
    leaves[: len(triangles), 0], leaves[: len(triangles), 1] = triangles.min(axis=1), triangles.max(axis=1)
    levels = [leaves]
    for _ in range(depth):
        pairs = levels[0].reshape(-1, 2, 2, 3)
        levels.insert(0, np.stack([pairs[:, :, 0].min(axis=1), pairs[:, :, 1].max(axis=1)], axis=1))
    return levels


def _overlap(boxes: Floats, pairs: Pairs) -> NDArray[np.bool_]:
    a, b = boxes[pairs[:, 0]], boxes[pairs[:, 1]]
    return np.asarray(((a[:, 0] <= b[:, 1]) & (b[:, 0] <= a[:, 1])).all(axis=1))


def _cross(triangles: Floats, pairs: Pairs) -> tuple[int, int, Floats] | None:
    """The first pair of facets of which one has an edge through the other."""
    for first, second in (pairs.T, pairs.T[::-1]):
        plane, edge = triangles[first], triangles[second]
        normal = np.cross(plane[:, 1] - plane[:, 0], plane[:, 2] - plane[:, 0])
        area = np.linalg.norm(normal, axis=1)
        good = area > DEEP**2
        normal = normal / np.where(good, area, 1.0)[:, None]
        height = np.einsum("nk,njk->nj", normal, edge - plane[:, :1])
        for j in range(3):
            a, b = height[:, j], height[:, (j + 1) % 3]
            through = good & (a * b < 0.0) & (np.abs(a) > DEEP) & (np.abs(b) > DEEP)
            some = np.flatnonzero(through)
            if not len(some):
                continue
            share = (a[some] / (a[some] - b[some]))[:, None]
            place = edge[some, j] + share * (edge[some, (j + 1) % 3] - edge[some, j])
            inside = np.ones(len(some), bool)
            for k in range(3):
                along = plane[some, (k + 1) % 3] - plane[some, k]
                inwards = np.cross(normal[some], along)
                inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
                inside &= ((place - plane[some, k]) * inwards).sum(axis=1) > DEEP
            if inside.any():
                k = int(np.flatnonzero(inside)[0])
                return int(first[some[k]]), int(second[some[k]]), place[k]
    return None
