"""When a point of a part can touch at the earliest: leaps that cannot miss a contact, and converge to it.

With gap g, rate u and a bound a on the acceleration with which point and surface come together, nothing touches before

    t = (u + sqrt(u^2 + 2 a g)) / a                                             (conservative advancement, Mirtich 1996)

Near a contact the surface's present acceleration h and a bound J on its change say more: the same with a = h + J t. And
while the surface falls away (h < 0) nothing touches before h has come back to zero. A leap is aimed at half the width
of the touch, `Exactness.touch`; so it ends in it, whatever its length, and a part never enters what it meets.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.lone.moving_surface import ahead, move_surface
from feeder_sim.engines.impulse.lone.state import (
    AT,
    FALL,
    GAP,
    GOES,
    JERK,
    KNOWN,
    MOVES,
    OWN,
    PUSH,
    RATE,
    SAFE,
    SWING,
    TOWARDS,
    WITH,
    fly_to,
)
from feeder_sim.engines.impulse.state import spin_of, top_speed, turning_acceleration, turning_speed
from feeder_sim.engines.impulse.vectors import add_to, cross, dot, plus, vector
from feeder_sim.machine_code import inlined

NEAR = 1.0  # [rad] of the surface's motion: for shorter leaps the bound on its jerk is worth using
MAX_LEAPS = 100  # of a forecast, in which every point has its own
NEVER = 1e9  # [s]; the flight of a part that is not over the plate
LEFT = 1e-9  # [m/s]; what round-off leaves of the speed of points that stay, or that have just been left
TINY = 1e-300
UP = (0.0, 0.0, 1.0)
POLISHED = 3  # steps of Newton's method
CURVED = 2.0  # times as much as one wave of that crest and that slope is a surface curved at most


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
        return 0.5 * touch, max(rate, 0.0)
    return max(gap, 0.25 * touch), rate


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
def still_leap(row, rate, slack, twist, touch):
    """As `leap_of`, on a surface that does not move: the point's acceleration is known where the row is."""
    gap, rate = room_of(row, rate, touch)
    found = leap(gap, rate, row[OWN] + slack)
    if row[KNOWN] == 1.0:
        found = max(found, near_leap(gap, rate, row[FALL] + slack, twist, 2.0 * found))
    elif row[KNOWN] != 0.0:
        swing = vector(row[SWING : SWING + 3])
        jerk = 3.0 * twist + 3.0 * math.sqrt(dot(swing, swing)) * row[OWN]
        found = max(found, near_leap(gap, rate, row[FALL] + slack, jerk, 2.0 * found))
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
def fall_on(part, kind, n, spare, slack, twist, surface, bounds, work):
    """Bring a part that is just about to touch to where it does; returns the time that takes [s], or 0.

    spare: the longest [s]. Nothing touches yet. For so brief a time the points and the surface move as polynomials of
    third degree say, to a share of the touch.
    """
    touch = bounds.exact.touch
    longest = min(bounds.brief, spare)
    if slack > 0.0:
        longest = min(longest, math.sqrt(0.1 * touch / slack))
    if twist * longest * longest * longest > 0.6 * touch:
        longest = np.cbrt(0.6 * touch / twist)
    found = longest
    for i in range(n):
        row = work.point[i]
        gap, rate = row[GAP] - 0.5 * touch, row[RATE]
        if row[KNOWN] == 0.0 or gap + found * (rate - 0.5 * found * (row[PUSH] + row[JERK] * found / 3.0)) > 0.0:
            continue
        if gap <= 0.5 * touch:
            return 0.0
        time = leap(gap, rate, max(row[PUSH], TINY))
        for _ in range(POLISHED):
            nears = rate - time * (row[PUSH] + 0.5 * row[JERK] * time)
            if nears >= 0.0:
                time = NEVER
                break
            time -= (gap + time * (rate - 0.5 * time * (row[PUSH] + row[JERK] * time / 3.0))) / nears
        found = min(found, time)
    if found == longest:
        return 0.0
    for i in range(n):
        row = work.point[i]
        rate = row[RATE] - 0.5 * (row[OWN] + slack + row[MOVES]) * found
        if row[KNOWN] == 0.0 and row[GAP] + found * rate <= touch:
            return 0.0
    spin, (q, dq, a, j) = spin_of(part, kind), work.now
    for s in range(q.shape[0]):
        q[s] += found * (dq[s] + 0.5 * found * (a[s] + found * j[s] / 3.0))
        dq[s] += found * (a[s] + 0.5 * found * j[s])
        a[s] += found * j[s]
    for i in range(n):
        row = work.point[i]
        normal, radius = vector(row[TOWARDS : TOWARDS + 3]), kind.radius
        if row[KNOWN] == 0.0:
            normal, radius = UP, 0.0
        if row[MOVES] == 0.0 and row[KNOWN] == 0.0:
            row[PUSH] = row[FALL] = row[OWN]  # at the worst
            row[JERK] = 0.0
        elif row[KNOWN] == 0.0:
            row[GAP] -= 0.5 * slack * found * found
        row[GAP] += found * (row[RATE] - 0.5 * found * (row[PUSH] + row[JERK] * found / 3.0))
        row[RATE] -= found * (row[PUSH] + 0.5 * row[JERK] * found)
        add_to(row[WITH : WITH + 3], found * (row[PUSH] - row[FALL] + 0.5 * row[JERK] * found), normal)
        add_to(row[AT : AT + 3], found, cross(spin, plus(row[AT : AT + 3], radius, normal)))
        row[PUSH] += found * row[JERK]
    fly_to(part, kind, part.clock + found)
    return found


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
                to_crest = min(to_crest, still_leap(row, rate, 0.0, twist, touch))
        else:
            if row[KNOWN] == 0.0:
                rate -= slack / bounds.fastest  # the slope there is not known
            if gap + found * (rate - 0.5 * (row[OWN] + slack + row[MOVES]) * found) <= 0.5 * touch:
                found = min(found, leap_of(row, rate, slack, twist, bounds, touch))
    return found, to_crest


@inlined
def forecast(part, kind, n, surface, bounds, t, until, flight, unknown, work):
    """Leap again and again as the surface will move, until the first point touches, or one reaches the crest.

    flight: the first leap, and when a point can be below the crest [s]; unknown: see `unsure`. The surface is taken as
    it will be under the way of a point, to first order where its slopes are known.
    """
    far, to_crest = flight
    slack, twist = unknown
    touch = bounds.exact.touch
    per_fastest = 1.0 / bounds.fastest
    curving = CURVED * slack * slack / (8.0 * bounds.fastest * bounds.fastest * max(bounds.crest, TINY))
    limit, brief = min(to_crest, until - t), 0.5 * bounds.brief
    for i in range(n):
        work.point[i, SAFE] = far
    for _ in range(MAX_LEAPS):
        if far >= limit:
            return limit
        move_surface(t + far, surface, work.then)
        phase = bounds.fastest * far
        further, bent = NEVER, curving * (2.0 + 4.0 * phase + phase * phase)
        for i in range(n):
            row = work.point[i]
            if row[MOVES] == 0.0 or row[GAP] == math.inf:
                continue
            if row[SAFE] > far:
                further = min(further, row[SAFE] - far)
                continue
            if row[KNOWN] != 0.0:
                gap, rate, h = ahead(i, far, 0.0, bent + twist * far, row[GOES], row[GOES + 1], work)
            else:
                gap, rate, h = ahead(i, far, slack * per_fastest, slack + twist * far, 0.0, 0.0, work)
            gap -= 0.5 * touch
            if gap <= 0.0 or gap < -rate * brief:
                return far
            found = leap(gap, rate, row[OWN] + slack + row[MOVES])
            if bounds.fastest * found < NEAR:
                jerk = row[MOVES] * bounds.fastest + twist
                found = max(found, near_leap(gap, rate, h + slack, jerk, 2.0 * found))
            row[SAFE] = far + found
            further = min(further, found)
        far += further
    return min(far, limit)
