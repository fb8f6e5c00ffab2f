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

from feeder_sim.engines.impulse.components import lay_to_rest
from feeder_sim.engines.impulse.crowd import (
    Crowd,
    Span,
    WindowResult,
    find_neighbours,
    has_left,
    longest_distance,
    open_parts,
    own_islands,
    own_pairs,
    reach_of,
)
from feeder_sim.engines.impulse.frame_rows import write_row
from feeder_sim.engines.impulse.pairs.collision import meet
from feeder_sim.engines.impulse.pairs.due import meeting_bound
from feeder_sim.engines.impulse.pairs.hulls import Hulls
from feeder_sim.engines.impulse.pairs.separating_axis import Meeting
from feeder_sim.engines.impulse.plate_contact import meet_plate
from feeder_sim.engines.impulse.rest import fall_asleep, wake
from feeder_sim.engines.impulse.scratch import Scratch
from feeder_sim.engines.impulse.state import ALONE, ASLEEP, fly_to
from feeder_sim.engines.impulse.surroundings import Plate
from feeder_sim.engines.impulse.window import acting_terms, bound_window
from feeder_sim.engines.protocol import ENDED
from feeder_sim.machine_code import borrow, compiled, entry_point, inlined, uncounted


class Tools(NamedTuple):
    """What belongs to one thread."""

    hulls: Hulls
    work: Scratch
    meeting: Meeting


class EventQueue(NamedTuple):
    """When the events of one island are due: first those of its parts, then those of its pairs.

    tree: see `all_due`; first_part, first_pair: of the island, in `Islands`; n_parts: of the island.
    """

    tree: NDArray[np.float64]
    first_part: int
    n_parts: int
    first_pair: int


@entry_point
def advance_islands(window, parts, n_free, kinds, drive, tools, frames):
    """Advance the islands of a thread through a window, and write their frames; returns a `WindowResult`.

    parts: where their state is written to, shared by all threads; those from n_free on are walls. On a calm plate what
    lies still at the end of the window is put to sleep.
    """
    initial = window.initial.copy()
    acting = acting_terms(drive.surface, window.start, window.end)
    bounds = bound_window(acting, drive, window.start, window.end)
    open_parts(initial, n_free, bounds)
    reach = reach_of(initial, n_free, kinds, bounds, window)
    pairs, islands = find_neighbours(initial, n_free, kinds, acting, reach, window.pairs)
    crowd = Crowd(parts, borrow(initial), borrow(pairs), kinds, borrow(islands))
    own = own_islands(window, crowd)
    left = _advance_all(own, crowd, Plate(borrow(acting), borrow(bounds), None), tools, window, reach, frames)
    distance = longest_distance(own, crowd) if left else 0.0
    # What was borrowed lives until here.
    alive = initial.shape[0] + acting.rate.shape[0] + bounds.amplitude.shape[0] >= 0
    return WindowResult(pairs, own_pairs(own, islands), reach, distance if alive else 0.0)


@compiled
def _advance_all(own, crowd, plate, tools, window, reach, frames):
    span, left = Span(window.start, window.until, reach), False
    for island in range(own.shape[0]):
        if own[island]:
            left |= _advance_island(island, crowd, plate, tools, span, frames)
    if not left and plate.bounds.calm and window.until == window.end and frames.interrupt[ENDED] == 0:
        lay_to_rest(own, crowd, plate, tools, span.end)
    return left


@compiled
def _advance_island(island, crowd, plate, tools, span, frames):
    islands, parts, kinds = crowd.islands, crowd.parts, crowd.kinds
    first, last = islands.first_part[island], islands.first_part[island + 1]
    first_pair, last_pair = islands.first_pair[island], islands.first_pair[island + 1]
    n = last - first
    tree = all_due(n + last_pair - first_pair, span.start)
    queue = EventQueue(borrow(tree), first, n, first_pair)
    for k in range(n):
        if parts[islands.part[first + k]].there == ASLEEP:
            set_due(tree, k, np.inf)
    left = False
    for frame in range(frames.time.shape[0] + 1):
        stop = frames.time[frame] if frame < frames.time.shape[0] else span.end
        while tree[1] < stop and frames.interrupt[ENDED] == 0:
            t, event = tree[1], earliest_of(tree)
            if event < n:
                left |= _check_part(event, t, queue, crowd, plate, tools.work, span.reach)
            else:
                left |= check_pair(event, t, queue, crowd, plate.bounds, tools, span.reach)
        for k in range(first, last):
            i = islands.part[k]
            if frame < frames.time.shape[0]:
                write_row(parts, i, kinds, stop, frames.row[frame, i])
            else:
                fly_to(parts[i], kinds.record[parts[i].kind], stop)
                left |= has_left(i, crowd, span.reach)
    return left and tree.shape[0] > 0  # what was borrowed lives until here


@inlined
def _check_part(event, t, queue, crowd, plate, work, reach):
    """A part over the plate; returns whether it has come farther than its reach."""
    i = crowd.islands.part[queue.first_part + event]
    part = crowd.parts[i]
    fly_to(part, crowd.kinds.record[part.kind], t)
    left = has_left(i, crowd, reach)
    leap, hit = meet_plate(i, crowd.parts, crowd.kinds, plate.surface, plate.bounds, t, work)
    set_due(queue.tree, event, t + leap)
    if hit:
        alone = crowd.islands.first_touching[i] == crowd.islands.first_touching[i + 1]
        if plate.bounds.calm and alone and fall_asleep(part, crowd.kinds, plate.surface, work):
            set_due(queue.tree, event, np.inf)
        recheck_pairs(i, -1, t, queue, crowd, plate.bounds)
    return left


@inlined
def check_pair(event, t, queue, crowd, bounds, tools, reach):
    """A pair of parts; returns whether one of them has come farther than its reach."""
    parts, kinds, islands = crowd.parts, crowd.kinds, crowd.islands
    p = islands.pair[queue.first_pair + event - queue.n_parts]
    pair = crowd.pairs[p]
    left = False
    due, near = meeting_bound(pair, parts, kinds, t, bounds)
    if near:
        hit, _ = meet(pair, parts, kinds, 0.0, tools)
        if hit:
            _wake_with(pair.a, p, t, queue, crowd, bounds)
            _wake_with(pair.b, p, t, queue, crowd, bounds)
        due, near = meeting_bound(pair, parts, kinds, t, bounds)
        if hit:
            for i in (pair.a, pair.b):
                if i < islands.place.shape[0]:  # walls have no events
                    left |= has_left(i, crowd, reach)
                    set_due(queue.tree, islands.place[i] - queue.first_part, t)
                    recheck_pairs(i, p, t, queue, crowd, bounds)
    set_due(queue.tree, event, due)
    return left


@uncounted
def _wake_with(i, except_pair, t, queue, crowd, bounds):
    """Wake a part at time t, and all that sleep with it."""
    parts, number = crowd.parts, crowd.parts[i].asleep_with
    if parts[i].there != ASLEEP:
        return
    wake(parts[i])
    if number == ALONE:
        return
    for k in range(queue.n_parts):
        j = crowd.islands.part[queue.first_part + k]
        if parts[j].there == ASLEEP and parts[j].asleep_with == number:
            parts[j].clock = t
            wake(parts[j])
            set_due(queue.tree, k, t)
            recheck_pairs(j, except_pair, t, queue, crowd, bounds)


@inlined
def recheck_pairs(i, except_pair, t, queue, crowd, bounds):
    """Make the pairs of a part due anew after its velocity has changed at time t.

    For touching pairs keep the earlier of the old and new due time; otherwise frequent impacts on the plate postpone it
    for ever.
    """
    islands = crowd.islands
    for k in range(islands.first_touching[i], islands.first_touching[i + 1]):
        place = islands.touching[k]
        p = islands.pair[place]
        if p != except_pair:
            due, near = meeting_bound(crowd.pairs[p], crowd.parts, crowd.kinds, t, bounds)
            event = queue.n_parts + place - queue.first_pair
            if near:
                due = min(due, queue.tree[queue.tree.shape[0] // 2 + event])
            set_due(queue.tree, event, due)


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
