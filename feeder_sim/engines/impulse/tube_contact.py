"""A part in a round tube: the points that can touch its wall, further rows of `Scratch.point`.

A point at distance rho from the axis has the gap R - rho (a ball: less its radius). The gap closes no faster than with
the point's own acceleration plus v^2 / rho, which the curved wall adds for a speed v across the axis.
"""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.plate_points import rate_of
from feeder_sim.engines.impulse.state import (
    AT,
    BODY,
    FALL,
    GAP,
    JERK,
    KNOWN,
    MOVES,
    MU,
    OTHER,
    OWN,
    PUSH,
    RATE,
    TOUCH,
    TOWARDS,
    WITH,
    E,
    arm_of,
    spin_of,
    turning_acceleration,
    turning_speed,
)
from feeder_sim.engines.impulse.vectors import cross, difference, dot, plus, vector
from feeder_sim.machine_code import compiled
from feeder_sim.scene.scene import GRAVITY


@compiled
def look_at_wall(part, kind, corners, wall, body, first, touch, work):
    """Fill the rows of all corners at the wall, from row `first` on; returns how many points there are then."""
    spin = spin_of(part, kind)
    v = vector(part.velocity)
    speed = math.sqrt(dot(v, v)) + turning_speed(part, kind)
    # What gravity can add on the way from wall to wall, at most.
    fastest = speed * speed + 4.0 * GRAVITY * wall.radius
    own = GRAVITY + turning_acceleration(part, kind) + 2.0 * fastest / wall.radius
    for i in range(corners.shape[0]):
        row = work.point[first + i]
        arm = arm_of(part, corners, i)
        r = difference(plus(part.position, 1.0, arm), wall.foot)
        across = plus(r, -dot(r, wall.axis), wall.axis)
        rho = math.sqrt(dot(across, across))
        row[GAP], row[MOVES], row[OWN], row[JERK], row[KNOWN] = wall.radius - rho - kind.radius, 0.0, own, 0.0, 1.0
        n = (-across[0] / rho, -across[1] / rho, -across[2] / rho) if rho > 0.0 else (0.0, 0.0, 0.0)
        row[TOWARDS], row[TOWARDS + 1], row[TOWARDS + 2] = n
        row[AT], row[AT + 1], row[AT + 2] = plus(arm, -kind.radius, n)
        row[WITH] = row[WITH + 1] = row[WITH + 2] = 0.0
        row[E], row[MU], row[BODY], row[OTHER] = wall.restitution, wall.friction, body, -1.0
        row[TOUCH] = touch
        row[RATE] = rate_of(row, part, spin, part, spin)
        u = plus(v, 1.0, cross(spin, arm))
        u = plus(u, -dot(u, wall.axis), wall.axis)
        u = plus(u, -dot(u, n), n)
        row[FALL] = row[PUSH] = GRAVITY * n[2] + (dot(u, u) / rho if rho > 0.0 else 0.0)
    return first + corners.shape[0]
