"""How long a part may fly over the plate before it has to be looked at again.

leap        the longest flight during which no corner can touch: with gap g, approach speed -u and a bound a on the
relative acceleration, no contact before t = (u + sqrt(u^2 + 2 a g)) / a; never shorter than the step,
or than a fast part takes to enter the surface by micrometres
forecast    as the motion of the surface is known, many such leaps are made before the part is looked at again
"""

from __future__ import annotations

import math

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.circles import ahead, further_of_circles
from feeder_sim.engines.impulse.state import top_speed, turning_acceleration, turning_speed
from feeder_sim.engines.impulse.surface import move_surface
from feeder_sim.engines.impulse.window import SAG
from feeder_sim.machine_code import inlined

DEPTH = 1e-6  # [m]; how deep a part may enter a surface that is no longer driven
DEEP = 5e-6  # [m]; how deep a fast part may enter the surface
MAX_LEAPS = 30  # of a forecast
NEVER = 1e9  # [s]; the flight of a part that is not over the plate


@inlined
def longest_leap(part, kind, corners, work):
    """Longest flight during which no corner can touch, and none above the crest can come below it [s].

    The third value is a bound on the acceleration of the corners by themselves [m/s^2].
    """
    own = GRAVITY + turning_acceleration(part, kind)
    leap = to_crest = NEVER
    for i in range(corners.shape[0]):
        gap, rate, moves = max(work.point[i].gap, 0.0), work.point[i].rate, work.point[i].most_push
        if _touches_within(leap, gap, rate, own + moves):
            leap = _no_contact(gap, rate, own + moves)
        if moves == 0.0 and _touches_within(to_crest, gap, rate, own):
            to_crest = _no_contact(gap, rate, own)
    return leap, to_crest, own


@inlined
def _touches_within(time, gap, rate, a):
    """Whether a corner can touch within a time [s], if it may be accelerated towards the surface by a [m/s^2]."""
    return gap + time * (rate - 0.5 * a * time) <= 0.0


@inlined
def _no_contact(gap, rate, a):
    """Time [s] before which a corner cannot touch."""
    return (rate + math.sqrt(rate * rate + 2.0 * a * gap)) / a


@inlined
def forecast(part, kind, corners, surface, bounds, t, flight, tilt, work):
    """Leap again and again as the surface will move, until the first corner touches, or a corner reaches the crest.

    flight: the first leap, the shortest [s], acceleration of the corners by themselves [m/s^2], when one can be below
    the crest. Each corner stays over the place where it is now; what it moves to the side lowers it by the slope.
    tilt: of a part with circles.
    """
    leap, shortest, own, to_crest = flight
    v = part.velocity
    slip = bounds.slope * (math.sqrt(v[0] * v[0] + v[1] * v[1]) + turning_speed(part, kind))
    limit = min(to_crest, bounds.end - t)
    for _ in range(MAX_LEAPS):
        if leap >= limit:
            return limit
        move_surface(t + leap, surface, work.then[:2])
        further = NEVER
        for i in range(corners.shape[0]):
            moves = work.point[i].most_push
            if moves == 0.0:
                continue
            gap, rate = ahead(i, leap, slip, own, bounds, work)
            if gap <= 0.0:
                return leap
            if _touches_within(further, gap, rate, own + moves):
                further = _no_contact(gap, rate, own + moves)
        further = further_of_circles(tilt, kind, bounds, (leap, slip, own), further, work)
        if further < 0.0:
            return leap
        leap += max(further, shortest)
    return leap


@inlined
def shortest_flight(part, kind, bounds):
    """The step [s]; less for a part so fast that it would enter the surface deeply, more for one that hardly moves.

    On a plate at rest looks are so close that no part enters it by more than it sinks in while it lies there.
    """
    fastest = top_speed(part, kind)
    if bounds.speed == 0.0:
        return min(bounds.rest_step, 0.5 * SAG / fastest)
    return max(min(bounds.step, DEEP / fastest), min(bounds.rest_step, DEPTH / fastest))


@inlined
def flight_on_flat(corners, own, bounds, work):
    """How long a part with these corners can slide or rock on a flat plate at rest before one is in it by `SAG` [s].

    own: bound on the acceleration of the corners by themselves [m/s^2]; work holds their gaps and rates.
    """
    flight = bounds.rest_step
    for i in range(corners.shape[0]):
        gap, rate = max(work.point[i].gap, 0.0) + SAG, work.point[i].rate
        a = own + work.point[i].most_push
        if _touches_within(flight, gap, rate, a):
            flight = _no_contact(gap, rate, a)
    return flight
