"""Hulls over the edge of the plate.

A hull rests on the plate's edge too: where its own edges cross the plane of a side of the plate it gets a further
point, for the moment, that meets the plate like a corner.
"""

from __future__ import annotations

import numpy as np

from feeder_sim.engines.impulse.state import GAP, point, top_speed
from feeder_sim.machine_code import compiled

EDGE_STEPS = 10  # a point on the edge moves along the hull: its leaps are estimates, and at least this long


@compiled
def points_on_edge(part, kind, kinds, surface, work):
    """How many edges of the part's hull cross the plane of a side of the plate, each in a further point.

    If any does, work.points holds the corners, and these points after them.
    """
    corners = kinds.corners[kind.corner_from : kind.corner_to]
    reach = kind.reach + kind.radius
    half_x, half_y = surface.grid_x[-1], surface.grid_y[-1]
    if abs(part.position[0]) + reach < half_x and abs(part.position[1]) + reach < half_y:
        return 0
    n = corners.shape[0]
    for i in range(n):
        for c in range(3):
            work.points[i, c] = corners[i, c]
    for axis in range(2):
        half = half_x if axis == 0 else half_y
        if abs(part.position[axis]) + reach < half or abs(part.position[axis]) - reach > half:
            continue
        side = half if part.position[axis] > 0.0 else -half
        for e in range(kind.edge_from, kind.edge_to):
            i, j = kinds.edges[e, 0], kinds.edges[e, 1]
            a, b = point(part, corners, i, axis) - side, point(part, corners, j, axis) - side
            if a * b < 0.0:
                share = a / (a - b)
                for c in range(3):
                    work.points[n, c] = corners[i, c] + share * (corners[j, c] - corners[i, c])
                n += 1
    return n - corners.shape[0]


@compiled
def edge_leap(part, kind, corners, first, step, work):
    """Flight after which the points on the plate's edge, from `first` on, are looked at again [s]."""
    speed, gap = top_speed(part, kind), np.inf
    for i in range(first, corners.shape[0]):
        gap = min(gap, work.corner[i, GAP])
    return max(0.25 * gap / speed, EDGE_STEPS * step)
