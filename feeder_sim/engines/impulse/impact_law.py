"""Laws of impact by choice: restitution that depends on the speed, and a tangential one for balls.

Marks in the records of the kinds say which of them a scene has (state.py). Without a mark each function here is a
look-up of a constant, or a call of the usual law, and nothing else is compiled.

    power of the speed    e = min(1, e0 (v / v0)^-p), v the normal approach speed of the impact
    Zener                 e(lambda), lambda = (inelasticity at 1 m/s) v^(1/5), from a table (feeder_sim/plate/zener.py)
    tangential            u_t' = -beta u_t, unless that takes more than mu times the normal impulse: then it slides
                          (Walton 1993; Foerster, Louge, Chang and Allia, Phys. Fluids 6 (1994) 1108)
"""

from __future__ import annotations

import math

from numba.extending import overload

from feeder_sim.engines.impulse.contact_problem import (
    ARM_FIRST,
    ARM_SECOND,
    FRICTION,
    NORMAL,
    RESTITUTION,
    ROLLING,
    VELOCITY,
)
from feeder_sim.engines.impulse.single_impact import added, mobility, resolve_free, tangents, velocity_of_point
from feeder_sim.engines.impulse.state import EXPONENT, RATE, TANGENTIAL, ZENER, E, inverse_inertia
from feeder_sim.engines.impulse.vectors import add_to, combine, cross, difference, dot, vector
from feeder_sim.machine_code import compiled, inlined
from feeder_sim.plate.zener import TABLE_STEP

SLOWEST = 1e-12  # [m/s]; for what does not approach
OF_PLATE, OF_PARTS = 0, 1  # of a restitution
PAIR = -2.0  # in place of a restitution in the row of a point: that of parts among each other


def restitution_at(part, kind, row):
    """Coefficient of restitution at a point that approaches; `row` of `Scratch.point`."""
    raise NotImplementedError("for compiled code only")


def largest_restitution(kind):
    """No impact on the plate has more restitution than this [1]."""
    raise NotImplementedError("for compiled code only")


def hit_alone(parts, kinds, work):
    """Impact at the only contact of a group, where it has a solution of its own; whether it has."""
    raise NotImplementedError("for compiled code only")


@overload(restitution_at)
def _restitution_by_kind(part, kind, row):
    falls, zener = EXPONENT in kind.fields, ZENER in kind.fields

    def restitution(part, kind, row):
        if row[E] >= 0.0:
            return row[E]
        law = OF_PARTS if row[E] == PAIR else OF_PLATE
        e = kind.restitution[law]
        if falls:
            e = falling_restitution(e, kind.restitution_exponent, kind.restitution_speed, -row[RATE])
        elif zener:
            e = e if law == OF_PARTS else _zener_restitution(kind.zener_inelasticity, kind.zener_table, -row[RATE])
        return e

    if zener:
        return restitution
    if falls:

        def falling(part, kind, row):
            if row[E] >= 0.0:
                return row[E]
            e = kind.restitution[OF_PARTS if row[E] == PAIR else OF_PLATE]
            return falling_restitution(e, kind.restitution_exponent, kind.restitution_speed, -row[RATE])

        return falling
    return lambda part, kind, row: row[E] if row[E] >= 0.0 else kind.restitution[1 if row[E] == PAIR else 0]


@overload(largest_restitution)
def _largest_by_kind(kind):
    if EXPONENT in kind.fields:
        return lambda kind: 1.0
    return lambda kind: kind.restitution[0]


@overload(hit_alone)
def _hit_by_kind(parts, kinds, work):
    if TANGENTIAL in kinds.types[kinds.fields.index("record")].dtype.fields:
        return lambda parts, kinds, work: _hit_balls(parts, kinds, work)
    return lambda parts, kinds, work: _hit_plate(parts, kinds, work)


@inlined
def _hit_plate(parts, kinds, work):
    """The point of a part on the plate or a wall, by far the most frequent case."""
    vectors, numbers = work.contacts.vector, work.contacts.number
    if work.contacts.body[0, 0] >= 0 or numbers[ROLLING, 0] > 0.0:
        return False
    part = parts[work.group[work.contacts.body[0, 1]]]
    kind = kinds.record[part.kind]
    arm, normal, velocity = vectors[ARM_SECOND, 0], vectors[NORMAL, 0], vectors[VELOCITY, 0]
    e, mu = numbers[RESTITUTION, 0], numbers[FRICTION, 0]
    turns = inverse_inertia(part, kind)
    return resolve_free(part, 1.0 / kind.mass, turns, vector(arm), vector(normal), vector(velocity), e, mu)


@compiled
def _hit_balls(parts, kinds, work):
    vectors, numbers, body = work.contacts.vector, work.contacts.number, work.contacts.body
    part = parts[work.group[body[0, 1]]]
    kind = kinds.record[part.kind]
    arm, normal, velocity = vector(vectors[ARM_SECOND, 0]), vector(vectors[NORMAL, 0]), vector(vectors[VELOCITY, 0])
    law = numbers[RESTITUTION, 0], numbers[FRICTION, 0], kind.tangential_restitution
    turns = inverse_inertia(part, kind)
    if body[0, 0] < 0:
        return resolve_ball(part, 1.0 / kind.mass, turns, arm, normal, velocity, law)
    other = parts[work.group[body[0, 0]]]
    kind_of_other = kinds.record[other.kind]
    masses, inertias = (1.0 / kind_of_other.mass, 1.0 / kind.mass), (inverse_inertia(other, kind_of_other), turns)
    return _resolve_balls(other, part, masses, inertias, (vector(vectors[ARM_FIRST, 0]), arm), normal, law)


@compiled
def falling_restitution(at_speed, exponent, reference, speed):
    """Restitution that falls with the speed by a power, at most 1; at_speed: what it is at the reference [m/s]."""
    return min(1.0, at_speed * (max(speed, SLOWEST) / reference) ** -exponent)


@compiled
def _zener_restitution(inelasticity, table, speed):
    """Restitution of a ball by Zener's theory; inelasticity: at 1 m/s; table: log e over log(1 + lambda)."""
    place = math.log1p(inelasticity * max(speed, SLOWEST) ** 0.2) / TABLE_STEP
    i = min(int(place), table.shape[0] - 2)  # beyond its end e is below 1e-9
    return math.exp(table[i] + (place - i) * (table[i + 1] - table[i]))


@compiled
def resolve_ball(part, inverse_mass, inverse_inertia, arm, normal, surface_velocity, law):
    """As `resolve_free`, of a ball with tangential restitution; law: restitution, friction, tangential restitution."""
    u = difference(velocity_of_point(part, inverse_inertia, arm), surface_velocity)
    a, b = tangents(normal)
    k = mobility(inverse_mass, inverse_inertia, arm, a, b, normal)
    p = _ball_impulse(k, (dot(a, u), dot(b, u), dot(normal, u)), law)
    push = combine(p[0], a, p[1], b, p[2], normal)
    add_to(part.velocity, inverse_mass, push)
    add_to(part.momentum, 1.0, cross(arm, push))
    return True


@compiled
def _resolve_balls(a, b, inverse_mass, inverse_inertia, arms, normal, law):
    """As `resolve_single`, of two balls, or a ball and a wall, with the law of `resolve_ball`."""
    velocity_a = velocity_of_point(a, inverse_inertia[0], arms[0])
    u = difference(velocity_of_point(b, inverse_inertia[1], arms[1]), velocity_a)
    if dot(normal, u) >= 0.0:
        return False
    s, t = tangents(normal)
    k = added(
        mobility(inverse_mass[0], inverse_inertia[0], arms[0], s, t, normal),
        mobility(inverse_mass[1], inverse_inertia[1], arms[1], s, t, normal),
    )
    p = _ball_impulse(k, (dot(s, u), dot(t, u), dot(normal, u)), law)
    push = combine(p[0], s, p[1], t, p[2], normal)
    add_to(a.velocity, -inverse_mass[0], push)
    add_to(a.momentum, -1.0, cross(arms[0], push))
    if inverse_mass[1] > 0.0:
        add_to(b.velocity, inverse_mass[1], push)
        add_to(b.momentum, 1.0, cross(arms[1], push))
    return True


@inlined
def _ball_impulse(k, u, law):
    """Impulse of a ball, whose normal and tangential motions do not act on each other; neither can create energy."""
    e, mu, beta = law
    pressed = max(0.0, -(1.0 + e) * u[2] / k[5])
    along, across = -(1.0 + beta) * u[0] / k[0], -(1.0 + beta) * u[1] / k[3]
    size, limit = math.sqrt(along * along + across * across), mu * pressed
    shrink = limit / size if size > limit else 1.0
    return shrink * along, shrink * across, pressed
