"""The outline of a plate that is no rectangle: its outer edge and its holes, as polygons.

Compiled code needs to know, millions of times, whether a place is on the plate. A table of signed distances on a coarse
grid answers that for all places that are farther from the edge than a cell is wide; only for the others the polygons
themselves are looked at, so that the answer is that of the polygons, not that of the table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

CELLS = 200  # of the table of distances, along the longer side
MARGIN = 2  # cells of the table beyond the outer edge
MOST_POINTS = 100_000  # of all polygons together
LEAST_AREA = 1e-10  # [m^2]


@dataclass(frozen=True, eq=False)
class Outline:
    """Outer edge and holes of a plate, whose bounding box is centred on the origin.

    Attributes:
        exterior: corners of the outer edge [m], shape (n, 2), the first one not repeated.
        holes: corners of every hole [m], each (n, 2).
    """

    exterior: NDArray[np.float64]
    holes: tuple[NDArray[np.float64], ...] = ()

    @property
    def rings(self) -> tuple[NDArray[np.float64], ...]:
        """The outer edge, then the holes."""
        return (self.exterior, *self.holes)

    @property
    def size(self) -> tuple[float, float]:
        """Length and width of the bounding box [m]."""
        length, width = np.ptp(self.exterior, axis=0)
        return float(length), float(width)

    @property
    def key(self) -> tuple[bytes, ...]:
        """The same for outlines that are the same."""
        return tuple(ring.tobytes() for ring in self.rings)

    @cached_property
    def polygon(self) -> Any:
        """As shapely has it."""
        import shapely

        polygon = shapely.Polygon(self.exterior, self.holes)
        shapely.prepare(polygon)
        return polygon

    @cached_property
    def _edges(self) -> Any:
        return self.polygon.boundary

    def holds(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (..., 2) [m] are on the plate, shape (...)."""
        import shapely

        return np.asarray(shapely.intersects_xy(self.polygon, points[..., 0], points[..., 1]))

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of points (..., 2) from the edge [m], shape (...): positive on the plate, negative beside it."""
        import shapely

        away = np.asarray(shapely.distance(shapely.points(points), self._edges))
        return np.where(self.holds(points), away, -away)

    def inside(self, lines: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], ...]:
        """The parts of polylines (n, 2) [m] that are on the plate."""
        import shapely

        inside = shapely.intersection(self.polygon, shapely.MultiLineString([line for line in lines if len(line) > 1]))
        pieces = shapely.get_parts(shapely.line_merge(inside)) if not inside.is_empty else ()
        return tuple(shapely.get_coordinates(piece) for piece in pieces if piece.geom_type == "LineString")

    def edge_points(self, spacing: float) -> NDArray[np.float64]:
        """Points (n, 2) [m] along all polygons, their corners among them, no farther apart than a spacing [m]."""
        pieces = []
        for ring in self.rings:
            for begin, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
                n = max(1, int(np.ceil(np.linalg.norm(end - begin) / spacing)))
                pieces.append(begin + np.arange(n)[:, None] / n * (end - begin))
        return np.concatenate(pieces)

    def simplified(self, tolerance: float) -> Outline:
        """The same within a tolerance [m], without corners that are not needed for it."""
        import shapely

        polygon = shapely.simplify(self.polygon, tolerance, preserve_topology=True)
        return checked_outline([shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)])

    def moved(self, shift: NDArray[np.float64]) -> Outline:
        """The same, moved by (2,) [m]."""
        return Outline(self.exterior + shift, tuple(hole + shift for hole in self.holes))

    @cached_property
    def table(self) -> tuple[NDArray[np.float64], float, NDArray[np.float64], NDArray[np.float64]]:
        """For compiled code: corner (2,) and cell [m] of a grid, distances on it (nx, ny) [m], edges (m, 4) [m].

        An edge is (x, y) of its begin, then of its end, with the plate on its left.
        """
        import shapely

        half = 0.5 * np.array(self.size)
        cell = 2.0 * float(half.max()) / CELLS
        corner = -half - MARGIN * cell
        nx, ny = (int(np.ceil(2.0 * h / cell)) + 2 * MARGIN + 1 for h in half)
        x, y = corner[0] + cell * np.arange(nx), corner[1] + cell * np.arange(ny)
        places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
        leftwards = [bool(shapely.is_ccw(shapely.linearrings(ring))) == (k == 0) for k, ring in enumerate(self.rings)]
        rings = [ring if left else ring[::-1] for ring, left in zip(self.rings, leftwards, strict=True)]
        edges = np.concatenate([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in rings])
        return corner, cell, np.ascontiguousarray(self.distance(places)), np.ascontiguousarray(edges)


def checked_outline(rings: Sequence[NDArray[np.float64]]) -> Outline:
    """An outline from its outer edge and its holes, each (n, 2) [m].

    Raises:
        ValueError: too few or too many corners, a polygon that crosses itself, a hole that is not within the outer edge
            or meets another; the message says which.
    """
    import shapely

    names = ["the outer edge", *(f"hole {i}" for i in range(1, len(rings)))]
    cleaned = []
    for name, points in zip(names, rings, strict=True):
        ring = np.asarray(points, float)
        if len(ring) > 1 and (ring[0] == ring[-1]).all():
            ring = ring[:-1]
        ring = ring[(ring != np.roll(ring, 1, axis=0)).any(axis=1)]
        if len(ring) < 3:
            raise ValueError(f"{name} has {len(ring)} different corners, must be at least 3")
        if not np.isfinite(ring).all():
            raise ValueError(f"{name} has a corner that is no number, must be numbers")
        polygon = shapely.Polygon(ring)
        if not polygon.is_valid:
            where = shapely.is_valid_reason(polygon)
            raise ValueError(f"{name} crosses itself ({_in_mm(where)}), must be a simple polygon")
        if polygon.area < LEAST_AREA:
            raise ValueError(f"{name} has no area, must be a polygon with one")
        cleaned.append(ring)
    if sum(map(len, cleaned)) > MOST_POINTS:
        raise ValueError(f"has {sum(map(len, cleaned))} corners, must be up to {MOST_POINTS}")
    outer = shapely.Polygon(cleaned[0])
    holes = [shapely.Polygon(ring) for ring in cleaned[1:]]
    for i, hole in enumerate(holes):
        if not outer.contains_properly(hole):
            raise ValueError(f"{names[i + 1]} is not within the outer edge, must be a hole that does not touch it")
        for j in range(i):
            if hole.intersects(holes[j]):
                raise ValueError(f"{names[i + 1]} meets hole {j + 1}, must be holes apart from each other")
    return Outline(cleaned[0], tuple(cleaned[1:]))


def rectangle_of(length: float, width: float) -> Outline:
    """A rectangle [m] without holes."""
    half = 0.5 * np.array([length, width])
    return Outline(half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]))


def rectangular(outline: Outline, tolerance: float) -> bool:
    """Whether an outline is its bounding box, within a tolerance [m] that is wider in the corners, without holes."""
    import shapely

    if outline.holes:
        return False
    box = shapely.box(*outline.polygon.bounds)
    return bool(box.difference(outline.polygon.buffer(tolerance)).area < max(tolerance**2, 1e-9 * box.area))


def _in_mm(reason: str) -> str:
    """Shapely's reason, such as Self-intersection[0.01 0.02], with its coordinates in mm."""
    words, _, place = reason.partition("[")
    try:
        x, y = (1e3 * float(number) for number in place.rstrip("]").split()[:2])
    except ValueError:
        return words.lower()
    return f"{words.lower()} at ({x:.4g}, {y:.4g}) mm"
