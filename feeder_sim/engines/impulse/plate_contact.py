"""What happens where a part meets the plate: impacts, and the forces that press it while it stays (docs/contact.md).

impact      a point that touches and approaches fast gets an impulse, together with all others that touch (impact.py);
            again at zero time until none approaches
pressed     where bounces pile up within a time T in which the change of the surface's acceleration, J, moves it by less
            than the tolerance, J T^3 / 6 < tolerance, points stay: constant forces, for no longer than T, after which no
            point that touches approaches; non-negative and in the cone of friction
following   a part that does not slip moves with the surface (follow.py), and on a plate that is calm it rests
flight      else, until a point can touch (leap.py)
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.circles import count_of, is_round, leap_of_circles, lowest_points, tilt_of
from feeder_sim.engines.impulse.far_corners import MANY, far_leap, gather_near
from feeder_sim.engines.impulse.follow import follows_until, sit_down
from feeder_sim.engines.impulse.impact import resolve_impact, solve_for
from feeder_sim.engines.impulse.impact_law import hit_plate, restitution_on_plate
from feeder_sim.engines.impulse.leap import NEVER, first_leaps, forecast, leap, leap_of, shortest_leap, unsure
from feeder_sim.engines.impulse.plate_edge import edge_leap, points_on_edge
from feeder_sim.engines.impulse.plate_points import CLOSE, look, move_surface, renew_rates
from feeder_sim.engines.impulse.state import (
    ARM,
    ASLEEP,
    AT,
    E,
    FALL,
    FREE,
    FRICTION,
    GAP,
    HEIGHT,
    IMPULSE,
    JERK,
    KNOWN,
    MOVES,
    MU,
    NORMAL,
    NOW,
    NOW_WITH,
    OWN,
    PRESSED,
    PUSH,
    RATE,
    RESTITUTION,
    SLOPE_X,
    SLOPE_Y,
    SPEED,
    TOWARDS,
    TURN_X,
    TURN_Y,
    VELOCITY,
    WITH,
    inverse_inertia,
    spin_of,
    turning_speed,
)
from feeder_sim.engines.impulse.tube_contact import look_at_wall
from feeder_sim.engines.impulse.vectors import add_to, cross, difference, dot, plus, times, vector, write_to
from feeder_sim.engines.noise import half_normal
from feeder_sim.machine_code import compiled, inlined
from feeder_sim.scene.scene import GRAVITY

ROUNDS = 20  # of impacts at zero time; after them what still approaches does so without rebound
LONGEST_CHATTER = 3e-5  # [s] of bounces that are summed where nothing moves: hops of a nanometre
LONGEST = 2e-4  # [s] of constant forces
TURNED = 0.02  # [rad] by which a part turns under constant forces
TOGETHER = 10.0  # tolerances; points this close hit together, so that a flat landing is one impact and not six
CARRIED = 30.0  # tolerances; points that have been pressed and are this close still are
RETURN = 0.05  # share of its gap that a pressed point gives back per step
NO_LIFT = 1e-3  # of the time of constant forces: what is lifted sooner than that is lifted now
FIRMLY = 0.99  # of full friction: what takes less is not sliding
TURNS, STOPS = 3, 0.98  # rounds, and share of the time, by which the end of a slip is found
STILL, SLIPS = 1e-6, 1e-7  # [m/s]
LEFT = 1e-7  # [m/s]; what sweeps leave of the speed of points that stay
JUMP = 1e-8  # [m]; a surface is only entered where it jumps (`ring_up = false`)
SETTLED = 1  # looks without slip until a part may follow
SKIPPED = 8  # looks after one at which it may not


@inlined
def meet_plate(part, kinds, wall, surface, bounds, t, work):
    """What a part does at time t [s], and how long it goes on so.

    The wall is None without a tube: then nothing about walls is compiled.

    Returns:
        the time [s]; whether forces or impulses of the plate act on it.
    """
    kind = kinds.record[part.kind]
    before = part.phase
    part.phase = FREE
    height = part.position[2] - kind.reach - kind.radius - bounds.crest
    if wall is None:  # noqa: SIM102 - else it can be near the wall; numba leaves out a plain test of None only
        if height > CLOSE:
            rising = part.velocity[2]
            return (rising + math.sqrt(rising * rising + 2.0 * GRAVITY * (height - 0.5 * CLOSE))) / GRAVITY, False
    lowest = lowest_points(part, kind, surface, bounds, CLOSE, t, work)
    further = points_on_edge(part, kind, kinds, surface, work)
    corners, n_corners, others = kinds.corners[kind.corner_from : kind.corner_to], count_of(kind), np.inf
    if further > 0 or is_round(kind):
        corners = work.points[: n_corners + further]
    elif wall is None and n_corners > MANY and not bounds.calm:  # what comes to rest is looked at with all corners
        near, others = gather_near(part, kind, corners, bounds, work)
        corners = work.points[:near]
    n, hit = corners.shape[0], False
    unknown = unsure(part, kind, bounds)
    until = _next_switch(surface, t, bounds.end)
    close = look(part, kind, corners, surface, bounds, t, work)
    _land(part, n, work)
    if wall is not None:
        n = look_at_wall(part, kind, corners, wall, n, work)
        close = n
    if close > 0:
        hit = _strike(part, kind, corners, n, surface, bounds, unknown, work)
        stays = _press(part, kind, corners, n, before != FREE, surface, bounds, t, until, unknown, work)
        if stays > 0.0:
            return stays, True
        if part.there == ASLEEP:
            return NEVER, True
        unknown = unsure(part, kind, bounds)
    slack, twist = unknown
    far, to_crest = first_leaps(n, slack, twist, bounds, work)
    tilt = tilt_of(lowest, part, kind, work)
    far, to_crest = leap_of_circles(tilt, kind, bounds, slack, far, to_crest, work)
    to_crest = min(to_crest, far_leap(part, kind, others, bounds))
    if further > 0:
        to_crest = min(to_crest, edge_leap(part, kind, corners, n_corners, work))
    if far < to_crest:
        far = forecast(part, kind, n, surface, bounds, t, until, (far, to_crest), unknown, tilt, work)
    return max(min(far, to_crest), shortest_leap(part, kind, bounds)), hit


@inlined
def _next_switch(surface, t, end):
    """When a term of the surface begins or ends next, or the end of the window [s]: its motion is smooth until then."""
    for k in range(surface.term_start.shape[0]):
        if surface.term_start[k] > t:
            end = min(end, surface.term_start[k])
        if surface.term_stop[k] > t:
            end = min(end, surface.term_stop[k])
    return end


@inlined
def _land(part, n, work):
    """Lift a part out of a surface that has jumped into it."""
    depth = 0.0
    for i in range(n):
        depth = max(depth, -work.point[i, GAP])
    if depth > JUMP:
        part.position[2] += depth
        for i in range(n):
            work.point[i, GAP] += depth


@inlined
def _chatter_time(moves, twist, bounds):
    """Time [s] in which the change of an acceleration moves the surface by less than the tolerance."""
    jerk = moves * bounds.fastest + twist
    longest = LONGEST_CHATTER
    if 6.0 * bounds.exact.tolerance < jerk * longest * longest * longest:
        return (6.0 * bounds.exact.tolerance / jerk) ** (1.0 / 3.0)
    return longest


@inlined
def _slow(row, restitution, time):
    """Approach [m/s] from which on the bounces of a point last no longer than a time [s]."""
    return 0.5 * time * (1.0 - restitution) * max(row[PUSH], 0.0)


@inlined
def _gather(row, m, restitution, work):
    write_to(work.contact[ARM, m], (row[AT], row[AT + 1], row[AT + 2]))
    write_to(work.contact[NORMAL, m], (row[TOWARDS], row[TOWARDS + 1], row[TOWARDS + 2]))
    write_to(work.contact[VELOCITY, m], (row[WITH], row[WITH + 1], row[WITH + 2]))
    work.law[RESTITUTION, m], work.law[FRICTION, m] = restitution, row[MU]


@compiled
def _strike(part, kind, corners, n, surface, bounds, unknown, work):
    """Impacts at all points that touch, until none approaches; returns whether there was one."""
    touch, together, hit = bounds.exact.touch, TOGETHER * bounds.exact.tolerance, False
    moved = 0.0
    for rounds in range(ROUNDS + 1):
        m, fast = 0, False  # contacts; whether one of those that touch approaches
        for i in range(n):
            row = work.point[i]
            if row[KNOWN] == 0.0 or not row[GAP] <= together:
                continue
            moved = max(moved, row[MOVES])
            arm, normal = vector(row[AT : AT + 3]), vector(row[TOWARDS : TOWARDS + 3])
            e = row[E]
            if e < 0.0:
                e = restitution_on_plate(part, kind, arm, normal, vector(row[WITH : WITH + 3]))
            if row[RATE] > (LEFT if row[PUSH] > 0.0 else 0.0):
                continue
            if row[RATE] < -(LEFT if row[PUSH] > 0.0 else 0.0) and row[GAP] <= touch:
                fast = True
            if -e * row[RATE] <= _slow(row, e, _chatter_time(row[MOVES], unknown[1], bounds)):
                e = 0.0  # what is left of its bounces is summed: they take what the plate pushes meanwhile
            _gather(row, m, 0.0 if rounds == ROUNDS else e, work)
            m += 1
        if not fast:
            return hit
        inverse_mass, turns = 1.0 / kind.mass, inverse_inertia(part, kind)
        done = False
        if m == 1:
            arm, normal, velocity = vector(work.contact[ARM, 0]), vector(work.contact[NORMAL, 0]), vector(work.contact[VELOCITY, 0])
            law = work.law[RESTITUTION, 0], work.law[FRICTION, 0]
            done = hit_plate(part, kind, inverse_mass, turns, arm, normal, velocity, law)
        if not done and not resolve_impact(part, inverse_mass, turns, work.contact, work.law, m):
            work.unresolved[0] += 1
        hit = True
        if moved > 0.0 and bounds.exact.noise > 0.0:
            scatter, part.draws = half_normal(part.draws)
            part.velocity[2] += bounds.exact.noise * scatter
        renew_rates(part, kind, corners, n, work)
    return hit


@compiled
def _press(part, kind, corners, n, pressed, surface, bounds, t, until, unknown, work):
    """Constant forces for a time, which is returned [s], on a part that stays; 0 if none is pressed.

    pressed: whether it has been until now.
    """
    touch = bounds.exact.touch
    time, lift = _time_of_forces(part, kind, n, pressed, bounds, unknown, work)
    if time == 0.0:
        part.held = 0
        return 0.0
    if lift < NO_LIFT * time:
        part.held = 0
        return 0.0
    least = shortest_leap(part, kind, bounds)
    usual, time = time, max(min(time, lift, until - t), least)
    for i in range(n):
        row = work.point[i]
        if row[GAP] == np.inf or _is_carried(row, time, bounds):
            continue
        if row[GAP] + time * (row[RATE] - 0.5 * (row[OWN] + unknown[0] + row[MOVES]) * time) > 0.5 * touch:
            continue
        if row[MOVES] == 0.0:
            time = max(min(time, leap(max(row[GAP] - 0.5 * touch, 0.0), row[RATE], row[OWN])), least)
        else:
            time = max(min(time, leap_of(row, row[RATE], unknown[0], unknown[1], bounds, touch)), least)
    inverse_mass, turns, spin = 1.0 / kind.mass, inverse_inertia(part, kind), spin_of(part, kind)
    change = times(turns, cross(vector(part.momentum), spin))  # of the spin, by turning
    m, v, w = 0, spin, spin
    for turn in range(TURNS):
        v = part.velocity[0], part.velocity[1], part.velocity[2] - GRAVITY * time
        w = plus(spin, time, change)
        m = _gather_ahead(part, kind, n, spin, surface, bounds, t, time, usual, work)
        v, w, settled = solve_for(v, w, inverse_mass, turns, work.contact, work.law, m)
        if not settled:
            work.unresolved[0] += 1
        stops = _slip_stops(part, kind, spin, v, w, m, time, work)
        if stops > STOPS * time or stops < (1.0 - STOPS) * usual or turn == TURNS - 1:
            break
        time = stops
    force, moment, loaded, held = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), False, True
    for i in range(m):
        p, normal = vector(work.contact[IMPULSE, i]), vector(work.contact[NORMAL, i])
        along = dot(p, normal)
        if along <= 0.0:
            continue
        loaded = True
        force, moment = plus(force, 1.0 / time, p), plus(moment, 1.0 / time, cross(work.contact[ARM, i], p))
        u = difference(plus(v, 1.0, cross(w, vector(work.contact[ARM, i]))), vector(work.contact[VELOCITY, i]))
        across, friction = plus(u, -dot(u, normal), normal), plus(p, -along, normal)
        held = held and dot(across, across) < SLIPS * SLIPS
        held = held and dot(friction, friction) <= (FIRMLY * work.law[FRICTION, i] * along) ** 2
    if not loaded:
        part.held = 0
        return 0.0
    part.held = part.held + 1 if held else min(part.held, 0)
    if part.held >= SETTLED:
        if bounds.calm and math.sqrt(dot(v, v)) + kind.reach * math.sqrt(dot(w, w)) < STILL + 1.01 * bounds.speed:
            _rest(part)
            return 0.0
        ends = follows_until(part, kind, n, _height(part, n, bounds, work), surface, bounds, t, until, work)
        if ends - t > time:
            sit_down(part, kind, t, surface)
            return ends - t
        part.held = -SKIPPED
    part.phase = PRESSED
    write_to(part.force, force)
    write_to(part.moment, moment)
    return time


@inlined
def _slip_stops(part, kind, spin, v, w, m, time, work):
    """When the first contact that slips will have stopped [s], if it does within a time of constant forces; or that.

    Along its slip s, with the other accelerations a and a share r of full friction F, it goes on by s - (a + r F) t.
    F is taken for that of a part that does not turn.
    """
    found, start, pressed = time, vector(part.velocity), 0.0
    for i in range(m):
        pressed += dot(work.contact[IMPULSE, i], work.contact[NORMAL, i])
    for i in range(m):
        p, normal = vector(work.contact[IMPULSE, i]), vector(work.contact[NORMAL, i])
        along, arm = dot(p, normal), vector(work.contact[ARM, i])
        if along <= 0.0 or work.law[FRICTION, i] == 0.0:
            continue
        u = difference(plus(start, 1.0, cross(spin, arm)), vector(work.contact[NOW_WITH, i]))
        u = plus(u, -dot(u, normal), normal)
        s = math.sqrt(dot(u, u))
        if s < SLIPS:
            continue
        after = difference(plus(v, 1.0, cross(w, arm)), vector(work.contact[VELOCITY, i]))
        share = -dot(p, u) / (s * work.law[FRICTION, i] * along)
        if share > FIRMLY:
            continue
        full = work.law[FRICTION, i] * pressed / kind.mass / time
        others = (s - dot(after, u) / s) / time - share * full
        if others + full > 0.0:
            found = min(found, s / (others + full))
    return found


@inlined
def _rest(part):
    """The part lies still from now on."""
    for k in range(3):
        part.velocity[k] = part.momentum[k] = 0.0
    part.there = ASLEEP


@inlined
def _height(part, n, bounds, work):
    """Height of the centre of mass over its supports [m]."""
    lowest = 0.0
    for i in range(n):
        row = work.point[i]
        if row[KNOWN] != 0.0 and row[GAP] <= CARRIED * bounds.exact.tolerance:
            lowest = min(lowest, row[AT + 2])
    return -lowest


@inlined
def _time_of_forces(part, kind, n, pressed, bounds, unknown, work):
    """How long forces may stay constant [s], 0 if no point is pressed; and when the last of the points is lifted."""
    tolerance, twist = bounds.exact.tolerance, unknown[1]
    close = CARRIED * tolerance if pressed else bounds.exact.touch
    moves = 0.0
    for i in range(n):
        row = work.point[i]
        if row[KNOWN] != 0.0 and row[GAP] <= close:
            moves = max(moves, row[MOVES])
    chatter = _chatter_time(moves, twist, bounds)
    any_pressed, lift = False, 0.0
    for i in range(n):
        row = work.point[i]
        if row[KNOWN] == 0.0 or not row[GAP] <= close or row[PUSH] <= 0.0:
            continue
        if abs(row[RATE]) > max(_slow(row, 0.0, chatter), LEFT):
            continue
        any_pressed = True
        root = math.inf
        if row[MOVES] > 0.0 and row[JERK] < 0.0:  # as if all moved at the fastest rate
            bend = 0.5 * bounds.fastest * bounds.fastest * (row[FALL] - row[PUSH])
            inside = row[JERK] * row[JERK] - 4.0 * bend * row[PUSH]
            if inside >= 0.0:
                root = 2.0 * row[PUSH] / (math.sqrt(inside) - row[JERK])
        lift = max(lift, root)
    if not any_pressed:
        return 0.0, 0.0
    jerk, time = moves * bounds.fastest, LONGEST
    if 6.0 * tolerance < jerk * time * time * time:
        time = (6.0 * tolerance / jerk) ** (1.0 / 3.0)
    turning = turning_speed(part, kind)
    if turning * time > TURNED * kind.reach:
        time = TURNED * kind.reach / turning
    return time, lift


@inlined
def _is_carried(row, time, bounds):
    """Whether a point is close enough, and slow enough, for the forces to see to it."""
    if row[KNOWN] == 0.0 or row[GAP] > CARRIED * bounds.exact.tolerance:
        return False
    return row[GAP] <= bounds.exact.touch or row[RATE] * time > -CARRIED * bounds.exact.tolerance


@inlined
def _gather_ahead(part, kind, n, spin, surface, bounds, t, time, usual, work):
    """Contacts as they will be after a time [s]: least normal velocities for which no point will have come inside.

    usual: the time that forces may stay constant [s], in which a share of what a point is off is given back.
    """
    touch = bounds.exact.touch
    move_surface(t + time, surface, work.then)
    moves = surface.half_thickness * surface.in_plane
    m = 0
    for i in range(n):
        row, under = work.point[i], work.under[i]
        if not _is_carried(row, time, bounds):
            continue
        arm = vector(row[AT : AT + 3])
        going = cross(spin, arm)
        dx, dy = (part.velocity[0] + going[0]) * time, (part.velocity[1] + going[1]) * time
        if not is_round(kind) and kind.corner_to - kind.corner_from > 1:
            arm = plus(arm, time, going)
        gap = row[GAP] - 0.5 * touch
        target = -RETURN * gap / usual
        if gap > 0.5 * touch:
            target = min(target, -2.0 * gap / time - row[RATE])
        write_to(work.contact[ARM, m], arm)
        write_to(work.contact[NOW_WITH, m], vector(row[WITH : WITH + 3]))
        work.law[RESTITUTION, m], work.law[FRICTION, m] = 0.0, row[MU]
        m += 1
        if row[MOVES] == 0.0:
            normal = vector(row[TOWARDS : TOWARDS + 3])
            write_to(work.contact[NORMAL, m - 1], normal)
            write_to(work.contact[VELOCITY, m - 1], (target * normal[0], target * normal[1], target * normal[2]))
            continue
        speed = slope_x = slope_y = along_x = along_y = 0.0
        for s in range(under.shape[0]):
            q, dq = work.then[NOW, s], work.then[SPEED, s]
            speed += (under[s, HEIGHT] + dx * under[s, SLOPE_X] + dy * under[s, SLOPE_Y]) * dq
            slope_x += under[s, SLOPE_X] * q
            slope_y += under[s, SLOPE_Y] * q
            along_x -= moves * under[s, TURN_X] * dq
            along_y -= moves * under[s, TURN_Y] * dq
        size = math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        write_to(work.contact[NORMAL, m - 1], (-slope_x / size, -slope_y / size, 1.0 / size))
        lift = speed + slope_x * along_x + slope_y * along_y + target * size
        write_to(work.contact[VELOCITY, m - 1], (along_x, along_y, lift))
    return m
