"""Contact of two parts: when they can meet at the earliest, and their impact.

Parts meet by convex pieces: a concave part has several, any other is one. A pair is one piece of each.

Of two parts that fly gravity does not change the relative motion; walls, and parts asleep, stand. Each pair keeps an
axis, the direction in which its hulls were last found apart. The plane across it between both hulls parts them for as
long as no corner of either can have crossed it, which bounds the time of their meeting from below by arithmetic on
corners alone; only where the plane does not part them any more is the library asked for distance and closest points
(conservative advancement, as at the plate). An impact is at the closest points and at all corners of one hull in the
other, so that faces meet as faces.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.hulls import hull_distance
from feeder_sim.engines.impulse.impact_law import hit_part, restitution_of_pair
from feeder_sim.engines.impulse.state import arm_of, flies, fly_to, inverse_inertia, turning_acceleration, turning_speed
from feeder_sim.engines.impulse.vectors import difference, dot, plus, vector, write_to
from feeder_sim.machine_code import compiled, inlined, uncounted

LEAST = 1e-300  # [m], of a length that is divided by
ROUND_OFF = 1e-7  # [m]; more than the library's tolerance
SLACK = 1e-6  # [m]; hulls this close touch, and may enter each other this far before anybody looks
DEEP = 2e-6  # [m]; how deep parts may enter each other before they are looked at again, where a step is longer
PUSHED = 0.1  # of that time, while parts are deep in each other: a heap that falls in needs many pushes
# [m]; parts laid into each other so deep are parted little by little, step by step: at once one would be put through
# the plate. Parts that meet do not come to that; 80 um has been seen at the bottom of a poured heap.
LAID_IN, LITTLE = 1.5e-4, 5e-6
LEVEL = 0.1  # upward component of the axis of two parts, from which on one of them counts as the lower
MAX_ROUNDS = 8  # of impacts at the points of one contact
SURELY = 1.0 + 1e-6  # beyond round-off
FAR = 1e3  # [m]; no distance beyond this is asked of the library: every answer gives the pair a better axis


# Pieces of two parts that can meet within a window: the numbers of the parts, a < b, those of the pieces in `Kinds`,
# and the axis from a to b.
PAIR = np.dtype([("a", "i8"), ("b", "i8"), ("piece_a", "i8"), ("piece_b", "i8"), ("axis", "f8", 3)], align=True)


@uncounted
def meeting_bound(pair, parts, kinds, t, bounds):
    """Earliest time [s] at which a pair has to be looked at again, and whether it may touch now; not before a step.

    Fast parts are looked at earlier than that: a column of parts that falls needs many impacts to stop. Slow ones
    over a plate that is no longer driven are looked at later.
    """
    a, b = parts[pair.a], parts[pair.b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    if kind_b.mass < np.inf:
        apart, wait = _spheres_meet(a, kind_a, b, kind_b, t)
        if apart:
            fastest = _relative_speed(a, kind_a, b, kind_b) + GRAVITY * abs(a.clock - b.clock)
            return t + max(wait, min(bounds.step, DEEP / fastest)), False
    fly_to(a, kind_a, t)
    fly_to(b, kind_b, t)
    axis, piece_a, piece_b = pair.axis, kinds.piece[pair.piece_a], kinds.piece[pair.piece_b]
    top = _extent(a, kind_a, piece_a, kinds, axis, 1.0)
    bottom = _extent(b, kind_b, piece_b, kinds, axis, -1.0)
    gap = -bottom - top
    # The plane moves with both hulls' mean speed along the axis; each has half of the gap to itself.
    # Gravity changes nothing between two that fly; beside a wall or a part asleep the plane stands and the other falls.
    drift, fall = 0.0, GRAVITY * abs(axis[2])
    flies_a, flies_b = flies(a, kind_a), flies(b, kind_b)
    if not flies_a and not flies_b and gap >= -DEEP:
        return np.inf, False
    if flies_a and flies_b:
        fall = 0.0
        for k in range(3):
            drift += 0.5 * axis[k] * (a.velocity[k] + b.velocity[k])
    room = 0.5 * (max(gap, 0.0) + SLACK)
    wait = min(
        _crossing_time(a, kind_a, piece_a, kinds, axis, 1.0, top, (drift, room, fall)),
        _crossing_time(b, kind_b, piece_b, kinds, axis, -1.0, bottom, (-drift, room, fall)),
    )
    speed = _relative_speed(a, kind_a, b, kind_b)
    shortest = min(max(bounds.step, SLACK / speed), DEEP / speed)
    if gap < -DEEP:  # pushed into each other by what lies beside them
        wait, shortest = 0.0, PUSHED * shortest
    else:
        shortest = max(shortest, min(bounds.rest_step, ROUND_OFF / speed))
    return t + max(wait, shortest), gap <= SLACK


@compiled
def _relative_speed(a, kind_a, b, kind_b):
    """No two points of both parts approach each other faster [m/s]; never quite zero."""
    squared = 1e-24
    for k in range(3):
        squared += (a.velocity[k] - b.velocity[k]) ** 2
    return math.sqrt(squared) + turning_speed(a, kind_a) + turning_speed(b, kind_b)


@compiled
def _spheres_meet(a, kind_a, b, kind_b, t):
    """Whether the bounding spheres are apart at time t, and how long they stay so [s]; without turning the parts."""
    reach = kind_a.reach + kind_a.radius + kind_b.reach + kind_b.radius
    age_a, age_b = t - a.clock, t - b.clock
    fall_a, fall_b = GRAVITY * flies(a, kind_a), GRAVITY * flies(b, kind_b)
    distance = closing = speed = 0.0
    for k in range(3):
        r = b.position[k] + b.velocity[k] * age_b - a.position[k] - a.velocity[k] * age_a
        u = b.velocity[k] - a.velocity[k]
        if k == 2:
            r -= 0.5 * (fall_b * age_b * age_b - fall_a * age_a * age_a)
            u -= fall_b * age_b - fall_a * age_a
        distance += r * r
        closing += r * u
        speed += u * u
    if distance <= reach * reach:
        return False, 0.0
    if fall_a != fall_b:  # one of them is asleep: bound what the other can cover
        speed, gap = math.sqrt(speed), math.sqrt(distance) - reach
        return True, 2.0 * gap / (speed + math.sqrt(speed * speed + 2.0 * GRAVITY * gap))
    discriminant = closing * closing - speed * (distance - reach * reach)
    if closing >= 0.0 or discriminant <= 0.0:
        return True, np.inf
    return True, (distance - reach * reach) / (-closing + math.sqrt(discriminant))


@inlined
def _along_body_axis(part, vector, n):
    """Component of a vector along body axis n."""
    attitude = part.attitude
    return attitude[0, n] * vector[0] + attitude[1, n] * vector[1] + attitude[2, n] * vector[2]


@compiled
def _extent(part, kind, piece, kinds, axis, sign):
    """Largest coordinate of a piece of a part along sign * axis [m]."""
    x, y, z = (
        _along_body_axis(part, axis, 0),
        _along_body_axis(part, axis, 1),
        _along_body_axis(part, axis, 2),
    )
    largest = -np.inf
    for c in range(piece.corner_from, piece.corner_to):
        largest = max(largest, sign * (x * kinds.corners[c, 0] + y * kinds.corners[c, 1] + z * kinds.corners[c, 2]))
    if piece.corner_to - piece.corner_from == 1:
        largest += kind.radius
    for n in range(3):
        largest += sign * axis[n] * part.position[n]
    return largest


@compiled
def _crossing_time(part, kind, piece, kinds, axis, sign, support, plane):
    """Time [s] before which no corner of a piece can come `room` farther along sign * axis than its support.

    The plane (drift, room, fall) it must not cross moves at `drift` [m/s]; a corner accelerates by turning, and by
    `fall` [m/s^2] relative to the plane.
    """
    drift, room, fall = plane
    if not flies(part, kind):
        return np.inf
    x, y, z = (
        _along_body_axis(part, axis, 0),
        _along_body_axis(part, axis, 1),
        _along_body_axis(part, axis, 2),
    )
    momentum, inertia = part.momentum, kind.inertia
    spin_x = _along_body_axis(part, momentum, 0) / inertia[0]
    spin_y = _along_body_axis(part, momentum, 1) / inertia[1]
    spin_z = _along_body_axis(part, momentum, 2) / inertia[2]
    # n . (w x r) = r . (n x w)
    turn_x, turn_y, turn_z = y * spin_z - z * spin_y, z * spin_x - x * spin_z, x * spin_y - y * spin_x
    speed, centre = -drift, 0.0
    for n in range(3):
        speed += sign * axis[n] * part.velocity[n]
        centre += sign * axis[n] * part.position[n]
    ball = piece.corner_to - piece.corner_from == 1
    if ball:
        centre += kind.radius
    a = fall + (0.0 if ball else turning_acceleration(part, kind))
    shortest = np.inf
    for c in range(piece.corner_from, piece.corner_to):
        rx, ry, rz = kinds.corners[c, 0], kinds.corners[c, 1], kinds.corners[c, 2]
        gap = support - centre - sign * (x * rx + y * ry + z * rz) + room
        rate = speed + sign * (turn_x * rx + turn_y * ry + turn_z * rz)
        if gap > SURELY * shortest * (rate + 0.5 * a * shortest):
            continue  # it comes later than another
        root = rate + math.sqrt(rate * rate + 2.0 * a * gap)
        if root > 0.0:
            shortest = min(shortest, 2.0 * gap / root)
    return shortest


@uncounted
def meet(pair, parts, kinds, hulls, points):
    """Ask for the distance of a pair and, where its parts touch and approach each other, give them impulses.

    Both parts are at the same time; points: room for the corners of both and one more. Returns whether their motion has
    changed.
    """
    a, b = parts[pair.a], parts[pair.b]
    axis, witness = pair.axis, hulls.witness
    distance = hull_distance(hulls, a, pair.piece_a, b, pair.piece_b, FAR)
    if distance >= FAR:
        return False
    piece_a, piece_b = kinds.piece[pair.piece_a], kinds.piece[pair.piece_b]
    if _is_ball(piece_a) and _is_ball(
        piece_b
    ):  # which meet just when their spheres do, with closest points that coincide
        write_to(axis, difference(b.position, a.position))
        size = math.sqrt(dot(axis, axis))
        for k in range(3):
            axis[k] /= max(size, LEAST)
    elif abs(distance) > ROUND_OFF:  # of closest points that coincide the direction is round-off
        for k in range(3):
            axis[k] = (witness[3 + k] - witness[k]) / distance
        size = math.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
        for k in range(3):
            axis[k] /= size
    if distance > SLACK:
        return False
    for k in range(3):
        points[0, k] = 0.5 * (witness[k] + witness[3 + k])
    n = _corners_inside(a, piece_a, b, piece_b, kinds, points, 1)
    n = _corners_inside(b, piece_b, a, piece_a, kinds, points, n)
    return _collide(a, kinds.record[a.kind], b, kinds.record[b.kind], points, n, axis, distance)


@inlined
def _is_ball(piece):
    """Whether a piece is a single corner, with the radius of its kind around it."""
    return piece.corner_to - piece.corner_from == 1


@compiled
def _corners_inside(a, piece_a, b, piece_b, kinds, points, n):
    """Append the corners of a's piece that are inside that of b, or as good as touch it; returns their number."""
    if piece_a.corner_to - piece_a.corner_from == 1:
        return n
    for c in range(piece_a.corner_from, piece_a.corner_to):
        at = plus(a.position, 1.0, arm_of(a, kinds.corners, c))
        from_b = difference(at, b.position)
        local = _along_body_axis(b, from_b, 0), _along_body_axis(b, from_b, 1), _along_body_axis(b, from_b, 2)
        inside = piece_b.plane_to > piece_b.plane_from
        for f in range(piece_b.plane_from, piece_b.plane_to):
            plane = kinds.planes[f]
            if dot(plane, local) + plane[3] > SLACK:
                inside = False
                break
        if inside:
            write_to(points[n], at)
            n += 1
    return n


@compiled
def _collide(a, kind_a, b, kind_b, points, n, axis, distance):
    """Impacts of part b on part a at n points, one after the other, along an axis from a to b; part what overlaps.

    At points that one impact makes approach again there are further ones, until all of them separate.
    """
    fixed = kind_b.mass == np.inf
    inverse_mass = 1.0 / kind_a.mass, 1.0 / kind_b.mass
    inverse, normal = (inverse_inertia(a, kind_a), inverse_inertia(b, kind_b)), vector(axis)
    law = 0 if fixed else 1
    hit = False
    for _ in range(MAX_ROUNDS):
        again = False
        for i in range(n):
            arms = difference(points[i], a.position), difference(points[i], b.position)
            e = restitution_of_pair(a, b, kind_a, law, inverse, arms, normal)
            again |= hit_part(a, b, kind_a, inverse_mass, inverse, arms, normal, (e, kind_a.friction[law]))
        hit |= again
        if not again:
            break
    if distance < 0.0:
        share = 1.0 if fixed else kind_b.mass / (kind_a.mass + kind_b.mass)
        if distance < -LAID_IN:
            distance = -LITTLE
            if not fixed and abs(axis[2]) > LEVEL:  # the lower one lies on the plate
                share = 0.0 if axis[2] > 0.0 else 1.0
        for k in range(3):
            a.position[k] += distance * share * axis[k]
            b.position[k] -= distance * (1.0 - share) * axis[k]
    return hit or distance < -ROUND_OFF
