"""When two parts can meet at the earliest.

Parts meet by convex pieces: a concave part has several, any other is one. A pair is one piece of each.

Of two parts that fly gravity does not change the relative motion; walls, and parts asleep, stand. Each pair keeps an
axis, the direction in which its hulls were last found apart. The plane across it between both hulls parts them for as
long as no corner of either can have crossed it, which bounds the time of their meeting from below by arithmetic on
corners alone; only where the plane does not part them any more are they looked at (collision.py).
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.state import FREE, flies, fly_to, turning_acceleration, turning_speed
from feeder_sim.engines.impulse.vectors import dot
from feeder_sim.machine_code import compiled, inlined, uncounted

ROUND_OFF = 1e-7  # [m]; more than the library's tolerance
SLACK = 1e-6  # [m]; hulls this close touch, and may enter each other this far before anybody looks
DEEP = 2e-6  # [m]; how deep parts may enter each other before they are looked at again, where a step is longer
PUSHED = 0.1  # of that time, while parts are deep in each other: a heap that falls in needs many pushes
SURELY = 1.0 + 1e-6  # beyond round-off
FREE_FLIGHT = 0.0, 0.0, 0.0, 0.0, DEEP


# Pieces of two parts that can meet within a window: the numbers of the parts, a < b, those of the pieces in `Kinds`,
# and the axis from a to b. pressing: both touch and hardly move apart, or hit each other again and again, and are
# looked at together with what else they touch (joint/component.py); struck: when they last hit each other [s],
# and repeats: how often more at that time.
PAIR = np.dtype(
    [
        ("a", "i8"),
        ("b", "i8"),
        ("piece_a", "i8"),
        ("piece_b", "i8"),
        ("pressing", "i8"),
        ("struck", "f8"),
        ("repeats", "i8"),
        ("axis", "f8", 3),
    ],
    align=True,
)


@uncounted
def meeting_bound(pair, parts, kinds, t, bounds):
    """Earliest time [s] at which a pair has to be looked at again, and whether it may touch now; not before a step.

    Fast parts are looked at earlier than that: a column of parts that falls needs many impacts to stop. Slow ones
    over a plate that is no longer driven are looked at later.
    """
    due = bound_of_spheres(pair, parts, kinds, t, bounds, FREE_FLIGHT)
    if due > t:
        return due, False
    for i in (pair.a, pair.b):
        fly_to(parts[i], kinds.record[parts[i].kind], t)
    return bound_of_hulls(pair, parts, kinds, t, bounds, FREE_FLIGHT)


@inlined
def bound_of_spheres(pair, parts, kinds, t, bounds, forced):
    """As `meeting_bound` where the spheres around both parts are apart, else t.

    forced: acceleration [m/s^2] of both parts beyond gravity, and speed [m/s] that they may get at once, at most; how
    far they may enter each other before they are looked at again [m].
    """
    a, b = parts[pair.a], parts[pair.b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    if kind_b.mass < np.inf:
        apart, wait = _spheres_meet(a, kind_a, b, kind_b, t, (forced[0] + forced[1], forced[2] + forced[3]))
        if apart:
            fastest = _relative_speed(a, kind_a, b, kind_b) + GRAVITY * abs(a.clock - b.clock)
            return t + max(wait, min(bounds.step, DEEP / fastest))
    return t


@inlined
def bound_of_hulls(pair, parts, kinds, t, bounds, forced):
    """As `meeting_bound`, of parts that are at time t; forced: see `bound_of_spheres`."""
    a, b = parts[pair.a], parts[pair.b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    axis, piece_a, piece_b = pair.axis, kinds.piece[pair.piece_a], kinds.piece[pair.piece_b]
    top = extent(a, kind_a, piece_a, kinds, axis, 1.0)
    bottom = extent(b, kind_b, piece_b, kinds, axis, -1.0)
    gap = -bottom - top
    # The plane moves with both hulls' mean speed along the axis; each has half of the gap to itself.
    # Gravity changes nothing between two that fly; beside a wall or a part asleep the plane stands and the other falls.
    drift, fall = 0.0, GRAVITY * abs(axis[2])
    flies_a, flies_b = flies(a, kind_a), flies(b, kind_b)
    if not flies_a and not flies_b:
        return np.inf, False
    if flies_a and flies_b:
        fall = 0.0
        for k in range(3):
            drift += 0.5 * axis[k] * (a.velocity[k] + b.velocity[k])
    to_b = forced[2] if flies_b else forced[2] + forced[3]  # what stands may come with its plate
    room = 0.5 * (max(gap, 0.0) + min(SLACK, forced[4]))
    wait = min(
        _crossing_time(a, kind_a, piece_a, kinds, axis, 1.0, top, (drift - to_b, room, fall + forced[0])),
        _crossing_time(b, kind_b, piece_b, kinds, axis, -1.0, bottom, (-drift - forced[3], room, fall + forced[1])),
    )
    speed = _relative_speed(a, kind_a, b, kind_b)
    if not flies_b:  # what stands has no angular momentum but a rate at which it turns
        speed += kind_b.reach * math.sqrt(dot(b.momentum, b.momentum))
    shortest = min(max(bounds.step, SLACK / speed), forced[4] / speed)
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
def _spheres_meet(a, kind_a, b, kind_b, t, forced):
    """Whether the bounding spheres are apart at time t, and how long they stay so [s]; without turning the parts.

    forced: acceleration [m/s^2] and speed [m/s] of both together that do not come from gravity.
    """
    reach, (pushed, thrown) = kind_a.reach + kind_a.radius + kind_b.reach + kind_b.radius, forced
    age_a, age_b = t - a.clock, t - b.clock
    fall_a = GRAVITY * (flies(a, kind_a) and a.phase == FREE)
    fall_b = GRAVITY * (flies(b, kind_b) and b.phase == FREE)
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
    if pushed > 0.0 or thrown > 0.0:  # where they are by now is not known but for that
        age, most = max(age_a, age_b), pushed + 2.0 * GRAVITY
        gap = math.sqrt(distance) - reach - age * (thrown + 0.5 * most * age)
        speed = math.sqrt(speed) + thrown + most * age
        return gap > 0.0, 2.0 * gap / (speed + math.sqrt(speed * speed + 2.0 * most * max(gap, 0.0)))
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
def extent(part, kind, piece, kinds, axis, sign):
    """Largest coordinate of a piece of a part along sign * axis [m]."""
    x, y, z = (_along_body_axis(part, axis, 0), _along_body_axis(part, axis, 1), _along_body_axis(part, axis, 2))
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
    x, y, z = (_along_body_axis(part, axis, 0), _along_body_axis(part, axis, 1), _along_body_axis(part, axis, 2))
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
