"""A part over the plate in steps, among others; one free part does without: free_part.

look        height of every corner above the surface, and how fast it approaches
impact      a corner that touches and approaches gets an impulse (single_impact.py), several together (impact.py)
flight      until a corner can touch (flight_time.py)
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.circle_lift import lift_by_turning
from feeder_sim.engines.impulse.circles import count_of, is_round, leap_of_circles, lowest_points, tilt_of
from feeder_sim.engines.impulse.contact_problem import meet_world
from feeder_sim.engines.impulse.far_corners import MANY, far_leap, gather_near
from feeder_sim.engines.impulse.flight_time import flight_on_flat, forecast, longest_leap, shortest_flight
from feeder_sim.engines.impulse.impact import resolve_impact
from feeder_sim.engines.impulse.impact_law import hit_plate, restitution_on_plate
from feeder_sim.engines.impulse.plate_edge import BESIDE, edge_leap, falls, points_on_edge
from feeder_sim.engines.impulse.reaction.yielding import give_to_plate, is_compliant, note_carried
from feeder_sim.engines.impulse.state import arm_of, height_of, inverse_inertia, spin_of
from feeder_sim.engines.impulse.surface import (
    HEIGHT,
    NOW,
    SPEED,
    TURN_X,
    TURN_Y,
    flow_at,
    move_surface_under,
    normal_at,
    shapes_under,
    slope_at,
)
from feeder_sim.engines.impulse.vectors import dot, plus, vector
from feeder_sim.engines.surface_arrays import ON_EDGE, off_plate
from feeder_sim.machine_code import compiled, inlined, uncounted
from feeder_sim.plate.compiled import W, cubic_weights, grid_cell, interpolate

CLOSELY = 3e-6  # [m/s]; what an impact may be off
TOUCH = 1e-9  # [m]; corners this close count as touching, so that a flat landing is one impact and not six


@inlined
def meet_plate(i, parts, kinds, surface, bounds, t, work):
    """Impacts of part i at time t [s], and how long it may fly then.

    Returns:
        the flight [s]; whether it has hit the plate.
    """
    part = parts[i]
    kind = kinds.record[part.kind]
    height = part.position[2] - kind.reach - kind.radius - bounds.crest
    if height > 2.0 * TOUCH:
        rising = part.velocity[2]
        fall = (rising + math.sqrt(rising * rising + 2.0 * GRAVITY * height)) / GRAVITY
        if fall >= bounds.step:
            return fall, False
        return max(fall, bounds.step if is_compliant(work) else shortest_flight(part, kind, bounds)), False
    moved, lowest = lowest_points(part, kind, surface, bounds, 2.0 * TOUCH, t, work)
    further = points_on_edge(part, kind, kinds, surface, bounds.crest, work)
    corners, n_corners, lowest_other = kinds.corners[kind.corner_from : kind.corner_to], count_of(kind), np.inf
    if further > 0 or is_round(kind):
        corners = work.corners[: n_corners + further]
    elif n_corners > MANY and not bounds.calm:  # what comes to rest is looked at with all corners
        near, lowest_other = gather_near(part, kind, corners, bounds, work)
        corners = work.corners[:near]
    on_plate, last = evaluate_points(part, kind, corners, surface, bounds, t, moved, work)
    if on_plate == 1 and kind.rolling == 0.0 and not is_compliant(work):
        _impact_at(last, i, parts, kinds, corners, surface, work)
    elif on_plate > 0:
        _impact(i, parts, kinds, corners, surface, t, work)
    leap, to_crest, own = longest_leap(part, kind, corners, work)
    tilt = tilt_of(lowest, part, kind, work)
    leap, to_crest = leap_of_circles(tilt, kind, bounds, own, leap, to_crest, work)
    shortest = stride = shortest_flight(part, kind, bounds)
    level = bounds.calm and bounds.slope == 0.0 and not is_compliant(work)
    if level and further == 0 and not is_round(kind):
        shortest = max(shortest, flight_on_flat(corners, own, bounds, work))
    to_crest = min(to_crest, far_leap(part, kind, lowest_other, bounds))
    if further > 0:
        to_crest = min(to_crest, edge_leap(part, kind, corners, n_corners, bounds.step, work))
    if leap < to_crest:
        flight = max(leap, shortest), stride, own, to_crest
        leap = forecast(part, kind, corners, surface, bounds, t, flight, tilt, work)
    return max(min(leap, to_crest), shortest), on_plate > 0


@compiled
def points_over_plate(part, kinds, surface, bounds, t, work):
    """Look at all points of a part over a plate that is calm, see `look`; returns them."""
    kind = kinds.record[part.kind]
    lowest_points(part, kind, surface, bounds, 2.0 * TOUCH, t, work)
    move_surface_under(part, surface, t, work)
    further = points_on_edge(part, kind, kinds, surface, bounds.crest, work)
    corners = kinds.corners[kind.corner_from : kind.corner_to]
    if further > 0 or is_round(kind):
        corners = work.corners[: count_of(kind) + further]
    evaluate_points(part, kind, corners, surface, bounds, t, True, work)
    return corners


@inlined
def evaluate_points(part, kind, corners, surface, bounds, t, moved, work):
    """Fill gap, rate and surface part of every corner; returns how many touch and approach, and the last of them.

    moved: whether the surface has been moved to time t.

    Above the crest the gap is to the crest and the surface counts as still; below it, to the surface itself. A corner
    beyond the edge of the plate has nothing under it, and a part that falls there has nothing at all.
    """
    lowest, rising, turning = part.position[2] - kind.radius, part.velocity[2], _turning(part, kind)
    touching, last, beyond = 0, -1, falls(part, kind, bounds.crest)
    for i in range(corners.shape[0]):
        bottom, rate = lowest + height_of(part, corners, i), rising + dot(turning, corners[i])
        gap, surface_rate, acceleration = bottom - bounds.crest, 0.0, 0.0
        if gap <= 2.0 * TOUCH:  # a gap to the crest must never pass for a touch
            if not moved:
                move_surface_under(part, surface, t, work)
                moved = True
            arm = arm_of(part, corners, i)
            x, y = part.position[0] + arm[0], part.position[1] + arm[1]
            height, surface_rate, acceleration = _surface_under(x, y, i, part, surface, bounds, work)
            gap, rate = bottom - height, rate - surface_rate
            outside = abs(x) > surface.grid_x[-1] + ON_EDGE or abs(y) > surface.grid_y[-1] + ON_EDGE
            if beyond or outside or gap < -BESIDE or off_plate(surface.outline, x, y):
                gap = np.inf
            if gap <= TOUCH and rate < 0.0:
                touching += 1
                last = i
        work.point[i].gap, work.point[i].rate = gap, rate
        work.point[i].surface_velocity[2], work.point[i].most_push = surface_rate, acceleration
    return touching, last


@inlined
def _turning(part, kind):
    """A corner r, in body axes, rises by r . (z x w) because the part turns; this is z x w there [rad/s]."""
    r, spin = part.attitude, spin_of(part, kind)
    return (
        spin[0] * r[1, 0] - spin[1] * r[0, 0],
        spin[0] * r[1, 1] - spin[1] * r[0, 1],
        spin[0] * r[1, 2] - spin[1] * r[0, 2],
    )


@inlined
def approach(part, kind, corners, work):
    """Fill the rate of every corner relative to the surface anew, after an impact."""
    rising, turning = part.velocity[2], _turning(part, kind)
    for i in range(corners.shape[0]):
        work.point[i].rate = rising + dot(turning, corners[i]) - work.point[i].surface_velocity[2]


@inlined
def _surface_under(x, y, i, part, surface, bounds, work):
    """Height of the surface under corner i, at (x, y) [m]; its rate [m/s], and a bound on its acceleration [m/s^2]."""
    height = rate = acceleration = 0.0
    first_x, a = grid_cell(x, surface.grid_x)
    first_y, b = grid_cell(y, surface.grid_y)
    weight_x, weight_y = cubic_weights(a), cubic_weights(b)
    centre = work.under[work.under.shape[0] - 1]
    for s in range(work.now.shape[1]):
        if bounds.acceleration[s] == 0.0:  # at rest in this window
            continue
        if surface.tangent:
            w = centre[s, HEIGHT]
            w += centre[s, TURN_X] * (x - part.position[0]) + centre[s, TURN_Y] * (y - part.position[1])
        else:
            w = interpolate(surface.table, s, W, first_x, first_y, weight_x, weight_y)
        work.under[i, s, HEIGHT] = w
        height += w * work.now[NOW, s]
        rate += w * work.now[SPEED, s]
        acceleration += abs(w) * bounds.acceleration[s]
    return height, rate, acceleration


@uncounted
def contact_of(i, part, kind, corners, surface, work):
    """Arm, normal and surface velocity of a corner that touches the plate; work.under is filled for it."""
    arm, under = arm_of(part, corners, i), work.under[i]
    shapes_under(part.position[0] + arm[0], part.position[1] + arm[1], part, surface, under)
    velocity, normal = flow_at(under, work.now, surface), normal_at(slope_at(under, work.now))
    return plus(arm, -kind.radius, normal), normal, (velocity[0], velocity[1], work.point[i].surface_velocity[2])


@inlined
def _impact_at(last, i, parts, kinds, corners, surface, work):
    """As `_impact`, of the corner `last` that touches the plate alone."""
    part, kind = parts[i], kinds.record[parts[i].kind]
    arm, normal, velocity = contact_of(last, part, kind, corners, surface, work)
    inverse_mass, turns = 1.0 / kind.mass, inverse_inertia(part, kind)
    e, mu = restitution_on_plate(part, kind, arm, normal, velocity), kind.friction[0]
    if not hit_plate(part, kind, inverse_mass, turns, arm, normal, velocity, (e, mu)):
        _impact(i, parts, kinds, corners, surface, 0.0, work)
        return
    depth = lift_by_turning(part, kind, inverse_mass, turns, arm, max(-work.point[last].gap, 0.0))
    put_back(part, corners, depth, work)
    approach(part, kind, corners, work)


@uncounted
def _impact(i, parts, kinds, corners, surface, t, work):
    """Put the deepest corner back on the surface and give impulses to all corners that touch and approach.

    What a corner covered inside the surface within one step would otherwise add up, and a resting part would sink.
    """
    part, kind, n, depth = parts[i], kinds.record[parts[i].kind], 0, 0.0
    for k in range(corners.shape[0]):
        if work.point[k].gap > TOUCH or work.point[k].rate >= 0.0:
            continue
        depth = max(depth, -work.point[k].gap)
        arm, normal, velocity = contact_of(k, part, kind, corners, surface, work)
        law = restitution_on_plate(part, kind, arm, normal, velocity), kind.friction[0], kind.rolling
        meet_world(n, work.contacts, 0, (arm, normal, velocity), law)
        note_carried(n, k, surface, work)
        n += 1
    before = vector(part.velocity), spin_of(part, kind)
    work.member[0] = i
    resolve_impact(parts, kinds, 1, n, (CLOSELY, CLOSELY), work)
    if is_compliant(work):
        give_to_plate(n, corners.shape[0], before, kind.mass * GRAVITY * depth, surface, t, work)
    put_back(part, corners, depth, work)
    approach(part, kind, corners, work)


@inlined
def put_back(part, corners, depth, work):
    """Lift a part out of the surface."""
    part.position[2] += depth
    for i in range(corners.shape[0]):
        work.point[i].gap += depth
