"""All points of a part that can touch the plate: how they stand to it, and how they do after a change of motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from feeder_sim.engines.impulse.free_part.at_edge import REACH, evaluate_edge, move_edge_point
from feeder_sim.engines.impulse.free_part.on_circle import evaluate_circles, move_on_circle
from feeder_sim.engines.impulse.free_part.on_plate import evaluate_corners, move_corner
from feeder_sim.engines.impulse.free_part.path import Turning, turning_of
from feeder_sim.engines.impulse.free_part.walls import evaluate_walls, in_tube, move_at_wall, walled
from feeder_sim.engines.impulse.scratch import ABOVE, AT_EDGE, ON_WALL
from feeder_sim.engines.impulse.surface import move_surface
from feeder_sim.engines.surface_arrays import edge_distance
from feeder_sim.machine_code import inlined


class Seen(NamedTuple):
    """A look at a part: how many points it has, whether one is close, and one may be at the edge; how it turns."""

    n: int
    close: bool
    near_edge: bool
    turning: Turning


@inlined
def evaluate_points(part, kinds, plate, t, work):
    """Fill all points at time t [s]; returns what is seen."""
    kind = kinds.record[part.kind]
    turning = turning_of(part, kind)
    n, close, moved = evaluate_corners(part, kinds, plate, t, turning, work)
    n, on_circle, moved = evaluate_circles(part, kinds, plate, n, t, moved, turning, work)
    near_edge, at_edge = _may_reach_edge(part, kind, plate.surface), False
    if walled(plate) and not in_tube(plate):
        near_edge = False  # behind the rim
    if near_edge:
        if not moved:
            move_surface(t, plate.surface, work.now)
        n, at_edge = evaluate_edge(part, kinds, plate, n, turning, work)
    n, at_wall = evaluate_walls(part, kinds, plate, n, turning, work)
    return Seen(n, close or on_circle or at_edge or at_wall, near_edge, turning)


@inlined
def _may_reach_edge(part, kind, surface):
    """Whether a part is so near the edge of the plate that a point there may come up."""
    far = kind.reach + kind.radius + REACH
    x, y = part.position[0], part.position[1]
    if abs(x) + far > surface.grid_x[-1] or abs(y) + far > surface.grid_y[-1]:
        return True
    return abs(edge_distance(surface.outline, x, y, far)) < far


@inlined
def move_points(part, kind, plate, n, work):
    """How the first n points move anew, after the velocity of the part has changed; returns how it turns."""
    turning = turning_of(part, kind)
    for i in range(n):
        if work.point[i].sort == AT_EDGE:
            move_edge_point(i, part, kind, turning, work)
        elif work.point[i].sort == ON_WALL:
            move_at_wall(i, part, kind, plate, turning, work)
        elif work.point[i].rolls > 0.0:
            move_on_circle(i, part, kind, turning, work)
        else:
            move_corner(i, part, kind, turning, work)
    return turning


@inlined
def lowest_gap(n, work):
    """The least gap of the first n points [m]."""
    gap = np.inf
    for i in range(n):
        gap = min(gap, work.point[i].gap)
    return gap


@inlined
def touches(point, gap):
    """Whether a point is no farther than a gap [m] from what it can touch."""
    return point.sort != ABOVE and point.gap <= gap
