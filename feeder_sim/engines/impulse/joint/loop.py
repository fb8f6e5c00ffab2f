"""Advance the parts of islands through a window, event by event: island.py with the step of one part (step.py).

An event is a look at a part, or at a pair. A part that is in a pair that presses is looked at with its component. The
plate has windows of its own, longer than those in which pairs are found, so that parts may ride it through them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.crowd import (
    Span,
    WindowResult,
    find_neighbours,
    has_left,
    longest_distance,
    own_islands,
    own_pairs,
    reach_of,
)
from feeder_sim.engines.impulse.fixed import move_fixture
from feeder_sim.engines.impulse.frame_rows import write_state
from feeder_sim.engines.impulse.free_part.loop import FreePart
from feeder_sim.engines.impulse.free_part.ride import move_to
from feeder_sim.engines.impulse.free_part.step import step
from feeder_sim.engines.impulse.island import EventQueue, all_due, earliest_of, set_due
from feeder_sim.engines.impulse.joint.component import SLOW, check_component
from feeder_sim.engines.impulse.joint.members import is_fixture
from feeder_sim.engines.impulse.joint.pair_bound import pair_bound, release
from feeder_sim.engines.impulse.pairs.at_fixture import meet_fixture, parting_from_fixture
from feeder_sim.engines.impulse.pairs.collision import meet, slowest_parting
from feeder_sim.engines.impulse.pairs.neighbours import Islands
from feeder_sim.engines.impulse.rest import wake
from feeder_sim.engines.impulse.state import ALONE, ASLEEP, AWAKE, FREE, Kinds, orthonormalise_parts
from feeder_sim.engines.impulse.window import acting_terms, bound_window
from feeder_sim.engines.protocol import ENDED
from feeder_sim.machine_code import borrow, compiled, entry_point, inlined, uncounted

CATCH_UP = 1000  # looks at a part that has gone back in time, until it is where the others are
SOON = 5e-5  # [s]; parts that hit each other again so soon do so between others
REPEATS = 3  # looks more at the time of a hit, at what has been hit by others meanwhile
AS_IT_FLEW = 1e-9  # [m/s]; a speed that has changed by no more has not


class Crowd(NamedTuple):
    """As `crowd.Crowd`; loads (parts, points, 6): what the points of each part bore last, force [N], moment [N m]."""

    parts: NDArray[np.void]
    initial: NDArray[np.void]
    pairs: NDArray[np.void]
    kinds: Kinds
    islands: Islands
    loads: NDArray[np.float64]


@entry_point
def open_plate(drive, start, end):
    """Terms that act, and bounds, of a window of the plate."""
    acting = acting_terms(drive.surface, start, end)
    return acting, bound_window(acting, drive, start, end)


@entry_point
def advance_together(window, plate_opens, parts, loads, kinds, plate, tools, frames):
    """As `advance_islands`; loads: as of `Crowd`. The plate has windows of its own; with this one one may open."""
    initial, n = window.initial.copy(), loads.shape[0]
    _open_parts(initial, n, window.start, plate_opens, plate.bounds)
    for i in range(n, parts.shape[0]):  # fixtures, wherever they were looked at last
        move_fixture(parts[i], window.start, plate.surface)
        initial[i] = parts[i]
    reach = reach_of(initial, n, kinds, plate.bounds, window)
    pairs, islands = find_neighbours(initial, n, kinds, plate.surface, reach, window.pairs)
    crowd = Crowd(parts, borrow(initial), borrow(pairs), kinds, borrow(islands), loads)
    own, span, left = own_islands(window, crowd), Span(window.start, window.until, reach), False
    for island in range(own.shape[0]):
        if own[island]:
            left |= _advance_island(island, crowd, plate, tools, span, frames)
    distance = longest_distance(own, crowd) if left else 0.0
    alive = initial.shape[0] >= 0  # what was borrowed lives until here
    return WindowResult(pairs, own_pairs(own, islands), reach, distance if alive else 0.0)


@compiled
def _open_parts(parts, n_free, start, plate_opens, bounds):
    """Wake parts that a plate moves; all are due where a window of the plate opens."""
    for i in range(n_free):
        if plate_opens:
            parts[i].due = start
        if parts[i].there == ASLEEP and not bounds.calm:
            parts[i].there, parts[i].clock, parts[i].due = AWAKE, start, start
    orthonormalise_parts(parts, n_free)


@compiled
def _advance_island(island, crowd, plate, tools, span, frames):
    islands, parts, kinds = crowd.islands, crowd.parts, crowd.kinds
    first, last = islands.first_part[island], islands.first_part[island + 1]
    first_pair, last_pair = islands.first_pair[island], islands.first_pair[island + 1]
    n = last - first
    tree = all_due(n + last_pair - first_pair, span.start)
    queue = EventQueue(borrow(tree), first, n, first_pair)
    for k in range(n):
        part = parts[islands.part[first + k]]
        set_due(tree, k, np.inf if part.there == ASLEEP else max(part.due, span.start))
    for k in range(last_pair - first_pair):
        if crowd.pairs[islands.pair[first_pair + k]].pressing != 0:
            set_due(tree, n + k, np.inf)
    left = False
    for frame in range(frames.time.shape[0] + 1):
        stop = frames.time[frame] if frame < frames.time.shape[0] else span.end
        while tree[1] < stop and frames.interrupt[ENDED] == 0:
            t, event = tree[1], earliest_of(tree)
            if event < n:
                left |= _check_part(event, t, queue, crowd, plate, tools, span.reach)
            else:
                left |= _check_pair(event, t, queue, crowd, plate, tools, span.reach)
        for k in range(first, last):
            i = islands.part[k]
            kind = kinds.record[parts[i].kind]
            if frame < frames.time.shape[0]:
                tools.seen[0] = parts[i]  # which itself is left as it is
                move_to(tools.seen[0], kind, stop, plate.surface)
                write_state(tools.seen[0], kind, frames.row[frame, i])
                continue
            move_to(parts[i], kind, stop, plate.surface)
            left |= has_left(i, crowd, span.reach)
    return left and tree.shape[0] > 0  # what was borrowed lives until here


@inlined
def _check_part(event, t, queue, crowd, plate, tools, reach):
    """Look at a part, with its component if it presses others; returns whether one has come farther than its reach."""
    i = crowd.islands.part[queue.first_part + event]
    if _presses(i, crowd):
        return _check_component(i, t, queue, crowd, plate, tools, reach)
    part = crowd.parts[i]
    free = FreePart(crowd.parts[i : i + 1], crowd.loads[i], crowd.kinds, tools.work, plate.wall, tools.notes)
    tools.work.member[0] = 0  # which pairs have written
    phase, fallen, due, looks = part.phase, GRAVITY * (t - part.clock), t, 0
    before = (
        part.velocity[0],
        part.velocity[1],
        part.velocity[2] - fallen,
        part.momentum[0],
        part.momentum[1],
        part.momentum[2],
    )
    while due <= t and looks < CATCH_UP:
        due = step(free, plate, due)
        looks += 1
    if part.there == ASLEEP:
        part.asleep_with, due = ALONE, np.inf
    part.due = due
    set_due(queue.tree, event, due)
    changed, v, momentum = (
        phase != FREE or part.phase != FREE or looks > 1 or part.there == ASLEEP,
        part.velocity,
        part.momentum,
    )
    changed = changed or abs(v[0] - before[0]) + abs(v[1] - before[1]) + abs(v[2] - before[2]) > AS_IT_FLEW
    if changed or momentum[0] != before[3] or momentum[1] != before[4] or momentum[2] != before[5]:
        _recheck(i, -1, t, queue, crowd, plate)
    return has_left(i, crowd, reach)


@inlined
def _presses(i, crowd):
    islands = crowd.islands
    for k in range(islands.first_touching[i], islands.first_touching[i + 1]):
        if crowd.pairs[islands.pair[islands.touching[k]]].pressing != 0:
            return True
    return False


@uncounted
def _check_component(i, t, queue, crowd, plate, tools, reach):
    """Look at the component of a part; returns whether a member has come farther than its reach."""
    n, m, until, pressed = check_component(i, t, crowd, plate, tools)
    together, left = tools.together, False
    for k in range(n):
        j = together.work.member[k]
        part = crowd.parts[j]
        if pressed:
            part.due = until
        if part.there == ASLEEP:
            part.due = np.inf
        set_due(queue.tree, crowd.islands.place[j] - queue.first_part, part.due)
        left |= has_left(j, crowd, reach)
    for x in range(m):
        place = together.pair[x]
        pair = crowd.pairs[crowd.islands.pair[place]]
        if not pressed:
            pair.pressing = 0
        if pair.pressing == 0:
            due, _ = pair_bound(pair, t, crowd, plate)
            set_due(queue.tree, queue.n_parts + place - queue.first_pair, due)
    for k in range(n):
        _recheck(together.work.member[k], -1, t, queue, crowd, plate)
    return left


@inlined
def _check_pair(event, t, queue, crowd, plate, tools, reach):
    """A pair of parts; returns whether one of them has come farther than its reach."""
    parts, kinds, islands = crowd.parts, crowd.kinds, crowd.islands
    p = islands.pair[queue.first_pair + event - queue.n_parts]
    pair, left = crowd.pairs[p], False
    due, near = pair_bound(pair, t, crowd, plate)
    if near:
        a, b = parts[pair.a], parts[pair.b]
        fixed = is_fixture(pair.b, crowd)
        if fixed:
            hit, n, wait = meet_fixture(pair, parts, kinds, SLOW, tools)
            if wait > 0.0:
                set_due(queue.tree, event, min(t + wait, due))  # other points may come sooner
                return left
        else:
            hit, n = meet(pair, parts, kinds, SLOW, tools)
        supported = a.phase != FREE or b.phase != FREE or a.there == ASLEEP or b.there == ASLEEP
        supported = supported or fixed or _presses(pair.a, crowd) or _presses(pair.b, crowd)
        again = hit and t < pair.struck + SOON
        pressing = again or (n > 0 and supported and _parting(pair, fixed, parts, kinds, n, tools) < SLOW)
        if hit:
            pair.repeats, pair.struck = pair.repeats + 1 if t == pair.struck else 0, t
        elif fixed and pressing:
            pair.repeats += 1  # it may not press, for all that it touches
        if hit or pressing:
            for end in range(1 if fixed else 2):
                i = pair.a if end == 0 else pair.b
                _wake_with(i, p, t, queue, crowd, plate)
                release(parts[i])
        due, near = pair_bound(pair, t, crowd, plate)
        if pressing:
            pair.pressing, due = 1, np.inf
        if hit or pressing:
            for end in range(1 if fixed else 2):
                i = pair.a if end == 0 else pair.b
                left |= has_left(i, crowd, reach)
                parts[i].due = t
                set_due(queue.tree, islands.place[i] - queue.first_part, t)
                _recheck(i, p, t, queue, crowd, plate)
    set_due(queue.tree, event, due)
    return left


@inlined
def _parting(pair, fixed, parts, kinds, n, tools):
    if fixed:
        return parting_from_fixture(pair, parts, kinds, n, tools)
    return slowest_parting(pair, parts, kinds, n, tools)


@uncounted
def _wake_with(i, except_pair, t, queue, crowd, plate):
    """Wake a part at time t, and all that sleep with it."""
    parts, number = crowd.parts, crowd.parts[i].asleep_with
    if parts[i].there != ASLEEP:
        return
    parts[i].clock = parts[i].due = t
    wake(parts[i])
    set_due(queue.tree, crowd.islands.place[i] - queue.first_part, t)
    if number == ALONE:
        return
    for k in range(queue.n_parts):
        j = crowd.islands.part[queue.first_part + k]
        if parts[j].there == ASLEEP and parts[j].asleep_with == number:
            parts[j].clock = parts[j].due = t
            wake(parts[j])
            set_due(queue.tree, k, t)
            _recheck(j, except_pair, t, queue, crowd, plate)


@uncounted
def _recheck(i, except_pair, t, queue, crowd, plate):
    """Make the pairs of a part due anew after its velocity has changed at time t."""
    islands = crowd.islands
    for k in range(islands.first_touching[i], islands.first_touching[i + 1]):
        place = islands.touching[k]
        p = islands.pair[place]
        if p == except_pair or crowd.pairs[p].pressing != 0:
            continue
        due, near = pair_bound(crowd.pairs[p], t, crowd, plate)
        event = queue.n_parts + place - queue.first_pair
        if near:
            due = min(due, queue.tree[queue.tree.shape[0] // 2 + event])
            struck, repeats = crowd.pairs[p].struck, crowd.pairs[p].repeats
            later = t > struck and not is_fixture(crowd.pairs[p].b, crowd)
            due = t if t < struck + SOON and (later or repeats < REPEATS) else due
        set_due(queue.tree, event, due)
