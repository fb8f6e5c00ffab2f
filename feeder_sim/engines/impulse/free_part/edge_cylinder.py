"""Points of a cylinder on a straight piece of the plate's edge, in closed form but for its circles (edge_points.py)."""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.free_part.edge_piece import (
    BESIDE,
    INWARDS,
    PARALLEL,
    UPRIGHT,
    carries,
    centre_from,
    faces_up,
    in_space,
    meets,
    place_on,
    row,
    seen,
    store,
    turned_back,
    turns_of_lines,
)
from feeder_sim.engines.impulse.vectors import dot, plus
from feeder_sim.engines.surface_arrays import ON_EDGE
from feeder_sim.machine_code import compiled

STEPS, SETTLED = 8, 1e-10  # Newton's method on a circle [rad]


@compiled
def cylinder_on_line(part, kind, piece, reach, points, n):
    r, radius, height, centre = part.attitude, kind.circle_radius, kind.circle_height, centre_from(part, piece)
    axis, at = (r[0, 2], r[1, 2], r[2, 2]), seen(centre, piece)
    axis_vector = seen(axis, piece)
    axis_vector = 2.0 * height * axis_vector[0], 2.0 * height * axis_vector[1], 2.0 * height * axis_vector[2]
    gap, share, along, normal = meets(plus(at, -0.5, axis_vector), axis_vector, radius + kind.radius, piece)
    if -min(BESIDE, radius) <= gap < reach:
        arm = plus((0.0, 0.0, 0.0), (2.0 * share - 1.0) * height, axis)
        foot = place_on(piece, along)
        turns, around = turns_of_lines(axis, 0.0, normal, piece), radius + kind.radius
        n = store(n, plus(arm, -around, normal), normal, foot, gap, turns, around, points)
    u, v = seen((r[0, 0], r[1, 0], r[2, 0]), piece), seen((r[0, 1], r[1, 1], r[2, 1]), piece)
    size = math.sqrt(u[0] * u[0] + v[0] * v[0])
    for end in (-height, height):
        middle = plus(at, 0.5 * end / height, axis_vector)
        if abs(middle[0]) >= radius * size or middle[1] - radius * math.sqrt(u[1] * u[1] + v[1] * v[1]) > 2.0 * reach:
            continue
        near = -middle[0] / (radius * size)
        far = math.sqrt(1.0 - near * near)
        for turn in (-far, far):
            c, s = (near * u[0] - turn * v[0]) / size, (near * v[0] + turn * u[0]) / size
            above = abs(middle[1] + radius * (c * u[1] + s * v[1]))
            along = middle[2] + radius * (c * u[2] + s * v[2])
            if abs(along - 0.5 * piece[2]) > 0.5 * piece[2] + 2.0 * above + ON_EDGE:
                continue
            gap, along, c, s, normal = _circle_meets(middle, u, v, radius, c, s, piece)
            gap -= kind.radius
            if turn * (s * u[0] - c * v[0]) < 0.0:  # that nearest to the other crossing
                continue
            if not (-BESIDE <= gap < reach) or abs(along - 0.5 * piece[2]) > 0.5 * piece[2] + max(gap, 0.0) + ON_EDGE:
                continue
            a = turned_back(r, normal)
            extent = radius * math.sqrt(a[0] * a[0] + a[1] * a[1]) + height * abs(a[2])
            if carries(gap, kind, dot(centre, normal), -extent, extent):
                body = radius * c, radius * s, end
                arm = plus((row(r, 0, body), row(r, 1, body), row(r, 2, body)), -kind.radius, normal)
                out, tangent = (c, s, 0.0), (-s, c, 0.0)
                bend = dot(out, a) / radius
                turns = turns_of_lines(
                    (row(r, 0, tangent), row(r, 1, tangent), row(r, 2, tangent)), bend, normal, piece
                )
                n = store(n, arm, normal, place_on(piece, along), gap, turns, kind.radius, points)
    return n


@compiled
def _circle_meets(middle, u, v, radius, c, s, piece):
    """Where a circle is nearest to the line of a piece, from its point (c, s) on.

    Returns:
        gap, infinite where it has no nearest point there; place on the piece; cosine and sine; normal.
    """
    step = np.inf
    for _ in range(STEPS):
        to = radius * (c * u[0] + s * v[0]), radius * (c * u[1] + s * v[1])
        rate = radius * (c * v[0] - s * u[0]), radius * (c * v[1] - s * u[1])
        x, z = middle[0] + to[0], middle[1] + to[1]
        bend = rate[0] * rate[0] + rate[1] * rate[1] - x * to[0] - z * to[1]
        if bend <= 0.0 or abs(step) < SETTLED:
            break
        step = -(x * rate[0] + z * rate[1]) / bend
        step = min(max(step, -0.5), 0.5)
        size = math.sqrt(1.0 + step * step)
        c, s = (c - step * s) / size, (s + step * c) / size
    size = math.sqrt(rate[0] * rate[0] + rate[1] * rate[1])
    if bend <= 0.0 or abs(step) >= 1e-6 or size <= PARALLEL * radius:
        return np.inf, 0.0, c, s, (0.0, 0.0, 1.0)
    across, up = -rate[1] / size, rate[0] / size
    if up < 0.0:
        across, up = -across, -up
    gap = x * across + z * up if up >= UPRIGHT and across >= -INWARDS else np.inf
    return gap, middle[2] + radius * (c * u[2] + s * v[2]), c, s, in_space(across, up, piece)


@compiled
def under_cylinder(kind, vertex, cone):
    x, y, z = vertex
    size = math.sqrt(x * x + y * y)
    end = 0.0, 0.0, (-1.0 if dot(cone[2], (0.0, 0.0, 1.0)) > 0.0 else 1.0)
    side = (x / size, y / size, 0.0) if size > 0.0 else end
    at_end, at_side = z * end[2] - kind.circle_height, size - kind.circle_radius
    end_up, side_up = faces_up(end, cone), faces_up(side, cone)
    if end_up and (at_end >= at_side or not side_up):
        return (at_end if at_side <= max(at_end, 0.0) + ON_EDGE else np.inf), end, 0.0
    if side_up:
        return (at_side if at_end <= max(at_side, 0.0) + ON_EDGE else np.inf), side, kind.circle_radius
    return np.inf, end, 0.0
