"""Laws of impact on the plate by choice, as in impulse/impact_law.py, for the rows of the engine of one part."""

from __future__ import annotations

from numba.extending import overload

from feeder_sim.engines.impulse.contact_problem import ARM_SECOND, FRICTION, NORMAL, RESTITUTION, VELOCITY
from feeder_sim.engines.impulse.impact_law import falling_restitution, resolve_ball, zener_restitution
from feeder_sim.engines.impulse.single_impact import resolve_free
from feeder_sim.engines.impulse.state import EXPONENT, TANGENTIAL, ZENER, inverse_inertia
from feeder_sim.engines.impulse.vectors import vector
from feeder_sim.machine_code import inlined


def restitution_at(kind, speed):
    """Coefficient of restitution on the plate at a normal approach speed [m/s]."""
    raise NotImplementedError("for compiled code only")


def hit_alone(part, kind, work):
    """Impact at the only contact; whether the direct solution applies, else nothing is changed."""
    raise NotImplementedError("for compiled code only")


@overload(restitution_at)
def _restitution_by_kind(kind, speed):
    if EXPONENT in kind.fields:
        return lambda kind, speed: falling_restitution(
            kind.restitution[0], kind.restitution_exponent, kind.restitution_speed, speed
        )
    if ZENER in kind.fields:
        return lambda kind, speed: zener_restitution(kind.zener_inelasticity, kind.zener_table, speed)
    return lambda kind, speed: kind.restitution[0]


@overload(hit_alone)
def _hit_by_kind(part, kind, work):
    if TANGENTIAL in kind.fields:
        return lambda part, kind, work: _hit_ball(part, kind, work)
    return lambda part, kind, work: _hit(part, kind, work)


@inlined
def _hit(part, kind, work):
    vectors, numbers = work.contacts.vector, work.contacts.number
    arm, normal, velocity = vector(vectors[ARM_SECOND, 0]), vector(vectors[NORMAL, 0]), vector(vectors[VELOCITY, 0])
    e, mu, turns = numbers[RESTITUTION, 0], numbers[FRICTION, 0], inverse_inertia(part, kind)
    return resolve_free(part, 1.0 / kind.mass, turns, arm, normal, velocity, e, mu)


@inlined
def _hit_ball(part, kind, work):
    vectors, numbers = work.contacts.vector, work.contacts.number
    arm, normal, velocity = vector(vectors[ARM_SECOND, 0]), vector(vectors[NORMAL, 0]), vector(vectors[VELOCITY, 0])
    law = numbers[RESTITUTION, 0], numbers[FRICTION, 0], kind.tangential_restitution
    return resolve_ball(part, 1.0 / kind.mass, inverse_inertia(part, kind), arm, normal, velocity, law)
