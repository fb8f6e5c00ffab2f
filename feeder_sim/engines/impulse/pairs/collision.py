"""Collisions of two pieces of parts: at zero time, all points at which they touch together.

A collision moves nothing, and gives both parts opposite impulses at the same points: both momenta are kept. Only what
lies in each other deeper than `DEEP`, pushed by what is beside it, is moved apart.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.contact_problem import (
    ARM_FIRST,
    ARM_SECOND,
    FRICTION,
    NORMAL,
    RESTITUTION,
    ROLLING,
)
from feeder_sim.engines.impulse.impact import resolve_impact
from feeder_sim.engines.impulse.impact_law import hit_part, restitution_of_pair
from feeder_sim.engines.impulse.pairs.due import DEEP, ROUND_OFF, SLACK
from feeder_sim.engines.impulse.pairs.hulls import hull_distance
from feeder_sim.engines.impulse.pairs.separating_axis import place_pieces, separating_axis
from feeder_sim.engines.impulse.pairs.touching_points import touching_points
from feeder_sim.engines.impulse.single_impact import velocity_of_point
from feeder_sim.engines.impulse.state import inverse_inertia
from feeder_sim.engines.impulse.vectors import add_to, combine, cross, difference, dot, plus, vector, write_to
from feeder_sim.machine_code import inlined, uncounted

# [m]; parts laid into each other so deep are parted little by little, step by step: at once one would be put through
# the plate. Parts that meet do not come to that; 80 um has been seen at the bottom of a poured heap.
LAID_IN, LITTLE = 1.5e-4, 5e-6
LEVEL = 0.1  # upward component of the axis of two parts, from which on one of them counts as the lower
FAR = 1e3  # [m]; no distance beyond this is asked of the library: every answer gives the pair a better axis
LEFT = 1e-9  # [m/s]; what round-off leaves of the speed of points that have just collided


@uncounted
def meet(pair, parts, kinds, tools):
    """See how far a pair is apart and, where its parts touch and approach each other, give them impulses.

    Both parts are at the same time. Returns whether their motion has changed.
    """
    a, b = parts[pair.a], parts[pair.b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    gap, n = look_at_pair(pair, a, kind_a, b, kind_b, kinds, tools)
    if n == 0:
        return False
    hit = _collide(pair, parts, kinds, n, vector(pair.axis), tools)
    if gap < -DEEP:
        _part(a, kind_a, b, kind_b, gap, pair.axis)
        return True
    return hit


@inlined
def look_at_pair(pair, a, kind_a, b, kind_b, kinds, tools):
    """Gap of a pair [m], whose axis is made anew, and the number of points at which it touches; they are written."""
    piece_a, piece_b = kinds.piece[pair.piece_a], kinds.piece[pair.piece_b]
    room, axis = tools.meeting, pair.axis
    if _is_ball(piece_a) and _is_ball(piece_b):
        gap = _between_balls(difference(b.position, a.position), kind_a.radius, kind_b.radius, axis)
        write_to(room.point[0], combine(kind_a.radius + 0.5 * gap, axis, 0.0, axis, 0.0, axis))
        return gap, 1 if gap <= SLACK else 0
    gap = hull_distance(tools.hulls, a, pair.piece_a, b, pair.piece_b, FAR)
    if gap >= FAR:
        return gap, 0
    _axis_of_closest(pair, a, b, piece_a, piece_b, gap, tools.hulls.witness)
    if gap > SLACK:
        return gap, 0
    if _is_ball(piece_a) or _is_ball(piece_b) or _has_no_faces(piece_a) or _has_no_faces(piece_b):
        witness = tools.hulls.witness
        for k in range(3):
            room.point[0, k] = 0.5 * (witness[k] + witness[3 + k]) - a.position[k]
        return gap, 1
    place_pieces(a, piece_a, b, piece_b, kinds, room)
    gap, normal = separating_axis(piece_a, piece_b, kinds, room)
    write_to(axis, normal)
    return gap, touching_points(piece_a, piece_b, kinds, SLACK, normal, room)


@inlined
def _is_ball(piece):
    """Whether a piece is a single corner, with the radius of its kind around it."""
    return piece.corner_to - piece.corner_from == 1


@inlined
def _has_no_faces(piece):
    return piece.plane_to == piece.plane_from


@inlined
def _between_balls(apart, first, second, axis):
    """Gap of two balls [m], whose centres are apart; writes their axis."""
    size = math.sqrt(dot(apart, apart))
    if size > 0.0:
        write_to(axis, combine(1.0 / size, apart, 0.0, apart, 0.0, apart))
    return size - first - second


@inlined
def _axis_of_closest(pair, a, b, piece_a, piece_b, gap, witness):
    """Write the axis between closest points; of a ball that to its centre, which is off by less."""
    axis, first, second = pair.axis, vector(witness[:3]), vector(witness[3:])
    if _is_ball(piece_a):
        first = vector(a.position)
    elif _is_ball(piece_b):
        second = vector(b.position)
    elif abs(gap) <= ROUND_OFF:  # of closest points that coincide the direction is round-off
        return
    apart = difference(second, first)
    size = math.sqrt(dot(apart, apart))
    if gap < 0.0 and not (_is_ball(piece_a) or _is_ball(piece_b)):
        size = -size
    if size != 0.0:
        write_to(axis, combine(1.0 / size, apart, 0.0, apart, 0.0, apart))


@uncounted
def _collide(pair, parts, kinds, n, normal, tools):
    """Collision of a pair at n points, along a normal from the first to the second; returns whether there was one."""
    a, b = parts[pair.a], parts[pair.b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    point, law = tools.meeting.point, 0 if kind_b.mass == np.inf else 1
    inverse, approaches = (inverse_inertia(a, kind_a), inverse_inertia(b, kind_b)), False
    from_b = difference(a.position, b.position)
    for i in range(n):
        of_a = velocity_of_point(a, inverse[0], point[i])
        of_b = velocity_of_point(b, inverse[1], plus(from_b, 1.0, point[i]))
        approaches = approaches or dot(normal, difference(of_b, of_a)) < -LEFT
    if not approaches:
        return False
    if n == 1:
        arms, inverse_mass = (vector(point[0]), plus(from_b, 1.0, point[0])), (1.0 / kind_a.mass, 1.0 / kind_b.mass)
        e = restitution_of_pair(a, b, kind_a, law, inverse, arms, normal)
        return hit_part(a, b, kind_a, inverse_mass, inverse, arms, normal, (e, kind_a.friction[law]))
    contacts, tools.work.member[0], tools.work.member[1] = tools.work.contacts, pair.a, pair.b
    for i in range(n):
        arms = vector(point[i]), plus(from_b, 1.0, point[i])
        contacts.body[i, 0], contacts.body[i, 1] = 0, 1
        write_to(contacts.vector[ARM_FIRST, i], arms[0])
        write_to(contacts.vector[ARM_SECOND, i], arms[1])
        write_to(contacts.vector[NORMAL, i], normal)
        contacts.number[RESTITUTION, i] = restitution_of_pair(a, b, kind_a, law, inverse, arms, normal)
        contacts.number[FRICTION, i], contacts.number[ROLLING, i] = kind_a.friction[law], 0.0
    resolve_impact(parts, kinds, 2, n, (0.0, 0.0), tools.work)
    return True


@uncounted
def _part(a, kind_a, b, kind_b, gap, axis):
    """Move two parts apart that are deeper in each other than they may be; both momenta are kept."""
    fixed = kind_b.mass == np.inf
    share = 1.0 if fixed else kind_b.mass / (kind_a.mass + kind_b.mass)
    if gap < -LAID_IN:
        gap = -LITTLE
        if not fixed and abs(axis[2]) > LEVEL:  # the lower one lies on the plate
            share = 0.0 if axis[2] > 0.0 else 1.0
    add_to(a.position, gap * share, axis)
    add_to(b.position, -gap * (1.0 - share), axis)
    if not fixed and gap != -LITTLE:  # the common centre of mass has stayed; so must the angular momentum about it
        moved = cross(axis, difference(b.velocity, a.velocity))
        heavier = kind_a.mass / (kind_a.mass + kind_b.mass)
        add_to(a.momentum, heavier * gap * share * kind_a.mass, moved)
        add_to(b.momentum, (1.0 - heavier) * gap * share * kind_a.mass, moved)
