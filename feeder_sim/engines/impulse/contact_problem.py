"""Impacts and contacts of any number of rigid bodies at once: Newton's restitution, Coulomb's friction, no stiffness.

At every contact i with normal n, relative velocity u' after and impulse p, for a target b that is given,

    u'.n >= b,   p.n >= 0,   complementary
    |p_t| <= mu p.n,    p_t opposite to u'_t where it slips                 (Coulomb's exact cone)
    |m|   <= arm p.n,   m opposite to the relative spin w'_t where it rolls (m: moment in the tangent plane)

and u' = u + W p, where W couples contacts through the bodies, and through the modes of a plate that gives way.
The same as equations (Alart and Curnier, CMAME 92 (1991) 353), with any r > 0 and P the projection,

    p.n = max(0, p.n - r (u'.n - b)),   p_t = P(p_t - r u'_t) onto the disc of radius mu p.n,   m likewise.

They are solved by Newton's method: each step takes the contacts for open, sticking or slipping by the last one. W is
singular where faces meet, so that only motions are unique, not impulses. So equations are written for the change of
motion, a few unknowns for each body, and a tiny compliance 1/r, by the last step's impulses, selects among these; it
changes no solution (proximal point method; Rockafellar, SIAM J. Control 14 (1976) 877). From impulses 0 it comes to
nearly the least ones, so that what is symmetric stays so. Where Newton's method goes astray, sweeps of Gauss-Seidel
with each contact solved exactly give it another start (Jean, CMAME 177 (1999) 235).

A single contact is solved directly (single_impact.py).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba.core import types
from numba.extending import overload
from numpy.typing import NDArray

from feeder_sim.engines.impulse.single_impact import (
    HALVINGS,
    ROUND_OFF,
    _slip,
    _stick,
    impulse_at_point,
    tangents,
)
from feeder_sim.engines.impulse.vectors import combine, cross, dot, times, vector, write_to
from feeder_sim.machine_code import compiled, inlined, uncounted

ARM_FIRST, ARM_SECOND, NORMAL, VELOCITY, IMPULSE, MOMENT = range(6)  # of Contacts.vector
RESTITUTION, FRICTION, ROLLING, TARGET = range(4)  # of Contacts.number
WORLD = -1  # in Contacts.body: what moves as it is told
A, B, N = range(3)  # directions at a contact: two tangents and the normal; then two more of spin
DIRECTIONS, FORCES = 5, 3
SECOND, OTHER, WIDTH, COUNT = range(4)  # of Room.place
START, NOW, STEP = range(3)  # of Room.motion
IMPULSES, BEFORE, KNOWN, GAP, BEST, RATE = range(6)  # of Room.number
ENOUGH = 1e-12  # of the largest approach: how closely contacts are solved
FLOOR = 4e-15  # of the largest speed, which is round-off
STIFF = 1e8  # r, in effective masses
ROUNDS, NEWTONS, STALE, FALL = 12, 40, 3, 0.3
FIRST_SWEEPS = 4  # doubled each time


class Bodies(NamedTuple):
    """Motion and inertia of rigid bodies.

    velocity [m/s] and spin [rad/s] in world axes, (m, 3); inverse_mass [1/kg] (m,), 0 for what cannot be moved;
    inverse_inertia: symmetric, in world axes [1/(kg m^2)], (m, 6).
    """

    velocity: NDArray[np.float64]
    spin: NDArray[np.float64]
    inverse_mass: NDArray[np.float64]
    inverse_inertia: NDArray[np.float64]


class Room(NamedTuple):
    """Room for one solution. All motion is one vector: (velocity, spin) of each body, then what the modes have lost.

    rows: how it gives the relative velocity in each direction at a contact, (n, DIRECTIONS, width), and
    push: how it is changed by an impulse in that direction; of the second body first, then of the first or of the
    modes. place: where the two begin, the length of the latter, and the number of directions (n, 4). number:
    (6, n, DIRECTIONS). law: how impulses fall with the velocity (n, DIRECTIONS, DIRECTIONS). motion: (3, all),
    matrix: (all, all).
    """

    rows: NDArray[np.float64]
    push: NDArray[np.float64]
    place: NDArray[np.int64]
    number: NDArray[np.float64]
    law: NDArray[np.float64]
    bent: NDArray[np.float64]
    motion: NDArray[np.float64]
    matrix: NDArray[np.float64]


class Contacts(NamedTuple):
    """Contacts of bodies with each other or the world, and room to solve them.

    body: (n, 2), which two; the first may be WORLD. vector: (6, n, 3): ARM_FIRST and ARM_SECOND from the centres of
    mass to the contact [m], NORMAL from the first to the second, VELOCITY of the world there [m/s], where it is the
    first; results: IMPULSE on the second [N s], the first gets the opposite, and MOMENT [N m s]. number: (4, n):
    RESTITUTION, FRICTION, ROLLING: arm of rolling resistance [m], TARGET [m/s].
    """

    body: NDArray[np.int64]
    vector: NDArray[np.float64]
    number: NDArray[np.float64]
    room: Room


class Modes(NamedTuple):
    """The modes of a plate that gives way; only contacts with the world move them.

    inverse_mass: 1 / m_j (s,) [1/kg]; carried: how contact i moves with them (n, s, 3) [1]; taken: velocities that the
    impulses take from them (s,) [m/s].
    """

    inverse_mass: NDArray[np.float64]
    carried: NDArray[np.float64]
    taken: NDArray[np.float64]


def new_room(bodies: int, contacts: int, shapes: int = 0) -> tuple[Bodies, Contacts, Modes | None]:
    """Room for so many bodies, contacts and modes of the plate; fewer bodies and contacts may be solved in it."""
    size, width = 6 * bodies + shapes, 6 + max(6, shapes)
    room = Room(
        rows=np.zeros((contacts, DIRECTIONS, width)),
        push=np.zeros((contacts, DIRECTIONS, width)),
        place=np.zeros((contacts, 4), np.int64),
        number=np.zeros((6, contacts, DIRECTIONS)),
        law=np.zeros((contacts, DIRECTIONS, DIRECTIONS)),
        bent=np.zeros((DIRECTIONS, width)),
        motion=np.zeros((3, size)),
        matrix=np.zeros((size, size)),
    )
    return (
        Bodies(np.zeros((bodies, 3)), np.zeros((bodies, 3)), np.zeros(bodies), np.zeros((bodies, 6))),
        Contacts(np.zeros((contacts, 2), np.int64), np.zeros((6, contacts, 3)), np.zeros((4, contacts)), room),
        Modes(np.zeros(shapes), np.zeros((contacts, shapes, 3)), np.zeros(shapes)) if shapes else None,
    )


@compiled
def solve(bodies, contacts, n, modes):
    """Find the impulses at the first n contacts that reach their TARGET; changes velocities and spins in place.

    Fills IMPULSE, MOMENT and modes.taken. Returns whether it has settled.
    """
    size = _lay_out(bodies, contacts, n, modes)
    settled = _settle(contacts, n, size)
    _write_out(bodies, contacts, n, modes)
    return settled


@compiled
def impact(bodies, contacts, n, modes):
    """As `solve`, by Newton's law of restitution: the target is -e u.n where contacts approach, else 0.

    Where that would create energy, the restitution of all is lowered. Returns whether it has settled.
    """
    size = _lay_out(bodies, contacts, n, modes)
    number, room = contacts.number, contacts.room
    if n == 1 and room.place[0, COUNT] == FORCES:
        settled = True
        if room.number[BEFORE, 0, N] < 0.0:
            u = room.number[BEFORE, 0, A], room.number[BEFORE, 0, B], room.number[BEFORE, 0, N]
            settled, p = impulse_at_point(_mobility(room, 0), u, number[RESTITUTION, 0], number[FRICTION, 0])
            for k in range(FORCES):
                _add_impulse(room, 0, k, p[k])
        if settled:
            _write_out(bodies, contacts, n, modes)
            return True
        _fresh_start(room, n, size)
    share, settled = 1.0, False
    for _ in range(HALVINGS + 1):
        for i in range(n):
            number[TARGET, i] = -share * number[RESTITUTION, i] * min(room.number[BEFORE, i, N], 0.0)
        settled = _settle(contacts, n, size)
        work, least = _work(room, n)
        if (settled and work <= least) or share == 0.0:
            break
        share = 0.5 * share if share > 0.02 else 0.0
    _write_out(bodies, contacts, n, modes)
    return settled


@uncounted
def _lay_out(bodies, contacts, n, modes):
    """Write the equations of n contacts into the room, without impulses; returns the length of the motion."""
    room, last = contacts.room, 0
    for i in range(n):
        last = max(last, contacts.body[i, 0], contacts.body[i, 1])
    size = 6 * (last + 1)
    for j in range(last + 1):
        for c in range(3):
            room.motion[START, 6 * j + c] = bodies.velocity[j, c]
            room.motion[START, 6 * j + 3 + c] = bodies.spin[j, c]
    for i in range(n):
        first, second = contacts.body[i, 0], contacts.body[i, 1]
        normal = vector(contacts.vector[NORMAL, i])
        frame, count = tangents(normal), DIRECTIONS if contacts.number[ROLLING, i] > 0.0 else FORCES
        for k in range(count):
            d = normal if k == N else frame[k % FORCES]
            _write_row(bodies, room, i, k, d, second, vector(contacts.vector[ARM_SECOND, i]), 0, 1.0)
            room.number[KNOWN, i, k] = 0.0
            if first >= 0:
                _write_row(bodies, room, i, k, d, first, vector(contacts.vector[ARM_FIRST, i]), 6, -1.0)
            else:
                _write_modes(modes, room, i, k, d)
                if k < FORCES:
                    room.number[KNOWN, i, k] = -dot(d, contacts.vector[VELOCITY, i])
        room.place[i, SECOND], room.place[i, OTHER] = 6 * second, 6 * first if first >= 0 else size
        room.place[i, WIDTH], room.place[i, COUNT] = 6 if first >= 0 else _number_of(modes), count
    size += _number_of(modes)
    for x in range(6 * (last + 1), size):
        room.motion[START, x] = 0.0
    _fresh_start(room, n, size)
    for i in range(n):
        for k in range(room.place[i, COUNT]):
            room.number[BEFORE, i, k] = _along(room, i, k, NOW) + room.number[KNOWN, i, k]
            room.number[RATE, i, k] = 0.0
            for x in range(6 + room.place[i, WIDTH]):
                room.number[RATE, i, k] += room.rows[i, k, x] * room.push[i, k, x]
    return size


@inlined
def _write_row(bodies, room, i, k, d, j, arm, at, sign):
    """How body j moves along direction k at contact i, or turns about it, and what an impulse there does to it."""
    turning = cross(arm, d) if k < FORCES else d
    turned = times(vector6(bodies.inverse_inertia[j]), turning)
    for c in range(3):
        room.rows[i, k, at + c] = sign * d[c] if k < FORCES else 0.0
        room.rows[i, k, at + 3 + c] = sign * turning[c]
        room.push[i, k, at + c] = bodies.inverse_mass[j] * room.rows[i, k, at + c]
        room.push[i, k, at + 3 + c] = sign * turned[c]


@inlined
def vector6(a):
    """The symmetric matrix in an array (6,)."""
    return a[0], a[1], a[2], a[3], a[4], a[5]


def _number_of(modes):
    """How many modes there are."""
    raise NotImplementedError("for compiled code only")


def _write_modes(modes, room, i, k, d):
    """As `_write_row`, of the modes, which lose what the contact takes."""
    raise NotImplementedError("for compiled code only")


def _write_taken(modes, motion, at):
    """Write what the modes have lost, from a motion in which they begin at a place."""
    raise NotImplementedError("for compiled code only")


@overload(_number_of)
def _number_by_kind(modes):
    if isinstance(modes, types.NoneType):
        return lambda modes: 0
    return lambda modes: modes.taken.shape[0]


@overload(_write_modes)
def _write_modes_by_kind(modes, room, i, k, d):
    if isinstance(modes, types.NoneType):
        return lambda modes, room, i, k, d: None

    def write(modes, room, i, k, d):
        for s in range(modes.taken.shape[0]):
            room.rows[i, k, 6 + s] = dot(modes.carried[i, s], d) if k < FORCES else 0.0
            room.push[i, k, 6 + s] = modes.inverse_mass[s] * room.rows[i, k, 6 + s]

    return write


@overload(_write_taken)
def _write_taken_by_kind(modes, motion, at):
    if isinstance(modes, types.NoneType):
        return lambda modes, motion, at: None

    def write(modes, motion, at):
        for s in range(modes.taken.shape[0]):
            modes.taken[s] = motion[NOW, at + s]

    return write


@inlined
def _along(room, i, k, which):
    """What a motion is in direction k at contact i."""
    second, other = room.place[i, SECOND], room.place[i, OTHER] - 6
    total = 0.0
    for x in range(6):
        total += room.rows[i, k, x] * room.motion[which, second + x]
    for x in range(6, 6 + room.place[i, WIDTH]):
        total += room.rows[i, k, x] * room.motion[which, other + x]
    return total


@inlined
def _push(room, i, k, p, which):
    """Change a motion by an impulse p in direction k at contact i."""
    second, other = room.place[i, SECOND], room.place[i, OTHER] - 6
    for x in range(6):
        room.motion[which, second + x] += p * room.push[i, k, x]
    for x in range(6, 6 + room.place[i, WIDTH]):
        room.motion[which, other + x] += p * room.push[i, k, x]


@inlined
def _add_impulse(room, i, k, p):
    room.number[IMPULSES, i, k] += p
    _push(room, i, k, p, NOW)


@inlined
def _relative(room, i, k):
    """Relative velocity [m/s], or spin [rad/s], in direction k at contact i."""
    return _along(room, i, k, NOW) + room.number[KNOWN, i, k]


@uncounted
def _fresh_start(room, n, size):
    """No impulses, and the motion before them."""
    for x in range(size):
        room.motion[NOW, x] = room.motion[START, x]
    for i in range(n):
        for k in range(room.place[i, COUNT]):
            room.number[IMPULSES, i, k] = 0.0


@uncounted
def _motion_of_impulses(room, n, size):
    """The motion that all impulses make of that at the start."""
    for x in range(size):
        room.motion[NOW, x] = room.motion[START, x]
    for i in range(n):
        for k in range(room.place[i, COUNT]):
            if room.number[IMPULSES, i, k] != 0.0:
                _push(room, i, k, room.number[IMPULSES, i, k], NOW)


@inlined
def _mobility(room, i):
    """Inverse effective mass of contact i in its directions [1/kg]."""
    return (
        room.number[RATE, i, A],
        _coupling(room, i, A, B),
        _coupling(room, i, A, N),
        room.number[RATE, i, B],
        _coupling(room, i, B, N),
        room.number[RATE, i, N],
    )


@inlined
def _coupling(room, i, k, m):
    total = 0.0
    for x in range(6 + room.place[i, WIDTH]):
        total += room.rows[i, k, x] * room.push[i, m, x]
    return total


@uncounted
def _settle(contacts, n, size):
    """Solve for impulses and motion NOW; returns whether every contact obeys its laws."""
    room, number = contacts.room, contacts.number
    approach = speed = 0.0
    for i in range(n):
        approach = max(approach, number[TARGET, i] - room.number[BEFORE, i, N])
        for k in range(FORCES):
            speed = max(speed, abs(room.number[KNOWN, i, k]), abs(room.number[BEFORE, i, k] - room.number[KNOWN, i, k]))
    tolerance = max(ENOUGH * approach, FLOOR * speed)
    best, sweeps = math.inf, FIRST_SWEEPS
    for _ in range(ROUNDS):
        stale = 0
        for _ in range(NEWTONS):
            _motion_of_impulses(room, n, size)
            error = _linearise(contacts, n, tolerance)
            if error <= tolerance:
                return True
            stale = 0 if error < FALL * best else stale + 1
            if error < best:
                best = error
                _copy(room, IMPULSES, BEST, n)
            if stale > STALE or not _newton(contacts, n, size):
                break
        _copy(room, BEST, IMPULSES, n)
        _motion_of_impulses(room, n, size)
        for _ in range(sweeps):
            _sweep(contacts, n)
        sweeps *= 2
    _motion_of_impulses(room, n, size)
    error = _linearise(contacts, n, tolerance)
    if error > best:
        _copy(room, BEST, IMPULSES, n)
        _motion_of_impulses(room, n, size)
    return min(error, best) <= tolerance


@uncounted
def _copy(room, source, target, n):
    for i in range(n):
        for k in range(DIRECTIONS):
            room.number[target, i, k] = room.number[source, i, k]


@uncounted
def _linearise(contacts, n, tolerance):
    """How impulses change, GAP - law (change of velocity), by the laws of contact; returns how far they are from them.

    The error is in [m/s].
    """
    room, worst = contacts.room, 0.0
    for i in range(n):
        p, law, gap, rate = room.number[IMPULSES, i], room.law[i], room.number[GAP, i], room.number[RATE, i]
        count = room.place[i, COUNT]
        for k in range(count):
            for m in range(count):
                law[k, m] = 0.0
        along = _relative(room, i, N) - contacts.number[TARGET, i]
        pressed = p[N] - along / rate[N]
        worst = max(worst, abs(p[N] - max(pressed, 0.0)) * rate[N])
        if pressed < -tolerance / rate[N]:
            for k in range(count):
                gap[k] = -p[k]
            worst = max(worst, math.hypot(p[A], p[B]) * (rate[A] + rate[B]))
            continue
        law[N, N] = STIFF / rate[N]
        gap[N] = -law[N, N] * along
        error = _linearise_disc(room, i, A, contacts.number[FRICTION, i], max(pressed, 0.0))
        worst = max(worst, error * (rate[A] + rate[B]))
        if count > FORCES:
            error = _linearise_disc(room, i, FORCES, contacts.number[ROLLING, i], max(pressed, 0.0))
            worst = max(worst, error * math.sqrt((rate[FORCES] + rate[FORCES + 1]) * rate[N]))
    return worst


@inlined
def _linearise_disc(room, i, k, share, pressed):
    """The same for directions k and k + 1 of contact i, where impulses are at most a share of the normal one."""
    p, law, gap = room.number[IMPULSES, i], room.law[i], room.number[GAP, i]
    r = 1.0 / (room.number[RATE, i, k] + room.number[RATE, i, k + 1])
    x, y = _relative(room, i, k), _relative(room, i, k + 1)
    s, t = p[k] - r * x, p[k + 1] - r * y
    size, limit = math.hypot(s, t), share * pressed
    if size <= limit:  # sticks
        law[k, k] = law[k + 1, k + 1] = STIFF * r
        gap[k], gap[k + 1] = -STIFF * r * x, -STIFF * r * y
        return r * math.hypot(x, y)
    error = math.hypot(p[k] - limit * s / size, p[k + 1] - limit * t / size)
    # Slips: p = share p.n (s, t), and a change of velocity across turns that direction.
    s, t, edge = p[k] - STIFF * r * x, p[k + 1] - STIFF * r * y, share * p[N]
    size = math.hypot(s, t)
    turn, s, t = (edge * STIFF * r / size, s / size, t / size) if size > 0.0 else (0.0, 0.0, 0.0)
    law[k, N], law[k + 1, N] = share * s * law[N, N], share * t * law[N, N]
    law[k, k], law[k, k + 1] = turn * t * t, -turn * s * t
    law[k + 1, k], law[k + 1, k + 1] = -turn * s * t, turn * s * s
    edge += share * gap[N]
    gap[k], gap[k + 1] = edge * s - p[k], edge * t - p[k + 1]
    return error


@uncounted
def _newton(contacts, n, size):
    """One step of Newton's method from the linear laws, then back into the cones; False where it does not exist."""
    room = contacts.room
    matrix, step, bent = room.matrix, room.motion[STEP], room.bent
    for x in range(size):
        step[x] = 0.0
        for y in range(size):
            matrix[x, y] = 0.0
        matrix[x, x] = 1.0
    for i in range(n):
        count, width = room.place[i, COUNT], 6 + room.place[i, WIDTH]
        for k in range(count):
            if room.number[GAP, i, k] != 0.0:
                _push(room, i, k, room.number[GAP, i, k], STEP)
        if room.law[i, N, N] == 0.0:
            continue
        second, other = room.place[i, SECOND], room.place[i, OTHER] - 6
        for k in range(count):
            for x in range(width):
                bent[k, x] = 0.0
            for m in range(count):
                if room.law[i, k, m] != 0.0:
                    for x in range(width):
                        bent[k, x] += room.law[i, k, m] * room.rows[i, m, x]
            for x in range(width):
                share, line = room.push[i, k, x], x + (second if x < 6 else other)
                for y in range(6):
                    matrix[line, second + y] += share * bent[k, y]
                for y in range(6, width):
                    matrix[line, other + y] += share * bent[k, y]
    if not solve_equations(matrix, step, size):
        return False
    for i in range(n):
        p, count = room.number[IMPULSES, i], room.place[i, COUNT]
        for k in range(count):
            p[k] += room.number[GAP, i, k]
        if room.law[i, N, N] == 0.0:
            continue
        for m in range(count):
            along = _along(room, i, m, STEP)
            for k in range(count):
                p[k] -= room.law[i, k, m] * along
        p[N] = max(p[N], 0.0)
        _keep_in_disc(p, A, contacts.number[FRICTION, i] * p[N])
        if count > FORCES:
            _keep_in_disc(p, FORCES, contacts.number[ROLLING, i] * p[N])
    return True


@inlined
def _keep_in_disc(p, k, limit):
    size = math.hypot(p[k], p[k + 1])
    if size > limit:
        p[k] *= limit / size
        p[k + 1] *= limit / size


@uncounted
def solve_equations(matrix, right, size):
    """Solve linear equations in place by elimination with the largest pivot of each column; False where singular."""
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
        for x in range(c + 1, size):
            share = matrix[x, c] / matrix[c, c]
            if share != 0.0:
                for y in range(c + 1, size):
                    matrix[x, y] -= share * matrix[c, y]
                right[x] -= share * right[c]
    for c in range(size - 1, -1, -1):
        for y in range(c + 1, size):
            right[c] -= matrix[c, y] * right[y]
        right[c] /= matrix[c, c]
    return True


@uncounted
def _sweep(contacts, n):
    """Solve each contact in turn, with the impulses of the others as they are."""
    room = contacts.room
    for i in range(n):
        p, rate, mu = room.number[IMPULSES, i], room.number[RATE, i], contacts.number[FRICTION, i]
        target = contacts.number[TARGET, i]
        k = _mobility(room, i)
        last = p[A], p[B], p[N]
        change = times(k, last)
        u = _relative(room, i, A) - change[0], _relative(room, i, B) - change[1], _relative(room, i, N) - change[2]
        found = (0.0, 0.0, 0.0)
        if u[2] < target:
            solved, found = _stick(k, u, target, mu)
            if not solved:
                solved, found = _slip(k, u, target, mu, found)
                if not solved:
                    found = (0.0, 0.0, (target - u[2]) / k[5])
        for m in range(FORCES):
            _add_impulse(room, i, m, found[m] - last[m])
        if room.place[i, COUNT] > FORCES:
            step = 1.0 / (rate[FORCES] + rate[FORCES + 1])
            last_s, last_t = p[FORCES], p[FORCES + 1]
            p[FORCES] -= step * _relative(room, i, FORCES)
            p[FORCES + 1] -= step * _relative(room, i, FORCES + 1)
            _keep_in_disc(p, FORCES, contacts.number[ROLLING, i] * p[N])
            _push(room, i, FORCES, p[FORCES] - last_s, NOW)
            _push(room, i, FORCES + 1, p[FORCES + 1] - last_t, NOW)


@uncounted
def _work(room, n):
    """Work of all impulses in the frame of the contacts [J], the energy they create; and what is as good as none."""
    total = size = 0.0
    for i in range(n):
        for k in range(room.place[i, COUNT]):
            p, before = room.number[IMPULSES, i, k], room.number[BEFORE, i, k]
            total += 0.5 * p * (before + _relative(room, i, k))
            size += abs(p * before)
    return total, ROUND_OFF * size


@uncounted
def _write_out(bodies, contacts, n, modes):
    """Velocities, impulses and moments, from the room."""
    room, last = contacts.room, -1
    for i in range(n):
        last = max(last, contacts.body[i, 0], contacts.body[i, 1])
        normal = vector(contacts.vector[NORMAL, i])
        a, b = tangents(normal)
        p = room.number[IMPULSES, i]
        write_to(contacts.vector[IMPULSE, i], combine(p[A], a, p[B], b, p[N], normal))
        if room.place[i, COUNT] > FORCES:
            write_to(contacts.vector[MOMENT, i], combine(p[FORCES], a, p[FORCES + 1], b, 0.0, normal))
        else:
            write_to(contacts.vector[MOMENT, i], (0.0, 0.0, 0.0))
    for j in range(last + 1):
        for c in range(3):
            bodies.velocity[j, c] = room.motion[NOW, 6 * j + c]
            bodies.spin[j, c] = room.motion[NOW, 6 * j + 3 + c]
    _write_taken(modes, room.motion, 6 * (last + 1))
