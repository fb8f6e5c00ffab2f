"""Corners of a part, or the sphere of a ball, over the curved surface of the plate, which moves sideways too.

Above the crest of the surface the gap of a point is that to the crest. Below it the gap is that to the surface itself;
its rate takes in that the point moves along a slope, so that it is the normal velocity of the contact, to round-off.
"""

from __future__ import annotations

import math

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.free_part.path import ahead, write_path
from feeder_sim.engines.impulse.scratch import ABOVE, ON_PLATE
from feeder_sim.engines.impulse.state import arm_of
from feeder_sim.engines.impulse.surface import (
    ACCELERATION,
    SLOPE_X,
    SLOPE_Y,
    SPEED,
    along_at,
    flow_at,
    height_at,
    most_push,
    move_surface,
    normal_at,
    shapes_under,
    slope_at,
)
from feeder_sim.engines.impulse.vectors import combine, cross, dot, plus, vector, write_to
from feeder_sim.engines.surface_arrays import ON_EDGE, off_plate
from feeder_sim.machine_code import inlined

CLOSE = 1e-6  # [m]
UP = (0.0, 0.0, 1.0)


@inlined
def evaluate_corners(part, kinds, plate, t, turning, work):
    """Fill the first of all points, one for each corner.

    Returns their number, whether one is close to the surface, and whether that has been moved to time t.
    """
    kind = kinds.record[part.kind]
    corners = kinds.corners[kind.corner_from : kind.corner_to]
    close = moved = False
    for i in range(corners.shape[0]):
        moved, near = see_corner(i, arm_of(part, corners, i), part, kind, plate, t, moved, work)
        close = close or near
        if work.point[i].gap < math.inf:
            move_corner(i, part, kind, turning, work)
    return corners.shape[0], close, moved


@inlined
def see_corner(i, arm, part, kind, plate, t, moved, work):
    """Write how point i of the part, at the end of an arm [m], stands to the plate.

    Returns whether the surface has been moved to time t, and whether the point is close to it.
    """
    point, surface = work.point[i], plate.surface
    point.sort, point.most_push, point.jerk_bound = ABOVE, 0.0, 0.0
    point.push, point.snap_bound, point.carried, point.rolls = 0.0, 0.0, 0, 0.0
    point.gap = part.position[2] + arm[2] - kind.radius - plate.bounds.crest
    write_to(point.arm, plus(arm, -kind.radius, UP))
    write_to(point.normal, UP)
    if point.gap > CLOSE:
        return moved, False
    x, y = part.position[0] + arm[0], part.position[1] + arm[1]
    outside = abs(x) > surface.grid_x[-1] + ON_EDGE or abs(y) > surface.grid_y[-1] + ON_EDGE
    if outside or off_plate(surface.outline, x, y):
        point.gap = math.inf
        return moved, False
    if not moved:
        move_surface(t, surface, work.now)
    shapes_under(x, y, part, surface, work.under[i])
    _stand(point, work.under[i], arm, kind, plate, work.now)
    point.gap = part.position[2] + arm[2] - kind.radius - height_at(work.under[i], work.now)
    return True, point.gap <= CLOSE


@inlined
def _stand(point, under, arm, kind, plate, modal):
    """Write contact, normal and motion of the plate for a corner at the end of an arm [m]."""
    normal, velocity = seen_at(under, 0.0, 0.0, modal, plate.surface)
    point.sort, point.friction = ON_PLATE, kind.friction[0]
    write_to(point.arm, plus(arm, -kind.radius, normal))
    write_to(point.normal, normal)
    write_to(point.surface_velocity, velocity)
    point.push = along_at(under, modal, ACCELERATION)
    point.most_push = most_push(under, plate.bounds)


@inlined
def seen_at(under, dx, dy, modal, surface):
    """Normal of the surface, and its velocity (dx, dy) [m] beside a place, rising as that place sees it [m/s]."""
    slope, along = slope_at(under, modal), flow_at(under, modal, surface)
    speed = along[2] + slope[0] * along[0] + slope[1] * along[1]
    for s in range(under.shape[0]):
        speed += (dx * under[s, SLOPE_X] + dy * under[s, SLOPE_Y]) * modal[SPEED, s]
    return normal_at(slope), (along[0], along[1], speed)


@inlined
def move_corner(i, part, kind, turning, work):
    """Write the path of corner i as its part moves now, and how its gap changes; above the crest one at the worst."""
    point = work.point[i]
    point.most_own = GRAVITY + turning.acceleration
    if point.sort == ON_PLATE:
        write_path(point, part, plus(point.arm, kind.radius, point.normal), turning)
        _, point.rate, point.closing, point.closing_rate = ahead(point, work.under[i], 0.0, work.now, work.now)
        return
    spin, arm = turning.spin, point.arm
    point.rate = part.velocity[2] + spin[0] * arm[1] - spin[1] * arm[0]


@inlined
def corner_after(i, kind, plate, turning, time, work):
    """Arm, normal and velocity of the plate at corner i for forces that last a time [s], to which `work.then` belongs.

    The arm is that of the middle and the normal the mean; the velocity is that of the end. A ball touches below its
    centre, wherever that goes.
    """
    point = work.point[i]
    v, old = point.path_velocity, vector(point.normal)
    new, velocity = seen_at(work.under[i], v[0] * time, v[1] * time, work.then, plate.surface)
    both = plus(old, 1.0, new)
    normal = combine(1.0 / math.sqrt(dot(both, both)), both, 0.0, UP, 0.0, UP)
    if kind.corner_to - kind.corner_from == 1:
        return combine(-kind.radius, normal, 0.0, UP, 0.0, UP), normal, velocity
    arm = vector(point.arm)
    return plus(arm, 0.5 * time, cross(turning.spin, arm)), normal, velocity
