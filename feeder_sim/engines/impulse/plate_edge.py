"""Hulls over the edge of the plate.

A hull rests on the plate's edge too: where its own edges cross the plane of a side of the plate it gets a further
point, for the moment, that meets the plate like a corner. Of a plate with an outline of its own it gets these where its
edges cross that outline, seen from above. A corner of the outline under a face of the hull is left out. A cylinder gets
these points in closed form (circle_crossings.py).
"""

from __future__ import annotations

import numpy as np

from feeder_sim.engines.impulse.circle_crossings import cross_circles
from feeder_sim.engines.impulse.circles import is_round, lay_out
from feeder_sim.engines.impulse.state import arm_of, in_pieces, point, top_speed
from feeder_sim.engines.surface_arrays import edge_distance
from feeder_sim.machine_code import inlined, is_none, overload, uncounted

BESIDE = 2e-4  # [m]; a point that far below the surface is beside the plate or under it
MOST_CROSSINGS = 2  # of an edge of the hull with the outline that have room in the scratch space
EDGE_STEPS = 10  # a point on the edge moves along the hull: its leaps are estimates, and at least this long


def points_on_edge(part, kind, kinds, surface, crest, work):
    """How many further points the part's hull has on the edge of the plate.

    If any, work.corners holds the corners or the points on circles, and these points after them. crest: how high, and
    how low, the surface may be [m].
    """
    raise NotImplementedError("for compiled code only")


@overload(points_on_edge)
def _points_on_edge(part, kind, kinds, surface, crest, work):
    """A plate without an outline has the four sides of its grid."""
    outline = surface.types[surface.fields.index("outline")]
    if is_none(outline):
        return lambda part, kind, kinds, surface, crest, work: _points_on_sides(part, kind, kinds, surface, crest, work)
    return lambda part, kind, kinds, surface, crest, work: _points_on_outline(
        part, kind, kinds, surface.outline, crest, work
    )


@inlined
def falls(part, kind, crest):
    """Whether a part has tipped over the edge: with its centre below the plate nothing that pushes up can hold it.

    Below the plate is below the trough of its motion, as deep as its crest is high. Not a concave part, which may hang
    there.
    """
    return part.position[2] < -BESIDE - crest and not in_pieces(kind)


@uncounted
def _points_on_outline(part, kind, kinds, outline, crest, work):
    """Where edges of the part's hull cross those of the outline, seen from above."""
    corners = kinds.corners[kind.corner_from : kind.corner_to]
    reach = kind.reach + kind.radius
    if falls(part, kind, crest) or abs(edge_distance(outline, part.position[0], part.position[1], reach)) > reach:
        return 0
    n = first = lay_out(kind, kinds, work)
    for k in range(outline.edges.shape[0]):
        ax, ay = outline.edges[k, 0] - part.position[0], outline.edges[k, 1] - part.position[1]
        bx, by = outline.edges[k, 2] - part.position[0], outline.edges[k, 3] - part.position[1]
        if min(ax, bx) > reach or max(ax, bx) < -reach or min(ay, by) > reach or max(ay, by) < -reach:
            continue
        if is_round(kind):
            begin, end = (outline.edges[k, 0], outline.edges[k, 1]), (outline.edges[k, 2], outline.edges[k, 3])
            n = cross_circles(part, kind, begin, end, n, work)
            continue
        for e in range(kind.edge_from, kind.edge_to):
            i, j = kinds.edges[e, 0], kinds.edges[e, 1]
            one, other = arm_of(part, corners, i), arm_of(part, corners, j)
            # Which side of the outline's edge the ends are on, and of the hull's edge those of the outline's.
            p = (bx - ax) * (one[1] - ay) - (by - ay) * (one[0] - ax)
            q = (bx - ax) * (other[1] - ay) - (by - ay) * (other[0] - ax)
            r = (other[0] - one[0]) * (ay - one[1]) - (other[1] - one[1]) * (ax - one[0])
            s = (other[0] - one[0]) * (by - one[1]) - (other[1] - one[1]) * (bx - one[0])
            if p * q < 0.0 and r * s <= 0.0 and n < first + MOST_CROSSINGS * (kind.edge_to - kind.edge_from):
                share = p / (p - q)
                for c in range(3):
                    work.corners[n, c] = corners[i, c] + share * (corners[j, c] - corners[i, c])
                n += 1
    return n - first


@uncounted
def _points_on_sides(part, kind, kinds, surface, crest, work):
    """Where edges of the part's hull cross the plane of a side of the plate."""
    corners = kinds.corners[kind.corner_from : kind.corner_to]
    reach = kind.reach + kind.radius
    half_x, half_y = surface.grid_x[-1], surface.grid_y[-1]
    if falls(part, kind, crest) or (abs(part.position[0]) + reach < half_x and abs(part.position[1]) + reach < half_y):
        return 0
    n = first = lay_out(kind, kinds, work)
    for axis in range(2):
        half = half_x if axis == 0 else half_y
        if abs(part.position[axis]) + reach < half or abs(part.position[axis]) - reach > half:
            continue
        side = half if part.position[axis] > 0.0 else -half
        if is_round(kind):
            if axis == 0:
                n = cross_circles(part, kind, (side, -half_y), (side, half_y), n, work)
            else:
                n = cross_circles(part, kind, (-half_x, side), (half_x, side), n, work)
            continue
        for e in range(kind.edge_from, kind.edge_to):
            i, j = kinds.edges[e, 0], kinds.edges[e, 1]
            a, b = point(part, corners, i, axis) - side, point(part, corners, j, axis) - side
            if a * b < 0.0:
                share = a / (a - b)
                for c in range(3):
                    work.corners[n, c] = corners[i, c] + share * (corners[j, c] - corners[i, c])
                n += 1
    return n - first


@uncounted
def edge_leap(part, kind, corners, first, step, work):
    """Flight after which the points on the plate's edge, from `first` on, are looked at again [s]."""
    speed, gap = top_speed(part, kind), np.inf
    for i in range(first, corners.shape[0]):
        gap = min(gap, work.point[i].gap)
    return max(0.25 * gap / speed, EDGE_STEPS * step)
