"""Sustained contact of parts that press each other: one problem of all their contacts (sustained.py for one part)."""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.contact_equations import STEP, STIFF, solve_equations
from feeder_sim.engines.impulse.contact_problem import (
    ARM_FIRST,
    ARM_SECOND,
    IMPULSE,
    MOMENT,
    NORMAL,
    TARGET,
    VELOCITY,
    WORLD,
    solve,
)
from feeder_sim.engines.impulse.free_part.leap import first_contact, remainder_bounds, shortest_leap
from feeder_sim.engines.impulse.free_part.path import turning_of
from feeder_sim.engines.impulse.free_part.ride import follows_until, goes_along, start_riding
from feeder_sim.engines.impulse.free_part.step import height_of_centre, is_still, next_switch
from feeder_sim.engines.impulse.free_part.sustained import (
    LIGHT,
    LOADED,
    NO_LIFT,
    SOLVED,
    TURNED,
    Moment,
    gather_forces,
    keep_loads,
    last_lift,
    mark_carried,
    push_unloaded,
    time_of_forces,
    until_dip,
)
from feeder_sim.engines.impulse.joint.members import is_fixture
from feeder_sim.engines.impulse.joint.pair_after import gather_pair_after
from feeder_sim.engines.impulse.pairs.separating_axis import BALL, CENTRES, CLOSEST
from feeder_sim.engines.impulse.scratch import UNRESOLVED, of_member
from feeder_sim.engines.impulse.state import ASLEEP, FIXED, FREE, PRESSED, spin_of
from feeder_sim.engines.impulse.surface import move_surface
from feeder_sim.engines.impulse.vectors import add_to, cross, difference, dot, plus, times, vector
from feeder_sim.machine_code import inlined, uncounted

NEVER = 1e9  # [s]
DEEP, PARTED, OUT = 1e-6, 0.3, 1e-3  # [m] that pairs may be in each other, share of the rest parted, [m/s] at most
SOON = 1e-4  # [s] after which a part that forces have let go is looked at again
# [m], [m/s] by which parts may turn into each other while forces last; [s] that these do at least.
COMES_IN, APPROACHES, LEAST = 5e-7, 2e-4, 1e-6
ARC = 4e-9  # [m] from the chord that points take under forces to the arc of a pair that turns, which moves their energy


@uncounted
def press_together(n, m, t, crowd, plate, together):
    """Set forces on all n members, at m pairs too, for a time; returns until when [s], and whether there are any."""
    parts, kinds, bounds, work = crowd.parts, crowd.kinds, plate.bounds, together.work
    until = next_switch(plate.surface, t, bounds.end)
    usual, lift, some, shortest = bounds.exact.longest, 0.0, False, 0.0
    for k in range(n):
        part, view = parts[work.member[k]], of_member(k, work)
        kind, now = kinds.record[part.kind], _moment(k, t, until, crowd, plate, together)
        own, together.chatter[k] = time_of_forces(part, kind, bounds, now, view)
        if now.turning.speed * usual > TURNED * kind.reach:
            usual = TURNED * kind.reach / now.turning.speed
        if own > 0.0:
            usual, rises = min(usual, own), last_lift(bounds, now, together.chatter[k], view)
            if rises >= NO_LIFT * own:
                some, lift = True, max(lift, rises)
        shortest = max(shortest, shortest_leap(part, bounds, now.turning))
    rides = True  # what leans on a fixture that stands does not
    for x in range(m):
        pair = crowd.pairs[crowd.islands.pair[together.pair[x]]]
        usual = min(usual, _time_of_pair(pair, together.origin[x], crowd))
        if is_fixture(pair.b, crowd) and pair.pressing != 0:  # which carries by itself
            usual, some, lift = min(usual, bounds.exact.sways / bounds.rate), True, bounds.exact.longest
            rides = rides and parts[pair.b].phase == FIXED
    time = max(min(usual, lift, until - t), shortest)
    if some:
        for k in range(n):
            mark_carried(together.number[k], usual, together.chatter[k], bounds, of_member(k, work))
        c = _solve_forces(n, m, t, until, (time, usual), crowd, plate, together)
        load = _load(c, work)
    if not some or load <= 0.0:
        _let_go(n, t, until, crowd, plate, together)
        return until, False
    sticks = _apply_forces(n, c, load, time, plate, crowd, together)
    if bounds.speed > 0.0:
        _change_forces(n, c, crowd, together)
    still = bounds.calm
    for k in range(n):
        part = parts[work.member[k]]
        still = still and is_still(part, kinds.record[part.kind], bounds, of_member(k, work))
    if still:
        for k in range(n):
            part = parts[work.member[k]]
            part.there, part.phase, part.asleep_with = ASLEEP, FREE, work.member[0]
            for x in range(3):
                part.velocity[x] = part.momentum[x] = 0.0
        return t + NEVER, True
    ends = _ride(n, t, time, until, crowd, plate, together) if sticks and rides else 0.0
    if ends > time:
        return t + ends, True
    ends = time
    for k in range(n):
        part, view = parts[work.member[k]], of_member(k, work)
        kind = kinds.record[part.kind]
        push_unloaded(part, kind, together.number[k], view)
        ends = min(ends, until_dip(together.number[k], time, bounds, view))
    for k in range(n):
        now = _moment(k, t, until, crowd, plate, together)
        ends = first_contact(together.number[k], ends, plate, t, now.remainder, of_member(k, work))
    return t + max(ends, shortest), True


@inlined
def _time_of_pair(pair, origin, crowd):
    """How long forces of a pair last [s]: until then no other point of both comes far into the other part.

    Nor does the arc on which their contact turns leave its chord, and unless it is known how their normal turns, what
    that lets them approach by is less than they are parted by.
    """
    a, b = crowd.parts[pair.a], crowd.parts[pair.b]
    kind_a, kind_b = crowd.kinds.record[a.kind], crowd.kinds.record[b.kind]
    fixed = is_fixture(pair.b, crowd)
    spin_b = vector(b.momentum) if fixed else spin_of(b, kind_b)
    turns = difference(spin_of(a, kind_a), spin_b)
    squared, size = dot(turns, turns), min(kind_a.reach + kind_a.radius, kind_b.reach + kind_b.radius)
    speed, bends = min(kind_a.reach, kind_b.reach) * math.sqrt(squared), size * squared
    if fixed:
        bends = max(bends, kind_b.reach * dot(spin_b, spin_b))
    if origin in (BALL, CENTRES):
        along = difference(b.velocity, a.velocity)
        bends = max(bends, dot(along, along) / (kind_a.radius + kind_b.radius))
    time = min(COMES_IN / max(speed, COMES_IN), math.sqrt(ARC / max(0.125 * bends, ARC)))
    if origin == CLOSEST:
        time = min(time, APPROACHES / max(0.5 * bends, APPROACHES))
    return max(time, LEAST)


@inlined
def _moment(k, t, until, crowd, plate, together):
    """How member k moves now."""
    part = crowd.parts[together.work.member[k]]
    kind = crowd.kinds.record[part.kind]
    turning = turning_of(part, kind)
    return Moment(t, until, together.number[k], turning, remainder_bounds(part, kind, plate.bounds, turning))


@uncounted
def _solve_forces(n, m, t, until, times_of, crowd, plate, together):
    """Solve for the impulses of a time; returns the number of contacts."""
    (time, usual), parts, kinds, work = times_of, crowd.parts, crowd.kinds, together.work
    exact, contacts, c = plate.bounds.exact, together.work.contacts, 0
    most = contacts.body.shape[0]
    slips = exact.slip if plate.bounds.speed > 0.0 else exact.slip_at_rest
    move_surface(t + time, plate.surface, work.then)
    leant = False
    for k in range(n):
        part, view, begin = parts[work.member[k]], of_member(k, work), c
        together.first_contact[k] = c
        if c + together.number[k] <= most:
            kind, now = kinds.record[part.kind], _moment(k, t, until, crowd, plate, together)
            loads = crowd.loads[work.member[k]]
            c, leans = gather_forces(part, kind, loads, plate, now, (time, usual, slips), c, view)
            leant = leant or leans
        else:
            work.counts[UNRESOLVED] += 1
        for i in range(begin, c):
            contacts.body[i, 1] = k
    together.first_contact[n] = c
    for x in range(m):
        for y in range(together.first_point[x], min(together.first_point[x + 1], together.first_point[x] + most - c)):
            gather_pair_after(c, x, y, t, time, crowd, plate.surface, together)
            if together.gap[x] < -DEEP:
                contacts.number[TARGET, c] = min(-PARTED * (together.gap[x] + DEEP) / exact.longest, OUT)
            c += 1
    if not solve(work.bodies, contacts, c, max(SOLVED * exact.tolerance / usual, exact.impacts), not leant):
        work.counts[UNRESOLVED] += 1
    for k in range(n):
        first, last = together.first_contact[k], together.first_contact[k + 1]
        keep_loads(crowd.loads[work.member[k]], together.number[k], first, last, time, of_member(k, work))
    return c


@inlined
def _load(c, work):
    """The sum of all normal impulses [N s]."""
    load = 0.0
    for i in range(c):
        load += dot(work.contacts.vector[IMPULSE, i], work.contacts.vector[NORMAL, i])
    return load


@uncounted
def _apply_forces(n, c, load, time, plate, crowd, together):
    """Press all members by what the last solution of c contacts says, over a time [s].

    Returns whether each has a load on the plate, and none of those contacts slips.
    """
    parts, work = crowd.parts, together.work
    contacts, bodies, exact = work.contacts, work.bodies, plate.bounds.exact
    for k in range(n):
        part, together.borne[k] = parts[work.member[k]], False
        part.phase, part.lead, part.supported = PRESSED, 0.5 * time, 0
        for x in range(3):
            part.force[x] = part.moment[x] = part.jerk[x] = part.twist[x] = 0.0
    slips = exact.slip if plate.bounds.speed > 0.0 else exact.slip_at_rest
    sticks = True
    for i in range(c):
        first, second = contacts.body[i, 0], contacts.body[i, 1]
        impulse, moment = vector(contacts.vector[IMPULSE, i]), vector(contacts.vector[MOMENT, i])
        _push(parts[work.member[second]], vector(contacts.vector[ARM_SECOND, i]), impulse, moment, 1.0 / time)
        if first != WORLD:
            _push(parts[work.member[first]], vector(contacts.vector[ARM_FIRST, i]), impulse, moment, -1.0 / time)
        if i >= together.first_contact[n]:  # of a pair
            continue
        normal = vector(contacts.vector[NORMAL, i])
        along = dot(impulse, normal)
        if along > LIGHT * load / n:
            of_member(second, work).point[work.point_of[i]].carried = LOADED
        if along > 0.0:
            together.borne[second] = True
            u = plus(bodies.velocity[second], 1.0, cross(bodies.spin[second], contacts.vector[ARM_SECOND, i]))
            u = difference(u, contacts.vector[VELOCITY, i])
            u = plus(u, -dot(u, normal), normal)
            sticks = sticks and dot(u, u) < slips * slips
    for k in range(n):
        sticks = sticks and together.borne[k]
    return sticks


@inlined
def _push(part, arm, impulse, moment, share):
    add_to(part.force, share, impulse)
    add_to(part.moment, share, plus(moment, 1.0, cross(arm, impulse)))


@uncounted
def _ride(n, t, time, until, crowd, plate, together):
    """Let all members follow the plate, each by itself; returns for how long [s], 0 if not at all."""
    parts, kinds, work, ends = crowd.parts, crowd.kinds, together.work, until - t
    for k in range(n):
        part, view = parts[work.member[k]], of_member(k, work)
        kind, now = kinds.record[part.kind], _moment(k, t, until, crowd, plate, together)
        height = height_of_centre(together.number[k], plate.bounds, view)
        if not goes_along(part, height, t + time, plate.surface, view):
            return 0.0
        ends = min(ends, follows_until(part, kind, plate, now, height, view) - t)
        if ends <= time:
            return 0.0
    for k in range(n):
        part = parts[work.member[k]]
        start_riding(part, kinds.record[part.kind], t, plate.surface)
    return ends


@uncounted
def _let_go(n, t, until, crowd, plate, together):
    """All fly by themselves, and each is due by itself."""
    parts, work = crowd.parts, together.work
    for k in range(n):
        part, view = parts[work.member[k]], of_member(k, work)
        now = _moment(k, t, until, crowd, plate, together)
        for i in range(together.number[k]):
            view.point[i].carried = 0
        shortest = shortest_leap(part, plate.bounds, now.turning)
        limit = min(until - t, SOON)
        part.due = t + max(first_contact(together.number[k], limit, plate, t, now.remainder, view), shortest)
        part.supported = 0


@uncounted
def _change_forces(n, c, crowd, together):
    """As `_change_forces` of one part, of all members in one problem."""
    parts, work, size = crowd.parts, together.work, 6 * n
    matrix, change, contacts = work.contacts.room.matrix, work.contacts.room.motion[STEP], work.contacts
    for x in range(size):
        change[x] = 0.0
        for y in range(size):
            matrix[x, y] = 1.0 if x == y else 0.0
    for i in range(c):
        stiff, rate, rows = _stiff_rows(i, n, together)
        if stiff == 0.0:
            continue
        for end in range(2):
            body, (_, push) = contacts.body[i, end], rows[end]
            if body == WORLD:
                continue
            for x in range(6):
                change[6 * body + x] += stiff * push[x] * rate
                for other in range(2):
                    if contacts.body[i, other] != WORLD:
                        for y in range(6):
                            matrix[6 * body + x, 6 * contacts.body[i, other] + y] += stiff * push[x] * rows[other][0][y]
    if not solve_equations(matrix, change, size):
        return
    for i in range(c):
        stiff, rate, rows = _stiff_rows(i, n, together)
        if stiff == 0.0:
            continue
        f = stiff * rate
        for end in range(2):
            if contacts.body[i, end] != WORLD:
                for x in range(6):
                    f -= stiff * rows[end][0][x] * change[6 * contacts.body[i, end] + x]
        for end in range(2):
            body, (row, _) = contacts.body[i, end], rows[end]
            if body != WORLD:
                part = parts[work.member[body]]
                add_to(part.jerk, f * work.bodies.inverse_mass[body], (row[0], row[1], row[2]))
                add_to(part.twist, f, (row[3], row[4], row[5]))


@inlined
def _stiff_rows(i, n, together):
    """Stiffness of contact i, 0 without a load; how the push of the plate changes there; and `_row` of both bodies."""
    work = together.work
    contacts, (first, second) = work.contacts, (work.contacts.body[i, 0], work.contacts.body[i, 1])
    normal = vector(contacts.vector[NORMAL, i])
    rows = (
        _row(max(first, 0), vector(contacts.vector[ARM_FIRST, i]), normal, -1.0, work.bodies),
        _row(second, vector(contacts.vector[ARM_SECOND, i]), normal, 1.0, work.bodies),
    )
    inverse = 0.0
    for x in range(6):
        inverse += rows[1][0][x] * rows[1][1][x]
        if first != WORLD:
            inverse += rows[0][0][x] * rows[0][1][x]
    of_plate = first == WORLD and i < together.first_contact[n]
    rate = of_member(second, work).point[work.point_of[i]].push_rate if of_plate else 0.0
    return (STIFF / inverse if dot(contacts.vector[IMPULSE, i], normal) > 0.0 else 0.0), rate, rows


@inlined
def _row(j, arm, normal, sign, bodies):
    """How a contact moves along its normal with body j, and what a force there does to it."""
    turns, share, inverse = cross(arm, normal), sign * bodies.inverse_mass[j], bodies.inverse_inertia[j]
    turned = times(inverse, turns)
    row = sign * normal[0], sign * normal[1], sign * normal[2], sign * turns[0], sign * turns[1], sign * turns[2]
    push = share * normal[0], share * normal[1], share * normal[2], sign * turned[0], sign * turned[1], sign * turned[2]
    return row, push
