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

from feeder_sim.borrow import borrow
from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.contact_problem import (
    ARM_FIRST,
    ARM_SECOND,
    FRICTION,
    NORMAL,
    ROLLING,
    TARGET,
    meet_world,
    new_room,
    solve,
)
from feeder_sim.engines.impulse.impact import load_body
from feeder_sim.engines.impulse.pairs.collision import look_at_pair
from feeder_sim.engines.impulse.pairs.due import SLACK, extent
from feeder_sim.engines.impulse.pairs.neighbours import root_of
from feeder_sim.engines.impulse.plate_contact import contact_of, points_over_plate
from feeder_sim.engines.impulse.state import ASLEEP, AWAKE, GAP
from feeder_sim.engines.impulse.vectors import difference, dot, plus, vector, write_to
from feeder_sim.machine_code import compiled, entry_point, inlined

STAYED = 5e-6  # [m] that any point of a part at rest may have moved in a window: it could fall as far
WEIGHED = 5e-4  # [s] for which the weight is held; a hop of 1 um takes as long
SOLVED, MOVES = 1e-3, 1e-2  # of the speed of a fall of that time: how closely to solve, and from where on a part moves
CARRIES = 1e-6  # [m]; points this close to the plate carry


class Component(NamedTuple):
    """Parts that touch each other, pairs of them (both by index), and the body that each part is, -1 for others."""

    member: NDArray[np.int64]
    pair: NDArray[np.int64]
    body: NDArray[np.int64]


def lay_to_rest(crowd, plate, tools, t):
    """Put to sleep the components that lie still at the end of a window, at t [s]."""
    root = still_components(crowd, len(crowd.islands.place))
    awake = np.unique(root[(root >= 0) & (crowd.parts["there"][: len(root)] == AWAKE)])
    of_pair = root[crowd.pairs["a"]]
    for number in awake:
        member, pair = np.flatnonzero(root == number), np.flatnonzero(of_pair == number)
        body = np.full(len(crowd.parts), -1)
        body[member] = np.arange(len(member))
        points = len(member) * tools.work.corner.shape[0] + len(pair) * tools.meeting.point.shape[0]
        bodies, contacts, _ = new_room(len(member), points)
        if holds(Component(member, pair, body), crowd, plate, tools, bodies, contacts, t):
            crowd.parts["there"][member], crowd.parts["asleep_with"][member] = ASLEEP, number
            crowd.parts["velocity"][member] = crowd.parts["momentum"][member] = 0.0


@entry_point
def still_components(crowd, n_free):
    """The component of every part: the lowest number of its parts; -1 where one of them is absent or moves."""
    parts, kinds = crowd.parts, crowd.kinds
    root = np.arange(n_free)
    for p in range(crowd.pairs.shape[0]):
        pair = crowd.pairs[p]
        if pair.b < n_free and _touch(pair, parts, kinds):
            a, b = root_of(root, pair.a), root_of(root, pair.b)
            root[max(a, b)] = min(a, b)
    moves = np.zeros(n_free, np.bool_)
    for i in range(n_free):
        root[i] = root_of(root, i)
        if not _has_stayed(parts[i], crowd.begun[i], kinds.record[parts[i].kind]):
            moves[root[i]] = True
    for i in range(n_free):
        if moves[root[i]]:
            root[i] = -1
    return root


@inlined
def _touch(pair, parts, kinds):
    """Whether a pair touches, by its axis."""
    a, b, axis = parts[pair.a], parts[pair.b], pair.axis
    top = extent(a, kinds.record[a.kind], kinds.piece[pair.piece_a], kinds, axis, 1.0)
    bottom = extent(b, kinds.record[b.kind], kinds.piece[pair.piece_b], kinds, axis, -1.0)
    return -bottom - top <= SLACK


@inlined
def _has_stayed(part, begun, kind):
    """Whether no point of a part has moved since the begin of the window."""
    way = difference(part.position, begun.position)
    turned = 0.0
    for i in range(3):
        for k in range(3):
            turned += (part.attitude[i, k] - begun.attitude[i, k]) ** 2
    return math.sqrt(dot(way, way)) + math.sqrt(turned) * kind.reach <= STAYED


@entry_point
def holds(component, crowd, plate, tools, bodies, contacts, t):
    """Whether the contacts of a component hold it as it is at t [s]."""
    component, crowd, plate, tools = borrow(component), borrow(crowd), borrow(plate), borrow(tools)
    bodies, contacts = borrow(bodies), borrow(contacts)
    n = 0
    for j in range(component.member.shape[0]):
        part = crowd.parts[component.member[j]]
        kind = crowd.kinds.record[part.kind]
        load_body(j, part, kind, bodies)
        bodies.velocity[j, 2] -= GRAVITY * WEIGHED
        n = _gather_plate(j, part, crowd.kinds, plate, t, n, contacts, tools.work)
    for k in range(component.pair.shape[0]):
        n = _gather_pair(crowd.pairs[component.pair[k]], component.body, crowd, n, contacts, tools)
    fall = GRAVITY * WEIGHED
    if not solve(bodies, contacts, n, None, SOLVED * fall):
        return False
    for j in range(component.member.shape[0]):
        v, spin = bodies.velocity[j], bodies.spin[j]
        reach = crowd.kinds.record[crowd.parts[component.member[j]].kind].reach
        if math.sqrt(dot(v, v)) + reach * math.sqrt(dot(spin, spin)) > MOVES * fall:
            return False
    return True


@compiled
def _gather_plate(j, part, kinds, plate, t, n, contacts, work):
    """Append the contacts of body j with the plate; returns the number of all."""
    kind = kinds.record[part.kind]
    corners = points_over_plate(part, kinds, plate.surface, plate.bounds, t, work)
    for i in range(corners.shape[0]):
        if work.corner[i, GAP] <= CARRIES:
            arm, normal, velocity = contact_of(i, part, kind, corners, plate.surface, work)
            meet_world(n, contacts, j, (arm, normal, velocity), (0.0, kind.friction[0]))
            contacts.number[TARGET, n] = 0.0
            n += 1
    return n


@compiled
def _gather_pair(pair, body, crowd, n, contacts, tools):
    """Append the contacts of a pair of bodies, or of one and a wall; returns the number of all."""
    parts, kinds = crowd.parts, crowd.kinds
    a, b = parts[pair.a], parts[pair.b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    _, found = look_at_pair(pair, a, kind_a, b, kind_b, kinds, tools)
    from_b, axis, wall = difference(a.position, b.position), pair.axis, body[pair.b] < 0
    for i in range(found):
        at = vector(tools.meeting.point[i])
        if wall:
            place = at, (-axis[0], -axis[1], -axis[2]), (0.0, 0.0, 0.0)
            meet_world(n, contacts, body[pair.a], place, (0.0, kind_a.friction[0]))
        else:
            contacts.body[n, 0], contacts.body[n, 1] = body[pair.a], body[pair.b]
            write_to(contacts.vector[ARM_FIRST, n], at)
            write_to(contacts.vector[ARM_SECOND, n], plus(from_b, 1.0, at))
            write_to(contacts.vector[NORMAL, n], axis)
            contacts.number[FRICTION, n], contacts.number[ROLLING, n] = kind_a.friction[1], 0.0
        contacts.number[TARGET, n] = 0.0
        n += 1
    return n
