"""Where a feature of a part meets a straight piece of the plate's edge: what hulls, balls and cylinders share.

A piece is (x, y, length, first vertex): unit vector along it, with the plate on the left, and [m]. Seen along it a
vector is (across, up, along), across outwards from the plate. Formulas and what counts as a point: edge_points.py.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.vectors import cross, dot, plus, write_to
from feeder_sim.engines.surface_arrays import ON_EDGE
from feeder_sim.machine_code import compiled, inlined

# arm: from the centre of mass to the point of the part [m]; normal: from the plate to the part; foot: x and y of the
# point on the plate's edge [m]; gap [m]. The normal of a BALL turns as its centre goes around the piece along `axis`,
# or around a vertex, where that is zero; that of a FACE with the part, that of a ROUND one as its axis, along `lever`,
# goes around a vertex. Two LINES meet in a point that slides along that
# of the part by -(v . axis); if it is bent by a curvature `bend` [1/m] along the normal, the normal turns at the rate
# -(spin . lever + bend (v . axis)) axis. radius: around ball or line [m].
BALL, LINES, FACE, ROUND = range(4)
EDGE_POINT = np.dtype(
    [
        ("arm", "f8", 3),
        ("normal", "f8", 3),
        ("foot", "f8", 2),
        ("gap", "f8"),
        ("turns", "i8"),
        ("lever", "f8", 3),
        ("axis", "f8", 3),
        ("bend", "f8"),
        ("radius", "f8"),
    ],
    align=True,
)
NONE = (0.0, 0.0, 0.0)
WITH_PART = (FACE, NONE, NONE, 0.0)  # turns, lever, axis and bend of a point whose normal turns with the part
LEAST_ACROSS = 0.02  # sine of the angle between two lines, at least: nearly parallel ones have a normal that leaps

BESIDE = 2e-4  # [m]; a point that deep is beside the plate or under it, as for corners
UPRIGHT = 0.02  # of a normal, at least: a degree from level
INWARDS = 0.05  # of a normal, at most: a part that rocks over the edge keeps its points there
FLAT = 1e-3  # of the reach; a feature that hangs over the lowest one by less still carries
PARALLEL = 1e-6  # [1]


@compiled
def store(n, arm, normal, foot, gap, turns, radius, points):
    """Append a point, or put it in place of the farthest of all; turns: its turns, lever, axis and bend."""
    k = n
    if n == points.shape[0]:
        k = 0
        for i in range(n):
            if points[i].gap > points[k].gap:
                k = i
        if n == 0 or points[k].gap <= gap:
            return n
    write_point(points[k], arm, normal, foot, gap, turns, radius)
    return max(n, k + 1)


@inlined
def write_point(point, arm, normal, foot, gap, turns, radius):
    write_to(point.arm, arm)
    write_to(point.normal, normal)
    point.foot[0], point.foot[1] = foot
    point.gap = gap
    point.turns = turns[0]
    write_to(point.lever, turns[1])
    write_to(point.axis, turns[2])
    point.bend, point.radius = turns[3], radius


@inlined
def turns_of_lines(along, bend, normal, piece):
    """How the normal of two lines turns (EDGE_POINT); along: that of the part, of any length; bend: its curvature.

    With unit vectors e along the part's and d along the plate's line, and a = (n x d) / ((n x d) . e), where they touch
    n' = -(w . (e x n) + bend (v . a)) a.
    """
    b = cross(normal, (piece[0], piece[1], 0.0))
    size = math.sqrt(dot(along, along))
    across = dot(b, along) / size
    if abs(across) < LEAST_ACROSS:
        across = LEAST_ACROSS if across >= 0.0 else -LEAST_ACROSS
    return LINES, plus(NONE, 1.0 / size, cross(along, normal)), plus(NONE, 1.0 / across, b), bend


@inlined
def row(r, k, a):
    return r[k, 0] * a[0] + r[k, 1] * a[1] + r[k, 2] * a[2]


@inlined
def turned_back(r, a):
    """A vector in body axes."""
    return (
        r[0, 0] * a[0] + r[1, 0] * a[1] + r[2, 0] * a[2],
        r[0, 1] * a[0] + r[1, 1] * a[1] + r[2, 1] * a[2],
        r[0, 2] * a[0] + r[1, 2] * a[1] + r[2, 2] * a[2],
    )


@inlined
def seen(a, piece):
    """A vector seen along a piece: its parts outwards from the plate, up, and along."""
    return a[0] * piece[1] - a[1] * piece[0], a[2], a[0] * piece[0] + a[1] * piece[1]


@inlined
def nearby(kind, reach):
    """No edge of a hull that is farther than this from a piece has a point on it [m]."""
    return 2.0 * max(reach, BESIDE) + kind.radius


@inlined
def centre_from(part, piece):
    """The centre of mass from the first vertex of a piece [m]."""
    return part.position[0] - piece[3][0], part.position[1] - piece[3][1], part.position[2]


@inlined
def place_on(piece, along):
    """The place on a piece at a way along it [m]."""
    along = min(max(along, 0.0), piece[2])
    return piece[3][0] + along * piece[0], piece[3][1] + along * piece[1]


@inlined
def in_space(across, up, piece):
    return across * piece[1], -across * piece[0], up


@inlined
def meets(begin, segment, radius, piece):
    """How a segment with a radius around it meets a piece: gap, infinite if not; share of its way; place; normal.

    begin, way: as seen along the piece [m].
    """
    size = math.sqrt(segment[0] * segment[0] + segment[1] * segment[1])
    length = math.sqrt(size * size + segment[2] * segment[2])
    gap, share, along, across, up = np.inf, 0.0, 0.0, 0.0, 1.0
    if size > PARALLEL * length:
        across, up = -segment[1] / size, segment[0] / size
        if up < 0.0:
            across, up = -across, -up
        if up >= UPRIGHT and across >= -INWARDS:
            gap = begin[0] * across + begin[1] * up - radius
            share = -(begin[0] * segment[0] + begin[1] * segment[1]) / (size * size)
            along, beyond = begin[2] + share * segment[2], max(gap, 0.0) + ON_EDGE
            if (
                abs(share - 0.5) * length > 0.5 * length + beyond
                or abs(along - 0.5 * piece[2]) > 0.5 * piece[2] + beyond
            ):
                gap = np.inf
    return gap, share, along, in_space(across, up, piece)


@inlined
def carries(gap, kind, centre, low, high):
    """Whether the part reaches along the normal to a feature with that gap, and no farther, and not past the edge."""
    return centre + low >= min(gap, 0.0) + kind.radius - FLAT * kind.reach and centre + high > 0.0


@inlined
def faces_up(face, cone):
    """Whether a vertex can touch a face with this outward normal."""
    return dot(face, cone[2]) <= -UPRIGHT and dot(face, cone[0]) >= -INWARDS and dot(face, cone[1]) >= -INWARDS
