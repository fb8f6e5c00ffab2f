"""Windows of time in which many parts advance: who can meet whom, and which thread has which parts.

A part covers at most a certain reach in a window, and only parts within twice that of each other are looked at as
pairs. The reach is that of the fastest part there is, thrown once more by the plate. An impact can make a part faster
than that (a light part struck by a heavy one, spin turned into translation): a window in which a part has left its
reach is computed again with a larger one.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.impact_law import largest_restitution
from feeder_sim.engines.impulse.pairs.neighbours import Room, find_islands, find_pairs
from feeder_sim.engines.impulse.rest import wake
from feeder_sim.engines.impulse.state import in_pieces, orthonormalise_parts, turning_speed
from feeder_sim.engines.impulse.window import acting_terms, bound_window
from feeder_sim.machine_code import compiled, entry_point


@entry_point
def open_window(parts, n_free, kinds, drive, span):
    """Terms that act and bounds of a window from span[0] to span[1] [s], and the reach of parts in it [m].

    Wakes all parts unless the plate is calm.
    """
    start, end = span
    acting = acting_terms(drive.surface, start, end)
    bounds = bound_window(acting, drive, start, end)
    if not bounds.calm:
        for i in range(n_free):
            wake(parts[i])
    orthonormalise_parts(parts, n_free)
    return acting, bounds, reach_of(parts, n_free, kinds, bounds, end - start)


@entry_point
def find_neighbours(parts, n_free, kinds, surface, reach, pairs):
    """Pairs that can meet while every part stays within its reach [m], and their islands; old pairs keep their axis."""
    room = Room(surface.grid_x[-1], surface.grid_y[-1], reach)
    meeting = find_pairs(parts, kinds, n_free, room, pairs)
    return meeting, find_islands(parts, n_free, meeting)


@compiled
def reach_of(parts, n_free, kinds, bounds, duration):
    """How far any part comes within a window [m]: the plate adds (1 + e) times its own speed to the fastest."""
    fastest, e = 0.0, largest_restitution(kinds.record[0])
    for i in range(n_free):
        if parts[i].there:
            v, kind = parts[i].velocity, kinds.record[parts[i].kind]
            fastest = max(fastest, v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
            if in_pieces(kind):
                fastest = max(fastest, turning_speed(parts[i], kind) ** 2)
    return (math.sqrt(fastest) + (1.0 + e) * bounds.speed + GRAVITY * duration) * duration


@entry_point
def share_out(islands, n_threads):
    """Thread of every island: the largest first, each to the thread that has the least to do."""
    count = islands.first_part.shape[0] - 1
    size = (islands.first_part[1:] - islands.first_part[:-1]) + 2 * (islands.first_pair[1:] - islands.first_pair[:-1])
    order = np.argsort(-size, kind="mergesort")
    load, owner = np.zeros(n_threads, np.int64), np.empty(count, np.int64)
    for island in order:
        owner[island] = np.argmin(load)
        load[owner[island]] += size[island]
    return owner
