"""Triangles of a plate with holes, whose edges follow its outline and given lines, such as the edges of patches.

Points of the lines are kept as drawn and long pieces are divided; points between them begin on a triangular grid and
move to the middle of their neighbours. Delaunay's triangulation holds every piece of a line once no point lies in the
circle around the piece; where it does not, lines are divided more finely.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.outline import Outline

ROUNDS = 15  # of moving points to the middle of their neighbours
APART = 0.45  # of the spacing; how far points stay from lines
FINER = 8  # times that lines are divided more finely, before the mesh is given up
PLACE_TOLERANCE = 1e-7  # [m]; corners of lines this close are one
NO_POINTS = np.zeros((0, 2))


def triangulate(
    outline: Outline, lines: Sequence[Any], spacing: float, corners: NDArray[np.float64] = NO_POINTS
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (n, 2) [m] and triangles (m, 3), counter-clockwise.

    Args:
        outline: of the plate.
        lines: on it, as shapely has them, which sides of triangles follow.
        spacing: of the points [m].
        corners: places (k, 2) [m] on it where triangles have a corner.

    Raises:
        ValueError: no such mesh is found, as with lines that cross at a sharp angle.
    """
    import shapely

    rings = [shapely.LinearRing(ring) for ring in outline.rings]
    edges = shapely.union_all([*rings, *lines], grid_size=PLACE_TOLERANCE)
    pieces = [shapely.get_coordinates(piece) for piece in shapely.get_parts(edges)]
    size = spacing
    for _ in range(FINER):
        on_lines, segments = _divided(pieces, size)
        apart = shapely.distance(shapely.points(corners), edges) > PLACE_TOLERANCE if len(corners) else []
        fixed = np.vstack([on_lines, corners[apart]])
        points = _relaxed(
            fixed, _between(outline, shapely.union(edges, shapely.multipoints(corners)), spacing), outline
        )
        triangles = _triangles(points, outline)
        sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        if set(map(tuple, np.sort(segments, axis=1).tolist())) <= set(map(tuple, sides.tolist())):
            return points, triangles
        size *= 0.7
    raise ValueError("no mesh follows its outline and patches; are there lines that cross at a sharp angle?")


def _divided(pieces: Sequence[NDArray[np.float64]], size: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (n, 2) of lines, no farther apart than `size` [m], and pairs (m, 2) of those next to each other."""
    number: dict[tuple[int, int], int] = {}
    points: list[NDArray[np.float64]] = []
    pairs = []

    def index_of(point: NDArray[np.float64]) -> int:
        x, y = np.round(point / PLACE_TOLERANCE).astype(np.int64).tolist()
        if (x, y) not in number:
            number[x, y] = len(points)
            points.append(point)
        return number[x, y]

    for piece in pieces:
        for begin, end in itertools.pairwise(piece):
            n = max(1, int(np.ceil(np.linalg.norm(end - begin) / size)))
            along = [index_of(begin + k / n * (end - begin)) for k in range(n + 1)]
            pairs += [pair for pair in itertools.pairwise(along) if pair[0] != pair[1]]
    return np.array(points), np.array(pairs, np.int64)


def _between(outline: Outline, edges: object, spacing: float) -> NDArray[np.float64]:
    """Points of a triangular grid on the plate (n, 2) [m], away from all lines."""
    import shapely

    (left, low), (right, high) = outline.exterior.min(axis=0), outline.exterior.max(axis=0)
    x, y = np.meshgrid(np.arange(left, right, spacing), np.arange(low, high, 0.5 * np.sqrt(3.0) * spacing))
    x[1::2] += 0.5 * spacing
    points = np.column_stack([x.ravel(), y.ravel()])
    points = points[outline.holds(points)]
    return points[shapely.distance(shapely.points(points), edges) > APART * spacing]


def _triangles(points: NDArray[np.float64], outline: Outline) -> NDArray[np.int64]:
    from scipy.spatial import Delaunay

    triangles = Delaunay(points).simplices.astype(np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    twice = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles[twice < 0.0] = triangles[twice < 0.0][:, [0, 2, 1]]
    flat = np.abs(twice) < 1e-9 * np.ptp(points, axis=0).max() ** 2  # between points of one straight line
    return triangles[outline.holds((a + b + c) / 3.0) & ~flat]


def _relaxed(fixed: NDArray[np.float64], moving: NDArray[np.float64], outline: Outline) -> NDArray[np.float64]:
    """All points, after those that may move have gone to the middle of their neighbours a few times."""
    points = np.vstack([fixed, moving])
    for _ in range(ROUNDS if len(moving) else 0):
        triangles = _triangles(points, outline)
        total, count = np.zeros_like(points), np.zeros(len(points))
        for i, j in ((0, 1), (1, 2), (2, 0)):
            for here, there in ((i, j), (j, i)):
                np.add.at(total, triangles[:, here], points[triangles[:, there]])
                np.add.at(count, triangles[:, here], 1.0)
        free = np.arange(len(points)) >= len(fixed)
        free &= count > 0.0
        points[free] = total[free] / count[free, None]
    return points
