"""Laws of impact by choice: restitution that depends on the speed, Poisson's, a tangential one for balls, one's own.

Marks in the records of the kinds say which of them a scene has (state.py). Without a mark each function here is a
look-up of a constant, or a call of the usual law, and nothing else is compiled.

    power of the speed    e = min(1, e0 (v / v0)^-p), v the normal approach speed of the impact
    Zener                 e(lambda), lambda = (inelasticity at 1 m/s) v^(1/5), from a table (feeder_sim/plate/zener.py)
    tangential            u_t' = -beta u_t, unless that takes more than mu times the normal impulse: then it slides
                          (Walton 1993; Foerster, Louge, Chang and Allia, Phys. Fluids 6 (1994) 1108)
    Poisson               an impulse of restitution that is e times that of compression (poisson.py)
    one's own             a function of another package (own_law.py)
"""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.contact_problem import impact
from feeder_sim.engines.impulse.own_law import law_of_mark, own_impact, own_impulse
from feeder_sim.engines.impulse.poisson import poisson_impact, poisson_impulse
from feeder_sim.engines.impulse.single_impact import (
    added,
    mobility,
    resolve_free,
    resolve_single,
    tangents,
    velocity_of_point,
)
from feeder_sim.engines.impulse.state import EXPONENT, POISSON, TANGENTIAL, ZENER, inverse_inertia
from feeder_sim.engines.impulse.vectors import add_to, combine, cross, difference, dot
from feeder_sim.machine_code import compiled, inlined, overload
from feeder_sim.plate.zener import TABLE_STEP

ON_PLATE, BETWEEN_PARTS = range(2)  # of restitution and friction
SLOWEST = 1e-12  # [m/s]; for what does not approach


def restitution_at(kind, law, speed):
    """Coefficient of restitution at a normal approach speed [m/s]; law: see `ON_PLATE`."""
    raise NotImplementedError("for compiled code only")


def restitution_on_plate(part, kind, arm, normal, velocity):
    """Coefficient of restitution of an impact at the end of an arm, on a surface of this normal and velocity [m/s]."""
    raise NotImplementedError("for compiled code only")


def restitution_of_pair(a, b, kind, law, inverse_inertias, arms, normal):
    """The same of two parts that meet, the kind being that of the first; law: 0 at what stands, 1 between parts."""
    raise NotImplementedError("for compiled code only")


def largest_restitution(kind):
    """No impact on the plate has more restitution than this [1]."""
    raise NotImplementedError("for compiled code only")


def hit_plate(part, kind, inverse_mass, turns, arm, normal, velocity, law):
    """Impact of a part at one point of a surface, as `resolve_free`; law: restitution and friction."""
    raise NotImplementedError("for compiled code only")


def hit_part(a, b, kind, inverse_mass, inverse_inertias, arms, normal, law):
    """Impact of two parts at one point, as `resolve_single`; law: restitution and friction."""
    raise NotImplementedError("for compiled code only")


def impact_by_law(kind, bodies, contacts, n, closely, near):
    """Impacts at several points at once, as `impact`."""
    raise NotImplementedError("for compiled code only")


def impulse_by_law(kind, k, u, e, mu):
    """Impulse of one point by a law other than the usual one, as `impulse_at_point`."""
    raise NotImplementedError("for compiled code only")


@overload(restitution_at)
def _restitution_by_kind(kind, law, speed):
    if EXPONENT in kind.fields:
        return lambda kind, law, speed: falling_restitution(
            kind.restitution[law], kind.restitution_exponent, kind.restitution_speed, speed
        )
    if ZENER in kind.fields:
        return lambda kind, law, speed: zener_restitution(kind.zener_inelasticity, kind.zener_table, speed)
    return lambda kind, law, speed: kind.restitution[law]


@overload(restitution_on_plate)
def _on_plate_by_kind(part, kind, arm, normal, velocity):
    if EXPONENT in kind.fields or ZENER in kind.fields:
        return lambda part, kind, arm, normal, velocity: restitution_at(
            kind, ON_PLATE, _approach(part, kind, arm, normal, velocity)
        )
    return lambda part, kind, arm, normal, velocity: kind.restitution[0]


@overload(restitution_of_pair)
def _of_pair_by_kind(a, b, kind, law, inverse_inertias, arms, normal):
    if EXPONENT in kind.fields:
        return lambda a, b, kind, law, inverse_inertias, arms, normal: restitution_at(
            kind, law, _approach_of_pair(a, b, inverse_inertias, arms, normal)
        )
    return lambda a, b, kind, law, inverse_inertias, arms, normal: kind.restitution[law]


@overload(largest_restitution)
def _largest_by_kind(kind):
    if EXPONENT in kind.fields or POISSON in kind.fields or law_of_mark(kind.fields) is not None:
        return lambda kind: 1.0
    return lambda kind: kind.restitution[0]


@overload(hit_plate)
def _hit_plate_by_kind(part, kind, inverse_mass, turns, arm, normal, velocity, law):
    if has_own_impulse(kind.fields):
        return lambda part, kind, inverse_mass, turns, arm, normal, velocity, law: push_off_plate(
            part, kind, inverse_mass, turns, arm, normal, velocity, law
        )
    return lambda part, kind, inverse_mass, turns, arm, normal, velocity, law: resolve_free(
        part, inverse_mass, turns, arm, normal, velocity, law[0], law[1]
    )


@overload(hit_part)
def _hit_part_by_kind(a, b, kind, inverse_mass, inverse_inertias, arms, normal, law):
    if has_own_impulse(kind.fields):
        return lambda a, b, kind, inverse_mass, inverse_inertias, arms, normal, law: push_apart(
            a, b, kind, inverse_mass, inverse_inertias, arms, normal, law
        )
    return lambda a, b, kind, inverse_mass, inverse_inertias, arms, normal, law: resolve_single(
        a, b, inverse_mass, inverse_inertias, arms, normal, law[0], law[1]
    )


@overload(impact_by_law)
def _impact_by_kind(kind, bodies, contacts, n, closely, near):
    if law_of_mark(kind.fields) is not None:
        return lambda kind, bodies, contacts, n, closely, near: own_impact(kind, bodies, contacts, n, closely, near)
    if POISSON in kind.fields:
        return lambda kind, bodies, contacts, n, closely, near: poisson_impact(bodies, contacts, n, closely, near)
    return lambda kind, bodies, contacts, n, closely, near: impact(bodies, contacts, n, closely, near)


@overload(impulse_by_law)
def _impulse_by_kind(kind, k, u, e, mu):
    if law_of_mark(kind.fields) is not None:
        return lambda kind, k, u, e, mu: (True, own_impulse(kind, k, u, e, mu))
    if POISSON in kind.fields:
        return lambda kind, k, u, e, mu: poisson_impulse(k, u, e, mu)
    return lambda kind, k, u, e, mu: (True, ball_impulse(k, u, e, mu, kind.tangential_restitution))


def has_own_impulse(fields):
    """Whether records with such fields ask for another impulse at one point than the usual one."""
    return TANGENTIAL in fields or POISSON in fields or law_of_mark(fields) is not None


@inlined
def _approach(part, kind, arm, normal, velocity):
    """Normal speed at which the end of an arm approaches a surface [m/s]."""
    return -dot(normal, difference(velocity_of_point(part, inverse_inertia(part, kind), arm), velocity))


@inlined
def _approach_of_pair(a, b, inverse_inertias, arms, normal):
    """Normal speed at which two parts approach each other at the ends of their arms [m/s]."""
    of_a = velocity_of_point(a, inverse_inertias[0], arms[0])
    return -dot(normal, difference(velocity_of_point(b, inverse_inertias[1], arms[1]), of_a))


@compiled
def falling_restitution(at_speed, exponent, reference, speed):
    """Restitution that falls with the speed by a power, at most 1; at_speed: what it is at the reference [m/s]."""
    return min(1.0, at_speed * (max(speed, SLOWEST) / reference) ** -exponent)


@compiled
def zener_restitution(inelasticity, table, speed):
    """Restitution of a ball by Zener's theory; inelasticity: at 1 m/s; table: log e over log(1 + lambda)."""
    place = math.log1p(inelasticity * max(speed, SLOWEST) ** 0.2) / TABLE_STEP
    i = min(int(place), table.shape[0] - 2)  # beyond its end e is below 1e-9
    return math.exp(table[i] + (place - i) * (table[i + 1] - table[i]))


@compiled
def push_off_plate(part, kind, inverse_mass, inverse_inertia, arm, normal, surface_velocity, law):
    """As `resolve_free`, with `impulse_by_law`; law: restitution and friction."""
    u = difference(velocity_of_point(part, inverse_inertia, arm), surface_velocity)
    a, b = tangents(normal)
    k = mobility(inverse_mass, inverse_inertia, arm, a, b, normal)
    solved, p = impulse_by_law(kind, k, (dot(a, u), dot(b, u), dot(normal, u)), law[0], law[1])
    if solved:
        push = combine(p[0], a, p[1], b, p[2], normal)
        add_to(part.velocity, inverse_mass, push)
        add_to(part.momentum, 1.0, cross(arm, push))
    return solved


@compiled
def push_apart(a, b, kind, inverse_mass, inverse_inertia, arms, normal, law):
    """As `resolve_single`, with `impulse_by_law`; law: restitution and friction."""
    velocity_a = velocity_of_point(a, inverse_inertia[0], arms[0])
    u = difference(velocity_of_point(b, inverse_inertia[1], arms[1]), velocity_a)
    if dot(normal, u) >= 0.0:
        return False
    s, t = tangents(normal)
    k = added(
        mobility(inverse_mass[0], inverse_inertia[0], arms[0], s, t, normal),
        mobility(inverse_mass[1], inverse_inertia[1], arms[1], s, t, normal),
    )
    _, p = impulse_by_law(kind, k, (dot(s, u), dot(t, u), dot(normal, u)), law[0], law[1])
    push = combine(p[0], s, p[1], t, p[2], normal)
    add_to(a.velocity, -inverse_mass[0], push)
    add_to(a.momentum, -1.0, cross(arms[0], push))
    if inverse_mass[1] > 0.0:
        add_to(b.velocity, inverse_mass[1], push)
        add_to(b.momentum, 1.0, cross(arms[1], push))
    return True


@inlined
def ball_impulse(k, u, e, mu, beta):
    """Impulse of a ball, whose normal and tangential motions do not act on each other; neither can create energy."""
    pressed = max(0.0, -(1.0 + e) * u[2] / k[5])
    along, across = -(1.0 + beta) * u[0] / k[0], -(1.0 + beta) * u[1] / k[3]
    size, limit = math.sqrt(along * along + across * across), mu * pressed
    shrink = limit / size if size > limit else 1.0
    return shrink * along, shrink * across, pressed
