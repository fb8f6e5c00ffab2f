"""Corners of a part, or its ball, in a round tube that stands still and has no ends.

With p from the axis to the centre of the sphere around a point, across the axis, and d the room that it has, the radius
of the tube less that of the sphere, the gap is taken as

    G = (d^2 - p.p) / 2d,   G' = -p.v / d,   G'' = -(v.v + p.a) / d,   G''' = -(3 v.a + p.j) / d

with v, a and the jerk j across the axis. At the wall that is the distance to it, to first order; away from it G is
less. It is a polynomial in time where p is one: of a ball in free flight nothing is left out.
"""

from __future__ import annotations

import math

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.free_part.leap import LONGEST, twist_of
from feeder_sim.engines.impulse.free_part.on_plate import CLOSE
from feeder_sim.engines.impulse.free_part.path import write_path
from feeder_sim.engines.impulse.scratch import ON_WALL
from feeder_sim.engines.impulse.state import arm_of
from feeder_sim.engines.impulse.surroundings import WINDOW
from feeder_sim.engines.impulse.vectors import cross, difference, dot, plus, vector, write_to
from feeder_sim.machine_code import inlined, uncounted

TINY = 1e-15  # [m]; so near the axis every direction is across it
ACROSS = (1.0, 0.0, 0.0)
STILL = (0.0, 0.0, 0.0)


@uncounted
def evaluate_tube(part, kinds, plate, first, turning, work):
    """Fill a point for every corner, from `first` on; returns the end, and whether one is close."""
    kind, wall, close = kinds.record[part.kind], plate.wall, False
    corners, room = kinds.corners[kind.corner_from : kind.corner_to], wall.radius - kind.radius
    for i in range(corners.shape[0]):
        n = first + i
        point, arm = work.point[n], arm_of(part, corners, i)
        p = _from_axis(part, arm, wall)
        rho = math.sqrt(dot(p, p))
        normal = plus(STILL, -1.0 / rho, p) if rho > TINY else ACROSS
        point.sort, point.carried, point.gap = ON_WALL, 0, 0.5 * (room - rho) * (room + rho) / room
        point.friction, point.jerk_bound, point.rolls = wall.friction, 0.0, 0.0
        point.push = point.most_push = point.push_rate = 0.0
        write_to(point.arm, plus(arm, -kind.radius, normal))
        write_to(point.normal, normal)
        write_to(point.surface_velocity, STILL)
        forget_plate(work.under[n])
        move_at_tube(n, part, kind, plate, turning, work)
        close = close or point.gap <= CLOSE
    return first + corners.shape[0], close


@inlined
def forget_plate(under):
    """The plate does not move a wall."""
    for s in range(under.shape[0]):
        for k in range(under.shape[1]):
            under[s, k] = 0.0


@inlined
def _from_axis(part, arm, wall):
    """The way from the axis to the end of an arm from the centre of mass, across the axis [m]."""
    return _across(difference(plus(part.position, 1.0, arm), wall.foot), wall)


@inlined
def _across(a, wall):
    return plus(a, -dot(a, wall.axis), wall.axis)


@inlined
def move_at_tube(i, part, kind, plate, turning, work):
    """Write the path of the gap of point i, at the wall, as its part moves now."""
    point, wall, room = work.point[i], plate.wall, plate.wall.radius - kind.radius
    arm = plus(point.arm, kind.radius, point.normal)
    jerk = _across(write_path(point, part, arm, turning), wall)
    p, v, a = _from_axis(part, arm, wall), _across(point.path_velocity, wall), _across(point.path_acceleration, wall)
    opens, changes = -(dot(v, v) + dot(p, a)) / room, -(3.0 * dot(v, a) + dot(p, jerk)) / room
    point.rate, point.closing, point.closing_rate = -dot(p, v) / room, -opens, -changes
    write_to(point.path_velocity, (0.0, 0.0, point.rate))
    write_to(point.path_acceleration, (0.0, 0.0, opens))
    point.path_jerk = changes
    swing = plus(v, -dot(v, point.normal), point.normal)
    write_to(point.swing, plus(STILL, -1.0 / (room - point.gap), swing))
    # Of the longest leap.
    most = GRAVITY * math.sqrt(max(1.0 - wall.axis[2] * wall.axis[2], 0.0)) + turning.acceleration
    fastest = math.sqrt(dot(v, v)) + most * min(LONGEST / plate.bounds.fastest, WINDOW)
    point.most_own = most + fastest * fastest / room
    point.snap_bound = (3.0 * most * most + 4.0 * fastest * twist_of(kind, turning)) / room


@inlined
def tube_point_after(i, part, kind, turning, time, work):
    """As `edge_point_after`, of point i at the wall."""
    point = work.point[i]
    at, n, swing = vector(point.arm), vector(point.normal), vector(point.swing)
    middle = plus(n, 0.5 * time, swing)
    middle = plus(STILL, 1.0 / math.sqrt(dot(middle, middle)), middle)
    centre = plus(at, kind.radius, n)
    going = cross(turning.spin, centre)
    at = plus(plus(centre, 0.5 * time, going), -kind.radius, middle)
    return at, middle, 0.5 * time * dot(swing, plus(part.velocity, 1.0, going))
