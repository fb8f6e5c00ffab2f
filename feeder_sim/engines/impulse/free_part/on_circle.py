"""Where a free cylinder is lowest over the plate: a point on the circle around either end, which slides along it.

With n the normal of the plate there, R the radius, s the length of n across the axis of the cylinder, and w the spin of
part against plate, the gap of the lowest point has the rate of that point of the part, and closes faster than it by

    R (n . (w x t))^2 / s                                   t: unit tangent of the circle there

since the lowest point goes on to the next one (of h(angle, time), least in the angle: h'' - h_at^2 / h_aa). A cylinder
that rolls does not lift off by it. Where it stands nearly upright no point is the lowest, and where it claps down flat
the lowest point runs around too fast: there its corners on the circle alone meet the plate, which lie inside of it by
less than a two-hundredth of R s.
"""

from __future__ import annotations

import math

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.free_part.on_plate import UP, move_corner, see_corner, seen_at
from feeder_sim.engines.impulse.free_part.path import ahead, write_path
from feeder_sim.engines.impulse.scratch import ABOVE, ON_CIRCLE, ON_PLATE
from feeder_sim.engines.impulse.surface import SLOPE_X, SLOPE_Y, SPEED
from feeder_sim.engines.impulse.vectors import combine, cross, dot, plus, vector, write_to
from feeder_sim.machine_code import inlined, uncounted

UPRIGHT = 1e-5  # length of the normal across the axis, below which no point is the lowest
GROWS = 4.0  # by which the acceleration may grow, or its bounds, in a leap
CLAPS = 2e4  # [rad/s]; where the lowest point runs around faster, the part claps down on its corners
NONE = (0.0, 0.0, 0.0)


@uncounted
def evaluate_circles(part, kinds, plate, first, t, moved, turning, work):
    """Fill the lowest points of both circles, from `first` on; nothing for other kinds.

    Returns their end, whether one is close, and whether the surface has been moved to time t [s].
    """
    kind, n, close = kinds.record[part.kind], first, False
    for side in range(2 if kind.circle_radius > 0.0 else 0):
        end = (2.0 * side - 1.0) * kind.circle_height
        arm, across = _lowest(part, kind, end, UP)
        if across < UPRIGHT or _claps(part, turning.spin):
            continue
        moved, _ = see_corner(n, arm, part, kind, plate, t, moved, work)
        point = work.point[n]
        if point.sort == ON_PLATE:
            arm, across = _lowest(part, kind, end, point.normal)
            if across < UPRIGHT:
                continue
            moved, near = see_corner(n, arm, part, kind, plate, t, moved, work)
            close = close or near
        point.rolls = kind.circle_radius / across
        if point.sort == ON_PLATE:
            point.sort = ON_CIRCLE
        if point.gap < math.inf:
            move_on_circle(n, part, kind, turning, work)
        n += 1
    return n, close, moved


@inlined
def move_on_circle(i, part, kind, turning, work):
    """As `move_corner`, of the lowest point of a circle."""
    point, fast = work.point[i], math.sqrt(dot(turning.spin, turning.spin))
    most = GROWS * point.rolls * fast * fast
    if point.sort == ABOVE:
        move_corner(i, part, kind, turning, work)
        point.most_own += most
        return
    under = work.under[i]
    write_path(point, part, plus(point.arm, kind.radius, point.normal), turning)
    axis = part.attitude[0, 2], part.attitude[1, 2], part.attitude[2, 2]
    along = cross(point.normal, axis)  # of length R / rolls
    tips, size = dot(point.normal, cross(_relative_spin(turning.spin, under, work.now), along)), dot(along, along)
    write_to(point.swing, plus(NONE, -kind.circle_radius * tips / (size * math.sqrt(size)), along))
    point.path_acceleration[2] -= _gains(point)
    _, point.rate, point.closing, point.closing_rate = ahead(point, under, 0.0, work.now, work.now)
    point.most_own = GRAVITY + turning.acceleration + most
    turns = fast * fast + (turning.acceleration / kind.reach if kind.reach > 0.0 else 0.0)
    tips = abs(tips) / math.sqrt(size)
    swings = tips * fast / math.sqrt(size)
    point.jerk_bound = GROWS * point.rolls * tips * (2.0 * turns + 3.0 * swings)
    point.snap_bound = GROWS * point.rolls * (turns + swings) * (turns + swings)


@inlined
def _claps(part, spin):
    """Whether the lowest point runs around its circle too fast to be followed."""
    axis = part.attitude[0, 2], part.attitude[1, 2], part.attitude[2, 2]
    along = cross(UP, axis)
    return abs(dot(UP, cross(spin, along))) > CLAPS * dot(along, along)


@inlined
def _lowest(part, kind, end, normal):
    """The way to the lowest point of the circle whose centre is at `end` along the axis [m]; length across the axis."""
    axis = part.attitude[0, 2], part.attitude[1, 2], part.attitude[2, 2]
    across = plus(normal, -dot(normal, axis), axis)
    size = math.sqrt(dot(across, across))
    return combine(end, axis, -kind.circle_radius / max(size, UPRIGHT), across, 0.0, axis), size


@inlined
def _gains(point):
    """By how much the gap of a point that slides on its circle closes faster [m/s^2]."""
    return dot(point.swing, point.swing) / point.rolls


@inlined
def _relative_spin(spin, under, modal):
    """Of a part against the plate [rad/s]."""
    x = y = 0.0
    for s in range(under.shape[0]):
        x += under[s, SLOPE_X] * modal[SPEED, s]
        y += under[s, SLOPE_Y] * modal[SPEED, s]
    return spin[0] - y, spin[1] + x, spin[2]


@inlined
def lowest_point_after(i, kind, plate, turning, time, work):
    """As `corner_after`, of the lowest point of a circle."""
    point = work.point[i]
    v, old = plus(point.path_velocity, 1.0, point.swing), vector(point.normal)
    new, velocity = seen_at(work.under[i], v[0] * time, v[1] * time, work.then, plate.surface)
    both = plus(old, 1.0, new)
    normal = plus(NONE, 1.0 / math.sqrt(dot(both, both)), both)
    centre = plus(point.arm, kind.radius, old)
    going = plus(cross(turning.spin, centre), 1.0, point.swing)
    return plus(plus(centre, 0.5 * time, going), -kind.radius, normal), normal, velocity
