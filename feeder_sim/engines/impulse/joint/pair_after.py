"""The contact of a pair as it will be after a time of forces: its points and its normal turn with the parts.

An axis turns with the face that it is normal to, with both of two edges, or with the centre of a ball as an edge, a
corner or another ball sees it.
The forces act in the middle of the time, and at its end no point approaches, which makes the order the second.
"""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.contact_problem import ARM_FIRST, ARM_SECOND, NORMAL, VELOCITY
from feeder_sim.engines.impulse.fixed import motion_at
from feeder_sim.engines.impulse.joint.members import gather_pair, is_fixture
from feeder_sim.engines.impulse.pairs.separating_axis import BALL, CENTRES, CLOSEST, EDGES, FACE_OF_FIRST
from feeder_sim.engines.impulse.vectors import combine, cross, difference, dot, plus, times, vector, write_to
from feeder_sim.machine_code import inlined, uncounted

NOTHING = (0.0, 0.0, 0.0)


@uncounted
def gather_pair_after(c, x, y, t, time, crowd, surface, together):
    """As `gather_pair`, for forces from time t on that last a time [s]."""
    gather_pair(c, x, y, crowd, together)
    pair, contacts, bodies = (
        crowd.pairs[crowd.islands.pair[together.pair[x]]],
        together.work.contacts,
        together.work.bodies,
    )
    a, b = crowd.parts[pair.a], crowd.parts[pair.b]
    if is_fixture(pair.b, crowd):
        _gather_fixture_after(c, x, t, time, crowd, surface, together)
        return
    if together.origin[x] == CLOSEST:
        return
    first, second = together.body[pair.a], together.body[pair.b]
    spins = _mean_spin(first, a, bodies), _mean_spin(second, b, bodies)
    balls = _is_ball(crowd.kinds.piece[pair.piece_a]), _is_ball(crowd.kinds.piece[pair.piece_b])
    motion = difference(b.position, a.position), difference(b.velocity, a.velocity), spins, balls
    now = (
        vector(contacts.vector[ARM_FIRST, c]),
        vector(contacts.vector[ARM_SECOND, c]),
        vector(contacts.vector[NORMAL, c]),
    )
    along = vector(together.along[x, 0]), vector(together.along[x, 1])
    middle = _after(0.5 * time, together.origin[x], now, along, motion)
    end = _after(time, together.origin[x], now, along, motion)
    write_to(contacts.vector[ARM_FIRST, c], middle[0])
    write_to(contacts.vector[ARM_SECOND, c], middle[1])
    write_to(contacts.vector[NORMAL, c], middle[2])
    w_a, w_b = vector(bodies.spin[first]), vector(bodies.spin[second])
    further = difference(cross(w_b, difference(end[1], middle[1])), cross(w_a, difference(end[0], middle[0])))
    u = plus(bodies.velocity[second], 1.0, cross(w_b, end[1]))
    u = difference(u, plus(bodies.velocity[first], 1.0, cross(w_a, end[0])))
    turned = plus(further, dot(difference(end[2], middle[2]), u), middle[2])
    write_to(contacts.vector[VELOCITY, c], plus(NOTHING, -1.0, turned))


@uncounted
def _gather_fixture_after(c, x, t, time, crowd, surface, together):
    """Contact c of pair x, with a fixture that moves on, as it will be after a time of forces."""
    pair, origin = crowd.pairs[crowd.islands.pair[together.pair[x]]], together.origin[x]
    contacts, bodies = together.work.contacts, together.work.bodies
    a, b = crowd.parts[pair.a], crowd.parts[pair.b]
    body, arm = contacts.body[c, 1], vector(contacts.vector[ARM_SECOND, c])
    velocity, spin = motion_at(b, t + time, surface)
    there = plus(difference(a.position, b.position), 1.0, arm)
    if origin == CLOSEST:
        write_to(contacts.vector[VELOCITY, c], plus(velocity, 1.0, cross(spin, there)))
        return
    spins = _mean_spin(body, a, bodies), combine(0.5, spin, 0.5, b.momentum, 0.0, NOTHING)
    closing = difference(combine(0.5, velocity, 0.5, b.velocity, 0.0, NOTHING), a.velocity)
    balls = _is_ball(crowd.kinds.piece[pair.piece_a]), False
    motion = difference(b.position, a.position), closing, spins, balls
    now = arm, there, vector(pair.axis)
    along = vector(together.along[x, 0]), vector(together.along[x, 1])
    middle = _after(0.5 * time, origin, now, along, motion)
    end = _after(time, origin, now, along, motion)
    w = vector(bodies.spin[body])
    further = difference(cross(spin, difference(end[1], middle[1])), cross(w, difference(end[0], middle[0])))
    u = plus(velocity, 1.0, cross(spin, end[1]))
    u = difference(u, plus(bodies.velocity[body], 1.0, cross(w, end[0])))
    turned = plus(further, dot(difference(end[2], middle[2]), u), middle[2])
    write_to(contacts.vector[ARM_SECOND, c], middle[0])
    write_to(contacts.vector[NORMAL, c], plus(NOTHING, -1.0, middle[2]))
    write_to(contacts.vector[VELOCITY, c], plus(plus(velocity, 1.0, cross(spin, middle[1])), 1.0, turned))


@inlined
def _is_ball(piece):
    return piece.corner_to - piece.corner_from == 1


@inlined
def _mean_spin(k, part, bodies):
    """Spin of member k [rad/s], in the mean of now and of what it will be without contact."""
    return combine(0.5, bodies.spin[k], 0.5, times(bodies.inverse_inertia[k], part.momentum), 0.0, NOTHING)


@uncounted
def _after(t, origin, now, along, motion):
    """Arms [m] and normal after a time t [s]; motion: the second centre from the first [m], its velocity, spins."""
    (arm_a, arm_b, normal), (apart, velocity, (w_a, w_b), (ball_a, ball_b)) = now, motion
    apart = plus(apart, t, velocity)
    if origin == CENTRES:
        normal = _unit(apart)
        size_a, size_b = math.sqrt(dot(arm_a, arm_a)), math.sqrt(dot(arm_b, arm_b))
        return plus(NOTHING, size_a, normal), plus(NOTHING, -size_b, normal), normal
    if origin == EDGES:
        d, e = _turn(along[0], w_a, t), _turn(along[1], w_b, t)
        across = _unit(cross(d, e))
        normal = across if dot(across, normal) > 0.0 else plus(NOTHING, -1.0, across)
        # Where the edges, through what has been their contact, are closest: p + s d and q + r e.
        p, q = _turn(arm_a, w_a, t), plus(apart, 1.0, _turn(arm_b, w_b, t))
        dd, de, ee, pq = dot(d, d), dot(d, e), dot(e, e), difference(q, p)
        s = (dot(pq, d) * ee - dot(pq, e) * de) / (dd * ee - de * de)
        arm_a = plus(plus(p, s, d), 0.5 * dot(pq, normal), normal)
        return arm_a, difference(arm_a, apart), normal
    if origin == BALL:
        p, edge = plus(apart, 1.0, _turn(arm_b, w_b, t)), _turn(along[0], w_b, t)
        centre, sign = NOTHING, 1.0
        if ball_b:
            p, edge, centre, sign = _turn(arm_a, w_a, t), _turn(along[0], w_a, t), apart, -1.0
        p = plus(p, dot(difference(centre, p), edge), edge)
        normal = _unit(difference(p, centre))
        return p, difference(p, apart), plus(NOTHING, sign, normal)
    if origin == FACE_OF_FIRST:
        normal = _turn(normal, w_a, t)
        arm_b = plus(NOTHING, -math.sqrt(dot(arm_b, arm_b)), normal) if ball_b else _turn(arm_b, w_b, t)
        return plus(apart, 1.0, arm_b), arm_b, normal
    normal = _turn(normal, w_b, t)
    arm_a = plus(NOTHING, math.sqrt(dot(arm_a, arm_a)), normal) if ball_a else _turn(arm_a, w_a, t)
    return arm_a, difference(arm_a, apart), normal


@inlined
def _turn(v, spin, t):
    """A vector after a time t [s] in which it turns, to the second order."""
    moved = cross(spin, v)
    return plus(plus(v, t, moved), 0.5 * t * t, cross(spin, moved))


@inlined
def _unit(v):
    return combine(1.0 / math.sqrt(dot(v, v)), v, 0.0, v, 0.0, v)
