"""One free part over the plate: impacts, forces, following, rest or flight (docs/contact.md).

Nothing is trusted that can be looked at: after a leap no point may be in the plate by more than before. If one is, the
part goes back, and the time of contact is found by halving what was leapt. What has no such time came from beside the
plate, under its sheet. And a part may be looked at so often, and no more, in a given time.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.lone.contact import CARRIED, press, strike
from feeder_sim.engines.impulse.lone.follow import bring, follows_until, goes_along, sit_down
from feeder_sim.engines.impulse.lone.leap import NEVER, fall_on, first_leaps, forecast, shortest_leap, unsure
from feeder_sim.engines.impulse.lone.plate_points import CLOSE, REACH, look, look_at_edge
from feeder_sim.engines.impulse.lone.state import AT, FREE, GAP, KNOWN, LATE, SPENT
from feeder_sim.engines.impulse.state import ASLEEP, top_speed
from feeder_sim.engines.surface_arrays import edge_distance
from feeder_sim.machine_code import inlined, uncounted

ENTERED = 1.0  # tolerances that a point may come into the plate in a leap; pressed ones are moved by CARRIED
SURE, HALVINGS = 0.1, 40  # tolerances that anything may move while the time of a contact is not known
LOOKS, PAID = 200.0, 6e6  # looks at once, and per second; where more are asked for, they are SPARING apart
SPARING = 6e-7  # [s]
PAST = 1e-3  # [s] between looks at a part that falls past the plate
STILL = 1e-6  # [m/s]; what is as slow on a plate that is calm, and does not slip, rests
BALANCED = 1e-3  # of its weight, and of that times its reach
SKIPPED = 8  # looks after one at which a part may not follow
LEAST_LOOK = 1e-5  # [s]; points at the edge of the plate come and go


@inlined
def meet_plate(parts, kinds, surface, bounds, t, shown, work):
    """Bring the part, an array of one, to time t [s] and see what it does; returns when to look at it next [s].

    shown: when its state is asked for next [s].
    """
    part, before = parts[0], work.before[0]
    kind = kinds.record[part.kind]
    work.before[0] = part
    bring(part, kind, t, surface)
    part.phase = FREE
    height = part.position[2] - kind.reach - kind.radius - bounds.crest
    if height > CLOSE:
        rising, part.beside, part.depth = part.velocity[2], 0, 0.0
        return t + (rising + math.sqrt(rising * rising + 2.0 * GRAVITY * (height - 0.5 * CLOSE))) / GRAVITY
    if part.beside:
        return t + PAST
    spent = _spends_budget(part, t, work)
    n, close, near_edge = _look_around(part, kind, kinds, surface, bounds, t, work)
    gap = _lowest_gap(n, work)
    allowed = before.depth + (ENTERED if before.phase == FREE else CARRIED) * bounds.exact.tolerance
    if gap < -allowed:
        if t == before.clock or _next_switch(surface, before.clock, np.inf) <= t:
            _land(part, n, -gap, work)
            gap = 0.0
        elif not spent:
            t, n, close, near_edge = _go_back(parts, kinds, surface, bounds, t, allowed, work)
            gap = _lowest_gap(n, work)
            if part.beside:
                return t
        else:
            work.counts[LATE] += 1
    part.depth = max(-gap, 0.0)
    due = _act(part, kind, n, close, near_edge, spent, surface, bounds, t, shown, work)
    return max(due, t + SPARING) if spent else due


@inlined
def _look_around(part, kind, kinds, surface, bounds, t, work):
    """Fill the rows of all points; returns their number, whether one is close, and whether the edge may be."""
    corners = kinds.corners[kind.corner_from : kind.corner_to]
    close, moved = look(part, kind, corners, surface, bounds, t, work)
    n, at_edge, near_edge = corners.shape[0], False, _may_reach_edge(part, kind, surface)
    if near_edge:
        n, at_edge = look_at_edge(part, kind, kinds, n, surface, bounds, t, moved, work)
    return n, close or at_edge, near_edge


@uncounted
def _go_back(parts, kinds, surface, bounds, late, allowed, work):
    """Find when the contact was that a leap has passed, by halving the leap; returns that time [s] and what is there.

    late: the time after the leap, at which a point is deeper than allowed [m]. One that is deep from its first moment
    on has come under the plate from beside it, if it is near the edge. Else it is a contact, and is pushed out.
    """
    part, kind, early, looks = parts[0], kinds.record[parts[0].kind], work.before[0].clock, 0
    sure = SURE * bounds.exact.tolerance / (top_speed(part, kind) + bounds.speed)
    while late - early > sure and looks < HALVINGS:
        looks += 1
        t = 0.5 * (early + late)
        n, close, near_edge = _look_back(parts, kind, kinds, surface, bounds, t, work)
        if _lowest_gap(n, work) < -allowed:
            late = t
        else:
            early = t
    n, close, near_edge = _look_back(parts, kind, kinds, surface, bounds, late, work)
    if near_edge and _lowest_gap(n, work) < -max(allowed, CLOSE):
        part.beside = 1
    else:
        work.counts[LATE] += 1
    part.looks += looks
    return late, n, close, near_edge


@inlined
def _look_back(parts, kind, kinds, surface, bounds, t, work):
    """As `_look_around`, at a time [s] before the last look and after the one before it."""
    parts[0] = work.before[0]
    bring(parts[0], kind, t, surface)
    parts[0].phase = FREE
    return _look_around(parts[0], kind, kinds, surface, bounds, t, work)


@inlined
def _spends_budget(part, t, work):
    """Count a look; returns whether there were too many of late."""
    spent = part.looks >= LOOKS
    part.looks = max(part.looks - PAID * (t - part.budget), 0.0) + 1.0
    part.budget = t
    if part.looks >= LOOKS and not spent:
        part.looks += 0.5 * LOOKS  # so that it is over for some us, not from one look to the next
        work.counts[SPENT] += 1
    return part.looks >= LOOKS


@inlined
def _act(part, kind, n, close, near_edge, spent, surface, bounds, t, shown, work):
    """What the part does where its first n points are as the rows say; returns when to look at it next [s].

    close: whether one is; near_edge: whether one may come up on the edge; spent: nothing may bounce.
    """
    before = work.before[0].phase
    unknown = unsure(part, kind, bounds)
    until = _next_switch(surface, t, bounds.end)
    if close:
        if before == FREE and not near_edge:
            t += fall_on(part, kind, n, min(shown, until) - t, unknown[0], unknown[1], surface, bounds, work)
        strike(part, kind, n, unknown[1], not spent, bounds, work)
        unknown = unsure(part, kind, bounds)
        least = SPARING if spent else shortest_leap(part, kind, bounds)  # forces last until they are looked at
        stays, held = press(part, kind, n, before != FREE, unknown, surface, bounds, t, until, least, work)
        if stays > 0.0:
            part.held = part.held + 1 if held else min(part.held, 0)
            if held:
                stays = _stay(part, kind, n, surface, bounds, t, until, stays, work)
            return t + stays
        part.held = 0
    slack, twist = unknown
    far, to_crest = first_leaps(n, slack, twist, bounds, work)
    if near_edge:
        to_crest = min(to_crest, max(LEAST_LOOK, 0.25 * max(_lowest_gap(n, work), 0.0) / top_speed(part, kind)))
    if far < to_crest:
        far = forecast(part, kind, n, surface, bounds, t, until, (far, to_crest), unknown, work)
    return min(t + max(min(far, to_crest), shortest_leap(part, kind, bounds)), until)  # where it jumps, it is landed


@inlined
def _stay(part, kind, n, surface, bounds, t, until, stays, work):
    """How long a part that does not slip stays [s]: for ever at rest, or while it follows, or for the time `stays`."""
    height = _height(n, bounds, work)
    if part.held < 1 or not goes_along(part, height, t + stays, surface, work):
        return stays
    ends = follows_until(part, kind, n, height, surface, bounds, t, until, work)
    if bounds.calm and (ends == until or _is_still(part, kind, bounds, work)):
        for k in range(3):
            part.velocity[k] = part.momentum[k] = 0.0
        part.there, part.phase = ASLEEP, FREE
        return NEVER
    if ends - t <= stays:
        part.held = -SKIPPED
        return stays
    sit_down(part, kind, t, surface)
    return ends - t


@inlined
def _is_still(part, kind, bounds, work):
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
def _next_switch(surface, t, end):
    """When a term of the surface begins or ends next, or the end of the window [s]: its motion is smooth until then."""
    for k in range(surface.term_start.shape[0]):
        if surface.term_start[k] > t:
            end = min(end, surface.term_start[k])
        if surface.term_stop[k] > t:
            end = min(end, surface.term_stop[k])
    return end


@inlined
def _land(part, n, depth, work):
    """Lift a part by a depth [m] out of a surface that has jumped into it (`ring_up = false`), or that it starts in."""
    part.position[2] += depth
    for i in range(n):
        work.point[i, GAP] += depth


@inlined
def _lowest_gap(n, work):
    gap = np.inf
    for i in range(n):
        gap = min(gap, work.point[i, GAP])
    return gap


@inlined
def _may_reach_edge(part, kind, surface):
    """Whether a part is so near the edge of the plate that a point there may come up."""
    far = kind.reach + kind.radius + REACH
    x, y = part.position[0], part.position[1]
    if abs(x) + far > surface.grid_x[-1] or abs(y) + far > surface.grid_y[-1]:
        return True
    return abs(edge_distance(surface.outline, x, y, far)) < far


@inlined
def _height(n, bounds, work):
    """Height of the centre of mass over its supports [m]."""
    lowest = 0.0
    for i in range(n):
        row = work.point[i]
        if row[KNOWN] != 0.0 and row[GAP] <= CARRIED * bounds.exact.tolerance:
            lowest = min(lowest, row[AT + 2])
    return -lowest
