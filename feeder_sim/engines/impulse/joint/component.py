"""Parts that press each other: looked at, struck, pressed and put to rest together (docs/contact.md)."""

from __future__ import annotations

import math

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.contact_problem import (
    IMPULSE,
    MOMENT,
    RESTITUTION,
    TARGET,
    VELOCITY,
    solve,
)
from feeder_sim.engines.impulse.fixed import move_fixture
from feeder_sim.engines.impulse.free_part.impact import (
    ROUNDS,
    gather,
    gather_touching,
    load_part,
    scatter,
)
from feeder_sim.engines.impulse.free_part.path import turning_of
from feeder_sim.engines.impulse.free_part.points import evaluate_points, lowest_gap, move_points, touches
from feeder_sim.engines.impulse.free_part.ride import move_to
from feeder_sim.engines.impulse.free_part.step import NEVER
from feeder_sim.engines.impulse.free_part.sustained import CARRIED
from feeder_sim.engines.impulse.impact import resolve_impact
from feeder_sim.engines.impulse.impact_law import BETWEEN_PARTS, restitution_at
from feeder_sim.engines.impulse.joint.forces import press_together
from feeder_sim.engines.impulse.joint.members import NOTHING, evaluate_pairs, gather_pair, is_fixture, members_of
from feeder_sim.engines.impulse.scratch import LATE, of_member
from feeder_sim.engines.impulse.state import ASLEEP, AWAKE, FREE, top_speed
from feeder_sim.engines.impulse.vectors import dot, write_to
from feeder_sim.machine_code import inlined, uncounted

SUMMED = 2e-4  # [s] of bounces between parts that are summed: hops of 50 nm
SLOW = 0.5 * GRAVITY * SUMMED  # [m/s]; what parts more slowly than that is together
WEIGHED, AGAIN = 5e-4, 1e-3  # [s] for which weight is held, and between two tests of that
SOLVED, MOVES = 1e-3, 1e-2  # of the speed of a fall of that time: how closely to solve, and from where on a part moves
CARRIES, STILL = 1e-6, 5e-3  # [m], [m/s]; points that carry, and speeds of parts that may sleep, as in rest.py


@uncounted
def check_component(i, t, crowd, plate, tools):
    """Bring the component of part i to time t [s], and see what it does.

    Returns the numbers of its members and pairs, until when [s], and whether forces act; without, each member knows
    when it is due.
    """
    together, parts, kinds = tools.together, crowd.parts, crowd.kinds
    work = together.work
    n, m = members_of(i, crowd, together)
    for k in range(n):
        part, view = parts[work.member[k]], of_member(k, work)
        kind = kinds.record[part.kind]
        if part.there == ASLEEP:
            part.there, part.clock = AWAKE, t
        view.before[0] = part
        move_to(part, kind, t, plate.surface)
        part.phase = FREE
        together.number[k] = evaluate_points(part, kinds, plate, t, view).n
        gap = lowest_gap(together.number[k], view)
        if gap < -(view.before[0].depth + CARRIED * plate.bounds.exact.tolerance):
            work.counts[LATE] += 1
        part.depth = max(-gap, 0.0)
    for x in range(m):
        j = crowd.pairs[crowd.islands.pair[together.pair[x]]].b
        if is_fixture(j, crowd):
            move_fixture(parts[j], t, plate.surface)
    evaluate_pairs(m, crowd, tools)
    _strike(n, m, crowd, plate, together)
    asleep = False
    if plate.bounds.calm and t >= parts[i].weighed + AGAIN:
        for k in range(n):
            parts[work.member[k]].weighed = t
        asleep = _holds(n, m, crowd, together)
    if asleep:
        for k in range(n):
            _lay(parts[work.member[k]], work.member[0])
        until, pressed = t + NEVER, True
    else:
        until, pressed = press_together(n, m, t, crowd, plate, together)
    for k in range(n):
        together.body[work.member[k]] = -1
    return n, m, until, pressed


@inlined
def _lay(part, number):
    part.there, part.phase, part.asleep_with = ASLEEP, FREE, number
    for x in range(3):
        part.velocity[x] = part.momentum[x] = 0.0


@uncounted
def _strike(n, m, crowd, plate, together):
    """Impacts at all points that touch, until none approaches."""
    parts, kinds, exact, work = crowd.parts, crowd.kinds, plate.bounds.exact, together.work
    most = work.contacts.body.shape[0]
    for rounds in range(ROUNDS + 1):
        c, approaches = 0, False
        for k in range(n):
            part, view = parts[work.member[k]], of_member(k, work)
            kind, turning, begin = kinds.record[part.kind], turning_of(part, kinds.record[part.kind]), c
            load_part(part, kind, turning, 0.0, view)
            together.first_contact[k], together.squeezed[k] = c, False
            if c + together.number[k] <= most:
                c, hits = gather_touching(kind, together.number[k], c, rounds < ROUNDS, plate, turning, view)
                approaches = approaches or hits
            for i in range(begin, c):
                work.contacts.body[i, 1] = k
        together.first_contact[n] = c
        for x in range(m):
            pair = crowd.pairs[crowd.islands.pair[together.pair[x]]]
            fixed = is_fixture(pair.b, crowd)
            kind = kinds.record[parts[pair.b if fixed else pair.a].kind]
            for y in range(
                together.first_point[x], min(together.first_point[x + 1], together.first_point[x] + most - c)
            ):
                approach = gather_pair(c, x, y, crowd, together)
                if approach > exact.approach:
                    approaches = True
                    e = restitution_at(kind, BETWEEN_PARTS, approach) if rounds < ROUNDS else 0.0
                    work.contacts.number[RESTITUTION, c] = summed(e, approach)
                    together.squeezed[together.body[pair.a]] = True
                    if not fixed:
                        together.squeezed[together.body[pair.b]] = True
                c += 1
        if not approaches:
            return
        _sum_squeezed(n, together)
        resolve_impact(parts, kinds, n, c, (exact.impacts, exact.approach), work)
        for k in range(n):
            part, view = parts[work.member[k]], of_member(k, work)
            scatter(part, together.first_contact[k], together.first_contact[k + 1], plate.bounds, view)
            move_points(part, kinds.record[part.kind], plate, together.number[k], view)


@inlined
def summed(e, approach):
    """Restitution of what approaches at a speed [m/s]: none where all further bounces are summed."""
    return 0.0 if e * approach < SLOW * (1.0 - e) else e


@inlined
def _sum_squeezed(n, together):
    """Sum the bounces on the plate of what another part presses onto it: they are shorter than under gravity."""
    work = together.work
    for k in range(n):
        for i in range(together.first_contact[k], together.first_contact[k + 1]):
            if together.squeezed[k]:
                approach = -of_member(k, work).point[work.point_of[i]].rate
                law = work.contacts.number[RESTITUTION, i]
                work.contacts.number[RESTITUTION, i] = summed(law, approach) if approach > 0.0 else law


@uncounted
def _holds(n, m, crowd, together):
    """Whether all contacts hold the component against its motion and its weight, as in components.py."""
    parts, kinds, work, fall = crowd.parts, crowd.kinds, together.work, GRAVITY * WEIGHED
    contacts, c = work.contacts, 0
    most = contacts.body.shape[0]
    for k in range(n):
        part, view = parts[work.member[k]], of_member(k, work)
        kind = kinds.record[part.kind]
        if top_speed(part, kind) > STILL:
            return False
        load_part(part, kind, turning_of(part, kind), 0.0, view)
        work.bodies.velocity[k, 2] -= fall
        for i in range(together.number[k]):
            if c < most and touches(view.point[i], CARRIES):
                gather(i, c, 0.0, kind, view)
                contacts.body[c, 1], contacts.number[TARGET, c] = k, 0.0
                for x in (VELOCITY, IMPULSE, MOMENT):
                    write_to(contacts.vector[x, c], NOTHING)
                c += 1
    for x in range(m):
        for y in range(together.first_point[x], together.first_point[x + 1]):
            if c < most:
                gather_pair(c, x, y, crowd, together)
                c += 1
    if c == 0 or not solve(work.bodies, contacts, c, SOLVED * fall):
        return False
    for k in range(n):
        v, spin = work.bodies.velocity[k], work.bodies.spin[k]
        reach = kinds.record[parts[work.member[k]].kind].reach
        if math.sqrt(dot(v, v)) + reach * math.sqrt(dot(spin, spin)) > MOVES * fall:
            return False
    return True
