"""What happens at contacts: impacts, and the forces that press parts together while they stay (docs/contact.md).

impact      a point that touches and approaches gets an impulse, together with all others that touch (contact_problem.py);
            again at zero time until none approaches
pressed     where bounces pile up within a time T in which the change of the surface's acceleration, J, moves it by less
            than the tolerance, J T^3 / 6 < tolerance, points stay: constant forces, for no longer than T, after which no
            point that touches approaches; non-negative and in the cone of friction

Both are for a group: parts that touch each other, and the points in the first n rows of `Scratch.point`.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.contact_problem import (
    ARM_FIRST,
    ARM_SECOND,
    FRICTION,
    IMPULSE,
    MOMENT,
    NORMAL,
    RESTITUTION,
    ROLLING,
    TARGET,
    VELOCITY,
    impact,
    solve,
)
from feeder_sim.engines.impulse.impact_law import hit_alone, restitution_at
from feeder_sim.engines.impulse.leap import leap, leap_of, shortest_leap
from feeder_sim.engines.impulse.moving_surface import move_surface
from feeder_sim.engines.impulse.plate_points import renew_rates, spin_change
from feeder_sim.engines.impulse.state import (
    AT,
    AT_EDGE,
    BODY,
    FALL,
    FROM,
    GAP,
    HEIGHT,
    JERK,
    KNOWN,
    MOVES,
    MU,
    NOW,
    OTHER,
    OWN,
    PRESSED,
    PUSH,
    RATE,
    SLOPE_X,
    SLOPE_Y,
    SPEED,
    TOUCH,
    TOWARDS,
    TURN_X,
    TURN_Y,
    WITH,
    inverse_inertia,
    spin_of,
    turning_acceleration,
    turning_speed,
)
from feeder_sim.engines.impulse.vectors import add_to, cross, difference, dot, plus, vector, write_to
from feeder_sim.engines.impulse.yielding import changes_surface, find_carried, modes_of, yields
from feeder_sim.engines.noise import half_normal
from feeder_sim.machine_code import compiled, inlined
from feeder_sim.scene.scene import GRAVITY

ROUNDS = 20  # of impacts at zero time; after them what still approaches does so without rebound
LONGEST_CHATTER = 3e-5  # [s] of bounces that are summed where nothing moves: hops of a nanometre
LONGEST = 2e-4  # [s] of constant forces
HOP = 0.7  # of the time in which bounces are summed: over a plate that yields, whose hops are that long
TURNED, TURNED_AT_EDGE = 0.02, 0.002  # [rad] by which a part turns under constant forces; there the normal turns too
TOGETHER = 10.0  # tolerances; points this close hit together, so that a flat landing is one impact and not six
CARRIED = 30.0  # tolerances; points that have been pressed and are this close still are
RETURN = 0.05  # share of its gap that a pressed point gives back in the time of constant forces
NO_LIFT = 1e-3  # of the time of constant forces: what is lifted sooner than that is lifted now
FIRMLY = 0.99  # of full friction: what takes less is not sliding
TURNS, STOPS = 3, 0.98  # rounds, and share of the time, by which the end of a slip is found
LEFT = 1e-9  # [m/s]; what round-off leaves of the speed of points that stay
SLIPS = 1e-7  # [m/s]


@inlined
def chatter_time(moves, twist, bounds):
    """Time [s] in which the change of an acceleration moves the surface by less than the tolerance."""
    return _time_of(moves * bounds.fastest + twist, LONGEST_CHATTER, bounds)


@inlined
def _time_of(jerk, longest, bounds):
    tolerance = bounds.exact.tolerance
    if 6.0 * tolerance < jerk * longest * longest * longest:
        return (6.0 * tolerance / jerk) ** (1.0 / 3.0)
    return longest


@inlined
def _twist(part, kind):
    """How fast turning can change the accelerations of a part's points [m/s^3]."""
    return 3.0 * turning_acceleration(part, kind) * turning_speed(part, kind) / max(kind.reach, 1e-9)


@inlined
def _member(parts, row, work):
    return parts[work.group[int(row[BODY])]]


@compiled
def _load(parts, kinds, size, time, work):
    """Motion of the parts of a group as it will be after a time [s] without contact, and their inertia."""
    bodies = work.bodies
    for k in range(size):
        part = parts[work.group[k]]
        kind = kinds.record[part.kind]
        spin, turns = spin_of(part, kind), inverse_inertia(part, kind)
        change = spin_change(part, kind, spin)
        bodies.inverse_mass[k] = 1.0 / kind.mass
        for c in range(6):
            bodies.inverse_inertia[k, c] = turns[c]
        for c in range(3):
            bodies.velocity[k, c], bodies.spin[k, c] = part.velocity[c], spin[c] + time * change[c]
        bodies.velocity[k, 2] -= GRAVITY * time


@inlined
def _gather(i, m, restitution, work):
    """Make the point in row i contact m."""
    row, contacts = work.point[i], work.contacts
    contacts.body[m, 0], contacts.body[m, 1] = int(row[OTHER]), int(row[BODY])
    for c in range(3):
        contacts.vector[ARM_SECOND, m, c], contacts.vector[ARM_FIRST, m, c] = row[AT + c], row[FROM + c]
        contacts.vector[NORMAL, m, c], contacts.vector[VELOCITY, m, c] = row[TOWARDS + c], row[WITH + c]
    contacts.number[RESTITUTION, m], contacts.number[FRICTION, m] = restitution, row[MU]
    contacts.number[ROLLING, m] = 0.0
    work.row_of[m] = i


@compiled
def strike(parts, kinds, size, n, surface, bounds, t, work, yielding):
    """Impacts of a group at all points that touch, until none approaches; returns whether there was one."""
    together, hit = TOGETHER * bounds.exact.tolerance, False
    for rounds in range(ROUNDS + 1):
        m, approaches = 0, False
        for i in range(n):
            row = work.point[i]
            if row[KNOWN] == 0.0 or not row[GAP] <= max(together, row[TOUCH]) or m == work.row_of.shape[0]:
                continue
            least = LEFT if row[PUSH] > 0.0 else 0.0
            if row[RATE] > least:
                continue
            part = _member(parts, row, work)
            kind = kinds.record[part.kind]
            e = restitution_at(part, kind, row)
            if -e * row[RATE] <= slow(row, e, _twist(part, kind), bounds):
                e = 0.0  # what is left of its bounces is summed: they take what the plate pushes meanwhile
            if row[RATE] < -least and row[GAP] <= row[TOUCH]:
                approaches = True
            _gather(i, m, 0.0 if rounds == ROUNDS else e, work)
            m += 1
        if not approaches:
            break
        hit = True
        _give_impulses(parts, kinds, size, m, n, surface, t, work, yielding)
        _scatter(parts, m, bounds, work)
        renew_rates(parts, kinds, n, work)
    return hit


@inlined
def slow(row, restitution, twist, bounds):
    """Departure [m/s] up to which the bounces of a point are summed."""
    return 0.5 * chatter_time(row[MOVES], twist, bounds) * (1.0 - restitution) * max(row[PUSH], 0.0)


@compiled
def _give_impulses(parts, kinds, size, m, n, surface, t, work, yielding):
    """Solve the first m contacts, of n rows, as an impact."""
    if m == 1 and not yields(yielding) and hit_alone(parts, kinds, work):
        return
    _load(parts, kinds, size, 0.0, work)
    find_carried(m, surface, work, yielding)
    if not impact(work.bodies, work.contacts, m, modes_of(yielding)):
        work.unresolved[0] += 1
    _take_over(parts, size, m, work)
    changes_surface(size, m, n, surface, t, work, yielding)


@compiled
def _take_over(parts, size, m, work):
    """Velocities of the parts after the impulses of m contacts."""
    for k in range(size):
        part = parts[work.group[k]]
        write_to(part.velocity, vector(work.bodies.velocity[k]))
    for i in range(m):
        impulse, moment = work.contacts.vector[IMPULSE, i], work.contacts.vector[MOMENT, i]
        first, second = work.contacts.body[i, 0], work.contacts.body[i, 1]
        part = parts[work.group[second]]
        turning = cross(work.contacts.vector[ARM_SECOND, i], impulse)
        add_to(part.momentum, 1.0, plus(turning, 1.0, moment))
        if first >= 0:
            other = parts[work.group[first]]
            turning = cross(work.contacts.vector[ARM_FIRST, i], impulse)
            add_to(other.momentum, -1.0, plus(turning, 1.0, moment))


@inlined
def _scatter(parts, m, bounds, work):
    """Add a random speed to every part that has hit a plate that moves."""
    if bounds.exact.noise == 0.0:
        return
    last = -1.0
    for i in range(m):
        row = work.point[work.row_of[i]]
        if row[MOVES] > 0.0 and row[BODY] != last:
            last = row[BODY]
            part = _member(parts, row, work)
            size, part.draws = half_normal(part.draws)
            part.velocity[2] += bounds.exact.noise * size


@compiled
def press(parts, kinds, size, n, pressed, slack, surface, bounds, t, until, work, yielding):
    """Constant forces on a group that stays together, for a time.

    pressed: whether it has been until now; slack: see `unsure`.

    Returns:
        the time [s], 0 if nothing is pressed; whether nothing slips; the number of contacts.
    """
    usual, lift = _time_of_forces(parts, kinds, size, n, pressed, bounds, work, yielding)
    if usual == 0.0 or lift < NO_LIFT * usual:
        return 0.0, False, 0
    least = _shortest(parts, kinds, size, bounds, work)
    time = max(min(usual, lift, until - t), least)
    for i in range(n):
        row = work.point[i]
        if row[GAP] == np.inf or _is_carried(row, time, bounds):
            continue
        if row[GAP] + time * (row[RATE] - 0.5 * (row[OWN] + slack + row[MOVES]) * time) > 0.5 * row[TOUCH]:
            continue
        if row[MOVES] == 0.0:
            time = max(min(time, leap(max(row[GAP] - 0.5 * row[TOUCH], 0.0), row[RATE], row[OWN])), least)
        else:
            part = _member(parts, row, work)
            twist = _twist(part, kinds.record[part.kind])
            time = max(min(time, leap_of(row, row[RATE], slack, twist, bounds, row[TOUCH])), least)
    m = 0
    for turn in range(TURNS):
        _load(parts, kinds, size, 0.0 if yields(yielding) else time, work)
        m = _gather_ahead(parts, kinds, n, surface, bounds, t, time, usual, work, yielding)
        find_carried(m, surface, work, yielding)
        if not solve(work.bodies, work.contacts, m, modes_of(yielding)):
            work.unresolved[0] += 1
        if yields(yielding):
            _take_over(parts, size, m, work)
            changes_surface(size, m, n, surface, t, work, yielding)
            break
        stops = _slip_stops(parts, kinds, m, time, work)
        if stops > STOPS * time or stops < (1.0 - STOPS) * usual or turn == TURNS - 1:
            break
        time = stops
    loaded, held = False, True
    for i in range(m):
        p, normal = vector(work.contacts.vector[IMPULSE, i]), vector(work.contacts.vector[NORMAL, i])
        along = dot(p, normal)
        if along > 0.0:
            loaded = True
            friction = plus(p, -along, normal)
            u = _relative(i, work)
            u = plus(u, -dot(u, normal), normal)
            held = held and dot(u, u) < SLIPS * SLIPS
            held = held and dot(friction, friction) <= (FIRMLY * work.contacts.number[FRICTION, i] * along) ** 2
    if yields(yielding):
        _fly_on(parts, kinds, size, m, time, work)
    return (time if loaded else 0.0), held, m


@inlined
def _fly_on(parts, kinds, size, m, time, work):
    """After impulses in place of forces: no forces, and how the group moves on average until it is down again."""
    for i in range(m):
        write_to(work.contacts.vector[IMPULSE, i], (0.0, 0.0, 0.0))
        write_to(work.contacts.vector[MOMENT, i], (0.0, 0.0, 0.0))
    _load(parts, kinds, size, 0.5 * time, work)


@compiled
def apply_forces(parts, size, m, time, work):
    """Press the parts of a group by what the last solution of m contacts says, over a time [s]."""
    for k in range(size):
        part = parts[work.group[k]]
        part.phase = PRESSED
        for c in range(3):
            part.force[c] = part.moment[c] = 0.0
    for i in range(m):
        impulse, moment = work.contacts.vector[IMPULSE, i], work.contacts.vector[MOMENT, i]
        first, second = work.contacts.body[i, 0], work.contacts.body[i, 1]
        part = parts[work.group[second]]
        add_to(part.force, 1.0 / time, impulse)
        add_to(part.moment, 1.0 / time, plus(cross(work.contacts.vector[ARM_SECOND, i], impulse), 1.0, moment))
        if first >= 0:
            other = parts[work.group[first]]
            add_to(other.force, -1.0 / time, impulse)
            add_to(other.moment, -1.0 / time, plus(cross(work.contacts.vector[ARM_FIRST, i], impulse), 1.0, moment))


@inlined
def _relative(i, work):
    """Relative velocity at contact i, as the bodies move now."""
    bodies, contacts = work.bodies, work.contacts
    first, second = contacts.body[i, 0], contacts.body[i, 1]
    u = plus(bodies.velocity[second], 1.0, cross(bodies.spin[second], contacts.vector[ARM_SECOND, i]))
    if first < 0:
        return difference(u, contacts.vector[VELOCITY, i])
    return difference(u, plus(bodies.velocity[first], 1.0, cross(bodies.spin[first], contacts.vector[ARM_FIRST, i])))


@inlined
def _shortest(parts, kinds, size, bounds, work):
    least = math.inf
    for k in range(size):
        part = parts[work.group[k]]
        least = min(least, shortest_leap(part, kinds.record[part.kind], bounds))
    return least


@compiled
def _slip_stops(parts, kinds, m, time, work):
    """When the first contact that slips will have stopped [s], if it does within a time of constant forces; or that.

    Along its slip s, with the other accelerations a and a share r of full friction F, it goes on by s - (a + r F) t.
    F is taken for that of a part that does not turn.
    """
    found = time
    for i in range(m):
        row = work.point[work.row_of[i]]
        p, normal = vector(work.contacts.vector[IMPULSE, i]), vector(work.contacts.vector[NORMAL, i])
        along, mu = dot(p, normal), work.contacts.number[FRICTION, i]
        if along <= 0.0 or mu == 0.0 or row[OTHER] >= 0.0:
            continue
        part = _member(parts, row, work)
        kind = kinds.record[part.kind]
        at = plus(part.velocity, 1.0, cross(spin_of(part, kind), vector(row[AT : AT + 3])))
        u = difference(at, vector(row[WITH : WITH + 3]))
        u = plus(u, -dot(u, normal), normal)
        s = math.sqrt(dot(u, u))
        share = -dot(p, u) / (s * mu * along) if s > SLIPS else 1.0
        if share > FIRMLY:
            continue
        pressed = 0.0
        for j in range(m):
            if work.contacts.body[j, 1] == work.contacts.body[i, 1]:
                pressed += dot(work.contacts.vector[IMPULSE, j], work.contacts.vector[NORMAL, j])
        full = mu * pressed / kind.mass / time
        others = (s - dot(_relative(i, work), u) / s) / time - share * full
        if others + full > 0.0:
            found = min(found, s / (others + full))
    return found


@inlined
def _time_of_forces(parts, kinds, size, n, pressed, bounds, work, yielding):
    """How long forces may stay constant [s], 0 if no point is pressed; and when the last of the points is lifted."""
    moves, twist, turning, turned = 0.0, 0.0, 0.0, TURNED
    for k in range(size):
        part = parts[work.group[k]]
        kind = kinds.record[part.kind]
        twist = max(twist, _twist(part, kind))
        turning = max(turning, turning_speed(part, kind) / max(kind.reach, 1e-9))
    for i in range(n):
        row = work.point[i]
        if row[KNOWN] != 0.0 and row[GAP] <= _close(row, pressed, bounds):
            moves = max(moves, row[MOVES])
            if row[KNOWN] == AT_EDGE:
                turned = TURNED_AT_EDGE
    chatter = chatter_time(moves, twist, bounds)
    any_pressed, lift = False, 0.0
    for i in range(n):
        row = work.point[i]
        if row[KNOWN] == 0.0 or not row[GAP] <= _close(row, pressed, bounds) or row[PUSH] <= 0.0:
            continue
        if abs(row[RATE]) > max(0.5 * chatter * row[PUSH], LEFT):
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
    time = HOP * chatter if yields(yielding) else _time_of(moves * bounds.fastest, LONGEST, bounds)
    if turning * time > turned:
        time = turned / turning
    return time, lift


@inlined
def _close(row, pressed, bounds):
    """From which gap on a point is pressed [m]."""
    return max(CARRIED * bounds.exact.tolerance, 2.0 * row[TOUCH]) if pressed else row[TOUCH]


@inlined
def _is_carried(row, time, bounds):
    """Whether a point is close enough, and slow enough, for the forces to see to it."""
    close = _close(row, True, bounds)
    if row[KNOWN] == 0.0 or row[GAP] > close:
        return False
    return row[GAP] <= row[TOUCH] or row[RATE] * time > -close


@inlined
def _gather_ahead(parts, kinds, n, surface, bounds, t, time, usual, work, yielding):
    """Contacts as they will be after a time [s]: least normal velocities for which no point will have come inside.

    usual: the time that forces may stay constant [s], in which a share of what a point is off is given back.
    """
    moves = surface.half_thickness * surface.in_plane
    move_surface(t + time, surface, work.then)
    m, contacts = 0, work.contacts
    for i in range(n):
        row, under = work.point[i], work.under[i]
        if not _is_carried(row, time, bounds) or m == work.row_of.shape[0]:
            continue
        _gather(i, m, 0.0, work)
        part = _member(parts, row, work)
        kind = kinds.record[part.kind]
        going = cross(spin_of(part, kind), vector(row[AT : AT + 3]))
        if row[OTHER] < 0.0 and kind.corner_to - kind.corner_from > 1 and row[KNOWN] == 1.0 and not yields(yielding):
            write_to(contacts.vector[ARM_SECOND, m], plus(row[AT : AT + 3], time, going))
        gap = row[GAP] - 0.5 * row[TOUCH]
        target = -RETURN * gap / usual
        if gap > 0.5 * row[TOUCH]:
            target = min(target, -2.0 * gap / time - row[RATE])
        if yields(yielding):  # impulses now, in place of forces: a hop that ends on the surface
            target = 0.5 * max(row[PUSH], 0.0) * time - (gap / time if gap > 0.0 else RETURN * gap / usual)
        contacts.number[TARGET, m] = target
        m += 1
        if row[MOVES] == 0.0 or yields(yielding):
            continue
        dx, dy = (part.velocity[0] + going[0]) * time, (part.velocity[1] + going[1]) * time
        speed = slope_x = slope_y = along_x = along_y = 0.0
        for s in range(under.shape[0]):
            q, dq = work.then[NOW, s], work.then[SPEED, s]
            speed += (under[s, HEIGHT] + dx * under[s, SLOPE_X] + dy * under[s, SLOPE_Y]) * dq
            slope_x += under[s, SLOPE_X] * q
            slope_y += under[s, SLOPE_Y] * q
            along_x -= moves * under[s, TURN_X] * dq
            along_y -= moves * under[s, TURN_Y] * dq
        size = math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        if row[TOWARDS + 2] > 1.0 - 1e-3:
            write_to(contacts.vector[NORMAL, m - 1], (-slope_x / size, -slope_y / size, 1.0 / size))
        lift = speed + slope_x * along_x + slope_y * along_y
        write_to(contacts.vector[VELOCITY, m - 1], (along_x, along_y, lift))
    return m
