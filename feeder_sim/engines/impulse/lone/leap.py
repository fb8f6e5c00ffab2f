"""When a point of a part can touch at the earliest: leaps that cannot miss a contact, and converge to it.

With gap g, rate u and a bound a on the acceleration with which point and surface come together, nothing touches before

    t = (u + sqrt(u^2 + 2 a g)) / a                                             (conservative advancement, Mirtich 1996)

Near a contact the surface's present acceleration h and a bound J on its change say more: the same with a = h + J t. And
while the surface falls away (h < 0) nothing touches before h has come back to zero. A leap is aimed at half the width
of the touch, `Exactness.touch`; so it ends in it, whatever its length, and a part never enters what it meets.
"""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.lone.moving_surface import ahead, move_surface
from feeder_sim.engines.impulse.lone.plate_points import CLOSE
from feeder_sim.engines.impulse.lone.state import GAP, JERK, MOVES, OWN, PUSH, RATE
from feeder_sim.engines.impulse.state import top_speed, turning_acceleration, turning_speed
from feeder_sim.machine_code import inlined
from feeder_sim.scene.scene import GRAVITY

NEAR = 1.0  # [rad] of the surface's motion: for shorter leaps the bound on its jerk is worth using
MAX_LEAPS = 40  # of a forecast
NEVER = 1e9  # [s]; the flight of a part that is not over the plate
LEFT = 1e-9  # [m/s]; what round-off leaves of the speed of points that stay, or that have just been left
TINY = 1e-300
SOON = 1e-2  # of a leap: a forecast that would go on by less ends


@inlined
def leap(gap, rate, bound):
    """Time [s] before which a gap [m] of this rate [m/s] cannot close, if it accelerates by no more than the bound."""
    root = math.sqrt(rate * rate + 2.0 * bound * gap)
    return (rate + root) / bound if rate > 0.0 else 2.0 * gap / max(root - rate, TINY)


@inlined
def near_leap(gap, rate, h, jerk, guess):
    """As `leap`, of a gap that accelerates by -h now, which changes by at most `jerk` per second.

    Until a time t the bound h + jerk t holds: what is shorter, t or the leap under that bound, is safe. The leap falls
    with t, so that it lies on the other side of the best t. guess: of that [s].
    """
    once = leap(gap, rate, max(h, 0.0) + jerk * guess + TINY)
    again = leap(gap, rate, max(h, 0.0) + jerk * once + TINY)
    return max(min(guess, once), min(once, again))


@inlined
def room_of(row, rate, touch):
    """The gap that a point may close in a leap [m], and its rate [m/s]: a point that has just been left is let go."""
    gap = row[GAP] - 0.5 * touch
    if gap <= 0.0 and rate >= -LEFT:
        return max(0.5 * row[GAP], 0.0), max(rate, 0.0)
    return max(gap, 0.0), rate


@inlined
def leap_of(row, rate, slack, twist, bounds, touch):
    """Time [s] before which a point with this rate [m/s] cannot touch; slack, twist: see `unsure`."""
    gap, rate = room_of(row, rate, touch)
    moves = row[MOVES]
    found = leap(gap, rate, row[OWN] + slack + moves)
    if moves == 0.0 or bounds.fastest * found > NEAR:
        return found
    h, jerk = row[PUSH] + slack, moves * bounds.fastest + twist
    found = max(found, near_leap(gap, rate, h, jerk, 2.0 * found))
    if rate >= 0.0 and h < 0.0:  # the surface falls away
        found = max(found, leap(-h, -row[JERK] - twist, jerk * bounds.fastest))
    return found


@inlined
def unsure(part, kind, bounds):
    """What is not known of the points' accelerations: by the slope that they cross [m/s^2], and by turning [m/s^3]."""
    turning = turning_speed(part, kind)
    v = part.velocity
    slack = 2.0 * bounds.slope * bounds.fastest * (math.sqrt(v[0] * v[0] + v[1] * v[1]) + turning)
    return slack, 3.0 * turning_acceleration(part, kind) * turning / kind.reach if kind.reach > 0.0 else 0.0


@inlined
def shortest_leap(part, kind, bounds):
    """A leap that covers no more than a quarter of a touch [s]: nothing is entered by it."""
    accelerated = GRAVITY + turning_acceleration(part, kind) + bounds.speed * bounds.fastest
    return leap(0.25 * bounds.exact.touch, -top_speed(part, kind) - bounds.speed, accelerated)


@inlined
def first_leaps(n, slack, twist, bounds, work):
    """Times [s] before which none of the first n points can touch, and none above the crest can come below it."""
    touch = bounds.exact.touch
    found = to_crest = NEVER
    for i in range(n):
        row = work.point[i]
        gap, rate = row[GAP], row[RATE]
        if gap == math.inf:
            continue
        if row[MOVES] == 0.0:
            if gap + to_crest * (rate - 0.5 * row[OWN] * to_crest) <= 0.5 * touch:
                gap, rate = room_of(row, rate, touch)
                to_crest = leap(gap, rate, row[OWN])
        else:
            if gap > CLOSE:
                rate -= slack / bounds.fastest  # the slope there is not known
            if gap + found * (rate - 0.5 * (row[OWN] + slack + row[MOVES]) * found) <= 0.5 * touch:
                found = min(found, leap_of(row, rate, slack, twist, bounds, touch))
    return found, to_crest


@inlined
def forecast(n, surface, bounds, t, until, flight, unknown, work):
    """Leap again and again as the surface will move, until the first point touches, or one reaches the crest.

    flight: the first leap, and when a point can be below the crest [s]; unknown: see `unsure`. Each
    point stays over the place where it is now; the slack takes in what it moves to the side.
    """
    far, to_crest = flight
    slack, twist = unknown
    touch = bounds.exact.touch
    slip = 0.0 if slack == 0.0 else slack / bounds.fastest
    limit = min(to_crest, until - t)
    for _ in range(MAX_LEAPS):
        if far >= limit:
            return limit
        move_surface(t + far, surface, work.then)
        further = NEVER
        for i in range(n):
            row = work.point[i]
            if row[MOVES] == 0.0 or row[GAP] == math.inf:
                continue
            gap, rate, h = ahead(i, far, slip, slack, twist, work)
            gap -= 0.5 * touch
            if gap <= 0.0:
                return far
            bound = row[OWN] + slack + row[MOVES]
            if gap + further * (rate - 0.5 * bound * further) <= 0.0:
                found = leap(gap, rate, bound)
                if bounds.fastest * found < NEAR:
                    jerk = row[MOVES] * bounds.fastest + twist
                    found = max(found, near_leap(gap, rate, h, jerk, 2.0 * found))
                further = min(further, found)
        far += further
        if further < SOON * far:
            return min(far, limit)
    return min(far, limit)
