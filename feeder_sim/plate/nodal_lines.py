"""Nodal lines of a mode shape, the distance of points to them, and the antinode next to a point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.surface import Surface


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
    """Nodal lines of one mode shape, as contours w = 0 on the grid of the surface."""
    from contourpy import contour_generator

    w = surface.table[shape, 0]
    traced = contour_generator(surface.x, surface.y, w.T).lines(0.0)
    return NodalLines(tuple(np.asarray(line) for line in traced if len(line) > 1))


def antinode_near(surface: Surface, shape: int, point: tuple[float, float]) -> NDArray[np.float64]:
    """Antinode of the cell in which a point (x, y) [m] lies, shape (2,) [m]: the maximum of |w| next to the point."""
    from scipy.optimize import minimize

    sign = np.sign(surface.deflection(shape, np.array([point]))[0]) or 1.0
    half = np.array([0.5 * surface.length, 0.5 * surface.width])
    optimum = minimize(  # in units of half the plate, for which the optimiser's default step sizes are right
        lambda u: -sign * surface.deflection(shape, (u * half)[None])[0],
        np.array(point) / half,
        method="L-BFGS-B",
        bounds=[(-1.0, 1.0), (-1.0, 1.0)],
    )
    return np.asarray(optimum.x) * half
