"""Corners of a part, or its ball, at the rim of the plate: four walls that stand still, from side to side of it."""

from __future__ import annotations

import math

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.free_part.on_plate import CLOSE
from feeder_sim.engines.impulse.free_part.on_tube import forget_plate
from feeder_sim.engines.impulse.free_part.path import write_path
from feeder_sim.engines.impulse.scratch import ON_WALL
from feeder_sim.engines.impulse.state import arm_of
from feeder_sim.engines.impulse.vectors import cross, dot, plus, vector, write_to
from feeder_sim.machine_code import inlined, uncounted

NEAR = 1e-3  # [m] from a wall, where a part is looked at there
STILL = (0.0, 0.0, 0.0)


@uncounted
def evaluate_rim(part, kinds, plate, first, turning, work):
    """Fill a point for every corner at each wall that is near, from `first` on.

    Returns the end, and whether one is close.
    """
    kind, n, close = kinds.record[part.kind], first, False
    corners = kinds.corners[kind.corner_from : kind.corner_to]
    for wall in range(4):
        along, sign, room = _room(wall, part, plate)
        if room > kind.reach + kind.radius + NEAR:
            continue
        normal = (-sign, 0.0, 0.0) if along == 0 else (0.0, -sign, 0.0)
        for i in range(corners.shape[0]):
            point, arm = work.point[n], arm_of(part, corners, i)
            point.sort, point.carried, point.gap = ON_WALL, 0, room + dot(normal, arm) - kind.radius
            point.friction, point.jerk_bound, point.rolls, point.snap_bound = kind.friction[0], 0.0, 0.0, 0.0
            point.push = point.most_push = point.push_rate = 0.0
            write_to(point.arm, plus(arm, -kind.radius, normal))
            write_to(point.normal, normal)
            write_to(point.surface_velocity, STILL)
            write_to(point.swing, STILL)
            forget_plate(work.under[n])
            move_at_rim(n, part, kind, turning, work)
            close = close or point.gap <= CLOSE
            n += 1
    return n, close


@inlined
def _room(wall, part, plate):
    """Axis and direction in which a wall is, and how far from the centre of mass [m]."""
    along, sign = wall // 2, 1.0 - 2.0 * (wall % 2)
    return along, sign, plate.wall.half[along] - sign * part.position[along]


@inlined
def time_to_rim(part, kind, plate):
    """Time [s] before which the part comes near no wall that it is not near yet."""
    earliest = math.inf
    for wall in range(4):
        along, sign, room = _room(wall, part, plate)
        distance = room - kind.reach - kind.radius
        if distance > NEAR and sign * part.velocity[along] > 0.0:
            earliest = min(earliest, distance / (sign * part.velocity[along]))
    return earliest


@inlined
def move_at_rim(i, part, kind, turning, work):
    """Write the path of the gap of point i, at a wall, as its part moves now."""
    point = work.point[i]
    jerk = write_path(point, part, plus(point.arm, kind.radius, point.normal), turning)
    opens, changes = dot(point.normal, point.path_acceleration), dot(point.normal, jerk)
    point.rate, point.closing, point.closing_rate = dot(point.normal, point.path_velocity), -opens, -changes
    write_to(point.path_velocity, (0.0, 0.0, point.rate))
    write_to(point.path_acceleration, (0.0, 0.0, opens))
    point.path_jerk, point.most_own = changes, GRAVITY + turning.acceleration


@inlined
def rim_point_after(i, kind, turning, time, work):
    """As `edge_point_after`, of point i at a wall."""
    normal = vector(work.point[i].normal)
    centre = plus(work.point[i].arm, kind.radius, normal)
    return plus(plus(centre, 0.5 * time, cross(turning.spin, centre)), -kind.radius, normal), normal, 0.0
