"""The equations of contacts that act on each other, and how they are solved; contact_problem.py says which they are.

With velocities u, impulses p and a target b, any r > 0, and P the projection onto a disc around 0 (Alart and Curnier,
CMAME 92 (1991) 353),

    p.n = max(0, p.n - r (u.n - b)),   p_t = P(p_t - r u_t), radius mu p.n,   u = u_0 + W p

and moments against rolling like p_t. By the last step's impulses each contact is taken for open, sticking or slipping
(semismooth Newton method). Where faces meet W is singular: impulses are not unique, and motions only without friction.
So the unknown of a step is the change of motion, six numbers for each body, and impulses follow it by a compliance
about what they were, which leaves solutions as they are (proximal points; Rockafellar, SIAM J. Control 14 (1976) 877).
From no impulses that leads to nearly the least ones, so that what is symmetric stays so.

Where many points stick or slip by a hair these steps lead nowhere. Then the laws are blurred by a speed s,

    p.n (u.n - b) = m s^2,   p_t sqrt(u_t^2 + s^2) = -mu p.n u_t          (m: effective mass)

whose solution is smooth (Chen and Harker, SIAM J. Matrix Anal. 14 (1993) 1168), and the path of the solutions is
followed from a large blur to none. A step linearises p_t and u_t alike (Chan, Golub and Mulet, SIAM J. Sci. Comput. 20
(1999) 1964). Between a heavy body and a light one that leads nowhere either; limited_friction.py goes on from there.
Sweeps of projected Gauss-Seidel (Jean, CMAME 177 (1999) 235) go first where a velocity may be off by a given speed,
from impulses of the last problem or none, and last where bodies are jammed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.machine_code import inlined, uncounted

A, B, N = range(3)  # directions at a contact: two tangents and the normal; then the tangents again, of spin
DIRECTIONS, FORCES = 5, 3
SECOND, OTHER, WIDTH, COUNT = range(4)  # of Room.place
IMPULSES, BEFORE, KNOWN, RATE, ACROSS, GAP, BEST, LIMIT, ROUND, EARLIER = range(10)  # of Room.value
SLIDES, ROLLS = range(2)  # of Room.limit
START, NOW, STEP = range(3)  # of Room.motion

ENOUGH = 1e-12  # of the largest approach: how closely contacts are solved
FLOOR = 4e-15  # of the largest speed, which is round-off
LEAST = 1e-11  # [m/s]; what does not count
# What follows was chosen by trial on thousands of random heaps, stacks and rides.
STIFF, STIFFEST = 1e8, 1e10  # largest changes of an impulse, in effective masses, with the velocity
NEWTONS, STALE_STEPS = 12, 3  # steps by the laws themselves; those that may lead nowhere, one after the other
STEPS = 100  # along the path
SHARPER, SHORTEST = 0.5, 0.98  # its factors: at first, and at last where it cannot be followed
SHARP, TRIAL = 1e-2, 0.3  # of the blur at first, or of what is near enough: from there on the laws themselves are tried
AGAIN = 0.2  # of the blur at which they were tried last
LEAST_BLUR = 0.01  # of the error that is small enough
CENTRED, LOST = 0.5, 1e3  # blurs by which blurred laws may be off, and by which a step has led away
SWEEPS, BATCHES = 16, 7  # at first, doubled each time; so often
WARM = 100  # sweeps from impulses that may be near the solution, in less time than Newton's steps from none take
NEAR, NEARER = 0.2, 0.04  # of what is near enough: changes of velocities at which sweeps end, at first and at last
SURE = 1e-4  # of what is near enough: errors of sweeps that need no step of Newton's
# Changes of a sweep over those of the one before: of sweeps that creep, and of slow ones; how steadily those shrink;
CREEPS, SLOW, STEADY, SETTLES = 0.985, 0.5, 0.2, 3  # and how many sweeps go before that is asked
FEW = 24  # sweeps that bring a small impact to its solution, in less time than Newton's method takes
LARGEST = 1 << 20


class Room(NamedTuple):
    """Equations and room to solve them. All motion is one vector: (velocity, spin) of each body, then of the modes.

    rows: what it is in each direction at a contact; push: what an impulse in that direction does to it; both (n,
    DIRECTIONS, width), of the second body and then of the first, or of the modes. place (n, 4): where in the motion
    these begin, the width of the latter, the number of directions. value (10, n, DIRECTIONS): IMPULSES; relative
    velocity BEFORE; KNOWN: that of the world, negative; RATE: effective inverse mass; ACROSS: its largest, of both
    tangents (A) and of both spins (FORCES); GAP and BEST: impulses on the way; LIMIT, ROUND: of limited_friction.py;
    EARLIER: of poisson.py. limit (n, 2): tangential impulse and moment, as shares of the normal impulse. target (n,)
    [m/s]. law (n, DIRECTIONS, DIRECTIONS): by how much impulses fall when velocities rise. motion: (3, all); matrix:
    (all, all).
    """

    rows: NDArray[np.float64]
    push: NDArray[np.float64]
    place: NDArray[np.int64]
    value: NDArray[np.float64]
    limit: NDArray[np.float64]
    target: NDArray[np.float64]
    law: NDArray[np.float64]
    bent: NDArray[np.float64]
    motion: NDArray[np.float64]
    matrix: NDArray[np.float64]


@inlined
def relative(room, i, k):
    """Relative velocity [m/s], or spin [rad/s], in direction k at contact i."""
    return along(room, i, k, NOW) + room.value[KNOWN, i, k]


@inlined
def place_of(room, i, which):
    """A number of contact i; told to the compiler to be an index, it makes loops twice as fast."""
    return min(max(room.place[i, which], 0), LARGEST)


@inlined
def coupling(room, i, k, m):
    total = 0.0
    for x in range(6 + place_of(room, i, WIDTH)):
        total += room.rows[i, k, x] * room.push[i, m, x]
    return total


@inlined
def along(room, i, k, which):
    """What a motion is in direction k at contact i."""
    second, other = place_of(room, i, SECOND), place_of(room, i, OTHER)
    total = 0.0
    for x in range(6):
        total += room.rows[i, k, x] * room.motion[which, second + x]
    for x in range(place_of(room, i, WIDTH)):
        total += room.rows[i, k, 6 + x] * room.motion[which, other + x]
    return total


@inlined
def push_along(room, i, k, p, which):
    """Change a motion by an impulse p in direction k at contact i."""
    second, other = place_of(room, i, SECOND), place_of(room, i, OTHER)
    for x in range(6):
        room.motion[which, second + x] += p * room.push[i, k, x]
    for x in range(place_of(room, i, WIDTH)):
        room.motion[which, other + x] += p * room.push[i, k, 6 + x]


@uncounted
def begin(room, n, size):
    """No impulses yet: the motion before them, relative velocities and effective masses."""
    forget(room, n)
    make_motion(room, n, size)
    for i in range(n):
        for k in range(place_of(room, i, COUNT)):
            room.value[BEFORE, i, k] = relative(room, i, k)
            room.value[RATE, i, k] = coupling(room, i, k, k)
        for k in range(0, place_of(room, i, COUNT), FORCES):
            s, t = room.value[RATE, i, k], room.value[RATE, i, k + 1]
            room.value[ACROSS, i, k] = 0.5 * (s + t) + length(0.5 * (s - t), coupling(room, i, k, k + 1))


@inlined
def forget(room, n):
    for i in range(n):
        for k in range(place_of(room, i, COUNT)):
            room.value[IMPULSES, i, k] = 0.0


@uncounted
def make_motion(room, n, size):
    """The motion NOW, which all impulses make of that at the START."""
    for x in range(size):
        room.motion[NOW, x] = room.motion[START, x]
    for i in range(n):
        for k in range(place_of(room, i, COUNT)):
            if room.value[IMPULSES, i, k] != 0.0:
                push_along(room, i, k, room.value[IMPULSES, i, k], NOW)


@uncounted
def accuracy(room, n, closely):
    """How closely contacts are solved, their largest approach, speed in any frame, and relative velocity [m/s]."""
    approach = speed = fastest = 0.0
    for i in range(n):
        approach = max(approach, room.target[i] - room.value[BEFORE, i, N])
        for k in range(FORCES):
            known, before = abs(room.value[KNOWN, i, k]), abs(room.value[BEFORE, i, k])
            speed, fastest = max(speed, known + before), max(fastest, before)
    return max(ENOUGH * approach, FLOOR * speed, LEAST, closely), approach, speed, fastest


@uncounted
def sweeps_settle(room, n, size, closely):
    """Sweep from impulses as they are; returns whether every contact obeys its laws, else there are no impulses.

    closely: what may be left of a velocity [m/s]. Where sweeps have found what is open, sticks and slips, a step of
    Newton's leads far closer, and to what is symmetric where the problem is; where they have not, they go on.
    """
    make_motion(room, n, size)
    for near in (NEAR, NEARER):
        if not _sweep_until(room, n, size, near * closely, WARM):
            break
        error = linearise(room, n, closely) / closely
        if error <= SURE or (error <= 1.0 and (_step_closer(room, n, size, closely, error) or near == NEARER)):
            return True
    forget(room, n)
    return False


@inlined
def _step_closer(room, n, size, closely, error):
    """Take Newton's step from an error [closely]; False, and nothing has changed, where that does not lead closer."""
    copy(room, IMPULSES, BEST, n)
    led = _newton(room, n, size)
    make_motion(room, n, size)
    if led and linearise(room, n, closely) < error * closely:
        return True
    go_back(room, n, size)
    return False


@inlined
def go_back(room, n, size):
    """To the impulses and motion of BEST."""
    copy(room, BEST, IMPULSES, n)
    make_motion(room, n, size)


@uncounted
def _sweep_until(room, n, size, small, most):
    """Sweep until that changes velocities by a small speed [m/s] at most; returns whether it comes to that in time.

    What is left of sweeps whose changes shrink steadily is taken at once (Aitken, Proc. Roy. Soc. Edinburgh 46 (1926)
    289). Where more contacts press than can reach their targets together, sweeps shift load from one to the next, each
    as much as the one before; that too, until one has no load left.
    """
    last, ratio, sweeps = math.inf, 0.0, 0
    for _ in range(most):
        copy(room, IMPULSES, BEST, n)
        change = _sweep(room, n)
        if change <= small:
            return True
        sweeps += 1
        before, ratio, last = ratio, change / last, change
        creeps, steady = ratio > CREEPS, ratio > SLOW and abs(ratio - before) < STEADY * (1.0 - ratio)
        times = math.inf if creeps else ratio / (1.0 - ratio)
        if sweeps >= SETTLES and (creeps or steady) and _repeat_change(room, n, size, times):
            last, sweeps = math.inf, 0
    return False


@inlined
def _repeat_change(room, n, size, times):
    """Repeat the change since BEST so often, but no more than until a contact has no load left; False if for ever."""
    for i in range(n):
        change = room.value[IMPULSES, i, N] - room.value[BEST, i, N]
        if change < 0.0:
            times = min(times, -room.value[IMPULSES, i, N] / change)
    if times == math.inf:
        return False
    for i in range(n):
        p, count = room.value[IMPULSES, i], place_of(room, i, COUNT)
        for k in range(count):
            p[k] += times * (p[k] - room.value[BEST, i, k])
        _keep_in_cones(room, i, count)
    make_motion(room, n, size)
    return True


@uncounted
def come_near(room, n, size, closely):
    """Sweep until that changes velocities by no more than `closely` [m/s], but a few times at most.

    It begins with what stops a flat landing, which is a mere shift, shared out: what is symmetric stays so.
    """
    for i in range(n):
        shifts = 0.0  # inverse mass, without what turns
        for x in range(3):
            shifts += room.rows[i, N, x] * room.push[i, N, x]
        room.value[IMPULSES, i, N] = max(room.target[i] - room.value[BEFORE, i, N], 0.0) / (n * shifts)
    make_motion(room, n, size)
    _sweep_until(room, n, size, closely, FEW)


@uncounted
def newtons(room, n, size, enough):
    """Steps by the laws themselves, as long as they lead closer; returns whether the error is small enough."""
    best, stale = math.inf, 0
    for _ in range(NEWTONS):
        make_motion(room, n, size)
        error = linearise(room, n, enough)
        if error <= enough:
            return True
        stale = 0 if error < best else stale + 1
        best = min(best, error)
        if stale > STALE_STEPS or not _newton(room, n, size):
            return False
    return False


@uncounted
def follow_path(room, n, size, blur, closely, enough):
    """Follow the solution of blurred laws from a large blur [m/s] to none; returns whether it leads to the end.

    closely: of `settle`; near it, or near none, the laws themselves are tried.
    """
    trial_blur = TRIAL * closely if closely > 0.0 else SHARP * blur
    forget(room, n)
    for i in range(n):
        room.value[IMPULSES, i, N] = blur / (n * room.value[RATE, i, N])
    sharp, sharper, followed, stale = blur, SHARPER, False, 0
    for _ in range(STEPS):
        make_motion(room, n, size)
        error = _linearise_blurred(room, n, blur)
        if error <= CENTRED * blur:
            copy(room, IMPULSES, BEST, n)
            if blur <= trial_blur:
                if newtons(room, n, size, enough):
                    return True
                if blur <= LEAST_BLUR * enough:
                    return False
                go_back(room, n, size)
                trial_blur = AGAIN * blur
            sharper = max(sharper * sharper, 0.1 * SHARPER) if stale < 2 else sharper
            sharp, blur, followed, stale = blur, max(sharper * blur, LEAST_BLUR * enough), True, 0
            _linearise_blurred(room, n, blur)
        else:
            stale += 1
            if followed and (stale > STALE_STEPS or error > LOST * blur):
                sharper, stale = math.sqrt(sharper), 0
                if sharper > SHORTEST:
                    return False
                blur = sharper * sharp
                go_back(room, n, size)
                _linearise_blurred(room, n, blur)
        if not _newton(room, n, size):
            return False
    return False


@uncounted
def sweep_in_batches(room, n, size, enough, nearly):
    """Sweep, and try Newton's method from where sweeps lead; returns whether the error is small enough, or nearly."""
    forget(room, n)
    make_motion(room, n, size)
    sweeps = SWEEPS
    for _ in range(BATCHES):
        for _ in range(sweeps):
            _sweep(room, n)
        copy(room, IMPULSES, BEST, n)
        if newtons(room, n, size, enough):
            return True
        go_back(room, n, size)
        sweeps *= 2
    return linearise(room, n, enough) < nearly


@uncounted
def copy(room, source, target, n):
    for i in range(n):
        for k in range(DIRECTIONS):
            room.value[target, i, k] = room.value[source, i, k]


@uncounted
def linearise(room, n, enough):
    """How impulses change, GAP - law (change of velocity), by the laws of contact; returns their error now [m/s]."""
    worst = 0.0
    for i in range(n):
        p, law, gap, rate = room.value[IMPULSES, i], room.law[i], room.value[GAP, i], room.value[RATE, i]
        count = place_of(room, i, COUNT)
        for k in range(count):
            for m in range(count):
                law[k, m] = 0.0
        parts = relative(room, i, N) - room.target[i]
        pressed = p[N] - parts / rate[N]
        worst = max(worst, abs(p[N] - max(pressed, 0.0)) * rate[N])
        if pressed < -enough / rate[N]:  # open
            for k in range(count):
                gap[k] = -p[k]
            worst = max(worst, length(p[A], p[B]) * (rate[A] + rate[B]))
            continue
        law[N, N] = STIFF / rate[N]
        gap[N] = -law[N, N] * parts
        error = _linearise_disc(room, i, A, room.limit[i, SLIDES], max(pressed, 0.0))
        worst = max(worst, error * (rate[A] + rate[B]))
        if count > FORCES:
            error = _linearise_disc(room, i, FORCES, room.limit[i, ROLLS], max(pressed, 0.0))
            worst = max(worst, error * math.sqrt((rate[FORCES] + rate[FORCES + 1]) * rate[N]))
    return worst


@inlined
def _linearise_disc(room, i, k, share, pressed):
    """The same for directions k and k + 1 of contact i, where impulses are at most a share of the normal one."""
    p, law, gap = room.value[IMPULSES, i], room.law[i], room.value[GAP, i]
    r = 1.0 / (room.value[RATE, i, k] + room.value[RATE, i, k + 1])
    x, y = relative(room, i, k), relative(room, i, k + 1)
    s, t = p[k] - r * x, p[k + 1] - r * y
    size, limit = math.sqrt(s * s + t * t), share * pressed
    stiff = STIFF * r
    if size <= limit:  # sticks
        law[k, k] = law[k + 1, k + 1] = stiff
        gap[k], gap[k + 1] = -stiff * x, -stiff * y
        return r * math.sqrt(x * x + y * y)
    error = length(p[k] - limit * s / size, p[k + 1] - limit * t / size)
    # Slips: p_t = share p.n (s, t), and a change of velocity across turns that direction.
    s, t, edge = p[k] - stiff * x, p[k + 1] - stiff * y, share * p[N]
    size = math.sqrt(s * s + t * t)
    turn, s, t = (edge * stiff / size, s / size, t / size) if size > 0.0 else (0.0, 0.0, 0.0)
    law[k, N], law[k + 1, N] = share * s * law[N, N], share * t * law[N, N]
    law[k, k], law[k, k + 1] = turn * t * t, -turn * s * t
    law[k + 1, k], law[k + 1, k + 1] = -turn * s * t, turn * s * s
    edge += share * gap[N]
    gap[k], gap[k + 1] = edge * s - p[k], edge * t - p[k + 1]
    return error


@uncounted
def _linearise_blurred(room, n, blur):
    """As `_linearise`, by the laws as a blur [m/s] makes them smooth."""
    worst = 0.0
    for i in range(n):
        p, law, gap, rate = room.value[IMPULSES, i], room.law[i], room.value[GAP, i], room.value[RATE, i]
        count = place_of(room, i, COUNT)
        for k in range(count):
            for m in range(count):
                law[k, m] = 0.0
        # q w = blur^2 as q + w = sqrt((q - w)^2 + 4 blur^2), written such that nothing cancels.
        q, w, square = rate[N] * p[N], relative(room, i, N) - room.target[i], 4.0 * blur * blur
        root = math.sqrt((q - w) * (q - w) + square)
        if q > w:
            of_q, of_w = square / (root * (root + q - w)), 1.0 + (q - w) / root
        else:
            of_q, of_w = 1.0 - (q - w) / root, square / (root * (root + w - q))
        error = (4.0 * q * w - square) / (q + w + root) if q + w > 0.0 else q + w - root
        law[N, N] = min(of_w / of_q, STIFFEST) / rate[N]
        gap[N] = -error / of_q / rate[N] if of_q > 1.0 / STIFFEST else -law[N, N] * w
        worst = max(worst, abs(error), _blur_disc(room, i, A, room.limit[i, SLIDES], blur))
        if count > FORCES:
            turns = math.sqrt((rate[FORCES] + rate[FORCES + 1]) / rate[N])
            worst = max(worst, _blur_disc(room, i, FORCES, room.limit[i, ROLLS], blur * turns) / turns)
    return worst


@inlined
def _blur_disc(room, i, k, share, blur):
    """The same for directions k and k + 1 of contact i, and by how much their law is not obeyed."""
    p, law, gap = room.value[IMPULSES, i], room.law[i], room.value[GAP, i]
    rate = room.value[RATE, i, k] + room.value[RATE, i, k + 1]
    x, y = relative(room, i, k), relative(room, i, k + 1)
    size, limit = math.sqrt(x * x + y * y + blur * blur), share * p[N]
    s, t = x / size, y / size
    law[k, k], law[k, k + 1] = (p[k] * s + limit) / size, p[k] * t / size
    law[k + 1, k], law[k + 1, k + 1] = p[k + 1] * s / size, (p[k + 1] * t + limit) / size
    law[k, N], law[k + 1, N] = -share * s * law[N, N], -share * t * law[N, N]
    edge = share * (p[N] + gap[N])
    gap[k], gap[k + 1] = -p[k] - edge * s, -p[k + 1] - edge * t
    return length(p[k] + limit * s, p[k + 1] + limit * t) * rate * size / (size + limit * rate)


@uncounted
def _newton(room, n, size):
    """One step by the linear laws, then back into the cones; False where there is none."""
    if not newton_step(room, n, size):
        return False
    for i in range(n):
        p, count = room.value[IMPULSES, i], place_of(room, i, COUNT)
        for k in range(count):
            p[k] += room.value[GAP, i, k]
        if _yields(room, i):
            _keep_in_cones(room, i, count)
    return True


@inlined
def _yields(room, i):
    """Whether impulses at contact i change with its velocity."""
    law = room.law[i]
    return law[N, N] + law[A, A] + law[B, B] > 0.0


@uncounted
def newton_step(room, n, size):
    """By how much all change by the linear laws: impulses, in GAP, and the motion; False where nothing does."""
    matrix, step, bent = room.matrix, room.motion[STEP], room.bent
    for x in range(size):
        step[x] = 0.0
        for y in range(size):
            matrix[x, y] = 0.0
        matrix[x, x] = 1.0
    for i in range(n):
        count, width = place_of(room, i, COUNT), 6 + place_of(room, i, WIDTH)
        for k in range(count):
            if room.value[GAP, i, k] != 0.0:
                push_along(room, i, k, room.value[GAP, i, k], STEP)
        if not _yields(room, i):
            continue
        second, other, far = place_of(room, i, SECOND), place_of(room, i, OTHER), place_of(room, i, WIDTH)
        law, rows, push = room.law[i], room.rows[i], room.push[i]
        for k in range(0, count, FORCES):
            for m in range(k, k + 2):
                for x in range(width):
                    bent[m, x] = law[m, N] * rows[N, x] + law[m, k] * rows[k, x] + law[m, k + 1] * rows[k + 1, x]
        for x in range(width):
            bent[N, x] = law[N, N] * rows[N, x]
        for x in range(width):
            line = second + x if x < 6 else other + x - 6
            s, t, r = push[A, x], push[B, x], push[N, x]
            for y in range(6):
                matrix[line, second + y] += s * bent[A, y] + t * bent[B, y] + r * bent[N, y]
            for y in range(far):
                matrix[line, other + y] += s * bent[A, 6 + y] + t * bent[B, 6 + y] + r * bent[N, 6 + y]
            if count > FORCES:
                s, t = push[FORCES, x], push[FORCES + 1, x]
                for y in range(6):
                    matrix[line, second + y] += s * bent[FORCES, y] + t * bent[FORCES + 1, y]
                for y in range(far):
                    matrix[line, other + y] += s * bent[FORCES, 6 + y] + t * bent[FORCES + 1, 6 + y]
    if not solve_equations(matrix, step, size):
        return False
    for i in range(n):
        gap, count = room.value[GAP, i], place_of(room, i, COUNT)
        if _yields(room, i):
            for m in range(count):
                change = along(room, i, m, STEP)
                for k in range(count):
                    gap[k] -= room.law[i, k, m] * change
    return True


@inlined
def _keep_in_cones(room, i, count):
    p = room.value[IMPULSES, i]
    p[N] = max(p[N], 0.0)
    for k in range(0, count, FORCES):
        _keep_in_disc(p, k, room.limit[i, k // FORCES] * p[N])


@inlined
def length(x, y):
    """As `math.hypot`, which takes three times as long."""
    return math.sqrt(x * x + y * y)


@inlined
def _keep_in_disc(p, k, limit):
    size = length(p[k], p[k + 1])
    if size > limit:
        p[k] *= limit / size
        p[k + 1] *= limit / size


@uncounted
def solve_equations(matrix, right, size):
    """Solve linear equations in place by elimination, with the largest pivot of a column; False if none is finite.

    What is 0 stays out of it: of many bodies each touches few.
    """
    for c in range(size):
        pivot = c
        for x in range(c + 1, size):
            if abs(matrix[x, c]) > abs(matrix[pivot, c]):
                pivot = x
        if not abs(matrix[pivot, c]) > 0.0:
            return False
        if pivot != c:
            right[c], right[pivot] = right[pivot], right[c]
            for y in range(c, size):
                matrix[c, y], matrix[pivot, y] = matrix[pivot, y], matrix[c, y]
        inverse, end = 1.0 / matrix[c, c], size
        while matrix[c, end - 1] == 0.0:
            end -= 1
        for x in range(c + 1, size):
            share = matrix[x, c] * inverse
            if share != 0.0:
                for y in range(c + 1, end):
                    matrix[x, y] -= share * matrix[c, y]
                right[x] -= share * right[c]
    finite = True
    for c in range(size - 1, -1, -1):
        for y in range(c + 1, size):
            right[c] -= matrix[c, y] * right[y]
        right[c] /= matrix[c, c]
        finite = finite and math.isfinite(right[c])
    return finite


@uncounted
def _sweep(room, n):
    """A step of each contact in turn: its impulses, changed freely, projected onto their cone.

    Returns by how much velocities have changed at most [m/s].
    """
    most = 0.0
    for i in range(n):
        p, last, rate = room.value[IMPULSES, i], room.value[IMPULSES, i, N], room.value[RATE, i]
        p[N] = max(0.0, last - (relative(room, i, N) - room.target[i]) / rate[N])
        push_along(room, i, N, p[N] - last, NOW)
        most = max(most, abs(p[N] - last) * rate[N])
        for k in range(0, place_of(room, i, COUNT), FORCES):
            r = 1.0 / room.value[ACROSS, i, k]
            last_s, last_t = p[k], p[k + 1]
            p[k], p[k + 1] = last_s - r * relative(room, i, k), last_t - r * relative(room, i, k + 1)
            _keep_in_disc(p, k, room.limit[i, k // FORCES] * p[N])
            push_along(room, i, k, p[k] - last_s, NOW)
            push_along(room, i, k + 1, p[k + 1] - last_t, NOW)
            share = 1.0 / r if k == A else math.sqrt(rate[N] / r)
            most = max(most, max(abs(p[k] - last_s), abs(p[k + 1] - last_t)) * share)
    return most
