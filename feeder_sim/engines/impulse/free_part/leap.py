"""When a point of a part can touch at the earliest: leaps that cannot miss a contact, and converge to it.

With gap g, rate u and a bound a on the acceleration with which point and surface come together, nothing touches before

    t = (u + sqrt(u^2 + 2 a g)) / a                                             (conservative advancement, Mirtich 1996)

Near a contact the present acceleration, its rate and a bound on the next derivative say more. From there on the surface
is looked at as it will be under the path of the point (path.py), and so on until one touches. Leaps aim at
half the width of the touch, `Exactness.touch`; so they end in it, whatever their length. What bounds do not know is
found after the leap (step.py).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.free_part.path import SIXTH, ahead
from feeder_sim.engines.impulse.scratch import ABOVE, AT_EDGE, ON_CIRCLE
from feeder_sim.engines.impulse.surface import move_surface
from feeder_sim.engines.impulse.vectors import dot
from feeder_sim.machine_code import inlined, uncounted

MAX_LEAPS = 100  # in which every point has its own
TINY = 1e-300
NEARLY = 0.2  # of half a touch
LONGEST, STRIDE = 8.0, 1.0  # [rad] of the surface's fastest motion: of a leap, and of one by a polynomial
POLISHED, LONGER = 5, 4.0  # leaps by a polynomial; how much longer is one after a whole stride
ALIKE = 1.0  # of the last leap: points that are due within that are looked at together
UNSEEN = 0.05  # tolerances by which a contact may be late since its time is not known better
SNAP_PER_TWIST = 8.0  # a fourth derivative of the path of a point, by the third and the spin, is less


class RemainderBounds(NamedTuple):
    """Bounds on what is not known of the motion of points.

    slack: acceleration by a slope that is crossed [m/s^2]; twist, snap_bound: third and fourth derivatives by turning
    [m/s^3, m/s^4]; curving: half the acceleration by the curvature of the surface [m/s^2].
    """

    slack: float
    twist: float
    snap_bound: float
    curving: float


@inlined
def remainder_bounds(part, kind, bounds, turning):
    v = part.velocity
    sideways = math.sqrt(v[0] * v[0] + v[1] * v[1]) + turning.speed
    slack, curving = 2.0 * bounds.slope * bounds.rate * sideways, 0.5 * bounds.curvature * sideways * sideways
    twist = twist_of(kind, turning)
    snap_bound = SNAP_PER_TWIST * twist * turning.speed / kind.reach if twist > 0.0 else 0.0
    return RemainderBounds(slack, twist, snap_bound, curving)


@inlined
def twist_of(kind, turning):
    """Bound on the third derivative of the path of any point by turning [m/s^3]."""
    return 3.0 * turning.acceleration * turning.speed / kind.reach if kind.reach > 0.0 else 0.0


@inlined
def leap(gap, rate, bound):
    """Time [s] before which a gap [m] of this rate [m/s] cannot close, if it accelerates by no more than the bound."""
    root = math.sqrt(rate * rate + 2.0 * bound * gap)
    return (rate + root) / bound if rate > 0.0 else 2.0 * gap / max(root - rate, TINY)


@inlined
def polynomial_leap(gap, motion, snap, stride, nearly):
    """As `leap`, of a gap whose motion is known: rate, closing acceleration, and the rate of that; snap: bound on more.

    gap + rate t - closing t^2/2 - change t^3/6 - snap t^4/24 is no more than the gap. Leaps under it converge to its
    first root; the first is no longer than a stride [s]. Also returns whether it is nearly there [m], and the gap too.
    """
    t, (rate, closing, change), half, sixth, last = 0.0, motion, 0.5 * snap, SIXTH * snap, SIXTH * 0.25 * snap
    third = SIXTH * change
    for _ in range(POLISHED):
        here = gap + t * (rate - t * (0.5 * closing + t * (third + t * last)))
        if here <= nearly:
            return t, last * t * t * t * t <= nearly
        goes = rate - t * (closing + t * (0.5 * change + t * sixth))
        end = t + stride
        most = closing + max(t * (change + half * t), end * (change + half * end))  # the second derivative is convex
        step = min(stride, leap(here, goes, max(most, TINY)))
        t, stride = t + step, (LONGER if step == stride else 2.0) * step
    return t, False


@inlined
def shortest_leap(part, bounds, turning):
    """A leap that covers no more than a quarter of a touch [s]: nothing is entered by it."""
    fastest = math.sqrt(dot(part.velocity, part.velocity)) + turning.speed + bounds.speed
    return leap(0.25 * bounds.exact.touch, -fastest, GRAVITY + turning.acceleration + bounds.speed * bounds.rate)


@uncounted
def first_contact(n, limit, plate, t, remainder, work):
    """Time after t [s] before which none of the first n points touches, nor comes below the crest; at most the limit.

    Points that forces see to are left out. The most urgent point is seen to first: it leaves little to find for others.
    """
    far, together, half = 0.0, 0.0, 0.5 * plate.bounds.exact.touch
    first, lowest = 0, math.inf
    for i in range(n):
        point = work.point[i]
        point.safe = math.inf
        if point.carried or point.gap == math.inf:
            continue
        if point.sort == ABOVE:
            if point.gap + limit * (point.rate - 0.5 * limit * point.most_own) < 0.0:
                limit = leap(point.gap, point.rate, point.most_own)
            continue
        point.safe = 0.0
        point.inside = max((2.0 if point.rate >= -plate.bounds.exact.approach else 1.5) * half - point.gap, 0.0)
        soon = plate.bounds.rate * (point.gap + point.inside) + point.rate
        if soon < lowest:
            first, lowest = i, soon
    for _ in range(MAX_LEAPS):
        if far > 0.0:
            move_surface(t + far, plate.surface, work.then)
        next_far, lands, begin = limit, False, first
        for k in range(begin, begin + n):
            i = k if k < n else k - n
            point = work.point[i]
            if point.safe <= far + together:
                flight, point.lands = _safe_leap(i, far, next_far - far, plate.bounds, remainder, work)
                point.safe = far + flight
            if point.safe < next_far:
                next_far, lands, first = point.safe, point.lands, i
        far, together = next_far, ALIKE * (next_far - far)
        if lands or far >= limit:
            return min(far, limit)
    return far


@inlined
def _safe_leap(i, far, enough, bounds, remainder, work):
    """Time [s] from `far` [s] on for which point i cannot touch, `enough` if it can be; and whether it touches then."""
    point = work.point[i]
    nearly, phase, per_fastest = 0.5 * NEARLY * bounds.exact.touch, bounds.rate * far, 1.0 / bounds.rate
    gap, rate, closing, change = _expected(i, far, bounds, remainder, work)
    if gap <= nearly:
        return 0.0, True
    # The plate pushes more, or less, where the point has come to after that phase of its motion.
    push = point.most_push + remainder.slack * (2.0 + 0.5 * (phase + LONGEST))
    snap = (push * bounds.rate + point.jerk_bound) * bounds.rate + remainder.snap_bound + point.snap_bound
    change += point.jerk_bound
    longest = LONGEST * per_fastest
    if enough < longest:
        bends = 0.5 * max(closing, 0.0) + enough * SIXTH * (max(change, 0.0) + 0.25 * enough * snap)
        if gap + enough * (rate - enough * bends) > nearly:
            return enough, False
    flight = min(leap(gap, rate, point.most_own + push), longest)
    if flight >= enough:
        return flight, False
    further, lands = polynomial_leap(gap, (rate, closing, change), snap, STRIDE * per_fastest, nearly)
    return (further, lands) if further > flight else (flight, False)


@inlined
def _expected(i, far, bounds, remainder, work):
    """Gap over half a touch, its rate, and as in `ahead`, a time [s] after the look; at the worst, but for UNSEEN."""
    point, half = work.point[i], 0.5 * bounds.exact.touch
    if far == 0.0:
        rate = max(point.rate, 0.0) if point.inside > 0.0 and point.rate >= -bounds.exact.approach else point.rate
        return point.gap + point.inside - half, rate, point.closing, point.closing_rate
    gap, rate, closing, change = ahead(point, work.under[i], far, work.now, work.then)
    if gap > 2.0 * half:
        point.inside = 0.0
    more, snap_bound = far * point.jerk_bound, far * far * (remainder.snap_bound + point.snap_bound)
    phase, bent, slip = bounds.rate * far, 0.0, 0.0
    if point.sort <= ON_CIRCLE:
        bent = remainder.curving
        if point.sort == ON_CIRCLE:  # slides
            bent = 2.0 * bent + bounds.curvature * dot(point.swing, point.swing)
    elif point.sort == AT_EDGE:  # the place on the edge moves along it
        slip, more = remainder.slack / bounds.rate, more + remainder.slack
    margin = far * (slip + far * (SIXTH * (more + 0.25 * snap_bound) + bent))
    rate -= slip + far * (0.5 * more + SIXTH * snap_bound + bent * (2.0 + phase))
    closing += more + 0.5 * snap_bound + bent * (2.0 + phase * (4.0 + phase))
    gap += point.inside - half
    return gap - max(margin - UNSEEN * bounds.exact.tolerance, 0.0), rate, closing, change + far * point.snap_bound
