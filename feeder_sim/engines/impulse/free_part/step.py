"""One free part over the plate: leap, verify, classify, act (docs/contact.md).

leap       move the part to the time at which it is due
verify     no point may be in the plate by more than before. If one is, the part goes back, and the time of contact is
           found by halving what was leapt; what has no such time came from beside the plate, under its sheet
classify   a point that touches approaches, is held, or is free; the solution of all contacts says which of the last two
act        impacts, forces, a ride, rest; or flight until the first point can touch

A part may be looked at so often, and no more, in a given time.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.circles import is_round
from feeder_sim.engines.impulse.free_part.impact import TOGETHER, strike
from feeder_sim.engines.impulse.free_part.leap import first_contact, remainder_bounds, shortest_leap
from feeder_sim.engines.impulse.free_part.notes import note_contact, speed_of_touched_plate
from feeder_sim.engines.impulse.free_part.on_plate import CLOSE
from feeder_sim.engines.impulse.free_part.points import evaluate_points, lowest_gap, touches
from feeder_sim.engines.impulse.free_part.ride import follows_until, goes_along, move_to, start_riding
from feeder_sim.engines.impulse.free_part.sustained import CARRIED, Moment, press
from feeder_sim.engines.impulse.free_part.walls import in_tube, leans, time_to_walls, walled
from feeder_sim.engines.impulse.scratch import LATE, SPENT
from feeder_sim.engines.impulse.state import ASLEEP, FREE, top_speed
from feeder_sim.machine_code import inlined, uncounted

ASIDE = 1e-5  # [m]; no plate moves a part that follows it sideways by more
NEVER = 1e9  # [s]; the flight of a part that is not over the plate
ENTERED = 1.0  # tolerances that a point may come into the plate in a leap; pressed ones are moved by CARRIED
SURE, HALVINGS = 0.1, 40  # tolerances that anything may move while the time of a contact is not known
LOOKS, PAID = 200.0, 6e6  # looks at once, and per second; where more are asked for, they are BUDGET_INTERVAL apart
BUDGET_INTERVAL = 6e-7  # [s]
PAST = 1e-3  # [s] between looks at a part that falls past the plate
STILL = 1e-6  # [m/s]; what is as slow on a plate that is calm, and does not slip, rests
BALANCED = 1e-3  # of its weight, and of that times its reach
SKIPPED = 8  # looks after one at which a part may not follow
JUST = 1e-12  # [s] before
LEAST_INTERVAL = 1e-5  # [s]; points at the edge of the plate come and go


@inlined
def step(free, plate, t):
    """Bring the part to time t [s] and see what it does; returns when to look at it next [s]."""
    part, kind = free.parts[0], free.kinds.record[free.parts[0].kind]
    free.work.before[0] = part
    move_to(part, kind, t, plate.surface)
    part.phase = FREE
    height = part.position[2] - kind.reach - kind.radius - plate.bounds.crest
    if height > CLOSE and not walled(plate):
        rising, part.beside, part.depth = part.velocity[2], 0, 0.0
        return t + (rising + math.sqrt(rising * rising + 2.0 * GRAVITY * (height - 0.5 * CLOSE))) / GRAVITY
    if part.beside:
        return t + PAST
    over_budget = _spends_budget(part, t, free.work)
    t, seen = _verify(free, plate, t, evaluate_points(part, free.kinds, plate, t, free.work), over_budget)
    if part.beside:
        return t
    part.depth = max(-lowest_gap(seen.n, free.work), 0.0)
    if t < part.jammed:
        for i in range(seen.n):
            free.work.point[i].friction = 0.0
    due = _act(free, plate, t, seen, over_budget)
    return max(due, t + BUDGET_INTERVAL) if over_budget else due


@inlined
def _spends_budget(part, t, work):
    """Count a look; returns whether there were too many of late."""
    over_budget = part.looks >= LOOKS
    part.looks = max(part.looks - PAID * (t - part.budget), 0.0) + 1.0
    part.budget = t
    if part.looks >= LOOKS and not over_budget:
        part.looks += 0.5 * LOOKS  # so that it is over for some us, not from one look to the next
        work.counts[SPENT] += 1
    return part.looks >= LOOKS


@inlined
def _verify(free, plate, t, seen, over_budget):
    """See that no point has come into the plate; returns a time [s] at which that is so, and what is seen then."""
    part, before, work, surface = free.parts[0], free.work.before[0], free.work, plate.surface
    # Of a circle ever another point comes up, a little deeper than the corners on it.
    entered = ENTERED if before.phase == FREE and not is_round(free.kinds.record[part.kind]) else CARRIED
    allowed = before.depth + entered * plate.bounds.exact.tolerance
    gap = lowest_gap(seen.n, work)
    if gap >= -allowed:
        return t, seen
    again = t == before.clock
    jumped = next_switch(surface, before.clock - JUST if again else before.clock, np.inf) <= t
    from_beside = seen.near_edge and gap < -max(allowed, CLOSE)
    if jumped or (again and not from_beside):
        part.position[2] -= gap  # out of a surface that has jumped into it (`ring_up = false`), or that it starts in
        for i in range(seen.n):
            work.point[i].gap -= gap
        return t, seen
    if again:
        part.beside = 1
        return t, seen
    if over_budget:
        work.counts[LATE] += 1
        return t, seen
    return _go_back(free, plate, t, allowed)


@uncounted
def _go_back(free, plate, late, allowed):
    """Find when the contact was that a leap has passed, by halving the leap; returns that time [s] and what is there.

    late: the time after the leap, at which a point is deeper than allowed [m]. One that is deep from its first moment
    on has come under the plate from beside it, if it is near the edge. Else it is a contact, and is pushed out.
    """
    part, kind, work = free.parts[0], free.kinds.record[free.parts[0].kind], free.work
    early, looks = work.before[0].clock, 0
    sure = SURE * plate.bounds.exact.tolerance / (top_speed(part, kind) + plate.bounds.speed)
    while late - early > sure and looks < HALVINGS:
        looks += 1
        t = 0.5 * (early + late)
        if lowest_gap(_last_safe_time(free, kind, plate, t).n, work) < -allowed:
            late = t
        else:
            early = t
    seen = _last_safe_time(free, kind, plate, late)
    if seen.near_edge and lowest_gap(seen.n, work) < -max(allowed, CLOSE):
        part.beside = 1
    else:
        work.counts[LATE] += 1
    part.looks += looks
    return late, seen


@inlined
def _last_safe_time(free, kind, plate, t):
    """Look at the part at a time [s] before the last look and after the one before it."""
    free.parts[0] = free.work.before[0]
    move_to(free.parts[0], kind, t, plate.surface)
    free.parts[0].phase = FREE
    return evaluate_points(free.parts[0], free.kinds, plate, t, free.work)


@inlined
def _act(free, plate, t, seen, over_budget):
    """What the part does after a look; returns when to look at it next [s]. spent: nothing bounces."""
    part, kind, work = free.parts[0], free.kinds.record[free.parts[0].kind], free.work
    until, bounds, turning = next_switch(plate.surface, t, plate.bounds.end), plate.bounds, seen.turning
    before, rises = part.velocity[2], np.nan
    if seen.close:
        if in_tube(plate):
            rises = speed_of_touched_plate(seen.n, TOGETHER * bounds.exact.tolerance, work)
        turning = strike(free, seen, not over_budget, plate)
    shortest, remainder = shortest_leap(part, bounds, turning), remainder_bounds(part, kind, bounds, turning)
    if seen.close:
        now = Moment(t, until, seen.n, turning, remainder)
        least = BUDGET_INTERVAL if over_budget else shortest
        stays, supported = press(free, plate, now, least)  # until it is looked at
        if stays > 0.0:
            part.supported = part.supported + 1 if supported else min(part.supported, 0)
            due = t + (_stay(part, kind, plate, now, stays, work) if supported else stays)
            if in_tube(plate):
                note_contact(free.notes, t, due + 0.0 * rises, rises - before, part)
            return due
        part.supported = 0
    if in_tube(plate):
        note_contact(free.notes, t, t + 0.0 * rises, rises - before, part)
    limit = min(until - t, time_to_walls(part, kind, plate))
    if seen.near_edge:
        limit = min(limit, max(LEAST_INTERVAL, 0.25 * max(lowest_gap(seen.n, work), 0.0) / top_speed(part, kind)))
    return min(t + max(first_contact(seen.n, limit, plate, t, remainder, work), shortest), until)


@inlined
def _stay(part, kind, plate, now, stays, work):
    """How long a part that does not slip stays [s]: for ever at rest, or while it follows, or for the time `stays`."""
    if in_tube(plate) or (walled(plate) and leans(now.n, ASIDE, work)):
        if plate.bounds.calm and is_still(part, kind, plate.bounds, work):
            return _rest(part)
        return stays
    height = height_of_centre(now.n, plate.bounds, work)
    if part.supported < 1 or not goes_along(part, height, now.t + stays, plate.surface, work):
        return stays
    ends = follows_until(part, kind, plate, now, height, work)
    if plate.bounds.calm and (ends == now.until or is_still(part, kind, plate.bounds, work)):
        return _rest(part)
    if ends - now.t <= stays:
        part.supported = -SKIPPED
        return stays
    start_riding(part, kind, now.t, plate.surface)
    return ends - now.t


@inlined
def _rest(part):
    for k in range(3):
        part.velocity[k] = part.momentum[k] = 0.0
    part.there, part.phase = ASLEEP, FREE
    return NEVER


@inlined
def is_still(part, kind, bounds, work):
    """Whether the part, as the solution of its contacts has it, hardly moves, and its forces balance."""
    speed = spin = force = moment = 0.0
    for k in range(3):
        speed += work.bodies.velocity[0, k] ** 2
        spin += work.bodies.spin[0, k] ** 2
        force += (part.force[k] - (kind.mass * GRAVITY if k == 2 else 0.0)) ** 2
        moment += part.moment[k] ** 2
    moves = math.sqrt(speed) + kind.reach * math.sqrt(spin)
    unbalanced = kind.reach * math.sqrt(force) + math.sqrt(moment)
    return moves < STILL + 1.01 * bounds.speed and unbalanced < BALANCED * kind.mass * GRAVITY * kind.reach


@inlined
def next_switch(surface, t, end):
    """When a term of the surface begins or ends next, or the end of the window [s]: its motion is smooth until then."""
    for k in range(surface.term_start.shape[0]):
        if surface.term_start[k] > t:
            end = min(end, surface.term_start[k])
        if surface.term_stop[k] > t:
            end = min(end, surface.term_stop[k])
    return end


@inlined
def height_of_centre(n, bounds, work):
    """Height of the centre of mass over its supports [m]."""
    lowest = 0.0
    for i in range(n):
        if touches(work.point[i], CARRIED * bounds.exact.tolerance):
            lowest = min(lowest, work.point[i].arm[2])
    return -lowest
