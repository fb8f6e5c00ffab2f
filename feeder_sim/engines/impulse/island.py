"""Advance the parts of islands through a window of time, event by event.

Every part has a time of its own. An event is a look at a part over the plate, or at a pair of parts; each is due at the
earliest time at which something can happen there, and the earliest of all is next. Only what changes its velocity in an
impact makes what it could meet due anew.

What is recorded changes nothing: at the time of a frame the state of each part is written as it will be if it flies on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.borrow import borrow, borrowed
from feeder_sim.engines.impulse.circles import count_of, is_round, lowest_points
from feeder_sim.engines.impulse.contact import apply_forces, press, strike
from feeder_sim.engines.impulse.follow import bring
from feeder_sim.engines.impulse.frame_rows import write_row
from feeder_sim.engines.impulse.hulls import Hulls
from feeder_sim.engines.impulse.leap import shortest_leap, unsure
from feeder_sim.engines.impulse.moving_surface import move_surface
from feeder_sim.engines.impulse.neighbours import Islands
from feeder_sim.engines.impulse.pair_contact import NEARBY, TOUCHING, find_axis, look_at_pair_points, meeting_bound
from feeder_sim.engines.impulse.plate_contact import STILL, meet_plate, next_switch, rest
from feeder_sim.engines.impulse.plate_points import CLOSE, look, look_at_edge, renew_pair_rates
from feeder_sim.engines.impulse.state import ASLEEP, FREE, Kinds, Scratch, in_pieces, wake
from feeder_sim.engines.impulse.yielding import yields
from feeder_sim.engines.impulse.yielding_bounds import has_changed, renewed
from feeder_sim.machine_code import compiled, entry_point, inlined

LEAST_LOOK = 1e-7  # [s]; after parts that touch have come apart


class Crowd(NamedTuple):
    """The parts of a window: state of each, now and at its begin, pairs that can meet, and their islands."""

    parts: NDArray[np.void]
    begun: NDArray[np.void]
    pairs: NDArray[np.void]
    kinds: Kinds
    islands: Islands


class Tools(NamedTuple):
    """What belongs to one thread."""

    hulls: Hulls
    work: Scratch


class Share(NamedTuple):
    """Thread that every island belongs to, and this thread."""

    owner: NDArray[np.int64]
    thread: int


class Span(NamedTuple):
    """A window: begin and end [s], and how far from its place at the begin a part may come [m]."""

    start: float
    end: float
    reach: float


class Agenda(NamedTuple):
    """When the events of one island are due: first those of its parts, then those of its pairs.

    tree: see `all_due`; first_part, first_pair: of the island, in `Islands`; n_parts: of the island.
    """

    tree: NDArray[np.float64]
    first_part: int
    n_parts: int
    first_pair: int


@entry_point
def advance_islands(share, crowd, plate, tools, span, frames):
    """Advance the islands of a thread to the end of a window, and write their frames.

    Returns whether a part has come farther than the reach that its possible neighbours were found for.
    """
    owner, crowd, plate, tools, frames = share.owner, borrow(crowd), borrow(plate), borrow(tools), borrow(frames)
    left = False
    for island in range(owner.shape[0]):
        if owner[island] == share.thread:
            left |= _advance_island(island, crowd, plate, tools, span, frames, None)
    return left


@entry_point
def advance_together(crowd, plate, tools, span, frames, yielding):
    """As `advance_islands`, all parts as one island, over a plate that takes their impulses: what one does others feel."""
    lent, plate, tools, frames = borrow(crowd), borrow(plate), borrow(tools), borrow(frames)
    yielding = borrow(yielding)
    yielding.changed[:] = 0.0
    left = _advance_island(0, lent, plate, tools, span, frames, yielding)
    return left and crowd.parts.shape[0] > 0  # what was borrowed lives until here


@compiled
def _advance_island(island, crowd, plate, tools, span, frames, yielding):
    """As `advance_islands`, one island; yielding: see `meet_plate`."""
    islands, parts, kinds = crowd.islands, crowd.parts, crowd.kinds
    first, last = islands.first_part[island], islands.first_part[island + 1]
    first_pair, last_pair = islands.first_pair[island], islands.first_pair[island + 1]
    n = last - first
    tree = all_due(n + last_pair - first_pair, span.start)
    agenda = Agenda(borrowed(tree), first, n, first_pair)
    for k in range(n):
        if parts[islands.part[first + k]].there == ASLEEP:
            set_due(tree, k, np.inf)
    left = False
    for frame in range(frames.time.shape[0] + 1):
        stop = frames.time[frame] if frame < frames.time.shape[0] else span.end
        while tree[1] < stop and frames.interrupt[0] == 0:
            t, event = tree[1], earliest_of(tree)
            if event < n:
                left |= look_at_part(event, t, agenda, crowd, plate, tools, span.reach, yielding)
            else:
                left |= look_at_pair(event, t, agenda, crowd, plate, tools, span.reach, yielding)
            if has_changed(yielding):
                plate = renewed(plate, t, yielding)
                look_again(t, agenda, crowd, plate)
        for k in range(first, last):
            i = islands.part[k]
            if frame < frames.time.shape[0]:
                write_row(parts, i, kinds, plate.surface, stop, frames.row[frame, i])
            else:
                bring(parts[i], kinds.record[parts[i].kind], stop, plate.surface)
                left |= has_left(i, crowd, span.reach)
    return left and tree.shape[0] > 0  # what was borrowed lives until here


@compiled
def look_at_part(event, t, agenda, crowd, plate, tools, reach, yielding):
    """A part over the plate, with all that touch it; returns whether one has come farther than its reach."""
    i = crowd.islands.part[agenda.first_part + event]
    part = crowd.parts[i]
    if _touches_one(i, crowd):
        return meet_group(i, t, agenda, crowd, plate, tools, reach, yielding)
    bring(part, crowd.kinds.record[part.kind], t, plate.surface)
    left = has_left(i, crowd, reach)
    before = part.phase
    leap, hit = meet_plate(i, crowd.parts, crowd.kinds, None, plate.surface, plate.bounds, t, tools.work, yielding)
    part.due = t + leap
    set_due(agenda.tree, event, np.inf if part.there == ASLEEP else part.due)
    if hit or (part.phase == FREE) != (before == FREE):
        look_again_at_pairs(i, t, agenda, crowd, plate)
    return left


@compiled
def look_at_pair(event, t, agenda, crowd, plate, tools, reach, yielding):
    """A pair of parts; returns whether a part has come farther than its reach."""
    parts, kinds, islands = crowd.parts, crowd.kinds, crowd.islands
    pair = crowd.pairs[islands.pair[agenda.first_pair + event - agenda.n_parts]]
    due, gap = meeting_bound(pair, parts, kinds, t, plate)
    if gap < NEARBY:
        find_axis(pair, parts, kinds, tools.hulls)
        due, gap = meeting_bound(pair, parts, kinds, t, plate)
        if gap <= TOUCHING:
            pair.touching = 1
            set_due(agenda.tree, event, np.inf)
            left = meet_group(pair.a, t, agenda, crowd, plate, tools, reach, yielding)
            if pair.touching == 1:
                return left
            due, gap = meeting_bound(pair, parts, kinds, t, plate)
            set_due(agenda.tree, event, max(due, t + LEAST_LOOK))
            return left
    set_due(agenda.tree, event, due)
    return False


@inlined
def _touches_one(i, crowd):
    """Whether a part touches another, or a wall."""
    islands = crowd.islands
    for k in range(islands.first_touching[i], islands.first_touching[i + 1]):
        if crowd.pairs[islands.pair[islands.touching[k]]].touching == 1:
            return True
    return False


@compiled
def meet_group(first, t, agenda, crowd, plate, tools, reach, yielding):
    """Part `first` and all that touch each other with it: impacts, and forces while they stay together.

    Returns whether a part has come farther than its reach.
    """
    parts, kinds, work, bounds, surface = crowd.parts, crowd.kinds, tools.work, plate.bounds, plate.surface
    size = _gather_group(first, crowd, work)
    n, moved, left, pressed, slack = 0, False, False, False, 0.0
    for k in range(size):
        i = work.group[k]
        part = parts[i]
        kind = kinds.record[part.kind]
        bring(part, kind, t, surface)
        left = has_left(i, crowd, reach) or left
        wake(part)
        pressed = pressed or part.phase != FREE
        part.phase = FREE
        lowest_points(part, kind, surface, bounds, CLOSE, t, work)
        corners = kinds.corners[kind.corner_from : kind.corner_to]
        if is_round(kind):
            corners = work.points[: count_of(kind)]
        work.from_row[k] = n
        if n + corners.shape[0] + 1 >= work.point.shape[0]:
            continue
        _, moved = look(part, kind, corners, k, n, surface, bounds, t, moved, work)
        n, _, moved = look_at_edge(part, kind, kinds, k, n + corners.shape[0], surface, bounds, t, moved, work)
        slack = max(slack, unsure(part, kind, bounds)[0])
    plate_rows = n
    n = _look_at_pairs(size, n, crowd, tools)
    work.from_row[size] = n
    if not moved:
        move_surface(t, surface, work.now)
    hit = strike(parts, kinds, size, n, surface, bounds, t, work, yielding)
    until = next_switch(surface, t, bounds.end)
    stays, held, m = press(parts, kinds, size, n, pressed, slack, surface, bounds, t, until, work, yielding)
    if stays > 0.0 and m > 0:
        if held and bounds.calm and _is_still(size, bounds, work):
            for k in range(size):
                rest(parts[work.group[k]])
                parts[work.group[k]].due = np.inf
        else:
            apply_forces(parts, size, m, stays, work)
            for k in range(size):
                parts[work.group[k]].due = t + stays
    else:
        _part_company(size, crowd, work)
    members = work.members
    for k in range(size):
        members[k] = work.group[k]
    for k in range(size):
        i = members[k]
        part = parts[i]
        if stays == 0.0 or m == 0:
            leap, again = meet_plate(i, parts, kinds, None, surface, bounds, t, work, yielding)
            part.due = t + leap
            hit = hit or again
            if part.there == ASLEEP:
                part.due = np.inf
        if i < crowd.islands.place.shape[0]:
            set_due(agenda.tree, crowd.islands.place[i] - agenda.first_part, part.due)
        if hit or not pressed or stays == 0.0 or yields(yielding):
            look_again_at_pairs(i, t, agenda, crowd, plate)
    return left and plate_rows >= 0


@inlined
def _is_still(size, bounds, work):
    """Whether a group will hardly move."""
    fastest = 0.0
    for k in range(size):
        for c in range(3):
            fastest = max(fastest, abs(work.bodies.velocity[k, c]), 1e-3 * abs(work.bodies.spin[k, c]))
    return fastest < STILL + 1.01 * bounds.speed


@compiled
def _gather_group(first, crowd, work):
    """The parts that touch each other, from one on, into work.group; returns their number."""
    islands = crowd.islands
    size, done = 1, 0
    work.group[0] = first
    while done < size:
        i = work.group[done]
        done += 1
        for k in range(islands.first_touching[i], islands.first_touching[i + 1]):
            pair = crowd.pairs[islands.pair[islands.touching[k]]]
            if pair.touching == 0:
                continue
            other = pair.b if pair.a == i else pair.a
            if other >= islands.place.shape[0] or size == work.group.shape[0] or _place_in(other, size, work) >= 0:
                continue
            work.group[size] = other
            size += 1
    return size


@inlined
def _place_in(i, size, work):
    """Place of a part in the group, or -1."""
    for k in range(size):
        if work.group[k] == i:
            return k
    return -1


@compiled
def _look_at_pairs(size, n, crowd, tools):
    """Rows of the pairs that touch in a group, after n others; returns their end. A pair that is apart touches no more."""
    islands, work = crowd.islands, tools.work
    for k in range(size):
        i = work.group[k]
        for place in range(islands.first_touching[i], islands.first_touching[i + 1]):
            pair = crowd.pairs[islands.pair[islands.touching[place]]]
            if pair.touching == 0 or (pair.a != i and pair.b != i):
                continue
            other = pair.b if pair.a == i else pair.a
            at = -1 if other >= islands.place.shape[0] else _place_in(other, size, work)
            if other < islands.place.shape[0] and (at < 0 or at < k):
                continue  # in a group of its own, or looked at already
            find_axis(pair, crowd.parts, crowd.kinds, tools.hulls)
            bodies = (k, at) if pair.a == i else (at, k)
            n = look_at_pair_points(pair, crowd.parts, crowd.kinds, tools.hulls, bodies, n, work)
    renew_pair_rates(crowd.parts, crowd.kinds, n, work)
    return n


@compiled
def _part_company(size, crowd, work):
    """Pairs of a group that does not stay together touch no more."""
    islands = crowd.islands
    for k in range(size):
        i = work.group[k]
        for place in range(islands.first_touching[i], islands.first_touching[i + 1]):
            crowd.pairs[islands.pair[islands.touching[place]]].touching = 0


@compiled
def look_again_at_pairs(i, t, agenda, crowd, plate):
    """Make the pairs of a part due anew after its velocity has changed at time t, but for those that touch."""
    islands = crowd.islands
    for k in range(islands.first_touching[i], islands.first_touching[i + 1]):
        place = islands.touching[k]
        pair = crowd.pairs[islands.pair[place]]
        event = agenda.n_parts + place - agenda.first_pair
        if pair.touching == 1:
            set_due(agenda.tree, event, np.inf)
            continue
        due, gap = meeting_bound(pair, crowd.parts, crowd.kinds, t, plate)
        if gap <= TOUCHING:
            due = max(due, t + LEAST_LOOK)
        set_due(agenda.tree, event, due)


@compiled
def look_again(t, agenda, crowd, plate):
    """Make every part due, and its pairs: its forecast was made over another surface."""
    for k in range(agenda.n_parts):
        i = crowd.islands.part[agenda.first_part + k]
        part = crowd.parts[i]
        kind = crowd.kinds.record[part.kind]
        if part.there == ASLEEP:
            if plate.bounds.calm:
                continue
            bring(part, kind, t, plate.surface)  # it has lain there until now
            wake(part)
        due = max(t, part.clock + shortest_leap(part, kind, plate.bounds))
        if due < agenda.tree[agenda.tree.shape[0] // 2 + k]:
            part.due = due
            set_due(agenda.tree, k, due)
        look_again_at_pairs(i, t, agenda, crowd, plate)


@inlined
def has_left(i, crowd, reach):
    """Whether a part is farther from its place at the begin of the window than its neighbours were looked for."""
    return _squared_way(crowd.parts[i], crowd.begun[i], crowd.kinds.record[crowd.parts[i].kind]) > reach * reach


@inlined
def _squared_way(part, begun, kind):
    """Square of the way that a part has come [m^2]; or of what the centres of its pieces have at most, by turning."""
    squared = 0.0
    for k in range(3):
        squared += (part.position[k] - begun.position[k]) ** 2
    if in_pieces(kind):
        turned = 0.0
        for i in range(3):
            for k in range(3):
                turned += (part.attitude[i, k] - begun.attitude[i, k]) ** 2
        squared = max(squared, turned * kind.reach * kind.reach)
    return squared


@compiled
def all_due(n, t):
    """Tournament tree over n events due at time t: node 1 holds the earliest, node k that of 2 k and 2 k + 1."""
    size = 1
    while size < n:
        size *= 2
    tree = np.full(2 * size, np.inf)
    tree[size : size + n] = t
    for k in range(size - 1, 0, -1):
        tree[k] = min(tree[2 * k], tree[2 * k + 1])
    return tree


@compiled
def earliest_of(tree):
    """Number of the event that is due first; of several, the one with the lowest number."""
    k, size = 1, tree.shape[0] // 2
    while k < size:
        k *= 2
        if tree[k] > tree[k + 1]:
            k += 1
    return k - size


@compiled
def set_due(tree, event, t):
    k = tree.shape[0] // 2 + event
    tree[k] = t
    k //= 2
    while k > 0:
        earliest = min(tree[2 * k], tree[2 * k + 1])
        if tree[k] == earliest:
            return
        tree[k] = earliest
        k //= 2
