"""A part that moves with the surface: it lies on it, does not slip, and nothing lifts it before a time that is known.

The surface has a frame at the place under the part, which moves with the plate and turns as the plate bends. A part
that follows keeps its offset in that frame, whatever the time between two looks; it costs nothing. It may do so while

    m (g + a) = N > 0                                  the plate does not fall away faster than the part
    |lateral force| <= FIRM mu N                       friction holds it
    |moment about the supports| <= BALANCED rho N      no support loses its load; rho: radius of the supports around the
                                                       centre of mass, seen from above
    its centre of mass is not beside its supports    rho >= 0
    the plate bends by less than a tolerance under the part, beside its frame

which is true for a whole window where the envelopes of the motion say so, or until the first time at which it is not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.free_part.points import touches
from feeder_sim.engines.impulse.state import FOLLOWING, fly_to
from feeder_sim.engines.impulse.surface import (
    ACCELERATION,
    HEIGHT,
    NOW,
    SLOPE_X,
    SLOPE_Y,
    TURN_X,
    TURN_Y,
    move_surface,
    shapes_under,
)
from feeder_sim.engines.impulse.vectors import cross, dot, write_to
from feeder_sim.machine_code import inlined, uncounted
from feeder_sim.plate.compiled import BETA_X, BETA_Y, W, cubic_slopes, cubic_weights, grid_cell, interpolate

FIRM, BALANCED = 0.9, 0.7
LEVEL = 1e-9  # [rad]; a slope that is none, on which what has no radius of support stands
ALONG = 1e-5  # [m/s]; what does not move like the surface by more does not follow it
BENDS = 10.0  # tolerances
STRIDE = 0.2  # [rad] of the fastest motion: between two looks ahead
DIRECTIONS = 16
HALVINGS = 12  # of a stride: a few nanoseconds


class Support(NamedTuple):
    """How a part sits on its supports.

    height: of its centre over them [m]; radius: see `_support_radius`; inertia: the largest, by its mass [m^2].
    """

    height: float
    radius: float
    inertia: float
    friction: float


@uncounted
def move_to(part, kind, t, surface):
    """Bring a part to time t [s], whatever it does, but a fixture."""
    if part.phase == FOLLOWING:
        _follow(part, kind, t, surface)
    else:
        fly_to(part, kind, t)


@uncounted
def _frame(place, t, surface):
    """The surface's frame at a place: where it is [m], how it is turned [rad], and the rates of both."""
    first_x, a = grid_cell(place[0], surface.grid_x)
    first_y, b = grid_cell(place[1], surface.grid_y)
    weight_x, weight_y = cubic_weights(a), cubic_weights(b)
    change_x = cubic_slopes(a, surface.grid_x[1] - surface.grid_x[0])
    change_y = cubic_slopes(b, surface.grid_y[1] - surface.grid_y[0])
    moves = surface.half_thickness * surface.in_plane
    x, y, z, about_x, about_y = place[0], place[1], 0.0, 0.0, 0.0
    vx = vy = vz = spin_x = spin_y = 0.0
    for k in range(surface.term_shape.shape[0]):
        if not surface.term_start[k] <= t < surface.term_stop[k]:
            continue
        age, s, growth = t - surface.term_start[k], surface.term_shape[k], surface.rate[k].real
        rate = surface.rate[k].imag
        fade = math.exp(growth * age) if growth != 0.0 else 1.0
        c, d = fade * math.cos(rate * age), fade * math.sin(rate * age)
        q = surface.coefficient[k].real * c - surface.coefficient[k].imag * d
        dq = growth * q - rate * (surface.coefficient[k].real * d + surface.coefficient[k].imag * c)
        w = interpolate(surface.table, s, W, first_x, first_y, weight_x, weight_y)
        turn_x = interpolate(surface.table, s, BETA_X, first_x, first_y, weight_x, weight_y)
        turn_y = interpolate(surface.table, s, BETA_Y, first_x, first_y, weight_x, weight_y)
        slope_x, slope_y = turn_x, turn_y
        if not surface.tangent:
            slope_x = interpolate(surface.table, s, W, first_x, first_y, change_x, weight_y)
            slope_y = interpolate(surface.table, s, W, first_x, first_y, weight_x, change_y)
        x, y, z = x - moves * turn_x * q, y - moves * turn_y * q, z + w * q
        vx, vy, vz = vx - moves * turn_x * dq, vy - moves * turn_y * dq, vz + w * dq
        about_x, about_y = about_x + slope_y * q, about_y - slope_x * q
        spin_x, spin_y = spin_x + slope_y * dq, spin_y - slope_x * dq
    return (x, y, z), (about_x, about_y, 0.0), (vx, vy, vz), (spin_x, spin_y, 0.0)


@inlined
def _turned(about, a, sense):
    """Vector a turned by the small rotation `about`, forwards (1) or back (-1); Rodrigues."""
    angle = math.sqrt(dot(about, about))
    if angle == 0.0:
        return a
    n = about[0] / angle, about[1] / angle, about[2] / angle
    c, s = math.cos(angle), sense * math.sin(angle)
    across, along = cross(n, a), dot(n, a) * (1.0 - c)
    return (
        c * a[0] + s * across[0] + along * n[0],
        c * a[1] + s * across[1] + along * n[1],
        c * a[2] + s * across[2] + along * n[2],
    )


@uncounted
def _follow(part, kind, t, surface):
    """Put a part where the surface is at time t, with its velocities."""
    origin, about, velocity, spin = _frame(part.place, t, surface)
    offset = _turned(about, (part.offset[0], part.offset[1], part.offset[2]), 1.0)
    carried = cross(spin, offset)
    for k in range(3):
        part.position[k] = origin[k] + offset[k]
        part.velocity[k] = velocity[k] + carried[k]
    for k in range(3):
        x, y, z = _turned(about, (part.orientation[0, k], part.orientation[1, k], part.orientation[2, k]), 1.0)
        part.attitude[0, k], part.attitude[1, k], part.attitude[2, k] = x, y, z
    r, inertia = part.attitude, kind.inertia
    for k in range(3):
        part.momentum[k] = 0.0
    for n in range(3):
        along = inertia[n] * (r[0, n] * spin[0] + r[1, n] * spin[1] + r[2, n] * spin[2])
        for k in range(3):
            part.momentum[k] += along * r[k, n]
    part.clock = t


@uncounted
def start_riding(part, kind, t, surface):
    """From time t on the part follows the surface under its centre."""
    part.place[0], part.place[1] = part.position[0], part.position[1]
    origin, about, _, _ = _frame(part.place, t, surface)
    offset = part.position[0] - origin[0], part.position[1] - origin[1], part.position[2] - origin[2]
    write_to(part.offset, _turned(about, offset, -1.0))
    for k in range(3):
        axis = part.attitude[0, k], part.attitude[1, k], part.attitude[2, k]
        part.orientation[0, k], part.orientation[1, k], part.orientation[2, k] = _turned(about, axis, -1.0)
    part.phase = FOLLOWING
    _follow(part, kind, t, surface)


@uncounted
def goes_along(part, height, t, surface, work):
    """Whether the part, as the solution of its contacts has it, moves and turns as the surface does at time t [s]."""
    _, _, velocity, spin = _frame(part.position, t, surface)
    carried = cross(spin, (0.0, 0.0, height))
    matches = True
    for k in range(3):
        matches = matches and abs(work.bodies.velocity[0, k] - velocity[k] - carried[k]) < ALONG
        matches = matches and abs(work.bodies.spin[0, k] - spin[k]) * height < ALONG
    return matches


@uncounted
def follows_until(part, kind, plate, now, height, work):
    """Until when a part that lies still on the surface may follow it [s]; the time of the look if not at all.

    now: the look (sustained.py), whose points are looked at as supports; height: of its centre over the surface [m].
    """
    surface, bounds, t, until, n = plate.surface, plate.bounds, now.t, now.until, now.n
    under = work.under[n]  # one row more than points
    shapes_under(part.position[0], part.position[1], part, surface, under)
    if _bends(part, n, under, bounds, work):
        return t
    most = max(kind.inertia[0], kind.inertia[1], kind.inertia[2])
    support = Support(height, _support_radius(n, bounds, work), most / kind.mass, kind.friction[0])
    # The largest acceleration of all.
    push = along = turning = 0.0
    moves = surface.half_thickness * surface.in_plane
    for s in range(under.shape[0]):
        a = bounds.acceleration[s]
        push += a * abs(under[s, HEIGHT])
        turning += a * (abs(under[s, SLOPE_X]) + abs(under[s, SLOPE_Y]))
        along += moves * a * (abs(under[s, TURN_X]) + abs(under[s, TURN_Y]))
    along += height * turning
    if _is_supported(GRAVITY - push, along + GRAVITY * bounds.slope, turning, support):
        return until
    if bounds.fastest * (until - t) < STRIDE:
        return t
    good, stride = t, STRIDE / bounds.fastest
    while good < until:
        next_time = min(good + stride, until)
        if not _is_supported_at(next_time, under, support, surface, work):
            bad = next_time
            for _ in range(HALVINGS):
                middle = 0.5 * (good + bad)
                if _is_supported_at(middle, under, support, surface, work):
                    good = middle
                else:
                    bad = middle
            return good
        good = next_time
    return until


@inlined
def _is_supported_at(t, under, support, surface, work):
    """Whether a part that follows is held at time t."""
    move_surface(t, surface, work.then)
    push = x = y = about_x = about_y = slope_x = slope_y = 0.0
    moves = surface.half_thickness * surface.in_plane
    for s in range(under.shape[0]):
        a, q = work.then[ACCELERATION, s], work.then[NOW, s]
        push += a * under[s, HEIGHT]
        x -= moves * a * under[s, TURN_X]
        y -= moves * a * under[s, TURN_Y]
        about_x += a * under[s, SLOPE_Y]
        about_y -= a * under[s, SLOPE_X]
        slope_x += q * under[s, SLOPE_X]
        slope_y += q * under[s, SLOPE_Y]
    x, y = x + about_y * support.height + GRAVITY * slope_x, y - about_x * support.height + GRAVITY * slope_y
    turning = math.sqrt(about_x * about_x + about_y * about_y)
    return _is_supported(GRAVITY + push, math.sqrt(x * x + y * y), turning, support)


@inlined
def _is_supported(normal, lateral, turning, support):
    """Whether friction and supports hold a part, for accelerations along and across the normal, and of its turning."""
    moment = support.inertia * turning + support.height * lateral
    return (
        normal > 0.0
        and support.radius >= -LEVEL * support.height
        and lateral <= FIRM * support.friction * normal
        and moment <= (BALANCED * max(support.radius, 0.0) + LEVEL * support.height) * normal
    )


@inlined
def _bends(part, n, under, bounds, work):
    """Whether the plate bends away from its tangent plane, under a support, by more than may be."""
    bends = False
    for i in range(n):
        point = work.point[i]
        if not touches(point, BENDS * bounds.exact.tolerance):
            continue
        bent = 0.0
        for s in range(under.shape[0]):
            plane = under[s, HEIGHT] + under[s, SLOPE_X] * point.arm[0] + under[s, SLOPE_Y] * point.arm[1]
            bent += 2.0 * bounds.amplitude[s] * abs(work.under[i, s, HEIGHT] - plane)
        bends = bends or bent > BENDS * bounds.exact.tolerance
    return bends


@inlined
def _support_radius(n, bounds, work):
    """Radius [m] of the largest circle around the centre of mass, seen from above, that the supports surround."""
    least = math.inf
    for k in range(DIRECTIONS):
        c, s = math.cos(2.0 * math.pi * k / DIRECTIONS), math.sin(2.0 * math.pi * k / DIRECTIONS)
        farthest = -math.inf
        for i in range(n):
            point = work.point[i]
            if touches(point, BENDS * bounds.exact.tolerance):
                farthest = max(farthest, point.arm[0] * c + point.arm[1] * s)
        least = min(least, farthest)
    return least
