"""Contacts solved where all else leads nowhere: in rounds, with friction limited by what pressed in the last one.

With limits that are given, the motion makes a convex function least: a round has a solution wherever bodies can part
at all, and its friction creates no energy. Rounds that no longer change obey Coulomb's law (Haslinger, Math. Meth.
Appl. Sci. 5 (1983) 422). A round is solved by augmented Lagrangians (Rockafellar, Math. Oper. Res. 1 (1976) 97): with
multipliers l, stiffnesses s, and the projection P onto what impulses may be,

    p = P(l - s (u - b)),   then l = p

where Newton's method with an exact line search finds the motion, wherever it begins.
"""

from __future__ import annotations

from feeder_sim.engines.impulse.contact_equations import (
    BEST,
    COUNT,
    FORCES,
    GAP,
    IMPULSES,
    LIMIT,
    OTHER,
    RATE,
    ROUND,
    SECOND,
    STEP,
    A,
    N,
    accuracy,
    along,
    copy,
    follow_path,
    forget,
    length,
    linearise,
    make_motion,
    newton_step,
    newtons,
    place_of,
    relative,
    sweep_in_batches,
)
from feeder_sim.machine_code import inlined, uncounted

ROUNDS, STEPS = 32, 100  # at most, of Newton's in all of them
FIRM = 1e6  # stiffness, in effective masses
MULTIPLIERS = 40
TRIALS, FLAT = 30, 1e-6  # of a line search, and slopes at which it ends, of that at its begin
CLOSE, EQUAL = 0.1, 1e-9  # of what may be left of a velocity, and of the largest impulse as a velocity: what is solved
NEARLY = 1e-4  # of the largest speed: by how much bodies that are jammed may still approach


@uncounted
def settle(room, n, size, closely):
    """Solve for impulses and motion, from impulses as they are; returns whether every contact obeys its laws.

    closely: what may be left of a velocity [m/s]. If not, friction has the limits of the last round that was solved.
    """
    enough, approach, speed, fastest = accuracy(room, n, closely)
    if newtons(room, n, size, enough) or follow_path(room, n, size, max(approach, fastest), closely, enough):
        return True
    settled, rounds = False, 0
    if _has_several_bodies(room, n):  # one alone that is not solved yet is jammed: its friction has no limit
        settled, rounds = _solve_in_rounds(room, n, size, CLOSE * enough, NEARLY * speed)
    if settled:
        return True
    if rounds == 0:
        return sweep_in_batches(room, n, size, enough, NEARLY * speed)
    copy(room, ROUND, IMPULSES, n)
    make_motion(room, n, size)
    return linearise(room, n, enough) < NEARLY * speed


@inlined
def _has_several_bodies(room, n):
    several = False
    for i in range(n):
        several = several or place_of(room, i, SECOND) > 0 or place_of(room, i, OTHER) > 6
    return several


@uncounted
def _solve_in_rounds(room, n, size, close, nearly):
    """Whether rounds lead to where Newton's steps solve all, and how many were solved; ROUND has the last one."""
    forget(room, n)
    for i in range(n):
        room.value[LIMIT, i, A] = room.value[LIMIT, i, FORCES] = 0.0
    remaining = STEPS
    for rounds in range(ROUNDS):
        remaining = _solve_round(room, n, size, close, nearly, remaining)
        if remaining == 0:
            return False, rounds
        copy(room, IMPULSES, ROUND, n)
        if newtons(room, n, size, close):
            return True, rounds
        copy(room, ROUND, IMPULSES, n)
        for i in range(n):
            for k in range(0, place_of(room, i, COUNT), FORCES):
                room.value[LIMIT, i, k] = room.limit[i, k // FORCES] * room.value[IMPULSES, i, N]
    return False, ROUNDS


@uncounted
def _solve_round(room, n, size, close, nearly, remaining):
    """Solve with limits that are given, closely or at least nearly [m/s]; returns what steps remain, 0 where not."""
    change = 0.0
    for _ in range(MULTIPLIERS):
        copy(room, IMPULSES, BEST, n)
        remaining = _find_motion(room, n, size, close, remaining)
        if remaining == 0:
            return 0
        change = 0.0
        for i in range(n):
            for k in range(place_of(room, i, COUNT)):
                by = abs(room.value[IMPULSES, i, k] - room.value[BEST, i, k])
                change = max(change, by * room.value[RATE, i, k] / FIRM)
        if change <= close:
            return remaining
    return remaining if change <= nearly else 0


@uncounted
def _find_motion(room, n, size, close, remaining):
    """Find the motion for multipliers that are given, until impulses fit it, as velocities [m/s]; what steps remain."""
    while remaining > 0:
        make_motion(room, n, size)
        error, largest = _linearise(room, n)
        if error <= max(close, EQUAL * largest):
            return remaining
        remaining -= 1
        if not newton_step(room, n, size):
            return 0
        share = _line_search(room, n)
        for i in range(n):
            for k in range(place_of(room, i, COUNT)):
                room.value[IMPULSES, i, k] += share * room.value[GAP, i, k]
    return 0


@uncounted
def _linearise(room, n):
    """How impulses change with the motion; returns by how much they miss it, and the largest, as velocities [m/s]."""
    error = largest = 0.0
    for i in range(n):
        p, law, gap, rate = room.value[IMPULSES, i], room.law[i], room.value[GAP, i], room.value[RATE, i]
        count, impulse = place_of(room, i, COUNT), _impulse(room, i, 0.0)
        for k in range(count):
            gap[k] = impulse[k] - p[k]
            error, largest = max(error, abs(gap[k]) * rate[k]), max(largest, abs(p[k]) * rate[k])
            for m in range(count):
                law[k, m] = 0.0
        law[N, N] = FIRM / rate[N] if impulse[N] > 0.0 else 0.0
        for k in range(0, count, FORCES):
            x, y, size = _free(room, i, k, 0.0)
            stiff, limit = FIRM / (rate[k] + rate[k + 1]), room.value[LIMIT, i, k]
            if size <= limit:  # sticks
                law[k, k] = law[k + 1, k + 1] = stiff
            else:
                turn, x, y = stiff * limit / size, x / size, y / size
                law[k, k], law[k, k + 1] = turn * y * y, -turn * x * y
                law[k + 1, k], law[k + 1, k + 1] = -turn * x * y, turn * x * x
    return error, largest


@inlined
def _impulse(room, i, share):
    """What the motion after a share of the step makes of the multipliers of contact i."""
    u = relative(room, i, N) + share * along(room, i, N, STEP) - room.target[i]
    normal = max(room.value[BEST, i, N] - FIRM / room.value[RATE, i, N] * u, 0.0)
    a, b = _within(room, i, A, share)
    c, d = _within(room, i, FORCES, share) if place_of(room, i, COUNT) > FORCES else (0.0, 0.0)
    return a, b, normal, c, d


@inlined
def _within(room, i, k, share):
    x, y, size = _free(room, i, k, share)
    part = room.value[LIMIT, i, k] / size if size > room.value[LIMIT, i, k] else 1.0
    return part * x, part * y


@inlined
def _free(room, i, k, share):
    """Impulses in directions k and k + 1, and their size, if they had no limit."""
    last, rate = room.value[BEST, i], room.value[RATE, i]
    stiff = FIRM / (rate[k] + rate[k + 1])
    x = last[k] - stiff * (relative(room, i, k) + share * along(room, i, k, STEP))
    y = last[k + 1] - stiff * (relative(room, i, k + 1) + share * along(room, i, k + 1, STEP))
    return x, y, length(x, y)


@uncounted
def _line_search(room, n):
    """The share of the step that makes the convex function least, 1 at most (Illinois algorithm)."""
    low, high, at_low, at_high, last = 0.0, 1.0, _slope(room, n, 0.0), _slope(room, n, 1.0), 0.0
    share, enough = 1.0, FLAT * abs(at_low)
    if at_high <= enough or at_low >= 0.0:
        return share
    for _ in range(TRIALS):
        share = (low * at_high - high * at_low) / (at_high - at_low)
        slope = _slope(room, n, share)
        if abs(slope) <= enough:
            break
        if slope > 0.0:
            at_low = 0.5 * at_low if last > 0.0 else at_low
            high, at_high = share, slope
        else:
            at_high = 0.5 * at_high if last < 0.0 else at_high
            low, at_low = share, slope
        last = slope
    return share


@uncounted
def _slope(room, n, share):
    """How the convex function changes along the step."""
    total = 0.0
    for i in range(n):
        impulse = _impulse(room, i, share)
        for k in range(place_of(room, i, COUNT)):
            missing = room.value[IMPULSES, i, k] + share * room.value[GAP, i, k] - impulse[k]
            total += along(room, i, k, STEP) * missing
    return total
