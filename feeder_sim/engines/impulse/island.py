"""Advance the parts of one island through a window of time, event by event.

Every part has a time of its own. An event is a look at a part over the plate, or at a pair of parts; each is due at the
earliest time at which something can happen there, and the earliest of all is next. Only what changes its velocity in an
impact makes what it could meet due anew.
"""

from __future__ import annotations

import numpy as np

from feeder_sim.engines.impulse.borrow import borrow, borrowed
from feeder_sim.engines.impulse.pair_contact import meet, meeting_bound
from feeder_sim.engines.impulse.plate_contact import meet_plate
from feeder_sim.engines.impulse.rest import fall_asleep, wake
from feeder_sim.engines.impulse.state import ASLEEP, fly_to
from feeder_sim.machine_code import compiled


@compiled
def advance_islands(owner, thread, islands, pairs, parts, kinds, no_wall, surface, bounds, hulls, start, end, work):
    """Advance the islands that belong to a thread from start to end [s]; work and hulls belong to it too."""
    islands, kinds, no_wall = borrow(islands), borrow(kinds), borrow(no_wall)
    pairs, parts = borrowed(pairs), borrowed(parts)
    surface, bounds, hulls, work = borrow(surface), borrow(bounds), borrow(hulls), borrow(work)
    for island in range(owner.shape[0]):
        if owner[island] != thread:
            continue
        first, last = islands.first_part[island], islands.first_part[island + 1]
        first_pair, last_pair = islands.first_pair[island], islands.first_pair[island + 1]
        n = last - first
        tree = _all_due(n + last_pair - first_pair, start)
        for k in range(first, last):
            if parts[islands.part[k]].there == ASLEEP:
                _set_due(tree, k - first, np.inf)
        while tree[1] < end:
            t, leaf = tree[1], _earliest(tree)
            if leaf < n:
                i = islands.part[first + leaf]
                part = parts[i]
                fly_to(part, kinds.record[part.kind], t)
                leap, hit = meet_plate(part, kinds, no_wall, surface, bounds, t, work)
                _set_due(tree, leaf, t + leap)
                if hit:
                    if bounds.calm and fall_asleep(part, kinds, work):
                        _set_due(tree, leaf, np.inf)
                    _look_at_pairs(i, -1, islands, first_pair, n, tree, pairs, parts, kinds, t, bounds)
                continue
            p = islands.pair[first_pair + leaf - n]
            pair = pairs[p]
            due, near = meeting_bound(pair, parts, kinds, t, bounds)
            if near:
                hit = meet(pair, parts, kinds, hulls)
                if hit:
                    wake(parts[pair.a])
                    wake(parts[pair.b])
                due, near = meeting_bound(pair, parts, kinds, t, bounds)
                if hit:
                    for i in (pair.a, pair.b):
                        if i < islands.place.shape[0]:
                            _set_due(tree, islands.place[i] - first, t)
                            _look_at_pairs(i, p, islands, first_pair, n, tree, pairs, parts, kinds, t, bounds)
            _set_due(tree, leaf, due)
        for k in range(first, last):
            part = parts[islands.part[k]]
            fly_to(part, kinds.record[part.kind], end)


@compiled
def _look_at_pairs(i, except_pair, islands, first_pair, n, tree, pairs, parts, kinds, t, bounds):
    """Make the pairs of a part due anew after its velocity has changed at time t.

    Of parts that touch the look that is due stays due: else one that hits the plate at every step would put it off for
    ever.
    """
    for k in range(islands.first_touching[i], islands.first_touching[i + 1]):
        place = islands.touching[k]
        p = islands.pair[place]
        if p != except_pair:
            due, near = meeting_bound(pairs[p], parts, kinds, t, bounds)
            event = n + place - first_pair
            if near:
                due = min(due, tree[tree.shape[0] // 2 + event])
            _set_due(tree, event, due)


@compiled
def _all_due(n, t):
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
def _earliest(tree):
    """Number of the event that is due first; of several, the one with the lowest number."""
    k, size = 1, tree.shape[0] // 2
    while k < size:
        k *= 2
        if tree[k] > tree[k + 1]:
            k += 1
    return k - size


@compiled
def _set_due(tree, event, t):
    k = tree.shape[0] // 2 + event
    tree[k] = t
    k //= 2
    while k > 0:
        earliest = min(tree[2 * k], tree[2 * k + 1])
        if tree[k] == earliest:
            return
        tree[k] = earliest
        k //= 2
