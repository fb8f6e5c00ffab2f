"""The walls around a part: that of a tube, those of a rim, or none; compilation goes by which they are."""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.free_part.on_rim import evaluate_rim, move_at_rim, rim_point_after, time_to_rim
from feeder_sim.engines.impulse.free_part.on_tube import evaluate_tube, move_at_tube, tube_point_after
from feeder_sim.engines.impulse.impact_law import ON_PLATE, restitution_at
from feeder_sim.engines.impulse.scratch import ON_WALL
from feeder_sim.engines.impulse.surroundings import Rim, Tube
from feeder_sim.engines.impulse.vectors import vector
from feeder_sim.machine_code import inlined, is_none, overload


def evaluate_walls(part, kinds, plate, first, turning, work):
    """Fill a point for every corner at a wall, from `first` on; returns the end, and whether one is close."""
    raise NotImplementedError("for compiled code only")


def move_at_wall(i, part, kind, plate, turning, work):
    """Write the path of the gap of point i, at a wall, as its part moves now."""
    raise NotImplementedError("for compiled code only")


def wall_point_after(i, part, kind, plate, turning, time, work):
    """As `edge_point_after`, of point i at a wall."""
    raise NotImplementedError("for compiled code only")


def restitution_of_wall(plate, kind, speed):
    """Coefficient of restitution of the wall at a normal approach speed [m/s]."""
    raise NotImplementedError("for compiled code only")


def time_to_walls(part, kind, plate):
    """Time [s] before which the part comes near no wall that it is not near yet."""
    raise NotImplementedError("for compiled code only")


def in_tube(plate):
    """Whether the part is in a tube."""
    raise NotImplementedError("for compiled code only")


def walled(plate):
    """Whether there are walls."""
    raise NotImplementedError("for compiled code only")


def _walls(plate):
    """None, or the class of the walls."""
    kind = plate.types[plate.fields.index("wall")]
    return None if is_none(kind) else kind.instance_class


@overload(evaluate_walls)
def _evaluate(part, kinds, plate, first, turning, work):
    if _walls(plate) is None:
        return lambda part, kinds, plate, first, turning, work: (first, False)
    if _walls(plate) is Tube:
        return lambda part, kinds, plate, first, turning, work: evaluate_tube(part, kinds, plate, first, turning, work)
    return lambda part, kinds, plate, first, turning, work: evaluate_rim(part, kinds, plate, first, turning, work)


@overload(move_at_wall)
def _move(i, part, kind, plate, turning, work):
    if _walls(plate) is None:
        return lambda i, part, kind, plate, turning, work: None
    if _walls(plate) is Tube:
        return lambda i, part, kind, plate, turning, work: move_at_tube(i, part, kind, plate, turning, work)
    return lambda i, part, kind, plate, turning, work: move_at_rim(i, part, kind, turning, work)


@overload(wall_point_after)
def _after(i, part, kind, plate, turning, time, work):
    if _walls(plate) is None:
        return lambda i, part, kind, plate, turning, time, work: (
            vector(work.point[i].arm),
            vector(work.point[i].normal),
            0.0,
        )
    if _walls(plate) is Tube:
        return lambda i, part, kind, plate, turning, time, work: tube_point_after(i, part, kind, turning, time, work)
    return lambda i, part, kind, plate, turning, time, work: rim_point_after(i, kind, turning, time, work)


@overload(restitution_of_wall)
def _restitution(plate, kind, speed):
    if _walls(plate) is Tube:
        return lambda plate, kind, speed: plate.wall.restitution
    return lambda plate, kind, speed: restitution_at(kind, ON_PLATE, speed)


@overload(time_to_walls)
def _time(part, kind, plate):
    if _walls(plate) is Rim:
        return lambda part, kind, plate: time_to_rim(part, kind, plate)
    return lambda part, kind, plate: math.inf


@overload(in_tube)
def _in_tube(plate):
    tube = _walls(plate) is Tube
    return lambda plate: tube


@overload(walled)
def _walled(plate):
    there = _walls(plate) is not None
    return lambda plate: there


@inlined
def leans(n, gap, work):
    """Whether one of the first n points is at a wall, up to a gap [m]."""
    touches = False
    for i in range(n):
        touches = touches or (work.point[i].sort == ON_WALL and work.point[i].gap <= gap)
    return touches
