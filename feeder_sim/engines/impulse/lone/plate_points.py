"""Which points of a part can touch the plate, and how they stand to it: the rows of `Scratch.point`.

Above the crest of the surface the gap of a point is that to the crest, and the surface counts as still. Below it the
gap is that to the surface itself, and its rate takes in that the point moves along a slope; so the normal velocity of
the contact is the rate of the gap, to round-off.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.lone.edge_piece import BALL, BESIDE, LINES, NONE
from feeder_sim.engines.impulse.lone.edge_points import edge_points
from feeder_sim.engines.impulse.lone.moving_surface import move_surface, shapes_at, shapes_under
from feeder_sim.engines.impulse.lone.state import (
    ACCELERATION,
    AT,
    AT_EDGE,
    CHANGE,
    EDGE,
    FALL,
    GAP,
    GOES,
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
    SWING,
    TOWARDS,
    TURN_X,
    TURN_Y,
    WITH,
)
from feeder_sim.engines.impulse.state import arm_of, inverse_inertia, spin_of, turning_acceleration
from feeder_sim.engines.impulse.vectors import add_to, cross, difference, dot, plus, times, vector, write_to
from feeder_sim.engines.surface_arrays import ON_EDGE, off_plate
from feeder_sim.machine_code import inlined

CLOSE = 1e-6  # [m]
NEARBY = 1e-5  # [m]; a surface that rises by less is known with its slopes under every point below its crest
REACH = 1e-3  # [m]; how far from the edge of the plate a part is looked at there
SWUNG = 4.0  # |n'| |v|, by which a gap at the edge is accelerated at most, over the other bounds: twice as much as now
UP = (0.0, 0.0, 1.0)


@inlined
def look(part, kind, corners, surface, bounds, t, work):
    """Fill the rows of all corners.

    Returns whether one is close to the surface, and whether the surface has been moved to time t.
    """
    spin, change, close, moved = spin_of(part, kind), (0.0, 0.0, 0.0), False, False
    own = GRAVITY + turning_acceleration(part, kind)
    lowest = part.position[2] - kind.radius - bounds.crest
    for i in range(corners.shape[0]):
        row, arm = work.point[i], arm_of(part, corners, i)
        gap = lowest + arm[2]
        row[GAP], row[RATE] = gap, part.velocity[2] + spin[0] * arm[1] - spin[1] * arm[0]
        row[OWN], row[MOVES], row[KNOWN], row[WITH + 2] = own, 0.0, 0.0, 0.0
        write_to(row[AT : AT + 3], arm)
        if gap > CLOSE:
            continue
        if not moved:
            move_surface(t, surface, work.now)
            change = spin_change(part, kind, spin)
            moved = True
        row[FALL], row[MU] = GRAVITY + falls(spin, change, arm, UP), kind.friction[0]
        row[TOWARDS], row[TOWARDS + 1], row[TOWARDS + 2] = UP
        x, y = part.position[0] + arm[0], part.position[1] + arm[1]
        outside = abs(x) > surface.grid_x[-1] + ON_EDGE or abs(y) > surface.grid_y[-1] + ON_EDGE
        if outside or off_plate(surface.outline, x, y):
            row[GAP] = np.inf
            continue
        close = _look_below(row, work.under[i], part, kind, arm, spin, surface, bounds, work) or close
    return close, moved


@inlined
def spin_change(part, kind, spin):
    """How the spin of a part changes by itself [rad/s^2]: I dw/dt = L x w."""
    return times(inverse_inertia(part, kind), cross(vector(part.momentum), spin))


@inlined
def falls(spin, change, arm, normal):
    """Acceleration of the end of an arm against a normal, as its part turns [m/s^2]: dw/dt x r + w x (w x r)."""
    return -dot(normal, plus(cross(change, arm), 1.0, cross(spin, cross(spin, arm))))


@inlined
def _look_below(row, under, part, kind, arm, spin, surface, bounds, work):
    """Fill the row of a corner below the crest; returns whether it is close to the surface."""
    x, y = part.position[0] + arm[0], part.position[1] + arm[1]
    known = bounds.crest < NEARBY
    shapes_under(x, y, part, surface, known, under)
    height = _moves_with(row, under, bounds, work)
    speed = row[WITH + 2]
    gap = part.position[2] + arm[2] - kind.radius - height
    row[GAP], row[RATE] = gap, row[RATE] - speed
    if gap > CLOSE and not known:
        return False
    row[KNOWN] = 1.0
    if not known:
        shapes_under(x, y, part, surface, True, under)
    stand(row, arm, kind.radius, speed, under, work.now[NOW], work.now[SPEED], surface)
    row[RATE] = rate_of(row, part, kind, spin)
    return gap <= CLOSE


@inlined
def _moves_with(row, under, bounds, work):
    """How the surface moves a row whose `under` is known; returns its height [m]."""
    height = speed = push = jerk = moves = 0.0
    for s in range(under.shape[0]):
        w = under[s, HEIGHT]
        height += w * work.now[NOW, s]
        speed += w * work.now[SPEED, s]
        push += w * work.now[ACCELERATION, s]
        jerk += w * work.now[CHANGE, s]
        moves += abs(w) * bounds.acceleration[s]
    row[WITH + 2], row[PUSH], row[JERK], row[MOVES] = speed, row[FALL] + push, jerk, moves
    return height


@inlined
def look_at_edge(part, kind, kinds, first, surface, bounds, t, moved, work):
    """Fill rows of points on the edge of the plate, from `first` on; returns their end, and whether one is close."""
    if not moved:
        move_surface(t, surface, work.now)
    height = _height_of_plate(part, surface, work.under[first], work.now[NOW])
    part.position[2] -= height
    found = edge_points(part, kind, kinds, surface, REACH, work.edge)
    part.position[2] += height
    if found == 0:
        return first, False
    spin = spin_of(part, kind)
    change = spin_change(part, kind, spin)
    own = GRAVITY + turning_acceleration(part, kind)
    n, close = first, False
    for k in range(found):
        point, row, under = work.edge[k], work.point[n], work.under[n]
        arm, normal = vector(point.arm), vector(point.normal)
        row[FALL] = 0.0
        shapes_under(point.foot[0], point.foot[1], part, surface, True, under)
        row[GAP] = point.gap + height * normal[2] - _moves_edge(row, under, normal, surface, bounds, work)
        if row[GAP] < -BESIDE:
            continue
        row[OWN], row[KNOWN], row[MU] = own, AT_EDGE, kind.friction[0]
        write_to(row[AT : AT + 3], arm)
        _lean_with_edge(row, point, kind, under, work.now[NOW])
        row[EDGE] = k
        _fall_at_edge(row, point, part, kind, spin, change)
        row[RATE] = rate_of(row, part, kind, spin)
        close = close or row[GAP] < CLOSE
        n += 1
    return n, close


@inlined
def _height_of_plate(part, surface, under, q):
    """How high the plate is under a part, or at its edge next to it [m]."""
    x = min(max(part.position[0], surface.grid_x[0]), surface.grid_x[-1])
    y = min(max(part.position[1], surface.grid_y[0]), surface.grid_y[-1])
    shapes_at(x, y, surface, False, under)
    height = 0.0
    for s in range(under.shape[0]):
        height += under[s, HEIGHT] * q[s]
    return height


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
def along_normal(under, s, n, moves):
    """How far mode shape s moves a place of the plate along a normal [1]; moves: half the thickness [m]."""
    return n[2] * under[s, HEIGHT] - moves * (n[0] * under[s, TURN_X] + n[1] * under[s, TURN_Y])


@inlined
def _moves_edge(row, under, normal, surface, bounds, work):
    """How the plate moves a place of its edge, and the row with it; returns how far along the normal [m]."""
    moves = surface.half_thickness * surface.in_plane
    moved = push = jerk = most = x = y = z = 0.0
    for s in range(under.shape[0]):
        w, dq = along_normal(under, s, normal, moves), work.now[SPEED, s]
        moved += w * work.now[NOW, s]
        push += w * work.now[ACCELERATION, s]
        jerk += w * work.now[CHANGE, s]
        most += abs(w) * bounds.acceleration[s]
        x, y, z = x - moves * under[s, TURN_X] * dq, y - moves * under[s, TURN_Y] * dq, z + under[s, HEIGHT] * dq
    row[PUSH], row[JERK], row[MOVES] = row[FALL] + push, jerk, most
    row[WITH], row[WITH + 1], row[WITH + 2] = x, y, z
    return moved


@inlined
def _lean_with_edge(row, point, kind, under, q):
    """Write the normal of a point on an edge that has the slope of the plate: it stays normal to it, and to the part's.

    The point itself has that over a level plate.
    """
    n, axis = vector(point.normal), vector(point.axis)
    slope_x = slope_y = 0.0
    for s in range(under.shape[0]):
        slope_x += under[s, SLOPE_X] * q[s]
        slope_y += under[s, SLOPE_Y] * q[s]
    along, leans = axis, axis
    if point.turns == LINES:
        along, leans = cross(axis, n), vector(point.lever)
    leant = plus(n, -n[2] * (slope_x * along[0] + slope_y * along[1]), leans)
    leant = plus(NONE, 1.0 / math.sqrt(dot(leant, leant)), leant)
    add_to(row[AT : AT + 3], kind.radius, difference(n, leant))
    write_to(row[TOWARDS : TOWARDS + 3], leant)


@inlined
def _fall_at_edge(row, point, part, kind, spin, change):
    """How the gap of a point on the edge is accelerated by itself, and how its normal turns.

    With n the normal from the edge to the nearest point of the part, or to the centre of a ball of radius r there,
    g'' = n . a + 2 n' . v - (g + r) n' . n', where a and v are the acceleration and the relative velocity of that
    point or centre. How n' follows from the motion: EDGE_POINT.
    """
    n, far = vector(row[TOWARDS : TOWARDS + 3]), row[GAP] + kind.radius
    at = plus(vector(row[AT : AT + 3]), kind.radius, n)
    v = difference(plus(part.velocity, 1.0, cross(spin, at)), vector(row[WITH : WITH + 3]))
    axis = vector(point.axis)
    if point.turns == BALL:
        around = plus(v, -dot(v, axis), axis)
        swing = plus(NONE, 1.0 / far, plus(around, -dot(around, n), n))
    elif point.turns == LINES:
        swing = plus(NONE, -dot(spin, vector(point.lever)), axis)
    else:
        swing = cross(spin, n)
    fall = GRAVITY * n[2] + falls(spin, change, at, n) - 2.0 * dot(swing, v) + far * dot(swing, swing)
    row[PUSH] += fall - row[FALL]
    row[FALL] = fall
    row[OWN] += SWUNG * math.sqrt(dot(swing, swing) * dot(v, v))
    write_to(row[SWING : SWING + 3], swing)


@inlined
def rate_of(row, part, kind, spin):
    """How fast the gap of a point grows [m/s]; writes how a corner goes sideways, or the centre of a ball."""
    normal = vector(row[TOWARDS : TOWARDS + 3])
    goes = plus(part.velocity, 1.0, cross(spin, plus(row[AT : AT + 3], kind.radius, normal)))
    row[GOES], row[GOES + 1] = goes[0], goes[1]
    return dot(normal, difference(goes, vector(row[WITH : WITH + 3])))


@inlined
def renew_rates(part, kind, n, work):
    """Rates of the first n points anew, after the velocity of the part has changed."""
    spin = spin_of(part, kind)
    change, own = spin_change(part, kind, spin), GRAVITY + turning_acceleration(part, kind)
    for i in range(n):
        row = work.point[i]
        row[OWN] = own
        if row[KNOWN] == 0.0 and row[MOVES] == 0.0:
            row[RATE] = part.velocity[2] + spin[0] * row[AT + 1] - spin[1] * row[AT] - row[WITH + 2]
            continue
        normal = vector(row[TOWARDS : TOWARDS + 3])
        row[RATE] = rate_of(row, part, kind, spin)
        if row[KNOWN] == AT_EDGE:
            _fall_at_edge(row, work.edge[int(row[EDGE])], part, kind, spin, change)
            continue
        # The gap of a ball goes as its centre does; what touches turns past.
        radius = kind.radius if row[KNOWN] != 0.0 else 0.0  # of a row that is not filled the arm ends at the centre
        fall = GRAVITY * normal[2] + falls(spin, change, plus(row[AT : AT + 3], radius, normal), normal)
        row[PUSH] += fall - row[FALL]
        row[FALL] = fall
