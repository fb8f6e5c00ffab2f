"""Impacts of the part on the plate, and which of its bounces are summed (docs/contact.md).

A point that touches and approaches gets an impulse, together with all others that touch (contact_problem.py); again at
zero time until none approaches. Where bounces pile up within a time in which the change of the surface's acceleration,
J, moves it by less than the tolerance, J T^3 / 6 < tolerance, a point does not rebound: it stays.
"""

from __future__ import annotations

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.contact_problem import ARM_SECOND, FRICTION, NORMAL, RESTITUTION, VELOCITY, meet_world
from feeder_sim.engines.impulse.free_part.leap import twist_of
from feeder_sim.engines.impulse.free_part.points import move_points, touches
from feeder_sim.engines.impulse.free_part.walls import leans, restitution_of_wall, walled
from feeder_sim.engines.impulse.impact import resolve_impact
from feeder_sim.engines.impulse.impact_law import ON_PLATE, hit_plate, restitution_at
from feeder_sim.engines.impulse.scratch import ON_WALL
from feeder_sim.engines.impulse.state import inverse_inertia
from feeder_sim.engines.impulse.vectors import plus, vector, write_to
from feeder_sim.engines.noise import half_normal
from feeder_sim.machine_code import inlined

ROUNDS = 20  # of impacts at zero time; after them what still approaches does so without rebound
LONGEST_CHATTER = 3e-5  # [s] of bounces that are summed where nothing moves: hops of a nanometre
TOGETHER = 10.0  # tolerances; points this close hit together, so that a flat landing is one impact and not six
JAMMED = 5e-4  # [s]; for which a part slips that no impact with friction frees
DOWN = (0.0, 0.0, -1.0)


@inlined
def chatter_time(push, twist, bounds):
    """Time [s] of bounces that are summed: the change of an acceleration moves a point by less than the tolerance.

    push: the largest of the surface [m/s^2]; twist: see `RemainderBounds`.
    """
    jerk, longest = push * bounds.rate + twist, LONGEST_CHATTER
    if 6.0 * bounds.exact.tolerance < jerk * longest * longest * longest:
        return np.cbrt(6.0 * bounds.exact.tolerance / jerk)
    return longest


@inlined
def load_part(part, kind, turning, time, work):
    """Motion of the part as it will be after a time [s] without contact, and its inertia."""
    bodies, turns = work.bodies, inverse_inertia(part, kind)
    bodies.inverse_mass[0] = 1.0 / kind.mass
    for c in range(6):
        bodies.inverse_inertia[0, c] = turns[c]
    write_to(bodies.spin[0], plus(turning.spin, time, turning.change))
    write_to(bodies.velocity[0], plus(part.velocity, GRAVITY * time, DOWN))


@inlined
def gather(i, m, restitution, kind, work):
    """Make point i contact m, of body 0."""
    point, contacts = work.point[i], work.contacts
    place = vector(point.arm), vector(point.normal), vector(point.surface_velocity)
    rolling = kind.rolling if point.sort != ON_WALL else 0.0
    meet_world(m, contacts, 0, place, (restitution, point.friction, rolling))
    work.point_of[m] = i


@inlined
def strike(free, seen, rebounds, plate):
    """Impacts at all points that touch, until none approaches; returns how the part turns after them.

    rebounds: False where nothing may bounce.
    """
    part, kind, work = free.parts[0], free.kinds.record[free.parts[0].kind], free.work
    turning, bounds = seen.turning, plate.bounds
    for rounds in range(ROUNDS + 1):
        m, approaches = gather_touching(kind, seen.n, 0, rebounds and rounds < ROUNDS, plate, turning, work)
        if not approaches:
            break
        alone = m == 1 and work.point[work.point_of[0]].sort != ON_WALL and kind.rolling == 0.0
        if not (alone and _hit(part, kind, work)):
            jams = walled(plate) and leans(seen.n, TOGETHER * bounds.exact.tolerance, work)
            if not resolve_impact(free.parts, free.kinds, 1, m, (0.0, 0.0 if jams else bounds.exact.approach), work):
                part.jammed = part.clock + JAMMED
        scatter(part, 0, m, bounds, work)
        turning = move_points(part, kind, plate, seen.n, work)
    return turning


@inlined
def _hit(part, kind, work):
    """Impact at the only contact; whether the direct solution applies, else nothing is changed."""
    vectors, law = work.contacts.vector, (work.contacts.number[RESTITUTION, 0], work.contacts.number[FRICTION, 0])
    arm, normal, velocity = vector(vectors[ARM_SECOND, 0]), vector(vectors[NORMAL, 0]), vector(vectors[VELOCITY, 0])
    return hit_plate(part, kind, 1.0 / kind.mass, inverse_inertia(part, kind), arm, normal, velocity, law)


@inlined
def gather_touching(kind, n, m, rebounds, plate, turning, work):
    """Make all points that are as good as touching, and do not leave, contacts from m on; returns where they end.

    And whether one of them touches and approaches.
    """
    approaches, twist, bounds = False, twist_of(kind, turning), plate.bounds
    for i in range(n):
        point = work.point[i]
        if point.rate > bounds.exact.approach or not touches(point, TOGETHER * bounds.exact.tolerance):
            continue
        approaches = approaches or (point.rate < -bounds.exact.approach and point.gap <= bounds.exact.touch)
        e = 0.0
        if rebounds:
            e = restitution_at(kind, ON_PLATE, -point.rate)
            if point.sort == ON_WALL:
                e = restitution_of_wall(plate, kind, -point.rate)
        departure = 0.5 * chatter_time(point.most_push, twist, bounds) * (1.0 - e) * max(point.closing, 0.0)
        if -e * point.rate <= departure or (e < 1.0 and _sinks(point, e, bounds)):
            e = 0.0  # what is left of its bounces is summed: they take what the plate pushes meanwhile
        gather(i, m, e, kind, work)
        m += 1
    return m, approaches


@inlined
def _sinks(point, e, bounds):
    """Whether bounces of a point inside the plate lose no more than they gain as each ends deeper, by half a touch."""
    fall = 0.5 * bounds.exact.touch
    return point.gap < -fall and (1.0 - e * e) * point.rate * point.rate <= 4.0 * fall * point.closing


@inlined
def scatter(part, begin, end, bounds, work):
    """Add a random speed to a part that has hit a plate that moves, at contacts from one to before another."""
    moves = False
    for i in range(begin, end):
        moves = moves or work.point[work.point_of[i]].most_push > 0.0
    if moves and bounds.exact.noise > 0.0:
        size, part.draws = half_normal(part.draws)
        part.velocity[2] += bounds.exact.noise * size
