"""Points at which two pieces touch: corners of one in the other, and where edges of one leave it.

Pieces touch where one, grown by a band, holds points of the other. Those of faces on each other are the corners of the
polygon in which both overlap; of crossing edges they are one point.
"""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.vectors import difference, dot, plus, vector, write_to
from feeder_sim.machine_code import inlined, uncounted

SAME = 1e-5  # [m]; points that close to each other are one


@uncounted
def touching_points(piece_a, piece_b, kinds, band, axis, room):
    """Write the points at which two pieces that have been placed touch; returns their number.

    band [m]: how far from each other they do; axis: that along which they are apart.
    """
    n, level = 0, _level(piece_a, piece_b, axis, room)
    for end in range(2):
        piece, other = (piece_a, piece_b) if end == 0 else (piece_b, piece_a)
        side, faces = (1.0 if end == 0 else -1.0), other.plane_to - other.plane_from
        for c in range(piece.corner_to - piece.corner_from):
            at = vector(room.corner[end, c])
            if side * (dot(axis, at) - level) >= -band and _inside(at, 1 - end, faces, band, room):
                n = _add(at, n, room)
    faces = piece_b.plane_to - piece_b.plane_from
    for e in range(piece_a.edge_from, piece_a.edge_to):
        p, q = vector(room.corner[0, kinds.edges[e, 0]]), vector(room.corner[0, kinds.edges[e, 1]])
        if max(dot(axis, p), dot(axis, q)) >= level - band:
            n = _cut(p, difference(q, p), faces, band, n, room)
    return n


@inlined
def _level(piece_a, piece_b, axis, room):
    """Where along the axis the pieces touch [m]: in the middle between both."""
    top, bottom = -math.inf, math.inf
    for c in range(piece_a.corner_to - piece_a.corner_from):
        top = max(top, dot(axis, room.corner[0, c]))
    for c in range(piece_b.corner_to - piece_b.corner_from):
        bottom = min(bottom, dot(axis, room.corner[1, c]))
    return 0.5 * (top + bottom)


@inlined
def _inside(at, end, faces, band, room):
    """Whether a point is in the piece at an end, grown by a band."""
    for f in range(faces):
        if dot(room.plane[end, f], at) + room.plane[end, f, 3] > band:
            return False
    return faces > 0


@inlined
def _cut(p, along, faces, band, n, room):
    """Add where an edge of the first piece leaves the second."""
    low, high = 0.0, 1.0
    for f in range(faces):
        plane = room.plane[1, f]
        above, rises = dot(plane, p) + plane[3] - band, dot(plane, along)
        if rises == 0.0:
            if above > 0.0:
                return n
        elif rises > 0.0:
            high = min(high, -above / rises)
        else:
            low = max(low, -above / rises)
    if low >= high or faces == 0:
        return n
    if (high - low) * math.sqrt(dot(along, along)) < SAME:
        return _add(plus(p, 0.5 * (low + high), along), n, room)
    if low > 0.0:
        n = _add(plus(p, low, along), n, room)
    if high < 1.0:
        n = _add(plus(p, high, along), n, room)
    return n


@inlined
def _add(at, n, room):
    """Add a point, unless it is there or there is no room for more."""
    for k in range(n):
        apart = difference(room.point[k], at)
        if dot(apart, apart) < SAME * SAME:
            return n
    if n == room.point.shape[0]:
        return n
    write_to(room.point[n], at)
    return n + 1
