"""Impacts and contacts of any number of rigid bodies at once: Newton's restitution, Coulomb's friction, no stiffness.

At every contact with normal n from the first body to the second, relative velocity u' after and impulse p, for a target
b that is given,

    u'.n >= b,   p.n >= 0,   complementary
    |p_t| <= mu p.n,    p_t opposite to u'_t where it slips                      (Coulomb's exact cone)
    |m_t| <= arm p.n,   m_t opposite to the relative spin w'_t where it rolls    (rolling resistance, a moment)

and u' = u + W p, where W couples contacts by the bodies, and by the modes of a plate that gives way: an impulse p takes
the velocity d.p / m_j from mode j, where d is how the contact moves with it. contact_equations.py solves all at once;
a single contact is solved directly (single_impact.py).

An impact has b = -e u.n (Moreau, in: Nonsmooth Mechanics, 1988). Newton's law with friction can create energy (Kane and
Levinson 1985); where the work sum p.(u + u')/2 would be positive, the restitution of all is lowered until it is not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.contact_equations import (
    BEFORE,
    COUNT,
    DIRECTIONS,
    FORCES,
    IMPULSES,
    KNOWN,
    NOW,
    OTHER,
    RATE,
    ROLLS,
    SECOND,
    SLIDES,
    START,
    WIDTH,
    A,
    B,
    N,
    Room,
    accuracy,
    begin,
    come_near,
    forget,
    make_motion,
    relative,
    sweeps_settle,
)
from feeder_sim.engines.impulse.limited_friction import settle
from feeder_sim.engines.impulse.single_impact import (
    HALVINGS,
    ROUND_OFF,
    added,
    impulse_at_point,
    impulse_to,
    mobility,
    tangents,
)
from feeder_sim.engines.impulse.vectors import add_to, combine, cross, difference, dot, plus, times, vector, write_to
from feeder_sim.machine_code import compiled, inlined, uncounted

ARM_FIRST, ARM_SECOND, NORMAL, VELOCITY, IMPULSE, MOMENT = range(6)  # of Contacts.vector
RESTITUTION, FRICTION, ROLLING, TARGET = range(4)  # of Contacts.number
JAMMED = 4.0  # times what all contacts approach by, as velocities; loads of a part that is not jammed come to half
WORLD = -1  # in Contacts.body: what moves as it is told


class Bodies(NamedTuple):
    """Motion and inertia of rigid bodies.

    velocity [m/s] and spin [rad/s] in world axes (m, 3); inverse_mass [1/kg] (m,), 0 like its inverse_inertia for what
    cannot be moved; inverse_inertia: symmetric, in world axes [1/(kg m^2)] (m, 6).
    """

    velocity: NDArray[np.float64]
    spin: NDArray[np.float64]
    inverse_mass: NDArray[np.float64]
    inverse_inertia: NDArray[np.float64]


class Modes(NamedTuple):
    """The modes of a plate that gives way, if any; contacts with the world move them, those of two bodies do not.

    inverse_mass: 1 / m_j (s,) [1/kg]; carried: d of every contact (n, s, 3) [1]; velocity_loss: what the impulses
    have taken from them (s,) [m/s].
    """

    inverse_mass: NDArray[np.float64]
    carried: NDArray[np.float64]
    velocity_loss: NDArray[np.float64]


class Contacts(NamedTuple):
    """Contacts of bodies with each other or the world, and room to solve them.

    body: (n, 2), the first and the second; the first may be WORLD. vector (6, n, 3): ARM_FIRST and ARM_SECOND from the
    centres of mass to the contact [m], NORMAL from the first to the second, VELOCITY of the first there beyond its body
    [m/s]; IMPULSE on the second [N s], of which the first gets the opposite, and MOMENT likewise [N m s]: results,
    and from where `solve` starts. number (4, n): RESTITUTION, FRICTION, ROLLING: arm of rolling resistance
    [m], 0 for none, TARGET [m/s].
    """

    body: NDArray[np.int64]
    vector: NDArray[np.float64]
    number: NDArray[np.float64]
    modes: Modes
    room: Room


def new_room(bodies: int, contacts: int, shapes: int = 0) -> tuple[Bodies, Contacts]:
    """Room for so many bodies, contacts and modes; fewer bodies and contacts may be solved in it."""
    size, width = 6 * bodies + shapes, 6 + max(6, shapes)
    return (
        Bodies(np.zeros((bodies, 3)), np.zeros((bodies, 3)), np.zeros(bodies), np.zeros((bodies, 6))),
        Contacts(
            np.zeros((contacts, 2), np.int64),
            np.zeros((6, contacts, 3)),
            np.zeros((4, contacts)),
            Modes(np.zeros(shapes), np.zeros((contacts, shapes, 3)), np.zeros(shapes)),
            Room(
                np.zeros((contacts, DIRECTIONS, width)),
                np.zeros((contacts, DIRECTIONS, width)),
                np.zeros((contacts, 4), np.int64),
                np.zeros((10, contacts, DIRECTIONS)),
                np.zeros((contacts, 2)),
                np.zeros(contacts),
                np.zeros((contacts, DIRECTIONS, DIRECTIONS)),
                np.zeros((DIRECTIONS, width)),
                np.zeros((3, size)),
                np.zeros((size, size)),
            ),
        ),
    )


make_room = compiled(new_room)


@inlined
def meet_world(n, contacts, body, place, law):
    """Make contact n one of a body with the world; place: arm, normal, velocity; law: the first three of number."""
    contacts.body[n, 0], contacts.body[n, 1] = WORLD, body
    write_to(contacts.vector[ARM_SECOND, n], place[0])
    write_to(contacts.vector[NORMAL, n], place[1])
    write_to(contacts.vector[VELOCITY, n], place[2])
    contacts.number[RESTITUTION, n], contacts.number[FRICTION, n], contacts.number[ROLLING, n] = law


@uncounted
def solve(bodies, contacts, n, closely=0.0, sweeps=True):
    """Find the impulses at the first n contacts that reach their TARGET; changes velocities and spins in place.

    closely: see `settle`; with it sweeps come first, from the impulses and moments that the contacts have, unless
    `sweeps` is False: where bodies may be jammed, what they lead to is not near the least impulses.

    Fills IMPULSE, MOMENT and velocity_loss of the modes. Returns whether every contact obeys its laws.
    """
    if n == 1 and contacts.number[ROLLING, 0] <= 0.0:
        frame, k, u = seen_alone(0, bodies, contacts)
        p, target = (0.0, 0.0, 0.0), contacts.number[TARGET, 0]
        if u[2] < target:
            _, p = impulse_to(k, u, target, contacts.number[FRICTION, 0])
        push_alone(0, bodies, contacts, frame, p)
        return True
    size = lay_out(bodies, contacts, n)
    for i in range(n):
        contacts.room.target[i] = contacts.number[TARGET, i]
    settled = sweeps and closely > 0.0 and _sweeps_settle(contacts, n, size, closely)
    if not settled:
        settled = settle(contacts.room, n, size, closely)
    write_out(bodies, contacts, n)
    return settled


@uncounted
def _sweeps_settle(contacts, n, size, closely):
    """Sweep from the impulses that contacts have; returns whether that solves them, else there are none again.

    Those that hold each other far more than anything approaches are dropped: what is jammed would stay so by itself.
    """
    given = needed = 0.0
    for i in range(n):
        p, normal = contacts.room.value[IMPULSES, i], vector(contacts.vector[NORMAL, i])
        impulse, moment = contacts.vector[IMPULSE, i], contacts.vector[MOMENT, i]
        a, b = tangents(normal)
        p[A], p[B], p[N] = dot(impulse, a), dot(impulse, b), dot(impulse, normal)
        if contacts.room.place[i, COUNT] > FORCES:
            p[FORCES], p[FORCES + 1] = dot(moment, a), dot(moment, b)
        given += p[N] * contacts.room.value[RATE, i, N]
        needed += max(contacts.room.target[i] - contacts.room.value[BEFORE, i, N], 0.0)
    if given > JAMMED * needed:
        forget(contacts.room, n)
    return sweeps_settle(contacts.room, n, size, closely)


@uncounted
def impact(bodies, contacts, n, closely=0.0, near=0.0):
    """As `solve`, by Newton's law of restitution: the target is -e u.n where a contact approaches, else 0.

    closely: see `settle`; near: up to what a velocity may be off [m/s] when sweeps that come first end, 0 for none.
    Overwrites TARGET. Energy never grows.
    """
    room, number = contacts.room, contacts.number
    if n == 1 and number[ROLLING, 0] <= 0.0 and _impact_alone(bodies, contacts):
        return True
    size = lay_out(bodies, contacts, n)
    settled = find_impulses(contacts, n, size, closely, near, 1.0)
    for i in range(n):
        number[TARGET, i] = room.target[i]
    write_out(bodies, contacts, n)
    return settled


@uncounted
def find_impulses(contacts, n, size, closely, near, share):
    """Impulses of an `impact` that has been laid out, with a share of the restitution at most; whether laws are obeyed.

    Energy never grows.
    """
    room, number, settled = contacts.room, contacts.number, False
    for _ in range(HALVINGS + 1):
        for i in range(n):
            room.target[i] = -share * number[RESTITUTION, i] * min(room.value[BEFORE, i, N], 0.0)
        if near > 0.0:
            come_near(room, n, size, near)
        settled = settle(room, n, size, closely)
        work, at_first, trace = work_of(room, n, closely)
        if (settled and work <= trace) or share == 0.0:
            break
        if not settled:
            begin(room, n, size)
        share = 0.5 * share if settled and share > 0.02 else 0.0
    if not settled and _slip(room, n, size, closely):
        work = 0.0
    _take_back(room, n, size, work, at_first, 1.0 if settled else 0.5)
    return settled


@uncounted
def _slip(room, n, size, closely):
    """Solve without friction what is jammed, as between a plate that moves and a wall; whether that has a solution.

    Rigid bodies may have none with friction: forces along a line that lies in the cones of both its ends grow at will.
    """
    for i in range(n):
        room.limit[i, SLIDES] = room.limit[i, ROLLS] = 0.0
    begin(room, n, size)
    return settle(room, n, size, closely)


@uncounted
def _impact_alone(bodies, contacts):
    """Impact at the only contact, directly; returns False, with nothing changed, where that does not apply."""
    frame, k, before = seen_alone(0, bodies, contacts)
    e, solved, p = contacts.number[RESTITUTION, 0], True, (0.0, 0.0, 0.0)
    if before[2] < 0.0:
        solved, p = impulse_at_point(k, before, e, contacts.number[FRICTION, 0])
    if solved:
        contacts.number[TARGET, 0] = -e * min(before[2], 0.0)
        push_alone(0, bodies, contacts, frame, p)
    return solved


@uncounted
def seen_alone(i, bodies, contacts):
    """Frame of contact i, its inverse effective mass and its relative velocity, both in that frame, without others."""
    first, second = contacts.body[i, 0], contacts.body[i, 1]
    normal, arm = vector(contacts.vector[NORMAL, i]), vector(contacts.vector[ARM_SECOND, i])
    first_arm, (a, b) = vector(contacts.vector[ARM_FIRST, i]), tangents(normal)
    k = mobility(bodies.inverse_mass[second], _inverse_inertia(bodies, second), arm, a, b, normal)
    u = plus(bodies.velocity[second], 1.0, cross(bodies.spin[second], arm))
    u = difference(u, contacts.vector[VELOCITY, i])
    if first == WORLD:
        modes = contacts.modes
        for s in range(modes.velocity_loss.shape[0]):
            d, share = modes.carried[i, s], modes.inverse_mass[s]
            x, y, z = dot(d, a), dot(d, b), dot(d, normal)
            k = added(k, (share * x * x, share * x * y, share * x * z, share * y * y, share * y * z, share * z * z))
    else:
        u = difference(u, plus(bodies.velocity[first], 1.0, cross(bodies.spin[first], first_arm)))
        inverse_inertia = _inverse_inertia(bodies, first)
        k = added(k, mobility(bodies.inverse_mass[first], inverse_inertia, first_arm, a, b, normal))
    return (a, b, normal), k, (dot(a, u), dot(b, u), dot(normal, u))


@uncounted
def push_alone(i, bodies, contacts, frame, p):
    """Give contact i an impulse, and no other."""
    first, second = contacts.body[i, 0], contacts.body[i, 1]
    push = combine(p[0], frame[0], p[1], frame[1], p[2], frame[2])
    _apply(bodies, second, vector(contacts.vector[ARM_SECOND, i]), push, 1.0)
    if first != WORLD:
        _apply(bodies, first, vector(contacts.vector[ARM_FIRST, i]), push, -1.0)
    modes = contacts.modes
    for s in range(modes.velocity_loss.shape[0]):
        modes.velocity_loss[s] = modes.inverse_mass[s] * dot(modes.carried[i, s], push) if first == WORLD else 0.0
    write_to(contacts.vector[IMPULSE, i], push)
    write_to(contacts.vector[MOMENT, i], (0.0, 0.0, 0.0))


@inlined
def _apply(bodies, j, arm, push, sign):
    """Change the motion of body j by an impulse at the end of an arm."""
    add_to(bodies.velocity[j], sign * bodies.inverse_mass[j], push)
    add_to(bodies.spin[j], sign, times(_inverse_inertia(bodies, j), cross(arm, push)))


@inlined
def _inverse_inertia(bodies, j):
    m = bodies.inverse_inertia[j]
    return m[0], m[1], m[2], m[3], m[4], m[5]


@uncounted
def lay_out(bodies, contacts, n):
    """Write the equations of n contacts into the room, without impulses; returns the length of the motion."""
    room, ends, one = contacts.room, _end_of_bodies(contacts, n), _is_one_pair(contacts, n)
    for j in range(ends // 6):
        for c in range(3):
            room.motion[START, 6 * j + c] = bodies.velocity[j, c]
            room.motion[START, 6 * j + 3 + c] = bodies.spin[j, c]
    if one:
        ends = 6
        _write_relative_motion(bodies, contacts, room)
    modes = contacts.modes
    n_modes = 0 if one else modes.velocity_loss.shape[0]
    size = ends + n_modes
    for x in range(ends, size):
        room.motion[START, x] = 0.0
    for i in range(n):
        first, second, normal = contacts.body[i, 0], contacts.body[i, 1], vector(contacts.vector[NORMAL, i])
        alone = first == WORLD
        arm, first_arm = vector(contacts.vector[ARM_SECOND, i]), vector(contacts.vector[ARM_FIRST, i])
        frame, count = tangents(normal), DIRECTIONS if contacts.number[ROLLING, i] > 0.0 else FORCES
        for k in range(count):
            d = normal if k == N else frame[k % FORCES]
            _write_body(bodies, room, i, k, d, second, arm, 0, 1.0)
            room.value[KNOWN, i, k] = -dot(d, contacts.vector[VELOCITY, i]) if k < FORCES else 0.0
            if alone:
                for s in range(n_modes):
                    room.rows[i, k, 6 + s] = dot(modes.carried[i, s], d) if k < FORCES else 0.0
                    room.push[i, k, 6 + s] = modes.inverse_mass[s] * room.rows[i, k, 6 + s]
            elif one:
                _add_other(bodies, room, i, k, d, first_arm, arm)
            else:
                _write_body(bodies, room, i, k, d, first, first_arm, 6, -1.0)
        place = room.place[i]
        place[SECOND], place[OTHER] = 6 * second, ends if alone else 6 * first
        place[WIDTH], place[COUNT] = n_modes if alone else 6, count
        if one:
            place[SECOND] = place[OTHER] = place[WIDTH] = 0
        room.limit[i, SLIDES], room.limit[i, ROLLS] = contacts.number[FRICTION, i], contacts.number[ROLLING, i]
    begin(room, n, size)
    return size


@inlined
def _is_one_pair(contacts, n):
    """Whether bodies 0 and 1 touch each other alone: then their relative motion says all, with half the unknowns."""
    one = True
    for i in range(n):
        one = one and contacts.body[i, 0] == 0 and contacts.body[i, 1] == 1
    return one


@inlined
def _write_relative_motion(bodies, contacts, room):
    """Motion of the second body relative to the first, where its own centre of mass is."""
    apart = difference(contacts.vector[ARM_FIRST, 0], contacts.vector[ARM_SECOND, 0])
    v = difference(bodies.velocity[1], plus(bodies.velocity[0], 1.0, cross(bodies.spin[0], apart)))
    spin = difference(bodies.spin[1], bodies.spin[0])
    write_to(room.motion[START, :3], v)
    write_to(room.motion[START, 3:6], spin)


@inlined
def _add_other(bodies, room, i, k, d, first_arm, arm):
    """Add to what an impulse does to the relative motion of two bodies what its opposite does to the first."""
    turned = times(_inverse_inertia(bodies, 0), cross(first_arm, d) if k < FORCES else d)
    moved = cross(turned, difference(first_arm, arm))
    for c in range(3):
        room.push[i, k, c] += (bodies.inverse_mass[0] * d[c] if k < FORCES else 0.0) + moved[c]
        room.push[i, k, 3 + c] += turned[c]


@inlined
def _end_of_bodies(contacts, n):
    """Where in the motion the bodies end."""
    last = -1
    for i in range(n):
        last = max(last, contacts.body[i, 0], contacts.body[i, 1])
    return 6 * (last + 1)


@inlined
def _write_body(bodies, room, i, k, d, j, arm, at, sign):
    """How contact i moves along direction k with body j, or turns about it, and what an impulse there does to it."""
    turning = cross(arm, d) if k < FORCES else d
    turned = times(_inverse_inertia(bodies, j), turning)
    for c in range(3):
        room.rows[i, k, at + c] = sign * d[c] if k < FORCES else 0.0
        room.rows[i, k, at + 3 + c] = sign * turning[c]
        room.push[i, k, at + c] = bodies.inverse_mass[j] * room.rows[i, k, at + c]
        room.push[i, k, at + 3 + c] = sign * turned[c]


@uncounted
def work_of(room, n, closely):
    """Work of all impulses in the frame of the contacts [J], the energy they create.

    Also the work that they would do if they changed no velocity, and what the accuracy of the solution leaves unknown.
    """
    total = size = at_first = pushes = 0.0
    for i in range(n):
        for k in range(room.place[i, COUNT]):
            p, before = room.value[IMPULSES, i, k], room.value[BEFORE, i, k]
            total += 0.5 * p * (before + relative(room, i, k))
            size += abs(p * before)
            at_first += p * before
            pushes += abs(p) if k < FORCES else 0.0
    return total, at_first, ROUND_OFF * size + pushes * accuracy(room, n, closely)[0]


@uncounted
def _take_back(room, n, size, work, at_first, part):
    """Lower all impulses, if they create energy: to a share that creates none, or to part of it.

    A trace is taken back whole (1); half of that share leaves the least energy, if impulses obey not all laws.
    """
    if work > max(at_first, 0.0):
        share = part * max(-at_first, 0.0) / (work - at_first)
        for i in range(n):
            for k in range(room.place[i, COUNT]):
                room.value[IMPULSES, i, k] *= share
        make_motion(room, n, size)


@uncounted
def write_out(bodies, contacts, n):
    """Velocities, impulses and moments, from the room."""
    room, ends = contacts.room, _end_of_bodies(contacts, n)
    for i in range(n):
        p, normal = room.value[IMPULSES, i], vector(contacts.vector[NORMAL, i])
        a, b = tangents(normal)
        rolling = room.place[i, COUNT] > FORCES
        write_to(contacts.vector[IMPULSE, i], combine(p[A], a, p[B], b, p[N], normal))
        moment = combine(p[FORCES], a, p[FORCES + 1], b, 0.0, normal) if rolling else (0.0, 0.0, 0.0)
        write_to(contacts.vector[MOMENT, i], moment)
    if _is_one_pair(contacts, n):
        for i in range(n):
            push, moment = vector(contacts.vector[IMPULSE, i]), vector(contacts.vector[MOMENT, i])
            for j in range(2):
                arm, sign = vector(contacts.vector[ARM_FIRST if j == 0 else ARM_SECOND, i]), 2.0 * j - 1.0
                _apply(bodies, j, arm, push, sign)
                add_to(bodies.spin[j], sign, times(_inverse_inertia(bodies, j), moment))
        return
    for j in range(ends // 6):
        for c in range(3):
            bodies.velocity[j, c] = room.motion[NOW, 6 * j + c]
            bodies.spin[j, c] = room.motion[NOW, 6 * j + 3 + c]
    for s in range(contacts.modes.velocity_loss.shape[0]):
        contacts.modes.velocity_loss[s] = room.motion[NOW, ends + s]
