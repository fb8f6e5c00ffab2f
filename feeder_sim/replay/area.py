"""The area of a plate as triangles, with its holes left out, and values on its grid carried over to their corners."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.outline import Outline

CLEAR = 0.35  # of the spacing of the grid; points nearer to the edge than this give way to those on it


@dataclass(frozen=True)
class Area:
    """Triangles over the plate.

    Attributes:
        points: their corners (n, 2) [m].
        triangles: indices (m, 3), counter-clockwise seen from above.
        carried: makes values at the corners (n,) of values on the grid (nx, ny).
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int64]
    carried: Callable[[NDArray[np.float64]], NDArray[np.float64]]


def area_of(x: NDArray[np.float64], y: NDArray[np.float64], outline: Outline | None) -> Area:
    """Triangles over the grid of x (nx,) and y (ny,) [m], up to the outline where there is one."""
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    if outline is None:
        return Area(grid.reshape(-1, 2), grid_triangles(len(x), len(y)), np.ravel)
    from scipy.interpolate import RegularGridInterpolator
    from scipy.spatial import Delaunay

    spacing = max(x[1] - x[0], y[1] - y[0])
    inner = grid.reshape(-1, 2)[outline.distance(grid.reshape(-1, 2)) > CLEAR * spacing]
    points = np.concatenate([inner, outline.edge_points(spacing)])
    triangles = Delaunay(points).simplices.astype(np.int64)
    triangles = triangles[outline.holds(points[triangles].mean(axis=1))]

    def carried(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(RegularGridInterpolator((x, y), values, bounds_error=False, fill_value=None)(points))

    return Area(points, triangles, carried)


def body_mesh(
    area: Area, outline: Outline, thickness: float, gap: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The plate below its surface: vertices (n, 3) [m] and triangles (m, 3) of its top, its bottom and its sides.

    The top is a gap [m] below z = 0.
    """
    bottom = np.column_stack([area.points, np.full(len(area.points), -gap - thickness)])
    top = np.column_stack([area.points, np.full(len(area.points), -gap)])
    vertices, faces = [top, bottom], [area.triangles, area.triangles[:, ::-1] + len(top)]
    count = 2 * len(top)
    for ring in outline.rings:
        n = len(ring)
        upper, lower = (np.column_stack([ring, np.full(n, z)]) for z in (-gap, -gap - thickness))
        here = count + np.arange(n)
        ahead = count + (np.arange(n) + 1) % n
        vertices += [upper, lower]
        faces += [np.column_stack([here, ahead, here + n]), np.column_stack([ahead, ahead + n, here + n])]
        count += 2 * n
    return np.concatenate(vertices), np.concatenate(faces)


def grid_triangles(nx: int, ny: int) -> NDArray[np.int64]:
    """Vertex indices (m, 3) of two triangles per cell of an (nx, ny) grid, counter-clockwise seen from above."""
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    lower = np.column_stack([corner, corner + ny, corner + ny + 1])
    upper = np.column_stack([corner, corner + ny + 1, corner + 1])
    return np.concatenate([lower, upper])
