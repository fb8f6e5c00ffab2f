"""`Surface` as compiled code takes it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.machine_code import inlined, is_none, lasting, overload
from feeder_sim.plate.outline import Outline
from feeder_sim.scene.scene import Scene, once_per_scene

# `Outline` as compiled code takes it: whether a place is on the plate, and where lines cross the plate's edge.
#
# On a plate that is a whole rectangle there is no outline, None in place of the arrays; what asks for it is then
# compiled to nothing.

ON_EDGE = 1e-9  # [m]; a place this far off the plate is still on its edge


class OutlineArrays(NamedTuple):
    """Grid of distances from the edge, positive on the plate, and all edges of the polygons, plate on the left.

    corner_x, corner_y: of the grid [m]; cell: its spacing [m]; distance: (nx, ny) [m]; edges: (m, 4), x and y of begin
    and end [m].
    """

    corner_x: float
    corner_y: float
    cell: float
    distance: NDArray[np.float64]
    edges: NDArray[np.float64]


def outline_arrays(outline: Outline | None) -> OutlineArrays | None:
    """Collect the arrays of an outline; None without one."""
    if outline is None:
        return None
    corner, cell, distance, edges = outline.table
    return OutlineArrays(float(corner[0]), float(corner[1]), cell, distance, edges)


def off_plate(outline, x, y):
    """Whether a place is off the plate, more than `ON_EDGE` from its edge; never without an outline."""
    raise NotImplementedError("for compiled code only")


def edge_distance(outline, x, y, needed):
    """Distance of a place from the edge [m], positive on the plate; infinite without an outline.

    Far from the edge, farther than `needed` [m], it may be less than it is.
    """
    raise NotImplementedError("for compiled code only")


@overload(off_plate)
def _off_plate(outline, x, y):
    if is_none(outline):
        return lambda outline, x, y: False
    return lambda outline, x, y: _distance(outline, x, y, 0.0) < -ON_EDGE


@overload(edge_distance)
def _edge_distance(outline, x, y, needed):
    if is_none(outline):
        return lambda outline, x, y, needed: np.inf
    return lambda outline, x, y, needed: _distance(outline, x, y, needed)


@inlined
def _distance(outline, x, y, needed):
    """As `edge_distance`, with an outline: from the table, or near the edge from the polygons."""
    u, v = (x - outline.corner_x) / outline.cell, (y - outline.corner_y) / outline.cell
    nx, ny = outline.distance.shape
    if not (0.0 <= u <= nx - 1.0 and 0.0 <= v <= ny - 1.0):
        return -outline.cell  # beside the bounding box by at least that
    i, j = int(u + 0.5), int(v + 0.5)
    near = outline.distance[i, j]
    off = math.sqrt(0.5) * outline.cell  # no place is farther from its point of the grid
    if near > needed + off:
        return near - off
    if near < -needed - off:
        return near + off
    return _exact_distance(outline.edges, x, y)


@inlined
def _exact_distance(edges, x, y):
    """Signed distance of a place from polygons, whose edges are crossed an odd number of times by a ray from inside."""
    nearest, inside = np.inf, False
    for k in range(edges.shape[0]):
        ax, ay, bx, by = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
        ex, ey, px, py = bx - ax, by - ay, x - ax, y - ay
        share = min(max((px * ex + py * ey) / (ex * ex + ey * ey), 0.0), 1.0)
        dx, dy = px - share * ex, py - share * ey
        nearest = min(nearest, dx * dx + dy * dy)
        if (ay > y) != (by > y) and px < ex * py / ey:
            inside = not inside
    nearest = math.sqrt(nearest)
    return nearest if inside else -nearest


class SurfaceArrays(NamedTuple):
    """Grid, table and terms of a `Surface`, half the thickness, the switches of the scenario, and the outline.

    in_plane: 1 when the surface moves in its plane, else 0; tangent: take it for a plane under the part;
    outline: None on a whole rectangle.
    """

    grid_x: NDArray[np.float64]
    grid_y: NDArray[np.float64]
    table: NDArray[np.float64]
    term_shape: NDArray[np.int64]
    term_start: NDArray[np.float64]
    term_stop: NDArray[np.float64]
    coefficient: NDArray[np.complex128]
    rate: NDArray[np.complex128]
    half_thickness: float
    in_plane: float
    tangent: bool
    outline: OutlineArrays | None


@once_per_scene
def surface_arrays(scene: Scene) -> SurfaceArrays:
    """Collect the arrays of the surface of a scene and the switches of its run."""
    surface, run = scene.surface, scene.scenario.run
    terms = surface.terms
    arrays: SurfaceArrays = lasting(
        SurfaceArrays(
            surface.x,
            surface.y,
            surface.table,
            terms.shape,
            terms.start,
            terms.stop,
            terms.coefficient,
            terms.rate,
            0.5 * surface.thickness,
            1.0 if run.in_plane_velocity else 0.0,
            run.tangent_surface,
            outline_arrays(surface.outline),
        )
    )
    return arrays
