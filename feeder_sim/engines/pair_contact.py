"""Contact of two parts: when they can meet at the earliest, and their impact.

Both parts fly freely, so gravity does not change their relative motion. Each pair keeps an axis, the direction in which
its hulls were last found apart. The plane across it between both hulls parts them for as long as no corner of either
can have crossed it, which bounds the time of their meeting from below by arithmetic on corners alone; only where the
plane does not part them any more is the library asked for distance and closest points (conservative advancement, as at
the plate). An impact is at the closest points and at all corners of one hull in the other, so that faces meet as faces.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from feeder_sim.engines.hulls import hull_distance
from feeder_sim.engines.impact import resolve_single
from feeder_sim.engines.impulse_state import FRICTION, RESTITUTION, fly_to, invert_inertia
from feeder_sim.scene import GRAVITY

SLACK = 1e-6  # [m]; hulls this close touch, and may enter each other this far before anybody looks
DEEP = 2e-6  # [m]; how deep parts may enter each other before they are looked at again, where a step is longer
MAX_ROUNDS = 8  # of impacts at the points of one contact
FAR = 1e-3  # [m]; no distance beyond this is asked of the library


class Pairs(NamedTuple):
    """Pairs of parts that can meet within a window: a < b (n,), and the axis from a to b (n, 3)."""

    a: NDArray[np.int64]
    b: NDArray[np.int64]
    axis: NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy")
def meeting_bound(pairs, p, parts, kinds, t, step):
    """Earliest time [s] at which pair p has to be looked at again, and whether it may touch now; not before a step.

    Fast parts are looked at earlier than that: a column of parts that falls needs many impacts to stop.
    """
    a, b = pairs.a[p], pairs.b[p]
    if kinds.mass[parts.kind[b]] < np.inf:
        apart, wait = _spheres_meet(parts, kinds, a, b, t)
        if apart:
            return t + max(wait, step), False
    fly_to(parts, kinds, a, t)
    fly_to(parts, kinds, b, t)
    axis = pairs.axis[p]
    top = _extent(parts, kinds, a, axis, 1.0)
    bottom = _extent(parts, kinds, b, axis, -1.0)
    gap = -bottom - top
    # The plane moves with both hulls' mean speed along the axis; each has half of the gap to itself.
    drift = 0.0
    for k in range(3):
        drift += 0.5 * axis[k] * (parts.velocity[a, k] + parts.velocity[b, k])
    if kinds.mass[parts.kind[b]] == np.inf:
        drift = 0.0
    room = 0.5 * (max(gap, 0.0) + SLACK)
    wait = min(
        _crossing_time(parts, kinds, a, axis, 1.0, top, drift, room),
        _crossing_time(parts, kinds, b, axis, -1.0, bottom, -drift, room),
    )
    if gap < -DEEP:  # pushed into each other by what lies beside them
        wait = 0.0
    return t + max(wait, min(step, DEEP / _relative_speed(parts, kinds, a, b))), gap <= SLACK


@njit(cache=True, nogil=True, error_model="numpy")
def _relative_speed(parts, kinds, a, b):
    """No two points of both parts approach each other faster [m/s]; never quite zero."""
    squared = 1e-24
    for k in range(3):
        squared += (parts.velocity[a, k] - parts.velocity[b, k]) ** 2
    return math.sqrt(squared) + _turning_speed(parts, kinds, a) + _turning_speed(parts, kinds, b)


@njit(cache=True, nogil=True, error_model="numpy")
def _turning_speed(parts, kinds, i):
    """No point of a part moves faster about its centre [m/s]."""
    inertia, momentum = kinds.inertia[parts.kind[i]], parts.momentum[i]
    squared = momentum[0] ** 2 + momentum[1] ** 2 + momentum[2] ** 2
    return kinds.reach[parts.kind[i]] * math.sqrt(squared) / min(inertia[0], inertia[1], inertia[2])


@njit(cache=True, nogil=True, error_model="numpy")
def _spheres_meet(parts, kinds, a, b, t):
    """Whether the bounding spheres are apart at time t, and how long they stay so [s]; without turning the parts."""
    reach = kinds.reach[parts.kind[a]] + kinds.radius[parts.kind[a]]
    reach += kinds.reach[parts.kind[b]] + kinds.radius[parts.kind[b]]
    age_a, age_b = t - parts.clock[a], t - parts.clock[b]
    distance = closing = speed = 0.0
    for k in range(3):
        r = parts.position[b, k] + parts.velocity[b, k] * age_b - parts.position[a, k] - parts.velocity[a, k] * age_a
        u = parts.velocity[b, k] - parts.velocity[a, k]
        if k == 2:
            r -= 0.5 * GRAVITY * (age_b * age_b - age_a * age_a)
            u -= GRAVITY * (age_b - age_a)
        distance += r * r
        closing += r * u
        speed += u * u
    if distance <= reach * reach:
        return False, 0.0
    discriminant = closing * closing - speed * (distance - reach * reach)
    if closing >= 0.0 or discriminant <= 0.0:
        return True, np.inf
    return True, (distance - reach * reach) / (-closing + math.sqrt(discriminant))


@njit(cache=True, nogil=True, error_model="numpy")
def _along_body_axis(parts, i, vector, n):
    """Component of a vector along body axis n of part i."""
    attitude = parts.attitude
    return attitude[i, 0, n] * vector[0] + attitude[i, 1, n] * vector[1] + attitude[i, 2, n] * vector[2]


@njit(cache=True, nogil=True, error_model="numpy")
def _extent(parts, kinds, i, axis, sign):
    """Largest coordinate of part i along sign * axis [m]."""
    k = parts.kind[i]
    x, y, z = (
        _along_body_axis(parts, i, axis, 0),
        _along_body_axis(parts, i, axis, 1),
        _along_body_axis(parts, i, axis, 2),
    )
    largest = -np.inf
    for c in range(kinds.first_corner[k], kinds.first_corner[k + 1]):
        largest = max(largest, sign * (x * kinds.corners[c, 0] + y * kinds.corners[c, 1] + z * kinds.corners[c, 2]))
    if kinds.first_corner[k + 1] - kinds.first_corner[k] == 1:
        largest += kinds.radius[k]
    for n in range(3):
        largest += sign * axis[n] * parts.position[i, n]
    return largest


@njit(cache=True, nogil=True, error_model="numpy")
def _crossing_time(parts, kinds, i, axis, sign, support, drift, room):
    """Time [s] before which no corner of part i can come `room` farther along sign * axis than its support.

    The plane it must not cross moves at `drift` [m/s]; a corner turns with at most 2 reach (L / I)^2.
    """
    k = parts.kind[i]
    if kinds.mass[k] == np.inf:
        return np.inf
    x, y, z = (
        _along_body_axis(parts, i, axis, 0),
        _along_body_axis(parts, i, axis, 1),
        _along_body_axis(parts, i, axis, 2),
    )
    momentum, inertia = parts.momentum[i], kinds.inertia[k]
    spin_x = _along_body_axis(parts, i, momentum, 0) / inertia[0]
    spin_y = _along_body_axis(parts, i, momentum, 1) / inertia[1]
    spin_z = _along_body_axis(parts, i, momentum, 2) / inertia[2]
    # n . (w x r) = r . (n x w)
    turn_x, turn_y, turn_z = y * spin_z - z * spin_y, z * spin_x - x * spin_z, x * spin_y - y * spin_x
    speed, centre, squared = -drift, 0.0, 0.0
    for n in range(3):
        speed += sign * axis[n] * parts.velocity[i, n]
        centre += sign * axis[n] * parts.position[i, n]
        squared += momentum[n] * momentum[n]
    ball = kinds.first_corner[k + 1] - kinds.first_corner[k] == 1
    if ball:
        centre += kinds.radius[k]
    least = min(inertia[0], inertia[1], inertia[2])
    a = 0.0 if ball else 2.0 * kinds.reach[k] * squared / (least * least)
    shortest = np.inf
    for c in range(kinds.first_corner[k], kinds.first_corner[k + 1]):
        rx, ry, rz = kinds.corners[c, 0], kinds.corners[c, 1], kinds.corners[c, 2]
        gap = support - centre - sign * (x * rx + y * ry + z * rz) + room
        rate = speed + sign * (turn_x * rx + turn_y * ry + turn_z * rz)
        root = rate + math.sqrt(rate * rate + 2.0 * a * gap)
        if root > 0.0:
            shortest = min(shortest, 2.0 * gap / root)
    return shortest


@njit(cache=True, nogil=True, error_model="numpy")
def meet(pairs, p, parts, kinds, hulls):
    """Ask for the distance of pair p and, where its parts touch and approach each other, give them impulses.

    Both parts are at the same time. Returns whether their motion has changed.
    """
    a, b = pairs.a[p], pairs.b[p]
    axis, witness = pairs.axis[p], hulls.witness
    distance = hull_distance(hulls, parts, a, b, FAR)
    if distance >= FAR:
        return False
    if abs(distance) > 0.1 * SLACK:  # of closest points that coincide the direction is round-off
        for k in range(3):
            axis[k] = (witness[3 + k] - witness[k]) / distance
        size = math.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
        for k in range(3):
            axis[k] /= size
    if distance > SLACK:
        return False
    ka, kb = parts.kind[a], parts.kind[b]
    most = 1 + kinds.first_corner[ka + 1] - kinds.first_corner[ka] + kinds.first_corner[kb + 1] - kinds.first_corner[kb]
    points = np.empty((most, 3))
    for k in range(3):
        points[0, k] = 0.5 * (witness[k] + witness[3 + k])
    n = _corners_inside(parts, kinds, a, b, points, 1)
    n = _corners_inside(parts, kinds, b, a, points, n)
    return _collide(parts, kinds, a, b, points, n, axis, distance)


@njit(cache=True, nogil=True, error_model="numpy")
def _corners_inside(parts, kinds, a, b, points, n):
    """Append the corners of part a that are inside the hull of part b, or as good as touch it; returns their number."""
    ka, kb = parts.kind[a], parts.kind[b]
    if kinds.first_corner[ka + 1] - kinds.first_corner[ka] == 1:
        return n
    at, local = np.empty(3), np.empty(3)
    for c in range(kinds.first_corner[ka], kinds.first_corner[ka + 1]):
        for k in range(3):
            at[k] = parts.position[a, k]
            for m in range(3):
                at[k] += parts.attitude[a, k, m] * kinds.corners[c, m]
        for m in range(3):
            local[m] = 0.0
            for k in range(3):
                local[m] += parts.attitude[b, k, m] * (at[k] - parts.position[b, k])
        inside = kinds.first_plane[kb + 1] > kinds.first_plane[kb]
        for f in range(kinds.first_plane[kb], kinds.first_plane[kb + 1]):
            plane = kinds.planes[f]
            if plane[0] * local[0] + plane[1] * local[1] + plane[2] * local[2] + plane[3] > SLACK:
                inside = False
                break
        if inside:
            points[n] = at
            n += 1
    return n


@njit(cache=True, nogil=True, error_model="numpy")
def _collide(parts, kinds, a, b, points, n, axis, distance):
    """Impacts of part b on part a at n points, one after the other, along an axis from a to b; part what overlaps.

    At points that one impact makes approach again there are further ones, until all of them separate.
    """
    ka, kb = parts.kind[a], parts.kind[b]
    fixed = kinds.mass[kb] == np.inf
    inverse, arms = np.empty((2, 3, 3)), np.empty((2, 3))
    invert_inertia(parts.attitude[a], kinds.inertia[ka], inverse[0])
    invert_inertia(parts.attitude[b], kinds.inertia[kb], inverse[1])
    law = 0 if fixed else 1
    hit = False
    for _ in range(MAX_ROUNDS):
        again = False
        for i in range(n):
            for k in range(3):
                arms[0, k], arms[1, k] = points[i, k] - parts.position[a, k], points[i, k] - parts.position[b, k]
            again |= resolve_single(
                parts.velocity[a],
                parts.momentum[a],
                1.0 / kinds.mass[ka],
                inverse[0],
                parts.velocity[b],
                parts.momentum[b],
                1.0 / kinds.mass[kb],
                inverse[1],
                arms,
                axis,
                kinds.law[RESTITUTION, law],
                kinds.law[FRICTION, law],
            )
        hit |= again
        if not again:
            break
    if distance < 0.0:
        share = 1.0 if fixed else kinds.mass[kb] / (kinds.mass[ka] + kinds.mass[kb])
        for k in range(3):
            parts.position[a, k] += distance * share * axis[k]
            parts.position[b, k] -= distance * (1.0 - share) * axis[k]
    return hit or distance < 0.0
