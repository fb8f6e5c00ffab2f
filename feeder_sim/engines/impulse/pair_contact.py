"""Two parts, or a part and a wall: when they can meet at the earliest, and the points at which they touch.

Parts meet by convex pieces: a concave part has several, any other is one. A pair is one piece of each.

Of two parts that fly gravity does not change the relative motion; walls, and parts asleep, stand. Each pair keeps an
axis, the direction in which its hulls were last found apart. The plane across it between both hulls parts them for as
long as no corner of either can have crossed it, which bounds the time of their meeting from below by arithmetic on
corners alone; only where the hulls are close is the library asked for a better axis (conservative advancement, as at
the plate), or a face of either is taken for one. They touch at the corners of one that lie on the other, and where the
edges of two faces that lie on each other cross; without those, at the closest points.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.follow import bring
from feeder_sim.engines.impulse.hulls import hull_distance
from feeder_sim.engines.impulse.impact_law import PAIR as LAW_OF_PAIRS
from feeder_sim.engines.impulse.leap import leap
from feeder_sim.engines.impulse.state import (
    AT,
    BODY,
    FALL,
    FREE,
    FROM,
    GAP,
    JERK,
    KNOWN,
    MOVES,
    MU,
    OTHER,
    OWN,
    POINTS_OF_PAIR,
    PUSH,
    TOUCH,
    TOWARDS,
    WITH,
    E,
    arm_of,
    flies,
    turning_acceleration,
    turning_speed,
)
from feeder_sim.engines.impulse.vectors import cross, difference, dot, plus, vector, write_to
from feeder_sim.machine_code import compiled, inlined, uncounted
from feeder_sim.scene.scene import GRAVITY

TOUCHING = 1e-8  # [m]; hulls this close touch: what the library is exact to
SETTLED = 1e-7  # [m]; of closest points that are closer the direction is round-off
NEARBY = 1e-6  # [m]; hulls this close want the best axis
ON_FACE = 2e-6  # [m]; corners and edges this close to the farthest lie on the same face
BESIDE = 5e-6  # [m]; points this far beside a face still lie on it
LIKE_AXIS = 0.999  # of a face's normal along the axis: it may be the better axis
SURELY = 1.0 + 1e-6  # beyond round-off
FAR = 1e3  # [m]; no distance beyond this is asked of the library: every answer gives the pair a better axis
ALIKE = 1e-7  # [m]; points this close to each other are one


# Pieces of two parts that can meet within a window: the numbers of the parts, a < b, those of the pieces in `Kinds`,
# the axis from a to b, and whether they touch: then their group looks after them, and not the pair.
PAIR = np.dtype(
    [("a", "i8"), ("b", "i8"), ("piece_a", "i8"), ("piece_b", "i8"), ("axis", "f8", 3), ("touching", "i8")], align=True
)


@uncounted
def meeting_bound(pair, parts, kinds, t, plate):
    """Earliest time [s] at which a pair can touch, and the gap along its axis [m], infinite where nobody looked."""
    a, b = parts[pair.a], parts[pair.b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    flies_a, flies_b = flies(a, kind_a), flies(b, kind_b)
    if not flies_a and not flies_b:
        return np.inf, np.inf
    pushed = _pushed(a, flies_a, plate.bounds) + _pushed(b, flies_b, plate.bounds)
    if kind_b.mass < np.inf and pushed == 0.0:
        apart, wait = _spheres_meet(a, kind_a, b, kind_b, t)
        if apart:
            return t + wait, np.inf
    bring(a, kind_a, t, plate.surface)
    bring(b, kind_b, t, plate.surface)
    axis, piece_a, piece_b = pair.axis, kinds.piece[pair.piece_a], kinds.piece[pair.piece_b]
    top = _extent(a, kind_a, piece_a, kinds, axis, 1.0)
    bottom = _extent(b, kind_b, piece_b, kinds, axis, -1.0)
    gap = -bottom - top
    # The plane moves with both hulls' mean speed along the axis; each has half of the gap to itself.
    # Gravity changes nothing between two that fly; beside a wall or a part asleep the plane stands and the other falls.
    drift, fall = 0.0, GRAVITY * abs(axis[2])
    if flies_a and flies_b:
        fall = 0.0
        for k in range(3):
            drift += 0.5 * axis[k] * (a.velocity[k] + b.velocity[k])
    room = 0.5 * max(gap - 0.5 * TOUCHING, 0.0)
    wait = min(
        _crossing_time(a, kind_a, piece_a, kinds, axis, 1.0, top, (drift, room, fall + pushed)),
        _crossing_time(b, kind_b, piece_b, kinds, axis, -1.0, bottom, (-drift, room, fall + pushed)),
    )
    if gap <= 0.25 * TOUCHING:
        return t, gap
    speed = _relative_speed(a, kind_a, b, kind_b)
    turning = turning_acceleration(a, kind_a) + turning_acceleration(b, kind_b)
    return t + max(wait, leap(0.1 * TOUCHING, -speed, turning + GRAVITY + pushed)), gap


@inlined
def _pushed(part, moves, bounds):
    """How the plate can accelerate a part that it presses [m/s^2]."""
    if part.phase == FREE or not moves:
        return 0.0
    return 2.0 * bounds.speed * bounds.fastest + 3.0 * GRAVITY


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
        gap = max(support - centre - sign * (x * rx + y * ry + z * rz), 0.0) + room
        rate = speed + sign * (turn_x * rx + turn_y * ry + turn_z * rz)
        if gap > SURELY * shortest * (rate + 0.5 * a * shortest):
            continue  # it comes later than another
        root = rate + math.sqrt(rate * rate + 2.0 * a * gap)
        if root > 0.0:
            shortest = min(shortest, 2.0 * gap / root)
    return shortest


@uncounted
def find_axis(pair, parts, kinds, hulls):
    """Give a close pair the best axis that is known; returns the gap along it [m]."""
    a, b = parts[pair.a], parts[pair.b]
    axis, witness = pair.axis, hulls.witness
    piece_a, piece_b = kinds.piece[pair.piece_a], kinds.piece[pair.piece_b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    if _is_ball(piece_a) and _is_ball(piece_b):
        write_to(axis, _unit(difference(b.position, a.position)))
    else:
        distance = hull_distance(hulls, a, pair.piece_a, b, pair.piece_b, FAR)
        if abs(distance) > SETTLED and distance < FAR:
            sign = 1.0 if distance > 0.0 else -1.0
            along = difference(witness[3:6], witness[0:3])
            found = _unit((sign * along[0], sign * along[1], sign * along[2]))
            if _gap_along(found, a, kind_a, piece_a, b, kind_b, piece_b, kinds) > _gap_along(
                vector(axis), a, kind_a, piece_a, b, kind_b, piece_b, kinds
            ):
                write_to(axis, found)
    best = _gap_along(vector(axis), a, kind_a, piece_a, b, kind_b, piece_b, kinds)
    start = vector(axis)
    for end in range(2):
        part, piece = (a, piece_a) if end == 0 else (b, piece_b)
        sign = 1.0 if end == 0 else -1.0
        for f in range(piece.plane_from, piece.plane_to):
            plane, r = kinds.planes[f], part.attitude
            n = (
                sign * (r[0, 0] * plane[0] + r[0, 1] * plane[1] + r[0, 2] * plane[2]),
                sign * (r[1, 0] * plane[0] + r[1, 1] * plane[1] + r[1, 2] * plane[2]),
                sign * (r[2, 0] * plane[0] + r[2, 1] * plane[1] + r[2, 2] * plane[2]),
            )
            if dot(n, start) > LIKE_AXIS:
                gap = _gap_along(n, a, kind_a, piece_a, b, kind_b, piece_b, kinds)
                if gap >= best:
                    best = gap
                    write_to(axis, n)
    return best


@inlined
def _unit(a):
    size = math.sqrt(dot(a, a))
    if size == 0.0:
        return 0.0, 0.0, 1.0
    return a[0] / size, a[1] / size, a[2] / size


@inlined
def _gap_along(axis, a, kind_a, piece_a, b, kind_b, piece_b, kinds):
    """Gap of two pieces along an axis from a to b [m]: what parts them, at most."""
    return -_extent(b, kind_b, piece_b, kinds, axis, -1.0) - _extent(a, kind_a, piece_a, kinds, axis, 1.0)


@compiled
def look_at_pair_points(pair, parts, kinds, hulls, bodies, first, work):
    """Fill the rows of the points at which a pair touches, from `first` on; returns their end.

    bodies: places of both parts in the group, that of a wall negative. The axis is that of `find_axis`.
    """
    a, b = parts[pair.a], parts[pair.b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    piece_a, piece_b = kinds.piece[pair.piece_a], kinds.piece[pair.piece_b]
    axis = vector(pair.axis)
    top = _extent(a, kind_a, piece_a, kinds, axis, 1.0)
    bottom = -_extent(b, kind_b, piece_b, kinds, axis, -1.0)
    n, last = first, min(first + POINTS_OF_PAIR, work.point.shape[0] - 1)
    n = _corners_on(b, piece_b, bottom, a, piece_a, top, axis, 1.0, kinds, n, first, last, work)
    n = _corners_on(a, piece_a, top, b, piece_b, bottom, axis, -1.0, kinds, n, first, last, work)
    if n > first:
        n = _crossings(a, kind_a, top, b, kind_b, bottom, axis, kinds, n, first, last, work)
    elif _is_ball(piece_a):
        n = _add(plus(a.position, kind_a.radius, axis), bottom - top, n, first, last, work)
    elif _is_ball(piece_b):
        n = _add(plus(b.position, -kind_b.radius, axis), bottom - top, n, first, last, work)
    else:
        hull_distance(hulls, a, pair.piece_a, b, pair.piece_b, FAR)
        middle = plus(hulls.witness[0:3], 1.0, hulls.witness[3:6])
        n = _add((0.5 * middle[0], 0.5 * middle[1], 0.5 * middle[2]), bottom - top, n, first, last, work)
    for i in range(first, n):
        row = work.point[i]
        at = vector(row[AT : AT + 3])
        row[MOVES], row[JERK], row[KNOWN], row[TOUCH] = 0.0, 0.0, 1.0, TOUCHING
        row[PUSH], row[FALL] = GRAVITY, 0.0
        row[OWN] = GRAVITY + turning_acceleration(a, kind_a)
        write_to(row[WITH : WITH + 3], (0.0, 0.0, 0.0))
        if bodies[1] < 0:  # a wall: the first part is what moves
            row[BODY], row[OTHER], row[E], row[MU] = bodies[0], -1.0, kind_a.restitution[0], kind_a.friction[0]
            write_to(row[AT : AT + 3], difference(at, a.position))
            write_to(row[TOWARDS : TOWARDS + 3], (-axis[0], -axis[1], -axis[2]))
            continue
        row[OWN] += turning_acceleration(b, kind_b)
        row[BODY], row[OTHER], row[E], row[MU] = bodies[1], bodies[0], LAW_OF_PAIRS, kind_b.friction[1]
        write_to(row[AT : AT + 3], difference(at, b.position))
        write_to(row[FROM : FROM + 3], difference(at, a.position))
        write_to(row[TOWARDS : TOWARDS + 3], axis)
    return n


@compiled
def _add(at, gap, n, first, last, work):
    """Append a point in space, if there is room for it and none like it; returns the end of the rows."""
    if n >= last:
        return n
    for i in range(first, n):
        apart = difference(at, vector(work.point[i, AT : AT + 3]))
        if dot(apart, apart) < ALIKE * ALIKE:
            return n
    write_to(work.point[n, AT : AT + 3], at)
    work.point[n, GAP] = gap
    return n + 1


@inlined
def _is_ball(piece):
    """Whether a piece is a single corner, with the radius of its kind around it."""
    return piece.corner_to - piece.corner_from == 1


@compiled
def _corners_on(part, piece, own, other, piece_of_other, face, axis, sign, kinds, n, first, last, work):
    """Append corners of a piece, as far along the axis as `own` [m], that lie on the face of the other at `face` [m]."""
    if _is_ball(piece):
        return n
    for c in range(piece.corner_from, piece.corner_to):
        at = plus(part.position, 1.0, arm_of(part, kinds.corners, c))
        along = dot(axis, at)
        if sign * (along - own) > ON_FACE:
            continue
        if _lies_on(at, other, piece_of_other, kinds):
            n = _add(at, sign * (along - face), n, first, last, work)
    return n


@compiled
def _lies_on(at, part, piece, kinds):
    """Whether a point lies in a piece, or outside it by little."""
    away = difference(at, part.position)
    local = _along_body_axis(part, away, 0), _along_body_axis(part, away, 1), _along_body_axis(part, away, 2)
    for f in range(piece.plane_from, piece.plane_to):
        plane = kinds.planes[f]
        if dot(plane, local) + plane[3] > BESIDE:
            return False
    return piece.plane_to > piece.plane_from


@compiled
def _crossings(a, kind_a, top, b, kind_b, bottom, axis, kinds, n, first, last, work):
    """Append where edges of the hull of a on its face at `top` cross those of b at `bottom`, seen along the axis."""
    for i in range(kind_a.edge_from, kind_a.edge_to):
        p = plus(a.position, 1.0, arm_of(a, kinds.corners, kind_a.corner_from + kinds.edges[i, 0]))
        q = plus(a.position, 1.0, arm_of(a, kinds.corners, kind_a.corner_from + kinds.edges[i, 1]))
        if dot(axis, p) < top - ON_FACE or dot(axis, q) < top - ON_FACE:
            continue
        along = difference(q, p)
        for j in range(kind_b.edge_from, kind_b.edge_to):
            r = plus(b.position, 1.0, arm_of(b, kinds.corners, kind_b.corner_from + kinds.edges[j, 0]))
            s = plus(b.position, 1.0, arm_of(b, kinds.corners, kind_b.corner_from + kinds.edges[j, 1]))
            if dot(axis, r) > bottom + ON_FACE or dot(axis, s) > bottom + ON_FACE:
                continue
            other, apart = difference(s, r), difference(r, p)
            across = dot(axis, cross(along, other))
            if across * across < 1e-12 * dot(along, along) * dot(other, other):
                continue  # parallel
            u, v = dot(axis, cross(apart, other)) / across, dot(axis, cross(apart, along)) / across
            if 0.0 < u < 1.0 and 0.0 < v < 1.0:
                n = _add(plus(p, u, along), bottom - top, n, first, last, work)
    return n
