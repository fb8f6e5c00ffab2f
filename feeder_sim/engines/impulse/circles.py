"""A free cylinder over the plate: it touches with the circles around its two ends, exactly.

points      at every look each circle gets four points, a quarter of a turn apart, the first where the circle is lowest
            over the plane that is tangent to the surface; they meet the plate like corners
leaps       what the circles can do between these points until the next look. Over a plane, the lowest point of a circle
            of radius R is R |s| below its centre, where s is the part of the plane's normal in the plane of the
            circle. With s(t) = s + u t and a bound a on the acceleration of the circle's points, the point that
            is at e in that plane now, with gap g and rate v, and the whole circle with it, touch nothing while

                g + v t - a t^2/2 - R (|s + u t| + (s + u t).e) >= 0

            which is a concave function of t with one root
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.state import spin_of
from feeder_sim.engines.impulse.surface import HEIGHT, NOW, SPEED, move_surface_under, shapes_under, slope_at
from feeder_sim.engines.impulse.vectors import cross
from feeder_sim.machine_code import compiled, inlined, uncounted

QUARTERS = 4  # points on each circle: four that lie on a plane share a flat landing evenly
POINTS = 2 * QUARTERS
CLOSE = 1e-12  # [m]; a circle this close to touching is as good as that
NARROW = 1e-2  # of a leap: how closely the root of a circle's gap is bracketed
MAX_NARROWINGS = 12


@uncounted
def lowest_points(part, kind, surface, bounds, near, t, work):
    """Find the points of a cylinder at time t [s], in work.corners; nothing for a kind that has corners.

    near: height over the crest [m] below which the slope of the surface counts.

    Returns:
        whether the surface has been moved to time t; whether the part has circles, and the slopes under it [1].
    """
    radius, height, r = kind.circle_radius, kind.circle_height, part.attitude
    if radius == 0.0:
        return False, (False, 0.0, 0.0)
    moved, slope_x, slope_y = False, 0.0, 0.0
    x, y = r[2, 0], r[2, 1]  # how the surface's normal lies in the plane of the circles
    across = math.sqrt(x * x + y * y)
    bottom = part.position[2] - kind.radius - radius * across - height * abs(r[2, 2])
    if bounds.crest > 0.0 and bottom - bounds.crest <= near:
        move_surface_under(part, surface, t, work)
        moved = True
        u, v, w = 0.0, 0.0, (-height if r[2, 2] > 0.0 else height)  # the lowest point
        if across > 0.0:
            u, v = -radius * x / across, -radius * y / across
        x_low = part.position[0] + r[0, 0] * u + r[0, 1] * v + r[0, 2] * w
        y_low = part.position[1] + r[1, 0] * u + r[1, 1] * v + r[1, 2] * w
        shapes_under(x_low, y_low, part, surface, work.under[0])
        slope_x, slope_y = slope_at(work.under[0], work.now)
        x -= slope_x * r[0, 0] + slope_y * r[1, 0]
        y -= slope_x * r[0, 1] + slope_y * r[1, 1]
        across = math.sqrt(x * x + y * y)
    c, s = 1.0, 0.0  # of a circle that is level any point will do
    if across > 0.0:
        c, s = -x / across, -y / across
    for quarter in range(QUARTERS):
        for end in range(2):
            i = quarter + end * QUARTERS
            work.corners[i, 0], work.corners[i, 1] = radius * c, radius * s
            work.corners[i, 2] = height if end == 0 else -height
        c, s = -s, c
    return moved, (True, slope_x, slope_y)


@inlined
def is_round(kind):
    """Whether a kind has circles in place of corners."""
    return kind.circle_radius > 0.0


@inlined
def tilt_of(lowest, part, kind, work):
    """How circles lie over the surface and turn: (whether the part has any, s, u [1/s], e)."""
    round_part, slope_x, slope_y = lowest
    if not round_part:
        return False, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)
    r = part.attitude
    turning = cross((-slope_x, -slope_y, 1.0), spin_of(part, kind))
    return (
        True,
        (r[2, 0] - slope_x * r[0, 0] - slope_y * r[1, 0], r[2, 1] - slope_x * r[0, 1] - slope_y * r[1, 1]),
        (
            turning[0] * r[0, 0] + turning[1] * r[1, 0] + turning[2] * r[2, 0],
            turning[0] * r[0, 1] + turning[1] * r[1, 1] + turning[2] * r[2, 1],
        ),
        (work.corners[0, 0] / kind.circle_radius, work.corners[0, 1] / kind.circle_radius),
    )


@uncounted
def leap_of_circles(tilt, kind, bounds, own, leap, to_crest, work):
    """As `longest_leap`, with the circles of a part."""
    round_part, s, u, e = tilt
    if not round_part:
        return leap, to_crest
    for first in (0, QUARTERS):
        gap, rate = max(work.point[first].gap, 0.0), work.point[first].rate
        if gap == np.inf:  # off the plate
            continue
        if work.point[first].most_push == 0.0:
            to_crest = _time_apart(gap, rate, own, s, u, e, kind.circle_radius, 0.0, to_crest)
            leap = min(leap, to_crest)
        else:
            a = own + _most_moved(first, work)
            leap = _time_apart(gap, rate, a, s, u, e, kind.circle_radius, 2.0 * bounds.slope, leap)
    return leap, to_crest


@uncounted
def further_of_circles(tilt, kind, bounds, flight, further, work):
    """Time further [s] in a forecast, with the circles; negative where one may touch.

    flight: the leap so far, what moving to the side lowers a point by [m/s], own acceleration [m/s^2].
    """
    round_part, s, u, e = tilt
    if not round_part:
        return further
    leap, slip, own = flight
    s = s[0] + leap * u[0], s[1] + leap * u[1]
    for first in (0, QUARTERS):
        if work.point[first].most_push == 0.0 or work.point[first].gap == np.inf:
            continue
        gap, rate = ahead(first, leap, slip, own, bounds, work)
        a = own + _most_moved(first, work)
        further = _time_apart(gap, rate, a, s, u, e, kind.circle_radius, 2.0 * bounds.slope, further)
        if further <= 0.0:
            return -1.0
    return further


@inlined
def count_of(kind):
    """Number of corners, or of points on circles."""
    return POINTS if is_round(kind) else kind.corner_to - kind.corner_from


@inlined
def lay_out(kind, kinds, work):
    """Put the corners of a kind into work.corners, where those on circles already are; returns their number."""
    n = count_of(kind)
    if not is_round(kind):
        for i in range(n):
            for c in range(3):
                work.corners[i, c] = kinds.corners[kind.corner_from + i, c]
    return n


@inlined
def ahead(i, leap, slip, own, bounds, work):
    """Gap [m] and rate [m/s] of point i after a leap [s], at least; see `forecast`."""
    rate = work.point[i].rate + work.point[i].surface_velocity[2] - slip
    gap = max(work.point[i].gap, 0.0) + leap * (rate - 0.5 * own * leap)
    rate -= own * leap
    for s in range(work.now.shape[1]):
        if bounds.acceleration[s] != 0.0:
            gap -= work.under[i, s, HEIGHT] * (work.then[NOW, s] - work.now[NOW, s])
            rate -= work.under[i, s, HEIGHT] * work.then[SPEED, s]
    return gap, rate


@inlined
def _most_moved(first, work):
    """The largest acceleration of the surface under the points of a circle, as far as it is known [m/s^2]."""
    most = 0.0
    for i in range(first, first + QUARTERS):
        most = max(most, work.point[i].most_push)
    return most


@compiled
def _time_apart(gap, rate, a, s, u, e, radius, turns, longest):
    """Time [s], up to the longest, before which a circle cannot touch; 0 where it may do so now.

    turns: how far the slope under the circle may change meanwhile [1].
    """
    if gap <= 0.0:
        return 0.0
    high = (rate + math.sqrt(rate * rate + 2.0 * a * gap)) / a  # of the one point
    high = min(high, longest)
    if turns > 0.0:
        gap -= radius * _lowered(s, u, e, turns, high)
    low, at_low = 0.0, _gap_after(0.0, gap, rate, a, s, u, e, radius)
    if at_low <= 0.0:
        return 0.0
    at_high = _gap_after(high, gap, rate, a, s, u, e, radius)
    for _ in range(MAX_NARROWINGS):
        if at_high >= -CLOSE:
            return high
        if high - low <= NARROW * high:
            break
        # The chord of a concave function lies below it, and its middle, where it is negative, brings the end nearer.
        chord = low + at_low * (high - low) / (at_low - at_high)
        at_chord = _gap_after(chord, gap, rate, a, s, u, e, radius)
        if at_chord >= 0.0:
            low, at_low = chord, at_chord
        middle = 0.5 * (low + high)
        at_middle = _gap_after(middle, gap, rate, a, s, u, e, radius)
        if at_middle >= 0.0:
            low, at_low = middle, at_middle
        else:
            high, at_high = middle, at_middle
    return low


@inlined
def _lowered(s, u, e, turns, time):
    """By how much, over the radius, a circle may be lower within a time [s] because the slope changes by `turns` [1].

    With F(v) = |v| + v.e, it is F(v - d) - F(v) <= min(2 D, D |v/|v| + e| + D^2 / |v|), the second for |v| > 2 D. The
    angle between v = s + u t and -e, which is none at the look, only grows.
    """
    least = math.sqrt(s[0] * s[0] + s[1] * s[1]) - time * math.sqrt(u[0] * u[0] + u[1] * u[1])
    if least <= 2.0 * turns:
        return 2.0 * turns
    x, y = s[0] + time * u[0], s[1] + time * u[1]
    size = math.sqrt(x * x + y * y)
    x, y = x / size + e[0], y / size + e[1]
    return turns * min(2.0, math.sqrt(x * x + y * y) + turns / least)


@inlined
def _gap_after(t, gap, rate, a, s, u, e, radius):
    x, y = s[0] + t * u[0], s[1] + t * u[1]
    return gap + t * (rate - 0.5 * a * t) - radius * (math.sqrt(x * x + y * y) + x * e[0] + y * e[1])
