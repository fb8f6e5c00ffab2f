"""Windows of time in which many parts advance: who can meet whom, and which thread has which parts.

A part covers at most a certain reach in a window, and only parts within twice that of each other are looked at as
pairs. The reach is that of the fastest part there is, thrown once more by the plate. An impact can make a part faster
than that (a light part struck by a heavy one, spin turned into translation): a window in which a part has left its
reach is computed again with a larger one.

Islands are shared out over threads. Each thread finds all of them, from the parts at the begin of the window, which
takes less than handing them over, and advances its own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.fixed import own_speed
from feeder_sim.engines.impulse.impact_law import largest_restitution
from feeder_sim.engines.impulse.pairs.neighbours import Islands, Room, find_islands, find_pairs
from feeder_sim.engines.impulse.rest import wake
from feeder_sim.engines.impulse.state import STEADY, Kinds, in_pieces, orthonormalise_parts, turning_speed
from feeder_sim.machine_code import compiled, inlined


class Window(NamedTuple):
    """A window that a thread computes its share of.

    initial: the parts at its begin; pairs: of the window before; start, end, and until when it is computed [s]; reach:
    how far a part may come [m], 0 for as far as its speed suggests; thread: which it is, of how many.
    """

    initial: NDArray[np.void]
    pairs: NDArray[np.void]
    start: float
    end: float
    until: float
    reach: float
    thread: int
    threads: int


class WindowResult(NamedTuple):
    """What a thread has computed of a window.

    pairs: all that can meet; own: those in islands of this thread; reach: that they were found with [m]; distance: of
    the part that has come farthest, if any has left its reach, else 0 [m].
    """

    pairs: NDArray[np.void]
    own: NDArray[np.bool_]
    reach: float
    distance: float


class Span(NamedTuple):
    """What is computed of a window: from when, to when [s], and how far from its initial place a part may come [m]."""

    start: float
    end: float
    reach: float


class Crowd(NamedTuple):
    """The parts of a window: state of each, now and at its begin, pairs that can meet, and their islands."""

    parts: NDArray[np.void]
    initial: NDArray[np.void]
    pairs: NDArray[np.void]
    kinds: Kinds
    islands: Islands


@compiled
def open_parts(parts, n_free, bounds):
    """Wake parts unless the plate is calm, and take the round-off of many flights out of their attitudes."""
    if not bounds.calm:
        for i in range(n_free):
            wake(parts[i])
    orthonormalise_parts(parts, n_free)


@compiled
def find_neighbours(initial, n_free, kinds, surface, reach, pairs):
    """Pairs that can meet while every part stays within its reach [m], and their islands; old pairs keep their axis."""
    room = Room(surface.grid_x[-1], surface.grid_y[-1], reach)
    meeting = find_pairs(initial, kinds, n_free, room, pairs)
    return meeting, find_islands(initial, n_free, meeting)


@compiled
def own_islands(window, crowd):
    """Whether each island is one of this thread; the parts of those are put where the window begins."""
    islands = crowd.islands
    own = _share_out(islands, window.threads) == window.thread
    for island in range(own.shape[0]):
        if own[island]:
            for k in range(islands.first_part[island], islands.first_part[island + 1]):
                crowd.parts[islands.part[k]] = crowd.initial[islands.part[k]]
    return own


@compiled
def own_pairs(own, islands):
    """Whether each pair is in an island that is `own`."""
    is_own = np.zeros(islands.pair.shape[0], np.bool_)
    for island in range(own.shape[0]):
        for k in range(islands.first_pair[island], islands.first_pair[island + 1]):
            is_own[islands.pair[k]] = own[island]
    return is_own


@compiled
def longest_distance(own, crowd):
    """How far any part of islands that are `own` has come [m]; NaN where one is nowhere."""
    longest, islands = 0.0, crowd.islands
    for island in range(own.shape[0]):
        if own[island]:
            for k in range(islands.first_part[island], islands.first_part[island + 1]):
                i = islands.part[k]
                squared = squared_distance(crowd.parts[i], crowd.initial[i], crowd.kinds.record[crowd.parts[i].kind])
                if not math.isfinite(squared):
                    return np.nan
                longest = max(longest, squared)
    return math.sqrt(longest)


@inlined
def has_left(i, crowd, reach):
    """Whether a part is farther from its place at the begin of the window than its neighbours were looked for."""
    return squared_distance(crowd.parts[i], crowd.initial[i], crowd.kinds.record[crowd.parts[i].kind]) > reach * reach


@inlined
def squared_distance(part, initial, kind):
    """Square of how far a part has come, or the centres of its pieces at most by turning [m^2]."""
    squared = 0.0
    for k in range(3):
        squared += (part.position[k] - initial.position[k]) ** 2
    if in_pieces(kind):
        turned = 0.0
        for i in range(3):
            for k in range(3):
                turned += (part.attitude[i, k] - initial.attitude[i, k]) ** 2
        squared = max(squared, turned * kind.reach * kind.reach)
    return squared


@compiled
def reach_of(parts, n_free, kinds, bounds, window):
    """How far any part comes within a window [m]: plate or fixture adds (1 + e) times its own speed to the fastest.

    A reach that the window brings with it stands.
    """
    if window.reach > 0.0:
        return window.reach
    fastest, e, duration = 0.0, largest_restitution(kinds.record[0]), window.end - window.start
    for i in range(n_free):
        if parts[i].there:
            v, kind = parts[i].velocity, kinds.record[parts[i].kind]
            fastest = max(fastest, v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
            if in_pieces(kind):
                fastest = max(fastest, turning_speed(parts[i], kind) ** 2)
    pushed = bounds.speed
    for i in range(n_free, parts.shape[0]):
        if parts[i].phase == STEADY:
            pushed = max(pushed, own_speed(parts[i], kinds.record[parts[i].kind]))
    return (math.sqrt(fastest) + (1.0 + e) * pushed + GRAVITY * duration) * duration


@compiled
def _share_out(islands, n_threads):
    """Thread of every island: the largest first, each to the thread that has the least to do."""
    count = islands.first_part.shape[0] - 1
    load, owner = np.zeros(n_threads, np.int64), np.zeros(count, np.int64)
    if n_threads == 1:
        return owner
    size = (islands.first_part[1:] - islands.first_part[:-1]) + 2 * (islands.first_pair[1:] - islands.first_pair[:-1])
    order = np.argsort(-size, kind="mergesort")
    for island in order:
        owner[island] = np.argmin(load)
        load[owner[island]] += size[island]
    return owner
