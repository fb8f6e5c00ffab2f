"""One free part over the plate: impacts, forces, following, rest or flight (docs/contact.md)."""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.circles import count_of, is_round, leap_of_circles, lowest_points, tilt_of
from feeder_sim.engines.impulse.contact import CARRIED, apply_forces, press, strike
from feeder_sim.engines.impulse.far_corners import MANY, far_leap, gather_near
from feeder_sim.engines.impulse.follow import follows_until, sit_down
from feeder_sim.engines.impulse.leap import NEVER, first_leaps, forecast, shortest_leap, unsure
from feeder_sim.engines.impulse.plate_points import CLOSE, REACH, look, look_at_edge
from feeder_sim.engines.impulse.state import ASLEEP, AT, FREE, GAP, KNOWN, top_speed
from feeder_sim.engines.impulse.tube_contact import look_at_wall
from feeder_sim.engines.impulse.yielding import yields
from feeder_sim.machine_code import compiled, inlined
from feeder_sim.scene.scene import GRAVITY

JUMP = 1e-8  # [m]; a surface is only entered where it jumps (`ring_up = false`)
STILL = 1e-6  # [m/s]; what is as slow on a plate that is calm, and does not slip, rests
SKIPPED = 8  # looks after one at which a part may not follow
LEAST_LOOK = 1e-5  # [s]; points at the edge of the plate come and go


@compiled
def meet_plate(i, parts, kinds, wall, surface, bounds, t, work, yielding):
    """What part i does at time t [s], and how long it goes on so.

    wall: None without a tube; yielding: None on a plate that moves as it is told. Then nothing about them is compiled.

    Returns:
        the time [s]; whether its velocity has jumped.
    """
    part = parts[i]
    kind = kinds.record[part.kind]
    before = part.phase
    part.phase = FREE
    height = part.position[2] - kind.reach - kind.radius - bounds.crest
    if wall is None:  # noqa: SIM102 - else it can be near the wall; numba leaves out a plain test of None only
        if height > CLOSE:
            rising = part.velocity[2]
            return (rising + math.sqrt(rising * rising + 2.0 * GRAVITY * (height - 0.5 * CLOSE))) / GRAVITY, False
    work.group[0] = i
    lowest = lowest_points(part, kind, surface, bounds, CLOSE, t, work)
    corners, others = kinds.corners[kind.corner_from : kind.corner_to], np.inf
    if is_round(kind):
        corners = work.points[: count_of(kind)]
    elif (
        wall is None and corners.shape[0] > MANY and not bounds.calm
    ):  # what comes to rest is looked at with all corners
        near, others = gather_near(part, kind, corners, bounds, work)
        corners = work.points[:near]
    close, moved = look(part, kind, corners, 0, 0, surface, bounds, t, False, work)
    n_corners = corners.shape[0]
    n, at_edge, moved = look_at_edge(part, kind, kinds, 0, n_corners, surface, bounds, t, moved, work)
    close = close or at_edge
    depth = 0.0 if yields(yielding) else land(part, n, work)  # a surface that yields never jumps
    if depth > 0.0:
        close = True
    if wall is not None:
        n = look_at_wall(part, kind, corners, wall, 0, n, bounds.exact.touch, work)
        close = True
    hit = False
    unknown = unsure(part, kind, bounds)
    until = next_switch(surface, t, bounds.end)
    if close:
        hit = strike(parts, kinds, 1, n, surface, bounds, t, work, yielding)
        stays, held, m = press(
            parts, kinds, 1, n, before != FREE, unknown[0], surface, bounds, t, until, work, yielding
        )
        if stays > 0.0:
            if held:
                stays = _stay(part, kind, n, surface, bounds, t, until, stays, m, work, yielding)
            else:
                part.held = min(part.held, 0)
            if part.phase == FREE and part.there != ASLEEP:
                apply_forces(parts, 1, m, stays, work)
            return stays, hit or yields(yielding)
        part.held = 0
        unknown = unsure(part, kind, bounds)
    slack, twist = unknown
    far, to_crest = first_leaps(n, slack, twist, bounds, work)
    tilt = tilt_of(lowest, part, kind, work)
    far, to_crest = leap_of_circles(tilt, kind, bounds, slack, far, to_crest, work)
    to_crest = min(to_crest, far_leap(part, kind, others, bounds))
    if n > n_corners or _may_reach_edge(part, kind, surface):
        to_crest = min(to_crest, max(LEAST_LOOK, 0.25 * lowest_gap(n, work) / top_speed(part, kind)))
    if far < to_crest:
        far = forecast(part, kind, n, surface, bounds, t, until, (far, to_crest), unknown, tilt, work)
    return max(min(far, to_crest), shortest_leap(part, kind, bounds)), hit


@inlined
def _stay(part, kind, n, surface, bounds, t, until, stays, m, work, yielding):
    """How long a part stays that does not slip [s]: it rests, or follows, or is pressed for the time `stays`."""
    part.held += 1
    bodies = work.bodies
    speed = spin = 0.0
    for k in range(3):
        speed += bodies.velocity[0, k] * bodies.velocity[0, k]
        spin += bodies.spin[0, k] * bodies.spin[0, k]
    if bounds.calm and math.sqrt(speed) + kind.reach * math.sqrt(spin) < STILL + 1.01 * bounds.speed:
        rest(part)
        return NEVER
    if part.held < 1 or yields(yielding):
        return stays
    ends = follows_until(part, kind, n, _height(n, bounds, work), surface, bounds, t, until, work)
    if ends - t <= stays:
        part.held = -SKIPPED
        return stays
    sit_down(part, kind, t, surface)
    return ends - t


@inlined
def next_switch(surface, t, end):
    """When a term of the surface begins or ends next, or the end of the window [s]: its motion is smooth until then."""
    for k in range(surface.term_start.shape[0]):
        if surface.term_start[k] > t:
            end = min(end, surface.term_start[k])
        if surface.term_stop[k] > t:
            end = min(end, surface.term_stop[k])
    return end


@inlined
def land(part, n, work):
    """Lift a part out of a surface that has jumped into it; returns by how much [m]."""
    depth = 0.0
    for i in range(n):
        depth = max(depth, -work.point[i, GAP])
    if depth <= JUMP:
        return 0.0
    part.position[2] += depth
    for i in range(n):
        work.point[i, GAP] += depth
    return depth


@inlined
def rest(part):
    """The part lies still from now on."""
    for k in range(3):
        part.velocity[k] = part.momentum[k] = 0.0
    part.there, part.phase = ASLEEP, FREE


@inlined
def lowest_gap(n, work):
    gap = np.inf
    for i in range(n):
        gap = min(gap, work.point[i, GAP])
    return max(gap, 0.0)


@inlined
def _may_reach_edge(part, kind, surface):
    """Whether a part is so near a side of the plate that a point there may come up."""
    far = kind.reach + kind.radius + REACH
    return abs(part.position[0]) + far > surface.grid_x[-1] or abs(part.position[1]) + far > surface.grid_y[-1]


@inlined
def _height(n, bounds, work):
    """Height of the centre of mass over its supports [m]."""
    lowest = 0.0
    for i in range(n):
        row = work.point[i]
        if row[KNOWN] != 0.0 and row[GAP] <= CARRIED * bounds.exact.tolerance:
            lowest = min(lowest, row[AT + 2])
    return -lowest
