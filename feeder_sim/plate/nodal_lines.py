"""Nodal lines of a mode shape, the distance of points to them, and the antinode next to a point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.outline import Outline
from feeder_sim.plate.surface import Surface

NEIGHBOURS = np.array([[0, 0], [-1, -1], [-1, 0], [-1, 1], [0, -1], [0, 1], [1, -1], [1, 0], [1, 1]], float)
CLOSE, LEVEL = 1e-7, 1e-12  # of half the plate, and of the largest deflection: closer and higher is round-off


@dataclass(frozen=True)
class NodalLines:
    """Zero contours of one mode shape.

    Attributes:
        lines: polylines on the plate, each of shape (n, 2) [m]; empty when the shape has no node.
    """

    lines: tuple[NDArray[np.float64], ...]

    @cached_property
    def _geometry(self) -> Any:
        from shapely import MultiLineString

        return MultiLineString([line for line in self.lines if len(line) > 1])

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance [m] of points (n, 2) to the nearest nodal line, shape (n,); infinite when there is none."""
        import shapely

        if not self.lines:
            return np.full(len(points), np.inf)
        return np.asarray(shapely.distance(shapely.points(points), self._geometry))


def nodal_lines(surface: Surface, shape: int = 0) -> NodalLines:
    """Nodal lines of one mode shape on the plate, as contours w = 0 on the grid of the surface."""
    from contourpy import contour_generator

    w = surface.table[shape, 0]
    traced = contour_generator(surface.x, surface.y, w.T).lines(0.0)
    lines = tuple(np.asarray(line) for line in traced if len(line) > 1)
    return NodalLines(lines if surface.outline is None or not lines else surface.outline.inside(lines))


def antinode_near(surface: Surface, shape: int, point: tuple[float, float]) -> NDArray[np.float64]:
    """Antinode of the cell in which a point (x, y) [m] lies, shape (2,) [m]: the maximum of |w| next to the point.

    It is climbed to in steps of the grid, then of half as much, and so on: no step leaves the cell.
    """
    if surface.outline is not None:
        return _antinode_on(surface, surface.outline, shape, point)
    sign = np.sign(surface.deflection(shape, np.array([point]))[0]) or 1.0
    half = np.array([0.5 * surface.length, 0.5 * surface.width])
    at, step = np.array(point), float(min(np.diff(surface.x).min(), np.diff(surface.y).min()))
    while step > CLOSE * half.min():
        around = np.clip(at + step * NEIGHBOURS, -half, half)
        height = sign * surface.deflection(shape, around)
        best = int(height.argmax())
        if height[best] > height[0] + LEVEL:
            at = around[best]
        else:
            step *= 0.5
    return at


def _antinode_on(surface: Surface, outline: Outline, shape: int, point: tuple[float, float]) -> NDArray[np.float64]:
    """As `antinode_near`, among the points of the grid that are on the plate and in one piece with the point."""
    from scipy.ndimage import label

    w = surface.table[shape, 0]
    places = np.stack(np.meshgrid(surface.x, surface.y, indexing="ij"), axis=-1)
    sign = np.sign(surface.deflection(shape, np.array([point]))[0]) or 1.0
    inside = outline.holds(places)
    pieces, _ = label((sign * w > 0.0) & inside)
    away = np.where(pieces > 0, ((places - np.array(point)) ** 2).sum(axis=-1), np.inf)
    if not np.isfinite(away).any():
        return np.array(point)
    piece = pieces.ravel()[np.argmin(away)]
    return np.asarray(places.reshape(-1, 2)[np.where(pieces == piece, np.abs(w), -1.0).argmax()])
