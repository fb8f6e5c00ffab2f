"""One free part over the plate: gaps, approach, impact, and how long it may fly without looking again.

proximity   height of every corner above the surface, and how fast it approaches
impact      corners that touch and approach get impulses, together (impact.py)
leap        the longest flight during which no corner can touch: with gap g, approach speed -u and a bound a on the
relative acceleration, no contact before t = (u + sqrt(u^2 + 2 a g)) / a; never shorter than the step,
or than a fast part takes to enter the surface by micrometres
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.impact import resolve_impact
from feeder_sim.engines.impulse.plate_edge import edge_leap, with_points_on_edge
from feeder_sim.engines.impulse.state import (
    ARM,
    FRICTION,
    GAP,
    NORMAL,
    RATE,
    RESTITUTION,
    SURFACE_ACCELERATION,
    SURFACE_RATE,
    VELOCITY,
    invert_inertia,
    point,
    top_speed,
)
from feeder_sim.engines.impulse.tube_contact import approach_wall, gather_wall, leap_to_wall, meeting_time
from feeder_sim.machine_code import compiled, inlined
from feeder_sim.plate.compiled import grid_cell, modal_motion, surface_deflection, surface_modes, surface_normal
from feeder_sim.scene.scene import GRAVITY

DEPTH = 1e-6  # [m]; how deep a part may enter a surface that is no longer driven
DEEP = 5e-6  # [m]; how deep a fast part may enter the surface
TOUCH = 1e-9  # [m]; corners this close count as touching, so that a flat landing is one impact and not six
ON_EDGE = 1e-9  # [m]; a point this far off the plate is still on its edge
BESIDE = 2e-4  # [m]; a point that far below the surface is beside the plate or under it


@compiled
def meet_plate(part, kinds, wall, surface, bounds, t, work):
    """Impacts of one part at time t [s], and how long it may fly then.

    The wall is None without a tube: then nothing about walls is compiled.

    Returns:
        the flight [s]; whether it has hit the plate.
    """
    kind = kinds.record[part.kind]
    height = part.position[2] - kind.reach - kind.radius - bounds.crest
    if wall is None:  # noqa: SIM102 - else it can be near the wall; numba leaves out a plain test of None only
        if height > 2.0 * TOUCH:
            rising = part.velocity[2]
            return max((rising + math.sqrt(rising * rising + 2.0 * GRAVITY * height)) / GRAVITY, bounds.step), False
    n_corners = kind.corner_to - kind.corner_from
    corners = with_points_on_edge(part, kind, kinds, surface, work)
    _proximity(part, kind, corners, surface, bounds, t, work)
    on_plate = _approach(part, kind, corners, work)
    on_wall = 0
    if wall is not None:
        on_wall = approach_wall(part, kind, corners, wall, TOUCH, work)
    if on_plate + on_wall > 0:
        _impact(part, kind, corners, wall, surface, work)
        _approach(part, kind, corners, work)
        if wall is not None:
            approach_wall(part, kind, corners, wall, TOUCH, work)
    leap = _leap(part, kind, corners, work)
    if wall is not None:  # in a play of micrometres a part must not fly a whole step into the wall
        wall_leap = leap_to_wall(part, kind, corners, wall, work)
        return max(min(leap, wall_leap), meeting_time(work, corners.shape[0], bounds.step)), on_plate > 0
    if corners.shape[0] > n_corners:
        leap = min(leap, edge_leap(part, kind, corners, n_corners, bounds.step, work))
    return max(leap, _shortest_flight(part, kind, bounds)), on_plate > 0


@compiled
def _shortest_flight(part, kind, bounds):
    """The step [s]; less for a part so fast that it would enter the surface deeply, more for one that hardly moves."""
    fastest = top_speed(part, kind)
    return max(min(bounds.step, DEEP / fastest), min(bounds.rest_step, DEPTH / fastest))


@inlined
def _proximity(part, kind, corners, surface, bounds, t, work):
    """Fill gap and surface part of every corner.

    Above the crest the gap is to the crest and the surface counts as still; below it, to the surface itself. A corner
    beyond the edge of the plate has nothing under it.
    """
    moved = False
    for i in range(corners.shape[0]):
        height = part.position[2] - kind.radius
        for axis in range(3):
            height += part.attitude[2, axis] * corners[i, axis]
        work.corner[i, GAP] = height - bounds.crest
        work.corner[i, SURFACE_RATE] = work.corner[i, SURFACE_ACCELERATION] = 0.0
        if work.corner[i, GAP] > 2.0 * TOUCH:  # a gap to the crest must never pass for a touch
            continue
        if not moved:
            _move_surface(surface, t, work)
            moved = True
        _measure_gap(part, kind, corners, surface, bounds, height, i, work)


@inlined
def _approach(part, kind, corners, work):
    """Fill the vertical rate of every corner relative to the surface; returns how many touch and approach."""
    # (w x r)_z = r . (z x w), taken in body axes once instead of for every corner.
    wx = wy = 0.0
    for axis in range(3):
        along = 0.0
        for k in range(3):
            along += part.attitude[k, axis] * part.momentum[k]
        along /= kind.inertia[axis]
        wx += part.attitude[0, axis] * along
        wy += part.attitude[1, axis] * along
    x = wx * part.attitude[1, 0] - wy * part.attitude[0, 0]
    y = wx * part.attitude[1, 1] - wy * part.attitude[0, 1]
    z = wx * part.attitude[1, 2] - wy * part.attitude[0, 2]
    touching = 0
    for i in range(corners.shape[0]):
        turning = x * corners[i, 0] + y * corners[i, 1] + z * corners[i, 2]
        work.corner[i, RATE] = part.velocity[2] + turning - work.corner[i, SURFACE_RATE]
        if work.corner[i, GAP] <= TOUCH and work.corner[i, RATE] < 0.0:
            touching += 1
    return touching


@inlined
def _move_surface(surface, t, work):
    """Modal coordinates and their rates at time t."""
    modal_motion(
        t,
        surface.term_shape,
        surface.term_start,
        surface.term_stop,
        surface.coefficient,
        surface.rate,
        work.modal[0],
        work.modal[1],
    )


@inlined
def _measure_gap(part, kind, corners, surface, bounds, height, i, work):
    """Gap of one corner to the surface under it, the surface's rate, and a bound on its acceleration."""
    x, y = point(part, corners, i, 0), point(part, corners, i, 1)
    if abs(x) > surface.grid_x[-1] + ON_EDGE or abs(y) > surface.grid_y[-1] + ON_EDGE:
        work.corner[i, GAP] = np.inf
        return
    n_x, n_y = surface.grid_x.shape[0], surface.grid_y.shape[0]
    first_x, first_y = 0, 0
    if surface.tangent:
        _modes_at(part, surface, x, y, work)
    else:
        first_x = grid_cell(x, surface.grid_x[0], surface.grid_x[1] - surface.grid_x[0], n_x, work.weight[0])
        first_y = grid_cell(y, surface.grid_y[0], surface.grid_y[1] - surface.grid_y[0], n_y, work.weight[1])
    gap, rate, acceleration = height, 0.0, 0.0
    for s in range(work.modal.shape[1]):
        if bounds.acceleration[s] == 0.0:  # at rest in this window
            continue
        if surface.tangent:
            w = work.modes[s, 0]
        else:
            w = surface_deflection(s, first_x, first_y, work.weight[0], work.weight[1], surface.table)
        gap -= w * work.modal[0, s]
        rate += w * work.modal[1, s]
        acceleration += abs(w) * bounds.acceleration[s]
    work.corner[i, GAP], work.corner[i, SURFACE_RATE] = gap, rate
    work.corner[i, SURFACE_ACCELERATION] = acceleration
    if work.corner[i, GAP] < -BESIDE:
        work.corner[i, GAP] = np.inf


@compiled
def _modes_at(part, surface, x, y, work):
    """Mode shapes at a point; on a tangent surface, those under the centre, continued along their slopes."""
    if not surface.tangent:
        surface_modes(x, y, surface.grid_x, surface.grid_y, surface.table, work.weight, work.modes)
        return
    cx, cy = part.position[0], part.position[1]
    surface_modes(cx, cy, surface.grid_x, surface.grid_y, surface.table, work.weight, work.modes)
    for s in range(work.modes.shape[0]):
        work.modes[s, 0] += work.modes[s, 1] * (x - cx) + work.modes[s, 2] * (y - cy)


@compiled
def _gather_plate(part, kind, corners, surface, work):
    """Collect the corners that touch the plate and approach it; returns their number and the deepest penetration."""
    n, depth = 0, 0.0
    for i in range(corners.shape[0]):
        if work.corner[i, GAP] > TOUCH or work.corner[i, RATE] >= 0.0:
            continue
        depth = max(depth, -work.corner[i, GAP])
        x, y = point(part, corners, i, 0), point(part, corners, i, 1)
        _modes_at(part, surface, x, y, work)
        for k in range(3):
            work.contact[VELOCITY, n, k] = 0.0
        for s in range(work.modal.shape[1]):
            for k in range(2):
                slide = surface.half_thickness * work.modes[s, 1 + k] * work.modal[1, s] * surface.in_plane
                work.contact[VELOCITY, n, k] -= slide
            work.contact[VELOCITY, n, 2] += work.modes[s, 0] * work.modal[1, s]
        if surface.tangent:
            x, y = part.position[0], part.position[1]
        normal = work.contact[NORMAL, n]
        surface_normal(x, y, surface.grid_x, surface.grid_y, surface.table, work.modal[0], work.weight, normal)
        for k in range(3):
            work.contact[ARM, n, k] = (
                point(part, corners, i, k) - part.position[k] - kind.radius * work.contact[NORMAL, n, k]
            )
        work.law[RESTITUTION, n], work.law[FRICTION, n] = kind.restitution[0], kind.friction[0]
        n += 1
    return n, depth


@compiled
def _impact(part, kind, corners, wall, surface, work):
    """Put the deepest corner back on the surface and give impulses to all corners that touch and approach.

    What a corner covered inside the surface within one step would otherwise add up, and a resting part would sink.
    """
    n, depth = _gather_plate(part, kind, corners, surface, work)
    if wall is not None:
        n = gather_wall(part, kind, corners, wall, TOUCH, n, work)
    part.position[2] += depth
    for i in range(corners.shape[0]):
        work.corner[i, GAP] += depth
    inverse_inertia = np.empty((3, 3))
    invert_inertia(part.attitude, kind.inertia, inverse_inertia)
    if not resolve_impact(part, 1.0 / kind.mass, inverse_inertia, work.contact, work.law, n):
        work.unresolved[0] += 1


@inlined
def _leap(part, kind, corners, work):
    """Longest flight [s] during which no corner can touch."""
    # |dw/dt| <= |w| |L| / I_min for a torque-free body, so a corner accelerates by at most 2 reach (L / I_min)^2.
    least = min(kind.inertia[0], kind.inertia[1], kind.inertia[2])
    squared = part.momentum[0] ** 2 + part.momentum[1] ** 2 + part.momentum[2] ** 2
    own = GRAVITY + 2.0 * kind.reach * squared / (least * least)
    shortest = np.inf
    for i in range(corners.shape[0]):
        gap, rate, a = max(work.corner[i, GAP], 0.0), work.corner[i, RATE], own + work.corner[i, SURFACE_ACCELERATION]
        if gap < np.inf:
            shortest = min(shortest, (rate + math.sqrt(rate * rate + 2.0 * a * gap)) / a)
    return shortest
