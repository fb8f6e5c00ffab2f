"""Advance all parts over a plate that takes their impulses: one run of events in order of time, in one thread.

What a part does to the plate the others feel, so that there are no islands here: the event that is due first is next,
whichever part it belongs to.

How long a part may fly is forecast from the surface as it moves at that time, and with bounds on it. An impact changes
the surface. That is let pass while it is small: bounds have a margin, and a part may enter the surface by as little. As
soon as the surface has changed by more than the margin since the bounds were made, they are made anew, and every part
is looked at again; so none flies on into a surface that it has not been told of.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
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
from feeder_sim.engines.impulse.flight_time import shortest_flight
from feeder_sim.engines.impulse.frame_rows import write_row
from feeder_sim.engines.impulse.island import (
    EventQueue,
    all_due,
    check_pair,
    earliest_of,
    recheck_pairs,
    set_due,
)
from feeder_sim.engines.impulse.plate_contact import meet_plate
from feeder_sim.engines.impulse.rest import fall_asleep, wake
from feeder_sim.engines.impulse.state import ABSENT, ASLEEP, fly_to
from feeder_sim.engines.impulse.surroundings import Bounds, Plate
from feeder_sim.engines.impulse.window import SAG, Drive, acting_terms, bound_window
from feeder_sim.engines.protocol import ENDED
from feeder_sim.machine_code import borrow, compiled, entry_point

MARGIN = 0.05  # of crest and acceleration; in a step of 1/40 period the surface itself moves by three times that
LEAST_MARGIN = 2e-8  # [m]


class Limits(NamedTuple):
    """What bounds are made from, and room for what comes of it.

    margin: of every shape (n_shapes,) [m]; reaction: at the end of a window, as of `reaction_of`.
    """

    drive: Drive
    margin: NDArray[np.float64]
    reaction: NDArray[np.float64]


@compiled
def _bounds(acting, start, end, limits):
    """Bounds of the surface from `start` to `end` [s], for as long as its reaction changes by no more than the margin.

    Whether parts may sleep goes by the motion as it is.
    """
    margin, antinode, steepest = limits.margin, limits.drive.extremes[0], limits.drive.extremes[1]
    now = bound_window(acting, limits.drive, start, end)
    n = margin.shape[0]
    first = acting.term_shape.shape[0] - n
    together = 0.0
    for s in range(n):
        together += now.acceleration[s] * antinode[s]
    crest, slope, speed = now.crest, now.slope, now.speed
    most = 0.0
    for s in range(n):
        fast = acting.rate[first + s].imag
        allowed = max(MARGIN / n * min(now.crest, together / (fast * fast)), LEAST_MARGIN) / antinode[s]
        margin[s] = allowed
        crest += allowed * antinode[s]
        slope += allowed * steepest[s]
        speed += allowed * fast * antinode[s]
        now.acceleration[s] += allowed * fast * fast
        most += now.acceleration[s] * antinode[s]
    rest_step = now.rest_step
    if rest_step > now.step:  # nothing drives it
        rest_step = max(now.step, math.sqrt(2.0 * SAG / (GRAVITY + most)))
    return Bounds(end, crest, slope, speed, rest_step, *now[5:])


@compiled
def _has_changed(changed, margin):
    """Whether the reaction has changed by more than the margin of a shape."""
    has_changed = False
    for s in range(margin.shape[0]):
        has_changed = has_changed or changed[s].real ** 2 + changed[s].imag ** 2 > margin[s] ** 2
    return has_changed


@entry_point
def advance_reacting(window, parts, n_free, kinds, limits, tools, frames):
    """Advance all parts through a window; as `advance_islands`, but that all are one island.

    The last terms of the surface are the reaction.
    """
    initial, n_shapes = window.initial.copy(), limits.margin.shape[0]
    acting = acting_terms(limits.drive.surface, window.start, window.end, n_shapes)
    bounds = _bounds(acting, window.start, window.end, limits)
    open_parts(initial, n_free, bounds)
    reach = reach_of(initial, n_free, kinds, bounds, window)
    pairs, islands = find_neighbours(initial, n_free, kinds, acting, reach, window.pairs)
    crowd = Crowd(parts, borrow(initial), borrow(pairs), kinds, borrow(islands))
    own, calm, acceleration = own_islands(window, crowd), bounds.calm, bounds.acceleration.copy()
    span, surface = Span(window.start, window.until, reach), borrow(acting)
    left = _advance(crowd, surface, borrow(bounds), tools, span, frames, limits)
    if not left and calm and window.until == window.end and frames.interrupt[ENDED] == 0:
        for s in range(n_shapes):
            bounds.acceleration[s] = acceleration[s]  # as the window opened
        lay_to_rest(own, crowd, Plate(surface, borrow(bounds), None), tools, span.end)
    distance, first = longest_distance(own, crowd) if left else 0.0, acting.rate.shape[0] - n_shapes
    for s in range(n_shapes):
        z = acting.coefficient[first + s]
        limits.reaction[s, 0], limits.reaction[s, 1], limits.reaction[s, 2] = (
            z.real,
            z.imag,
            acting.term_start[first + s],
        )
    alive = initial.shape[0] + bounds.amplitude.shape[0] >= 0  # what was borrowed lives until here
    return WindowResult(pairs, own_pairs(own, islands), reach, distance if alive else 0.0)


@compiled
def _advance(crowd, surface, bounds, tools, span, frames, limits):
    islands, parts, kinds = crowd.islands, crowd.parts, crowd.kinds
    n = islands.part.shape[0]
    tree = all_due(n + islands.pair.shape[0], span.start)
    queue = EventQueue(borrow(tree), 0, n, 0)
    changed = tools.work.yielding.changed
    changed[:] = 0.0
    for k in range(n):
        if parts[islands.part[k]].there == ASLEEP:
            set_due(tree, k, np.inf)
    left = False
    for frame in range(frames.time.shape[0] + 1):
        stop = frames.time[frame] if frame < frames.time.shape[0] else span.end
        while tree[1] < stop and frames.interrupt[ENDED] == 0:
            t, event = tree[1], earliest_of(tree)
            if event >= n:
                left |= check_pair(event, t, queue, crowd, bounds, tools, span.reach)
                continue
            i = islands.part[event]
            part = parts[i]
            fly_to(part, kinds.record[part.kind], t)
            left |= has_left(i, crowd, span.reach)
            leap, hit = meet_plate(i, parts, kinds, surface, bounds, t, tools.work)
            set_due(tree, event, t + leap)
            if not hit:
                continue
            if _has_changed(changed, limits.margin):
                bounds = _renewed(surface, bounds, t, changed, limits)
                _recheck(t, queue, crowd, bounds)
            if bounds.calm and fall_asleep(part, kinds, surface, tools.work):
                set_due(tree, event, np.inf)
            recheck_pairs(i, -1, t, queue, crowd, bounds)
        for k in range(n):
            i = islands.part[k]
            if frame < frames.time.shape[0]:
                write_row(parts, i, kinds, stop, frames.row[frame, i])
            else:
                fly_to(parts[i], kinds.record[parts[i].kind], stop)
                left |= has_left(i, crowd, span.reach)
    return left and tree.shape[0] > 0


@compiled
def _renewed(surface, bounds, t, changed, limits):
    """Bounds from time t on, in the arrays of the old ones."""
    changed[:] = 0.0
    new = _bounds(surface, t, bounds.end, limits)
    for s in range(new.acceleration.shape[0]):
        bounds.acceleration[s] = new.acceleration[s]
    sizes = bounds.acceleration, bounds.amplitude
    return Bounds(new.end, new.crest, new.slope, new.speed, new.rest_step, *sizes, *new[7:])


@compiled
def _recheck(t, queue, crowd, bounds):
    """Make every part due, as its forecast was made over another surface; but none sooner than a step after a look."""
    for k in range(queue.n_parts):
        i = crowd.islands.part[k]
        part = crowd.parts[i]
        kind = crowd.kinds.record[part.kind]
        if part.there == ASLEEP and not bounds.calm:
            fly_to(part, kind, t)  # it has lain there until now
            wake(part)
            recheck_pairs(i, -1, t, queue, crowd, bounds)
        if part.there != ASLEEP and part.there != ABSENT:
            due = max(t, part.clock + shortest_flight(part, kind, bounds))
            if due < queue.tree[queue.tree.shape[0] // 2 + k]:
                set_due(queue.tree, k, due)
