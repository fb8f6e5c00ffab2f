"""Parts that touch each other are a component, which comes to rest, and wakes, as a whole.

On a plate that is calm a component lies still if none of its parts has moved in a window, and if one joint solution of
all its contacts, without rebound, holds it against its own motion and its weight for a short time: what would move by
more in that time does not rest, and less than that is lost.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.contact_problem import (
    ARM_FIRST,
    ARM_SECOND,
    FRICTION,
    IMPULSE,
    NORMAL,
    ROLLING,
    TARGET,
    VELOCITY,
    make_room,
    meet_world,
    solve,
)
from feeder_sim.engines.impulse.impact import load_body
from feeder_sim.engines.impulse.pairs.collision import check_pair
from feeder_sim.engines.impulse.pairs.due import SLACK, extent
from feeder_sim.engines.impulse.pairs.neighbours import grouped, root_of
from feeder_sim.engines.impulse.plate_contact import contact_of, points_over_plate
from feeder_sim.engines.impulse.state import ASLEEP, AWAKE
from feeder_sim.engines.impulse.vectors import difference, dot, plus, vector, write_to
from feeder_sim.machine_code import borrow, compiled, inlined

STAYED = 5e-6  # [m] that any point of a part at rest may have moved in a window: it could fall as far
WEIGHED = 5e-4  # [s] for which the weight is held; a hop of 1 um takes as long
SOLVED, MOVES = 1e-3, 1e-2  # of the speed of a fall of that time: how closely to solve, and from where on a part moves
CARRIES = 1e-6  # [m]; points this close to the plate carry


class Components(NamedTuple):
    """Those that may come to rest: parts that touch each other, and pairs of them, both by index and grouped.

    member, first_member: parts of component c are member[first_member[c] : first_member[c + 1]]; pair, first_pair
    likewise. body: of every part, its place in its component.
    """

    member: NDArray[np.int64]
    first_member: NDArray[np.int64]
    pair: NDArray[np.int64]
    first_pair: NDArray[np.int64]
    body: NDArray[np.int64]


@compiled
def lay_to_rest(own, crowd, plate, tools, t):
    """Put to sleep what lies still at the end of a window, t [s], in islands that are `own`."""
    still = _still_components(own, crowd)
    parts = pairs = 0
    for c in range(still.first_member.shape[0] - 1):
        parts = max(parts, still.first_member[c + 1] - still.first_member[c])
        pairs = max(pairs, still.first_pair[c + 1] - still.first_pair[c])
    if parts == 0:
        return False
    points = parts * tools.work.point.shape[0] + pairs * tools.meeting.point.shape[0]
    bodies, contacts = make_room(parts, points, 0)
    _rest(borrow(still), crowd, plate, tools, borrow(bodies), borrow(contacts), t)
    return (
        still.member.shape[0] + bodies.spin.shape[0] + contacts.body.shape[0] > 0
    )  # what was borrowed lives until here


@compiled
def _still_components(own, crowd):
    """Components of own islands of which no part has moved in this window, and one at least is awake."""
    parts, pairs, kinds, islands = crowd.parts, crowd.pairs, crowd.kinds, crowd.islands
    n_free = islands.place.shape[0]
    root, is_own = np.arange(n_free), np.zeros(n_free, np.bool_)
    for island in range(own.shape[0]):
        for k in range(islands.first_part[island], islands.first_part[island + 1]):
            is_own[islands.part[k]] = own[island]
    for p in range(pairs.shape[0]):
        if is_own[pairs[p].a] and pairs[p].b < n_free and _touch(pairs[p], parts, kinds):
            a, b = root_of(root, pairs[p].a), root_of(root, pairs[p].b)
            root[max(a, b)] = min(a, b)
    moves, awake = np.zeros(n_free, np.bool_), np.zeros(n_free, np.bool_)
    for i in range(n_free):
        if is_own[i]:
            root[i] = root_of(root, i)
            moves[root[i]] |= not _has_stayed(parts[i], crowd.initial[i], kinds.record[parts[i].kind])
            awake[root[i]] |= parts[i].there == AWAKE
    number, count = np.full(n_free, -1), 0
    for i in range(n_free):
        if root[i] == i and awake[i] and not moves[i]:
            number[i] = count
            count += 1
        number[i] = number[root[i]]
    of_pair = np.empty(pairs.shape[0], np.int64)
    for p in range(pairs.shape[0]):
        of_pair[p] = number[pairs[p].a]
    member, first_member = grouped(number, count)
    pair, first_pair = grouped(of_pair, count)
    body = np.full(parts.shape[0], -1)
    for c in range(count):
        for k in range(first_member[c], first_member[c + 1]):
            body[member[k]] = k - first_member[c]
    return Components(member, first_member, pair, first_pair, body)


@inlined
def _touch(pair, parts, kinds):
    """Whether a pair touches, by its axis."""
    a, b, axis = parts[pair.a], parts[pair.b], pair.axis
    top = extent(a, kinds.record[a.kind], kinds.piece[pair.piece_a], kinds, axis, 1.0)
    bottom = extent(b, kinds.record[b.kind], kinds.piece[pair.piece_b], kinds, axis, -1.0)
    return -bottom - top <= SLACK


@inlined
def _has_stayed(part, initial, kind):
    """Whether no point of a part has moved since the begin of the window."""
    displacement = difference(part.position, initial.position)
    turned = 0.0
    for i in range(3):
        for k in range(3):
            turned += (part.attitude[i, k] - initial.attitude[i, k]) ** 2
    return math.sqrt(dot(displacement, displacement)) + math.sqrt(turned) * kind.reach <= STAYED


@compiled
def _rest(still, crowd, plate, tools, bodies, contacts, t):
    """Put to sleep the components that their contacts hold at t [s]."""
    for c in range(still.first_member.shape[0] - 1):
        n = _gather(c, still, crowd, plate, tools, bodies, contacts, t)
        first, last = still.first_member[c], still.first_member[c + 1]
        if not _holds(still.member[first:last], crowd, bodies, contacts, n):
            continue
        for k in range(first, last):
            part = crowd.parts[still.member[k]]
            part.there, part.asleep_with = ASLEEP, still.member[first]
            for x in range(3):
                part.velocity[x] = part.momentum[x] = 0.0


@compiled
def _gather(c, components, crowd, plate, tools, bodies, contacts, t):
    """Write bodies and contacts of component c; returns the number of contacts."""
    n, first = 0, components.first_member[c]
    for k in range(first, components.first_member[c + 1]):
        part = crowd.parts[components.member[k]]
        load_body(k - first, part, crowd.kinds.record[part.kind], bodies)
        n = _gather_plate(k - first, part, crowd.kinds, plate, t, n, contacts, tools.work)
    for k in range(components.first_pair[c], components.first_pair[c + 1]):
        n = _gather_pair(crowd.pairs[components.pair[k]], components.body, crowd, n, contacts, tools)
    return n


@compiled
def _holds(member, crowd, bodies, contacts, n):
    """Whether n contacts hold all bodies against their motion and their weight."""
    fall = GRAVITY * WEIGHED
    for j in range(member.shape[0]):
        bodies.velocity[j, 2] -= fall
    contacts.vector[IMPULSE:, :n] = 0.0  # and moments
    if not solve(bodies, contacts, n, SOLVED * fall):
        return False
    for j in range(member.shape[0]):
        v, spin = bodies.velocity[j], bodies.spin[j]
        reach = crowd.kinds.record[crowd.parts[member[j]].kind].reach
        if math.sqrt(dot(v, v)) + reach * math.sqrt(dot(spin, spin)) > MOVES * fall:
            return False
    return True


@compiled
def _gather_plate(j, part, kinds, plate, t, n, contacts, work):
    """Append the contacts of body j with the plate; returns the number of all."""
    kind = kinds.record[part.kind]
    corners = points_over_plate(part, kinds, plate.surface, plate.bounds, t, work)
    for i in range(corners.shape[0]):
        if work.point[i].gap <= CARRIES:
            arm, normal, velocity = contact_of(i, part, kind, corners, plate.surface, work)
            meet_world(n, contacts, j, (arm, normal, velocity), (0.0, kind.friction[0], kind.rolling))
            contacts.number[TARGET, n] = 0.0
            n += 1
    return n


@compiled
def _gather_pair(pair, body, crowd, n, contacts, tools):
    """Append the contacts of a pair of bodies, or of one and a wall; returns the number of all."""
    parts, kinds = crowd.parts, crowd.kinds
    a, b = parts[pair.a], parts[pair.b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    _, components, _ = check_pair(pair, a, kind_a, b, kind_b, kinds, tools)
    from_b, axis, wall = difference(a.position, b.position), pair.axis, body[pair.b] < 0
    for i in range(components):
        at = vector(tools.meeting.point[i])
        if wall:
            place = at, (-axis[0], -axis[1], -axis[2]), (0.0, 0.0, 0.0)
            meet_world(n, contacts, body[pair.a], place, (0.0, kind_a.friction[0], 0.0))
        else:
            contacts.body[n, 0], contacts.body[n, 1] = body[pair.a], body[pair.b]
            write_to(contacts.vector[ARM_FIRST, n], at)
            write_to(contacts.vector[VELOCITY, n], (0.0, 0.0, 0.0))
            write_to(contacts.vector[ARM_SECOND, n], plus(from_b, 1.0, at))
            write_to(contacts.vector[NORMAL, n], axis)
            contacts.number[FRICTION, n], contacts.number[ROLLING, n] = kind_a.friction[1], 0.0
        contacts.number[TARGET, n] = 0.0
        n += 1
    return n
