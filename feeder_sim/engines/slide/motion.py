"""One degree of freedom: a part on a slide over a plate that moves up and down, with every event found exactly.

With the part's lowest point at height z, the plate's surface at p(t) (a sum of exponentials, so all its derivatives are
at hand) and the part's deceleration g, three things can end a phase of the motion; each is the first root of a smooth
function f whose second derivative is bounded by B:

    flight    gap = z - p = 0              B = g + max |p''|
    sticking  h = p'' + g = 0: lift-off    B = max |p''''|
    sticking  p' = 0: friction turns       B = max |p'''|

From f > 0 with slope f' the first root lies no earlier than (f' + sqrt(f'^2 + 2 B f)) / B. Leaping by that again and
again never misses a root, and converges to it quadratically. An impact reverses the relative velocity, w -> -e w, and
adds the size of a small normal number. While the plate pushes (h > 0) impacts chatter: the rest of the geometric series
lasts T = 2 w / (h (1 - e)). It is summed once neither its hops, w^2 / 2 h, nor the change of h, max |p'''| T^3 / 6, is
as much as the tolerance. The part then sticks until lift-off. Lift-off adds a number, too: a ride stands for impacts
without end, and rides must not all end in the same state bit by bit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impact_log import begin_contact, end_contact, is_full, log_impact
from feeder_sim.engines.noise import half_normal
from feeder_sim.machine_code import compiled, entry_point

TIME_TOLERANCE = 1e-14  # [s], or the spacing of floating-point numbers at that time
CREST_MARGIN = 1e-12  # [m]
TINY = 1e-300
NUDGE = 1e-6  # [rad] of the plate's motion: gets past a threshold that is only touched
NEAR = 0.3  # [rad] of the plate's motion: for shorter leaps the bound on its jerk is worth using
ROUND_OFF = 1e-15
JUMP = 1e-9  # of the largest velocity or height of the plate
SLOW = 1e-11  # [m/s]; an impact as slow as this is a touch
# Places in the state vector. SIGN: which way a riding part moves, 0 where it does not matter. FREE: time for which a
# part that has just lifted off cannot meet the plate [s].
T, Z, V, STUCK, SIGN, FREE = range(6)


class Plate(NamedTuple):
    """p(t) = sum of Re[coefficient exp(rate (t - start))], and bounds of it.

    switch: times at which terms begin or end (m,), the last one infinite. bound: of |p|, |p'|, ... |p''''| (5,).
    """

    start: NDArray[np.float64]
    stop: NDArray[np.float64]
    coefficient: NDArray[np.complex128]
    rate: NDArray[np.complex128]
    switch: NDArray[np.float64]
    bound: NDArray[np.float64]


class Law(NamedTuple):
    """Deceleration on the way up and down [m/s^2], restitution, noise of an impact [m/s], tolerance of chatter [m]."""

    up: float
    down: float
    restitution: float
    noise: float
    tolerance: float


@compiled
def _plate_motion(t, plate, p):
    """Write p and its first three derivatives into p (4,)."""
    p[:] = 0.0
    for k in range(plate.start.shape[0]):
        if plate.start[k] <= t < plate.stop[k]:
            age, rate = t - plate.start[k], plate.rate[k]
            fade = math.exp(rate.real * age) if rate.real != 0.0 else 1.0
            value = plate.coefficient[k] * complex(math.cos(rate.imag * age), math.sin(rate.imag * age)) * fade
            for derivative in range(4):
                p[derivative] += value.real
                value *= rate


@compiled
def _leap(f, slope, bound):
    """Earliest time [s] at which a function with value f >= 0, this slope and |f''| <= bound can reach zero."""
    root = math.sqrt(slope * slope + 2.0 * bound * max(f, 0.0))
    return (slope + root) / bound if slope > 0.0 else 2.0 * max(f, 0.0) / max(root - slope, TINY)


@compiled
def _near_leap(gap, rate, h, jerk):
    """Like `_leap` for a gap whose second derivative is -h now and changes by at most `jerk` per second.

    With slowly changing h this is far longer. The leap under the bound h + jerk tau falls with tau, so that repeating
    it from a tau beyond the root gives in turn leaps that are safe and leaps that are not.
    """
    beyond = math.sqrt(12.0 * max(rate, 0.0) / jerk) + (12.0 * max(gap, 0.0) / jerk) ** (1.0 / 3.0)
    for _ in range(3):
        beyond = _leap(gap, rate, max(h, 0.0) + jerk * beyond + TINY)
    return beyond


@compiled
def _tolerance(t):
    """What counts as no time at all [s]."""
    return max(TIME_TOLERANCE, 4.5e-16 * t)


@compiled
def _move(state, g, duration):
    state[Z] += (state[V] - 0.5 * g * duration) * duration
    state[V] -= g * duration
    state[T] += duration


@compiled
def _fly(state, seen, plate, law, limit, p):
    """Fly until the part meets the plate (returns True), or show where it is at `limit`.

    The state goes on by whole leaps, which `limit` has no part in; what it is at `limit` goes into `seen`.
    """
    while True:
        rising = state[V] > 0.0
        g = law.up if rising else law.down
        rest = limit - state[T]
        at_apex = rising and law.up != law.down and state[V] / g < rest
        if at_apex:  # the friction of the guide turns there
            rest = state[V] / g
        over_crest = state[Z] - plate.bound[0]
        if state[FREE] > 0.0:
            leap = state[FREE]
        elif over_crest > CREST_MARGIN:
            leap = _leap(over_crest, state[V], g)
        else:
            _plate_motion(state[T], plate, p)
            gap, rate, h = state[Z] - p[0], state[V] - p[1], p[2] + g
            leap = _leap(gap, rate, g + plate.bound[2])
            if plate.bound[3] * leap < NEAR * plate.bound[2]:
                leap = max(leap, _near_leap(gap, rate, h, plate.bound[3]))
            if rate >= 0.0 and h < 0.0:  # the plate falls away: the gap grows until h has come back to zero at least
                leap = max(leap, _leap(-h, -p[3], plate.bound[4]))
            if leap <= _tolerance(state[T]):
                return True
        if leap < rest:
            _move(state, g, leap)
        elif at_apex:
            _move(state, g, rest)
            state[V] = 0.0
        else:
            seen[:] = state
            _move(seen, g, rest)
            seen[T] = limit
            return False
        state[FREE] = 0.0


@compiled
def _strike(state, stream, plate, law, switch, log, p):
    """One impact; when the chatter that follows is short, and over before the switch, sum it and stick."""
    t = state[T]
    _plate_motion(t, plate, p)
    approach = max(p[1] - state[V], 0.0)
    departure = law.restitution * approach + _noise(stream, law)
    state[Z], state[V] = p[0], p[1] + departure
    log_impact(log, t, t, approach, state[V])
    h = p[2] + (law.up if p[1] > 0.0 else law.down)
    if h <= 0.0 and approach < SLOW:  # the plate falls away: nothing can meet within the time that gets past this
        _move(state, law.up if p[1] > 0.0 else law.down, _nudge(plate))
    if h <= 0.0 or (law.restitution == 1.0 and departure > 0.0):
        return
    chatter = 2.0 * departure / (h * (1.0 - law.restitution)) if departure > 0.0 else 0.0
    moved = max(0.5 * departure * departure / h, plate.bound[3] * chatter**3 / 6.0)
    summed = moved < law.tolerance and t + chatter < switch
    if summed:
        _plate_motion(t + chatter, plate, p)
        summed = p[2] + (law.up if p[1] > 0.0 else law.down) > 0.0
    if summed or _lost_in_round_off(departure, h, t, plate):
        state[T] = t + chatter if summed else t
        _plate_motion(state[T], plate, p)
        state[Z], state[V], state[STUCK], state[SIGN] = p[0], p[1], 1.0, 0.0
        begin_contact(log, state[T], 0.0)


@compiled
def _noise(stream, law):
    """What an impact adds to the speed of departure [m/s]."""
    if law.noise == 0.0:
        return 0.0
    scatter, stream[0] = half_normal(stream[0])
    return law.noise * scatter


@compiled
def _lost_in_round_off(departure, h, t, plate):
    """True for a hop no higher than what round-off in the plate's phase moves the plate by."""
    hop = departure * departure / h
    if plate.bound[3] > 0.0:
        hop = min(hop, departure * math.sqrt(6.0 * departure / plate.bound[3]))
    return hop < ROUND_OFF * (plate.bound[1] * t + plate.bound[0])


@compiled
def _nudge(plate):
    """A time [s] in which the plate hardly moves."""
    return NUDGE * math.sqrt(plate.bound[2] / plate.bound[4])


@compiled
def _until_turn(state, plate, p):
    """Earliest time [s] at which the riding part can turn round; turns the friction if it does so now."""
    if plate.bound[3] == 0.0:
        return np.inf
    leap = _leap(state[SIGN] * p[1], state[SIGN] * p[2], plate.bound[3])
    if leap > _tolerance(state[T]):
        return leap
    state[SIGN] = -state[SIGN]
    return max(_leap(state[SIGN] * p[1], state[SIGN] * p[2], plate.bound[3]), _nudge(plate))


@compiled
def _until_lift_off(state, plate, law, p):
    """Deceleration that holds for the riding part [m/s^2], and earliest possible times of lift-off and turn [s].

    Which way the part moves matters only where it could lift off on the way down.
    """
    pressing = p[2] + law.down
    to_lift = _leap(pressing, p[3], plate.bound[4]) if plate.bound[4] > 0.0 else np.inf
    if law.up == law.down or (pressing > 0.0 and to_lift > _tolerance(state[T])):
        state[SIGN] = 0.0
        return law.down, to_lift, np.inf
    if state[SIGN] == 0.0:
        state[SIGN] = 1.0 if p[1] > 0.0 else -1.0
    to_turn = _until_turn(state, plate, p)
    g = law.up if state[SIGN] > 0.0 else law.down
    return g, _leap(p[2] + g, p[3], plate.bound[4]), to_turn


@compiled
def _ride(state, seen, stream, plate, law, limit, log, p):
    """Stick to the plate until it falls away from under the part (returns True), or show where it is at `limit`.

    As in `_fly`, the state goes on by whole leaps.
    """
    while True:
        _plate_motion(state[T], plate, p)
        state[Z], state[V] = p[0], p[1]
        rest = limit - state[T]
        g, to_lift, to_turn = _until_lift_off(state, plate, law, p)
        h = p[2] + g
        if h <= 0.0 or to_lift <= _tolerance(state[T]):
            free = _leap(-h, -p[3], plate.bound[4])
            if free > 0.0:
                state[STUCK] = 0.0
                if state[SIGN] > 0.0:
                    free = min(free, p[1] / g)  # up to the apex, where friction turns
                if state[SIGN] < 0.0:
                    state[V] = min(state[V], 0.0)  # at the crest, round-off must not send it up again
                else:
                    state[V] += _noise(stream, law)
                end_contact(log, state[T], state[V])
                state[FREE] = free
                return True
            to_lift = _nudge(plate)  # the threshold is only touched
        leap = min(to_lift, to_turn)
        if leap >= rest:
            seen[:] = state
            _plate_motion(limit - _tolerance(limit), plate, p)  # before what may switch there
            seen[T], seen[Z], seen[V] = limit, p[0], p[1]
            return False
        state[T] += leap


@compiled
def _let_go(state, plate, log, p):
    """Let a riding part go where a switch makes the plate jump; it flies, or the plate hits it."""
    _plate_motion(state[T], plate, p)
    if abs(p[1] - state[V]) > JUMP * plate.bound[1] or abs(p[0] - state[Z]) > JUMP * plate.bound[0]:
        end_contact(log, state[T], state[V])
        state[Z], state[STUCK] = max(state[Z], p[0]), 0.0


@entry_point
def advance(state, stream, plate, law, log, interval, first_frame, out):
    """Advance frame by frame, writing (z, v) into a row of out (n, 2); returns the rows done, fewer with a full log."""
    p, seen = np.empty(4), np.empty(state.shape[0])
    for row in range(out.shape[0]):
        end = (first_frame + row + 1) * interval
        seen[:] = state
        while state[T] < end:
            if is_full(log):
                return row
            switch = plate.switch[np.searchsorted(plate.switch, state[T], side="right")]
            limit = min(end, switch)
            if state[STUCK] > 0.0:
                event = _ride(state, seen, stream, plate, law, limit, log, p)
                if not event and limit == switch:
                    state[:] = seen
                    _let_go(state, plate, log, p)
            else:
                event = _fly(state, seen, plate, law, limit, p)
                if event:
                    _strike(state, stream, plate, law, switch, log, p)
                elif limit == switch:
                    state[:] = seen
            if not event and limit == end:
                break
            seen[:] = state
        if seen[T] > end and seen[STUCK] > 0.0:  # a chatter that is summed beyond the frame: on the plate meanwhile
            _plate_motion(end, plate, p)
            seen[Z], seen[V] = p[0], p[1]
        out[row, 0], out[row, 1] = seen[Z], seen[V]
    return out.shape[0]
