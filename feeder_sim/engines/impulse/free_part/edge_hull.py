"""Points of a hull, or of balls, on a straight piece of the plate's edge (edge_points.py)."""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.free_part.edge_piece import (
    BALL,
    BESIDE,
    NONE,
    UPRIGHT,
    carries,
    centre_from,
    faces_up,
    in_space,
    meets,
    nearby,
    place_on,
    seen,
    store,
    turned_back,
    turns_of_lines,
    write_point,
)
from feeder_sim.engines.impulse.state import arm_of
from feeder_sim.engines.impulse.vectors import difference, dot, plus
from feeder_sim.engines.surface_arrays import ON_EDGE
from feeder_sim.machine_code import compiled, inlined

APART = 0.9  # cosine between the directions in which two points of a ball lie around it, at most


@compiled
def hull_on_line(part, kind, kinds, piece, reach, points, n):
    corners = kinds.corners[kind.corner_from : kind.corner_to]
    for k in range(kind.edge_from, kind.edge_to):
        n = hull_edge_on_line(part, kind, corners, (kinds.edges[k, 0], kinds.edges[k, 1]), piece, reach, points, n)
    return n


@compiled
def hull_edge_on_line(part, kind, corners, ends, piece, reach, points, n):
    """Points of one edge of the hull; ends: its two corners."""
    centre, near = centre_from(part, piece), nearby(kind, reach)
    one, other, at = arm_of(part, corners, ends[0]), arm_of(part, corners, ends[1]), seen(centre, piece)
    a, b = plus(at, 1.0, seen(one, piece)), plus(at, 1.0, seen(other, piece))
    if min(a[1], b[1]) > near or max(a[1], b[1]) < -near or min(a[0], b[0]) > near or max(a[0], b[0]) < -near:
        return n
    gap, share, along, normal = meets(a, difference(b, a), kind.radius, piece)
    if -BESIDE <= gap < reach:
        low, high = _extent(part, corners, normal)
        if carries(gap, kind, dot(centre, normal), low, high):
            arm = plus(plus(one, share, difference(other, one)), -kind.radius, normal)
            turns = turns_of_lines(difference(other, one), 0.0, normal, piece)
            n = store(n, arm, normal, place_on(piece, along), gap, turns, kind.radius, points)
    return n


@inlined
def _extent(part, corners, normal):
    """How far the hull reaches from the centre of mass along a normal, least and most [m]."""
    a, low, high = turned_back(part.attitude, normal), np.inf, -np.inf
    for i in range(corners.shape[0]):
        along = corners[i, 0] * a[0] + corners[i, 1] * a[1] + corners[i, 2] * a[2]
        low, high = min(low, along), max(high, along)
    return low, high


@compiled
def under_plane(kinds, piece, vertex, cone):
    planes, gap, best = kinds.planes, -np.inf, -1
    for k in range(piece.plane_from, piece.plane_to):
        away = dot(planes[k], vertex) + planes[k, 3]
        if away > gap and faces_up(planes[k], cone):
            gap, best = away, k
    if best < 0:
        return np.inf, (0.0, 0.0, 1.0), 0.0
    face, beyond = (planes[best, 0], planes[best, 1], planes[best, 2]), max(gap, 0.0)
    nearest = plus(vertex, -beyond, face)  # on the face, or the vertex itself inside the part
    for k in range(piece.plane_from, piece.plane_to):
        if k != best and dot(planes[k], nearest) + planes[k, 3] > beyond + ON_EDGE:
            return np.inf, face, 0.0
    return gap, face, 0.0


@compiled
def balls_on_piece(part, kind, kinds, piece, back, reach, points, n):
    """Points of balls on a piece and on its first vertex.

    back: unit vector from that vertex to the one before, where the vertex is convex; else zero.
    """
    corners, centre = kinds.corners[kind.corner_from : kind.corner_to], centre_from(part, piece)
    for i in range(corners.shape[0]):
        arm = arm_of(part, corners, i)
        to = plus(centre, 1.0, arm)
        beside, up, along = seen(to, piece)
        separation, on_line = to, 0.0 <= along <= piece[2] and beside > ON_EDGE
        if on_line:
            separation = in_space(beside, up, piece)
        elif along >= 0.0 or to[0] * back[0] + to[1] * back[1] >= 0.0:
            continue
        away = math.sqrt(dot(separation, separation))
        gap = away - kind.radius
        if not -BESIDE <= gap < reach or up < UPRIGHT * away:
            continue
        normal = separation[0] / away, separation[1] / away, separation[2] / away
        turns = BALL, NONE, ((piece[0], piece[1], 0.0) if on_line else NONE), 0.0
        foot = place_on(piece, along)
        n = _store_apart(n, plus(arm, -kind.radius, normal), normal, foot, gap, kind.radius, turns, points)
    return n


@inlined
def _store_apart(n, arm, normal, foot, gap, radius, turns, points):
    """As `store`; of points that lie in nearly the same direction around a ball the nearest is kept."""
    for k in range(n):
        other = points[k]
        x, y, u, v = normal[0], normal[1], other.normal[0], other.normal[1]
        product = x * u + y * v
        if product <= 0.0 or product * product < APART * APART * (x * x + y * y) * (u * u + v * v):
            continue
        apart = plus(plus(arm, radius, normal), -1.0, plus(other.arm, radius, other.normal))  # of two balls
        if dot(apart, apart) < 1e-6 * radius * radius:
            if gap < other.gap:
                write_point(other, arm, normal, foot, gap, turns, radius)
            return n
    return store(n, arm, normal, foot, gap, turns, radius, points)
