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
    VELOCITY,
)
from feeder_sim.engines.impulse.impact import resolve_impact
from feeder_sim.engines.impulse.impact_law import hit_part, restitution_of_pair
from feeder_sim.engines.impulse.pairs.due import DEEP, ROUND_OFF, SLACK
from feeder_sim.engines.impulse.pairs.hulls import hull_distance
from feeder_sim.engines.impulse.pairs.separating_axis import (
    BALL,
    CENTRES,
    CLOSEST,
    FACE_OF_FIRST,
    FACE_OF_SECOND,
    place_pieces,
    separating_axis,
    turned,
)
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
ALIGNED = 1e-8  # 1 - cosine of the angle between an axis and the normal of a face that are one
AT_CORNER = 1e-6  # [m]; what is so close to the end of an edge is its corner
LEFT = 1e-9  # [m/s]; what round-off leaves of the speed of points that have just collided


@uncounted
def meet(pair, parts, kinds, slow, tools):
    """See how far a pair is apart and, where its parts touch and approach each other, give them impulses.

    Both parts are at the same time. What rebounds by no more than `slow` [m/s] does not rebound. Returns whether their
    motion has changed, and at how many points they touch.
    """
    a, b = parts[pair.a], parts[pair.b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    gap, n, _ = check_pair(pair, a, kind_a, b, kind_b, kinds, tools)
    if n == 0:
        return False, n
    hit = _collide(pair, parts, kinds, n, slow, tools)
    if gap < -DEEP and (slow == 0.0 or gap < -LAID_IN):
        _part(a, kind_a, b, kind_b, gap, pair.axis)
        return True, n
    return hit, n


@inlined
def slowest_parting(pair, parts, kinds, n, tools):
    """The least speed [m/s] at which two of n points at which a pair touches move apart."""
    a, b = parts[pair.a], parts[pair.b]
    inverse = inverse_inertia(a, kinds.record[a.kind]), inverse_inertia(b, kinds.record[b.kind])
    from_b, least = difference(a.position, b.position), np.inf
    for i in range(n):
        of_a = velocity_of_point(a, inverse[0], tools.meeting.point[i])
        of_b = velocity_of_point(b, inverse[1], plus(from_b, 1.0, tools.meeting.point[i]))
        least = min(least, dot(vector(pair.axis), difference(of_b, of_a)))
    return least


@inlined
def check_pair(pair, a, kind_a, b, kind_b, kinds, tools):
    """Gap of a pair [m], the number of points at which it touches, and the origin of its axis; all are written."""
    piece_a, piece_b = kinds.piece[pair.piece_a], kinds.piece[pair.piece_b]
    room, axis = tools.meeting, pair.axis
    if _is_ball(piece_a) and _is_ball(piece_b):
        gap = _between_balls(difference(b.position, a.position), kind_a.radius, kind_b.radius, axis)
        write_to(room.point[0], combine(kind_a.radius + 0.5 * gap, axis, 0.0, axis, 0.0, axis))
        return gap, 1 if gap <= SLACK else 0, CENTRES
    gap = hull_distance(tools.hulls, a, pair.piece_a, b, pair.piece_b, FAR)
    if gap >= FAR:
        return gap, 0, CLOSEST
    _axis_of_closest(pair, a, b, piece_a, piece_b, gap, tools.hulls.witness)
    if gap > SLACK:
        return gap, 0, CLOSEST
    if _is_ball(piece_a) or _is_ball(piece_b) or _has_no_faces(piece_a) or _has_no_faces(piece_b):
        witness = tools.hulls.witness
        for k in range(3):
            room.point[0, k] = 0.5 * (witness[k] + witness[3 + k]) - a.position[k]
        return gap, 1, _origin_at_ball(a, piece_a, b, piece_b, axis, kinds, tools)
    place_pieces(a, piece_a, b, piece_b, kinds, room)
    gap, normal, origin = separating_axis(piece_a, piece_b, kinds, room)
    write_to(axis, normal)
    return gap, touching_points(piece_a, piece_b, kinds, SLACK, normal, room), origin


@inlined
def _origin_at_ball(a, piece_a, b, piece_b, axis, kinds, tools):
    """Origin of the axis of a pair of which one is a ball: a face, an edge or a corner of the other."""
    hull = 1 if _is_ball(piece_a) else 0
    part, piece = (a, piece_a) if hull == 0 else (b, piece_b)
    outwards = vector(axis) if hull == 0 else (-axis[0], -axis[1], -axis[2])
    for f in range(piece.plane_from, piece.plane_to):
        if dot(outwards, turned(part.attitude, kinds.planes[f])) > 1.0 - ALIGNED:
            return FACE_OF_FIRST if hull == 0 else FACE_OF_SECOND
    if piece.plane_to == piece.plane_from:
        return CLOSEST
    closest = difference(vector(tools.hulls.witness[3 * hull : 3 * hull + 3]), part.position)
    nearest = np.inf
    for e in range(piece.edge_from, piece.edge_to):
        p = turned(part.attitude, kinds.corners[piece.corner_from + kinds.edges[e, 0]])
        along = difference(turned(part.attitude, kinds.corners[piece.corner_from + kinds.edges[e, 1]]), p)
        size, apart = math.sqrt(dot(along, along)), difference(closest, p)
        along = combine(1.0 / size, along, 0.0, along, 0.0, along)
        at = dot(apart, along)
        beside = plus(apart, -min(max(at, 0.0), size), along)
        if dot(beside, beside) < nearest:
            nearest = dot(beside, beside)
            at_corner = at < AT_CORNER or at > size - AT_CORNER
            write_to(tools.meeting.along[0], combine(0.0 if at_corner else 1.0, along, 0.0, along, 0.0, along))
    return BALL


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
def _collide(pair, parts, kinds, n, slow, tools):
    """Collision of a pair at n points, along its axis; returns whether there was one. slow: see `meet`."""
    a, b, normal = parts[pair.a], parts[pair.b], vector(pair.axis)
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    point, law = tools.meeting.point, 0 if kind_b.mass == np.inf else 1
    inverse, from_b = (inverse_inertia(a, kind_a), inverse_inertia(b, kind_b)), difference(a.position, b.position)
    approach = -slowest_parting(pair, parts, kinds, n, tools)
    if approach <= LEFT:
        return False
    if n == 1:
        arms, inverse_mass = (vector(point[0]), plus(from_b, 1.0, point[0])), (1.0 / kind_a.mass, 1.0 / kind_b.mass)
        e = _rebound(restitution_of_pair(a, b, kind_a, law, inverse, arms, normal), approach, slow)
        return hit_part(a, b, kind_a, inverse_mass, inverse, arms, normal, (e, kind_a.friction[law]))
    contacts, tools.work.member[0], tools.work.member[1] = tools.work.contacts, pair.a, pair.b
    for i in range(n):
        arms = vector(point[i]), plus(from_b, 1.0, point[i])
        contacts.body[i, 0], contacts.body[i, 1] = 0, 1
        write_to(contacts.vector[ARM_FIRST, i], arms[0])
        write_to(contacts.vector[ARM_SECOND, i], arms[1])
        write_to(contacts.vector[NORMAL, i], normal)
        write_to(contacts.vector[VELOCITY, i], (0.0, 0.0, 0.0))
        e = restitution_of_pair(a, b, kind_a, law, inverse, arms, normal)
        contacts.number[RESTITUTION, i] = _rebound(e, approach, slow)
        contacts.number[FRICTION, i], contacts.number[ROLLING, i] = kind_a.friction[law], 0.0
    resolve_impact(parts, kinds, 2, n, (0.0, 0.0), tools.work)
    return True


@inlined
def _rebound(e, approach, slow):
    """Restitution of parts that approach at a speed [m/s]: none where all bounces from `slow` on are summed."""
    return 0.0 if e * approach < slow * (1.0 - e) else e


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
