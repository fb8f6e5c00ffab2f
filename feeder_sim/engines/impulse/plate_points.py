"""Which points of a part can touch the plate, and how they stand to it: the rows of `Scratch.point`.

Above the crest of the surface the gap of a point is that to the crest, and the surface counts as still. Below it the
gap is that to the surface itself, and its rate takes in that the point moves along a slope; so the normal velocity of
the contact is the rate of the gap, to round-off.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.state import (
    ACCELERATION,
    AT,
    CHANGE,
    E,
    FALL,
    GAP,
    HEIGHT,
    JERK,
    KNOWN,
    MOVES,
    MU,
    NOW,
    OWN,
    PUSH,
    RATE,
    SLOPE_X,
    SLOPE_Y,
    SPEED,
    TOWARDS,
    TURN_X,
    TURN_Y,
    WITH,
    arm_of,
    height_of,
    inverse_inertia,
    spin_of,
    turning_acceleration,
)
from feeder_sim.engines.impulse.vectors import cross, dot, times, vector
from feeder_sim.engines.outline_arrays import ON_EDGE, off_plate
from feeder_sim.machine_code import compiled, inlined
from feeder_sim.plate.compiled import BETA_X, BETA_Y, W, cubic_slopes, cubic_weights, grid_cell, interpolate
from feeder_sim.scene.scene import GRAVITY

CLOSE = 1e-6  # [m]; how a surface moves and slopes is known under points that are closer
BESIDE = 2e-4  # [m]; a point that far below the surface is beside the plate or under it


@inlined
def move_surface(t, surface, modal):
    """Modal coordinates and three derivatives of every mode shape at time t [s], into modal (4, n_shapes); see NOW."""
    for s in range(modal.shape[1]):
        modal[NOW, s] = modal[SPEED, s] = modal[ACCELERATION, s] = modal[CHANGE, s] = 0.0
    for k in range(surface.term_shape.shape[0]):
        if surface.term_start[k] <= t < surface.term_stop[k]:
            age, s = t - surface.term_start[k], surface.term_shape[k]
            growth, rate = surface.rate[k].real, surface.rate[k].imag
            fade = math.exp(growth * age) if growth != 0.0 else 1.0
            c, d = fade * math.cos(rate * age), fade * math.sin(rate * age)
            x = surface.coefficient[k].real * c - surface.coefficient[k].imag * d
            y = surface.coefficient[k].real * d + surface.coefficient[k].imag * c
            modal[NOW, s] += x
            x, y = growth * x - rate * y, growth * y + rate * x
            modal[SPEED, s] += x
            x, y = growth * x - rate * y, growth * y + rate * x
            modal[ACCELERATION, s] += x
            modal[CHANGE, s] += growth * x - rate * y


@inlined
def shapes_at(x, y, surface, known, under):
    """What every mode shape does at (x, y) [m], into under (n_shapes, 5), see HEIGHT; its height alone if not `known`."""
    first_x, a = grid_cell(x, surface.grid_x)
    first_y, b = grid_cell(y, surface.grid_y)
    weight_x, weight_y = cubic_weights(a), cubic_weights(b)
    table = surface.table
    for s in range(under.shape[0]):
        under[s, HEIGHT] = interpolate(table, s, W, first_x, first_y, weight_x, weight_y)
    if not known:
        return
    change_x = cubic_slopes(a, surface.grid_x[1] - surface.grid_x[0])
    change_y = cubic_slopes(b, surface.grid_y[1] - surface.grid_y[0])
    for s in range(under.shape[0]):
        under[s, SLOPE_X] = interpolate(table, s, W, first_x, first_y, change_x, weight_y)
        under[s, SLOPE_Y] = interpolate(table, s, W, first_x, first_y, weight_x, change_y)
        under[s, TURN_X] = interpolate(table, s, BETA_X, first_x, first_y, weight_x, weight_y)
        under[s, TURN_Y] = interpolate(table, s, BETA_Y, first_x, first_y, weight_x, weight_y)


@inlined
def shapes_under(x, y, part, surface, known, under):
    """As `shapes_at`; a tangent surface is the plane under the part's centre."""
    if not surface.tangent:
        shapes_at(x, y, surface, known, under)
        return
    shapes_at(part.position[0], part.position[1], surface, True, under)
    for s in range(under.shape[0]):
        under[s, SLOPE_X], under[s, SLOPE_Y] = under[s, TURN_X], under[s, TURN_Y]
        under[s, HEIGHT] += under[s, SLOPE_X] * (x - part.position[0]) + under[s, SLOPE_Y] * (y - part.position[1])


@compiled
def look(part, kind, corners, surface, bounds, t, work):
    """Fill the rows of all corners; returns how many of them are close to the surface."""
    spin, close, moved = spin_of(part, kind), 0, False
    rises, falls = _vertical(part, kind, spin)
    own = GRAVITY + turning_acceleration(part, kind)
    lowest = part.position[2] - kind.radius - bounds.crest
    for i in range(corners.shape[0]):
        row = work.point[i]
        gap = lowest + height_of(part, corners, i)
        row[GAP], row[RATE], row[FALL] = gap, part.velocity[2] + dot(rises, corners[i]), GRAVITY + dot(falls, corners[i])
        row[MOVES], row[PUSH], row[JERK], row[OWN] = 0.0, row[FALL], 0.0, own
        row[KNOWN] = 0.0
        if gap > CLOSE:
            continue
        if not moved:
            move_surface(t, surface, work.now)
            moved = True
        close += _look_below(i, part, kind, corners, spin, surface, bounds, work)
    return close


@inlined
def _vertical(part, kind, spin):
    """Vectors in body axes: a corner r rises by r . rises [m/s] and is accelerated downwards by r . falls [m/s^2], as
    the part turns: with z' = z . (w x r), z'' = z . (dw/dt x r + w x (w x r)), and I dw/dt = L x w.
    """
    r, momentum = part.attitude, vector(part.momentum)
    change = times(inverse_inertia(part, kind), cross(momentum, spin))
    squared = dot(spin, spin)
    x, y, z = spin[2] * spin[0] - change[1], spin[2] * spin[1] + change[0], spin[2] * spin[2] - squared
    rises = (
        spin[0] * r[1, 0] - spin[1] * r[0, 0],
        spin[0] * r[1, 1] - spin[1] * r[0, 1],
        spin[0] * r[1, 2] - spin[1] * r[0, 2],
    )
    falls = (
        -(x * r[0, 0] + y * r[1, 0] + z * r[2, 0]),
        -(x * r[0, 1] + y * r[1, 1] + z * r[2, 1]),
        -(x * r[0, 2] + y * r[1, 2] + z * r[2, 2]),
    )
    return rises, falls


@compiled
def _look_below(i, part, kind, corners, spin, surface, bounds, work):
    """Fill the row of a corner below the crest; returns 1 if it is close to the surface, else 0."""
    row, under = work.point[i], work.under[i]
    arm = arm_of(part, corners, i)
    x, y = part.position[0] + arm[0], part.position[1] + arm[1]
    row[KNOWN] = 1.0
    outside = abs(x) > surface.grid_x[-1] + ON_EDGE or abs(y) > surface.grid_y[-1] + ON_EDGE
    if outside or off_plate(surface.outline, x, y):
        row[GAP], row[RATE] = np.inf, 0.0
        return 0
    shapes_under(x, y, part, surface, False, under)
    height = speed = push = jerk = moves = 0.0
    for s in range(under.shape[0]):
        w = under[s, HEIGHT]
        height += w * work.now[NOW, s]
        speed += w * work.now[SPEED, s]
        push += w * work.now[ACCELERATION, s]
        jerk += w * work.now[CHANGE, s]
        moves += abs(w) * bounds.acceleration[s]
    gap = part.position[2] + arm[2] - kind.radius - height
    turned = cross(spin, arm)
    row[GAP], row[RATE], row[PUSH] = gap, part.velocity[2] + turned[2] - speed, row[FALL] + push
    row[JERK], row[MOVES], row[E], row[MU] = jerk, moves, -1.0, kind.friction[0]
    row[AT], row[AT + 1], row[AT + 2] = arm[0], arm[1], arm[2] - kind.radius
    row[TOWARDS], row[TOWARDS + 1], row[TOWARDS + 2] = 0.0, 0.0, 1.0
    row[WITH], row[WITH + 1], row[WITH + 2] = 0.0, 0.0, speed
    if gap < -BESIDE:
        row[GAP] = np.inf
        return 0
    if gap > CLOSE:
        return 0
    shapes_under(x, y, part, surface, True, under)
    stand(row, arm, kind.radius, speed, under, work.now[NOW], work.now[SPEED], surface)
    row[RATE] = rate_of(row, part.velocity, spin)
    return 1


@inlined
def stand(row, arm, radius, speed, under, q, dq, surface):
    """Arm, normal and motion of the surface at a point whose surface rises at a speed [m/s], for modal coordinates q.

    A place of the plate moves sideways too; it moves upwards so that a place in space sees the surface rise at `speed`.
    """
    slope_x = slope_y = along_x = along_y = 0.0
    for s in range(under.shape[0]):
        slope_x += under[s, SLOPE_X] * q[s]
        slope_y += under[s, SLOPE_Y] * q[s]
        along_x -= under[s, TURN_X] * dq[s]
        along_y -= under[s, TURN_Y] * dq[s]
    moves = surface.half_thickness * surface.in_plane
    along_x, along_y = moves * along_x, moves * along_y
    size = math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
    n = -slope_x / size, -slope_y / size, 1.0 / size
    row[AT], row[AT + 1], row[AT + 2] = arm[0] - radius * n[0], arm[1] - radius * n[1], arm[2] - radius * n[2]
    row[TOWARDS], row[TOWARDS + 1], row[TOWARDS + 2] = n
    row[WITH], row[WITH + 1], row[WITH + 2] = along_x, along_y, speed + slope_x * along_x + slope_y * along_y


@inlined
def rate_of(row, velocity, spin):
    """How fast the gap of a point grows [m/s], at these velocities of its part."""
    turned = cross(spin, (row[AT], row[AT + 1], row[AT + 2]))
    return (
        row[TOWARDS] * (velocity[0] + turned[0] - row[WITH])
        + row[TOWARDS + 1] * (velocity[1] + turned[1] - row[WITH + 1])
        + row[TOWARDS + 2] * (velocity[2] + turned[2] - row[WITH + 2])
    )


@compiled
def renew_rates(part, kind, corners, n, work):
    """Rates of all points anew, after the part's velocity has changed; `n` points, of which the first are corners."""
    spin = spin_of(part, kind)
    rises, falls = _vertical(part, kind, spin)
    own = GRAVITY + turning_acceleration(part, kind)
    for i in range(n):
        row = work.point[i]
        if i < corners.shape[0]:
            fall = GRAVITY + dot(falls, corners[i])
            row[PUSH] += fall - row[FALL]
            row[FALL], row[OWN] = fall, own
        if row[KNOWN] == 0.0:
            row[RATE] = part.velocity[2] + dot(rises, corners[i])
        else:
            row[RATE] = rate_of(row, part.velocity, spin)


@inlined
def ahead(i, far, slip, slack, twist, work):
    """Gap [m], rate [m/s] and acceleration towards the surface [m/s^2] of point i after a time [s], at the worst."""
    row, under = work.point[i], work.under[i]
    fall = row[FALL] + slack + twist * far
    rate = row[RATE] - slip
    gap = row[GAP] + far * (rate - 0.5 * fall * far)
    rate -= fall * far
    h = fall
    for s in range(under.shape[0]):
        w = under[s, HEIGHT]
        gap -= w * (work.then[NOW, s] - work.now[NOW, s] - work.now[SPEED, s] * far)
        rate -= w * (work.then[SPEED, s] - work.now[SPEED, s])
        h += w * work.then[ACCELERATION, s]
    return gap, rate, h
