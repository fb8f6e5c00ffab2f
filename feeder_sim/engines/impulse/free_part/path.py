"""How a point goes by itself, how the plate meets it, and the gap between both, now and later: one source for all.

A gap is that between the centre of the sphere around a point, which flies on a path r(t), and the surface, less the
radius. With modal coordinates q(t) and shapes w, gradient s of the surface at the place below,

    gap     = r_z - (w + s . dr) q
    rate    = v_z - (w + s . dr) q' - (s . v) q
    closing = -a_z + (w + s . dr) q'' + 2 (s . v) q' + (s . a) q            (left out: the curvature of the surface)

At an edge the path is that along the normal, and w how far a shape moves the edge along it (at_edge.py).
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.state import inverse_inertia, turning_acceleration, turning_speed
from feeder_sim.engines.impulse.surface import ACCELERATION, ALONG, CHANGE, NOW, SLOPE_X, SLOPE_Y, SPEED
from feeder_sim.engines.impulse.vectors import cross, plus, times, vector, write_to
from feeder_sim.machine_code import inlined

SIXTH = 1.0 / 6.0
Vector: TypeAlias = tuple[float, float, float]


class Turning(NamedTuple):
    """How a part turns: its spin [rad/s] and the first two derivatives of that, by itself.

    speed, acceleration: no point is faster about the centre of mass [m/s], or accelerated more but by gravity [m/s^2].
    """

    spin: Vector
    change: Vector
    change_rate: Vector
    speed: float
    acceleration: float


@inlined
def turning_of(part, kind):
    """How a part turns now: I w' = L x w, where the inertia I turns with the part."""
    momentum, inverse = vector(part.momentum), inverse_inertia(part, kind)
    spin = times(inverse, momentum)
    twist = cross(momentum, spin)
    change = times(inverse, twist)
    again = plus(cross(spin, change), -1.0, times(inverse, cross(spin, twist)))
    again = plus(again, 1.0, times(inverse, cross(momentum, change)))
    return Turning(spin, change, again, turning_speed(part, kind), turning_acceleration(part, kind))


@inlined
def write_path(point, part, centre, turning):
    """Write the path of a centre [m], seen from the centre of mass, as the part flies by itself; returns its jerk."""
    spin, change, again = turning.spin, turning.change, turning.change_rate
    v = cross(spin, centre)
    a = plus(cross(change, centre), 1.0, cross(spin, v))
    jerk = plus(plus(cross(again, centre), 2.0, cross(change, v)), 1.0, cross(spin, a))
    write_to(point.path_velocity, plus(part.velocity, 1.0, v))
    point.path_acceleration[0], point.path_acceleration[1], point.path_acceleration[2] = a[0], a[1], a[2] - GRAVITY
    point.path_jerk = jerk[2]
    return jerk


@inlined
def ahead(point, under, far, now, then):
    """Gap [m], rate [m/s], closing acceleration [m/s^2] and its rate, of a point a time `far` [s] after a look.

    now, then: modal coordinates at both times, see NOW.
    """
    v, a, jerk = point.path_velocity, point.path_acceleration, point.path_jerk
    gap = point.gap + far * (v[2] + far * (0.5 * a[2] + SIXTH * far * jerk))
    rate, closing = v[2] + far * (a[2] + 0.5 * far * jerk), -a[2] - far * jerk
    dx, dy = far * (v[0] + 0.5 * far * a[0]), far * (v[1] + 0.5 * far * a[1])
    vx, vy, change = v[0] + far * a[0], v[1] + far * a[1], -jerk
    for s in range(under.shape[0]):
        q, dq, d2q = then[NOW, s], then[SPEED, s], then[ACCELERATION, s]
        there = under[s, ALONG] + under[s, SLOPE_X] * dx + under[s, SLOPE_Y] * dy
        rises = under[s, SLOPE_X] * vx + under[s, SLOPE_Y] * vy
        gap -= there * q - under[s, ALONG] * now[NOW, s]
        rate -= there * dq + rises * q
        bends = under[s, SLOPE_X] * a[0] + under[s, SLOPE_Y] * a[1]
        closing += there * d2q + 2.0 * rises * dq + bends * q
        change += there * then[CHANGE, s] + 3.0 * (rises * d2q + bends * dq)
    return gap, rate, closing, change
