"""What happens where the part touches: impacts, and the forces that press it while it stays (docs/contact.md).

impact      a point that touches and approaches gets an impulse, together with all others that touch
            (contact_problem.py); again at zero time until none approaches
pressed     where bounces pile up within a time T in which the change of the surface's acceleration, J, moves it by
            less than the tolerance, J T^3 / 6 < tolerance, points stay: forces for no longer than T, after which no
            point that touches approaches; non-negative and in the cone of friction. A share of gap that is left is
            given back by the velocity; the forces act at the middle of that time, so that the order is the second
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.lone.contact_law import hit_alone, restitution_at
from feeder_sim.engines.impulse.lone.contact_problem import (
    ARM_SECOND,
    FRICTION,
    IMPULSE,
    NORMAL,
    RESTITUTION,
    ROLLING,
    TARGET,
    VELOCITY,
    WORLD,
    impact,
    solve,
)
from feeder_sim.engines.impulse.lone.edge_piece import BALL, LINES
from feeder_sim.engines.impulse.lone.leap import LEFT, leap_of, room_of, shortest_leap, still_leap
from feeder_sim.engines.impulse.lone.moving_surface import move_surface
from feeder_sim.engines.impulse.lone.plate_points import UP, along_normal, renew_rates, spin_change
from feeder_sim.engines.impulse.lone.state import (
    ACCELERATION,
    AT,
    AT_EDGE,
    CARRY,
    EDGE,
    FALL,
    GAP,
    HEIGHT,
    JERK,
    KNOWN,
    MOVES,
    MU,
    NOW,
    OWN,
    PRESSED,
    PUSH,
    RATE,
    SLOPE_X,
    SLOPE_Y,
    SPEED,
    SWING,
    TOWARDS,
    TURN_X,
    TURN_Y,
    UNRESOLVED,
    WITH,
)
from feeder_sim.engines.impulse.state import inverse_inertia, spin_of, top_speed, turning_speed
from feeder_sim.engines.impulse.vectors import add_to, cross, difference, dot, plus, times, vector, write_to
from feeder_sim.engines.noise import half_normal
from feeder_sim.machine_code import inlined

ROUNDS = 20  # of impacts at zero time; after them what still approaches does so without rebound
LONGEST_CHATTER = 3e-5  # [s] of bounces that are summed where nothing moves: hops of a nanometre
LONGEST = 5e-5  # [s] of constant forces
TURNED, TURNED_AT_EDGE = 0.02, 0.0005  # [rad] by which a part turns under constant forces; there the normal turns too
TOGETHER = 10.0  # tolerances; points this close hit together, so that a flat landing is one impact and not six
CARRIED = 30.0  # tolerances; points that have been pressed and are this close still are
RETURN = 0.3  # share of its gap that a pressed point gives back in the time of constant forces
SETTLED = 0.1  # of the speed that the plate gives a point in the time of summed bounces: what is slower stays
NO_LIFT = 1e-3  # of the time of constant forces: what is lifted sooner than that is lifted now
FIRMLY = 0.99  # of full friction: what takes less is not sliding
SOLVED = 0.05  # tolerances by which the motion under forces may be off that the laws of contact ask for
TURNS, STOPS = 3, 0.98  # rounds, and share of the time, by which the end of a slip is found
SLIPS, CREPT = 1e-7, 10.0  # [m/s], and on a plate that moves tolerances in the time of forces: what slips by less stays
NOTHING = (0.0, 0.0, 0.0)


@inlined
def chatter_time(moves, twist, bounds):
    """Time [s] of bounces that are summed: the change of an acceleration moves a point by less than the tolerance."""
    jerk, longest = moves * bounds.fastest + twist, LONGEST_CHATTER
    if 6.0 * bounds.exact.tolerance < jerk * longest * longest * longest:
        return np.cbrt(6.0 * bounds.exact.tolerance / jerk)
    return longest


@inlined
def _time_of_force(moves, longest, bounds):
    """Time T [s] of a force that changes steadily: what it misses moves the surface by less than the tolerance.

    Of a motion whose fourth derivative is S, a cubic with the right speeds at both ends misses S T^4 / 384 at most.
    """
    snap = moves * bounds.fastest * bounds.fastest
    if 384.0 * bounds.exact.tolerance < snap * longest * longest * longest * longest:
        return math.sqrt(math.sqrt(384.0 * bounds.exact.tolerance / snap))
    return longest


@inlined
def _load(part, kind, time, work):
    """Motion of the part as it will be after a time [s] without contact, and its inertia."""
    bodies, spin, turns = work.bodies, spin_of(part, kind), inverse_inertia(part, kind)
    change = spin_change(part, kind, spin)
    bodies.inverse_mass[0] = 1.0 / kind.mass
    for c in range(6):
        bodies.inverse_inertia[0, c] = turns[c]
    for c in range(3):
        bodies.velocity[0, c], bodies.spin[0, c] = part.velocity[c], spin[c] + time * change[c]
    bodies.velocity[0, 2] -= GRAVITY * time


@inlined
def _gather(i, m, restitution, work):
    """Make the point in row i contact m."""
    row, contacts = work.point[i], work.contacts
    contacts.body[m, 0], contacts.body[m, 1] = WORLD, 0
    for c in range(3):
        contacts.vector[ARM_SECOND, m, c] = row[AT + c]
        contacts.vector[NORMAL, m, c], contacts.vector[VELOCITY, m, c] = row[TOWARDS + c], row[WITH + c]
    contacts.number[RESTITUTION, m], contacts.number[FRICTION, m] = restitution, row[MU]
    contacts.number[ROLLING, m] = 0.0
    work.row_of[m] = i


@inlined
def strike(part, kind, n, twist, rebounds, bounds, work):
    """Impacts at all points that touch, until none approaches; returns whether there was one.

    twist: see `unsure`; rebounds: False where nothing may bounce.
    """
    touch, together, hit = bounds.exact.touch, TOGETHER * bounds.exact.tolerance, False
    for rounds in range(ROUNDS + 1):
        m, approaches = 0, False
        for i in range(n):
            row = work.point[i]
            if row[KNOWN] == 0.0 or not row[GAP] <= together:
                continue
            if row[RATE] > LEFT:
                continue
            e = restitution_at(kind, -row[RATE])
            departure = 0.5 * chatter_time(row[MOVES], twist, bounds) * (1.0 - e) * max(row[PUSH], 0.0)
            if -e * row[RATE] <= departure:
                e = 0.0  # what is left of its bounces is summed: they take what the plate pushes meanwhile
            if row[RATE] < -LEFT and row[GAP] <= touch:
                approaches = True
            _gather(i, m, e if rebounds and rounds < ROUNDS else 0.0, work)
            m += 1
        if not approaches:
            break
        hit = True
        if not (m == 1 and hit_alone(part, kind, work)):
            _load(part, kind, 0.0, work)
            if not impact(work.bodies, work.contacts, m, None):
                work.counts[UNRESOLVED] += 1
            write_to(part.velocity, vector(work.bodies.velocity[0]))
            for i in range(m):
                arm, impulse = work.contacts.vector[ARM_SECOND, i], work.contacts.vector[IMPULSE, i]
                add_to(part.momentum, 1.0, cross(arm, impulse))
        _scatter(part, m, bounds, work)
        renew_rates(part, kind, n, work)
    return hit


@inlined
def _scatter(part, m, bounds, work):
    """Add a random speed to a part that has hit a plate that moves."""
    moves = 0.0
    for i in range(m):
        moves = max(moves, work.point[work.row_of[i], MOVES])
    if moves > 0.0 and bounds.exact.noise > 0.0:
        size, part.draws = half_normal(part.draws)
        part.velocity[2] += bounds.exact.noise * size


@inlined
def press(part, kind, n, pressed, unknown, surface, bounds, t, until, least, work):
    """Set constant forces on the part for a time, as the contacts in `work` say.

    pressed: whether it has been until now; unknown: see `unsure`; until: no longer than that [s], but for the time
    `least` [s].

    Returns:
        the time [s], 0 if nothing is pressed; whether nothing slips.
    """
    usual, chatter, lift = _time_of_forces(part, kind, n, pressed, unknown, bounds, work)
    if usual == 0.0 or lift < NO_LIFT * usual:
        return 0.0, False
    _mark_carried(n, usual, chatter, bounds, work)
    time = max(min(usual, lift, until - t), least)
    m = 0
    for turn in range(TURNS):
        slips = SLIPS if bounds.speed == 0.0 else max(SLIPS, CREPT * bounds.exact.tolerance / time)
        _load(part, kind, time, work)
        m = _gather_ahead(part, kind, n, surface, bounds, t, time, usual, work)
        if bounds.speed > 0.0:
            _move_as_one(m, slips, work.contacts)
        if kind.corner_to - kind.corner_from > 1:
            _turn_inwards(part, kind, m, time, work)
        if not solve(work.bodies, work.contacts, m, None, SOLVED * bounds.exact.tolerance / usual):
            work.counts[UNRESOLVED] += 1
        stops = _slip_stops(part, kind, m, time, slips, work)
        if stops > STOPS * time or stops < max((1.0 - STOPS) * usual, least) or turn == TURNS - 1:
            break
        time = stops
    held, loaded, firmly, friction = True, False, 0.0, NOTHING
    for i in range(m):
        p, normal = vector(work.contacts.vector[IMPULSE, i]), vector(work.contacts.vector[NORMAL, i])
        along = dot(p, normal)
        if along > 0.0:
            loaded = True
            firmly += FIRMLY * work.contacts.number[FRICTION, i] * along
            friction = plus(friction, 1.0, plus(p, -along, normal))
            u = _relative(i, work)
            u = plus(u, -dot(u, normal), normal)
            held = held and dot(u, u) < slips * slips
    held = held and dot(friction, friction) <= firmly * firmly
    if not loaded:
        return 0.0, False
    _apply_forces(part, m, time, work)
    return _until_next(part, kind, n, time, unknown, bounds, work), held


@inlined
def _apply_forces(part, m, time, work):
    """Press the part by what the last solution of m contacts says, over a time [s].

    The force is no constant: the part's acceleration changes as that of the surface at its contacts does, by load.
    """
    part.phase, part.lead, load = PRESSED, 0.5 * time, 0.0
    for c in range(3):
        part.force[c] = part.moment[c] = part.jerk[c] = 0.0
    for i in range(m):
        load += dot(work.contacts.vector[IMPULSE, i], work.contacts.vector[NORMAL, i])
    for i in range(m):
        arm, impulse = work.contacts.vector[ARM_SECOND, i], work.contacts.vector[IMPULSE, i]
        normal = vector(work.contacts.vector[NORMAL, i])
        add_to(part.jerk, work.point[work.row_of[i], JERK] * dot(normal, impulse) / load, normal)
        add_to(part.force, 1.0 / time, impulse)
        add_to(part.moment, 1.0 / time, cross(arm, impulse))


@inlined
def _until_next(part, kind, n, time, unknown, bounds, work):
    """How much of a time of constant forces [s] passes before a point that they do not press can touch.

    A part that tips brings its far side down faster than it would fall by itself.
    """
    touch, (slack, twist), found = bounds.exact.touch, unknown, time
    turning = times(work.bodies.inverse_inertia[0], part.moment)
    pushed = plus(NOTHING, 1.0 / kind.mass, part.force)
    for i in range(n):
        row = work.point[i]
        if row[GAP] == math.inf or row[CARRY] != 0.0:
            continue
        pulled = plus(pushed, 1.0, cross(turning, vector(row[AT : AT + 3])))
        normal = vector(row[TOWARDS : TOWARDS + 3]) if row[KNOWN] != 0.0 else UP
        more = max(-dot(normal, pulled), 0.0) + slack
        bound = row[OWN] + more + row[MOVES]
        gap, rate = room_of(row, row[RATE], touch)
        if gap + found * (rate - 0.5 * bound * found) > 0.0:
            continue
        if row[MOVES] == 0.0:
            found = min(found, still_leap(row, row[RATE], more, twist, touch))
        else:
            found = min(found, leap_of(row, rate, more, twist, bounds, touch))
    return max(found, shortest_leap(part, kind, bounds))


@inlined
def _relative(i, work):
    """Relative velocity at contact i, as the body moves now."""
    arm = work.contacts.vector[ARM_SECOND, i]
    u = plus(work.bodies.velocity[0], 1.0, cross(work.bodies.spin[0], arm))
    return difference(u, work.contacts.vector[VELOCITY, i])


@inlined
def _slip_stops(part, kind, m, time, slips, work):
    """When the first contact that slips will have stopped [s], if it does within a time of constant forces; or that.

    slips: what is slower does not slip [m/s].

    Along its slip s, with the other accelerations a and a share r of full friction F, it goes on by s - (a + r F) t.
    F is taken for that of a part that does not turn.
    """
    found, pressed, spin = time, 0.0, spin_of(part, kind)
    for i in range(m):
        pressed += dot(work.contacts.vector[IMPULSE, i], work.contacts.vector[NORMAL, i])
    for i in range(m):
        row = work.point[work.row_of[i]]
        p, normal = vector(work.contacts.vector[IMPULSE, i]), vector(work.contacts.vector[NORMAL, i])
        along, mu = dot(p, normal), work.contacts.number[FRICTION, i]
        if along <= 0.0 or mu == 0.0:
            continue
        at = plus(part.velocity, 1.0, cross(spin, vector(row[AT : AT + 3])))
        u = difference(at, vector(row[WITH : WITH + 3]))
        u = plus(u, -dot(u, normal), normal)
        s = math.sqrt(dot(u, u))
        share = -dot(p, u) / (s * mu * along) if s > slips else 1.0
        if share > FIRMLY:
            continue
        full = mu * pressed / kind.mass / time
        others = (s - dot(_relative(i, work), u) / s) / time - share * full
        if others + full > 0.0:
            found = min(found, s / (others + full))
    return found


@inlined
def _time_of_forces(part, kind, n, pressed, unknown, bounds, work):
    """How long forces last [s], 0 if no point is pressed; summed bounces; and when the last point is lifted."""
    close = CARRIED * bounds.exact.tolerance if pressed else bounds.exact.touch
    moves, least, may_stay, (slack, twist) = 0.0, LONGEST, False, unknown
    for i in range(n):
        row = work.point[i]
        push = row[PUSH] + slack  # what is not known to part is left to the solution of all contacts
        slow = abs(row[RATE]) <= max(SETTLED * LONGEST_CHATTER * push, LEFT)
        may_stay = may_stay or (row[KNOWN] != 0.0 and row[GAP] <= close and push > 0.0 and slow)
    if not may_stay:
        return 0.0, 0.0, 0.0
    for i in range(n):
        row = work.point[i]
        if row[KNOWN] != 0.0 and row[GAP] <= close:
            moves = max(moves, row[MOVES])
            if row[KNOWN] == AT_EDGE:
                arm = vector(row[AT : AT + 3])
                least = min(least, TURNED_AT_EDGE * math.sqrt(dot(arm, arm)) / top_speed(part, kind))
    chatter = chatter_time(moves, twist, bounds)
    any_pressed, lift = False, 0.0
    for i in range(n):
        row = work.point[i]
        push = row[PUSH] + slack
        if row[KNOWN] == 0.0 or not row[GAP] <= close or push <= 0.0:
            continue
        if abs(row[RATE]) > max(SETTLED * chatter * push, LEFT):
            continue
        any_pressed = True
        root = math.inf
        if row[MOVES] > 0.0 and row[JERK] < 0.0:  # as if all moved at the fastest rate
            bend = 0.5 * bounds.fastest * bounds.fastest * (row[FALL] + slack - push)
            inside = row[JERK] * row[JERK] - 4.0 * bend * push
            if inside >= 0.0:
                root = 2.0 * push / (math.sqrt(inside) - row[JERK])
        lift = max(lift, root)
    if not any_pressed:
        return 0.0, 0.0, 0.0
    time = _time_of_force(moves, least, bounds)
    turning = turning_speed(part, kind)
    if turning * time > TURNED * kind.reach:
        time = TURNED * kind.reach / turning
    return time, chatter, lift


@inlined
def _is_settled(row, usual, chatter, bounds):
    """Whether a point is pressed so firmly, or leaves so slowly, that it stays."""
    return row[RATE] <= max(SETTLED * chatter * row[PUSH], bounds.exact.tolerance / usual)


@inlined
def _mark_carried(n, usual, chatter, bounds, work):
    """Mark the points that are close enough, and slow enough, for the forces to see to them."""
    close = CARRIED * bounds.exact.tolerance
    for i in range(n):
        row = work.point[i]
        near = row[GAP] <= bounds.exact.touch or (row[GAP] <= close and row[RATE] * usual > -close)
        carried = row[KNOWN] != 0.0 and near and _is_settled(row, usual, chatter, bounds)
        row[CARRY] = 1.0 if carried else 0.0


@inlined
def _gather_ahead(part, kind, n, surface, bounds, t, time, usual, work):
    """Contacts as they will be after a time [s]: least normal velocities for which no point will have come inside.

    usual: the time that forces may stay constant [s], in which a share of what a point is off is given back.
    """
    touch, moves = bounds.exact.touch, surface.half_thickness * surface.in_plane
    move_surface(t + time, surface, work.then)
    spin = spin_of(part, kind)
    m, contacts = 0, work.contacts
    for i in range(n):
        row, under = work.point[i], work.under[i]
        if row[CARRY] == 0.0:
            continue
        _gather(i, m, 0.0, work)
        going = cross(spin, vector(row[AT : AT + 3]))
        turned = 0.0
        if row[KNOWN] == AT_EDGE:
            turned = _turn_along(row, work.edge[int(row[EDGE])], m, part, kind, going, time, contacts)
        elif kind.corner_to - kind.corner_from > 1:
            write_to(contacts.vector[ARM_SECOND, m], plus(row[AT : AT + 3], 0.5 * time, going))
        gap = row[GAP] - 0.5 * touch
        target = -RETURN * gap / usual
        if gap > 0.5 * touch:
            target = min(target, -2.0 * gap / time - row[RATE])
        contacts.number[TARGET, m] = target - turned
        m += 1
        if row[MOVES] == 0.0:
            continue
        # A ball touches below its centre, wherever that goes.
        past = cross(spin, plus(row[AT : AT + 3], kind.radius, row[TOWARDS : TOWARDS + 3]))
        dx, dy = (part.velocity[0] + past[0]) * time, (part.velocity[1] + past[1]) * time
        up = UP
        if row[KNOWN] == AT_EDGE:  # a place of the edge, which moves with it
            up, dx, dy = vector(row[TOWARDS : TOWARDS + 3]), 0.0, 0.0
        speed = slope_x = slope_y = along_x = along_y = push = 0.0
        for s in range(under.shape[0]):
            q, dq = work.then[NOW, s], work.then[SPEED, s]
            push += along_normal(under, s, up, moves) * work.then[ACCELERATION, s]
            speed += (under[s, HEIGHT] + dx * under[s, SLOPE_X] + dy * under[s, SLOPE_Y]) * dq
            slope_x += under[s, SLOPE_X] * q
            slope_y += under[s, SLOPE_Y] * q
            along_x -= moves * under[s, TURN_X] * dq
            along_y -= moves * under[s, TURN_Y] * dq
        row[JERK] = (push - row[PUSH] + row[FALL]) / time  # the mean
        if row[KNOWN] != AT_EDGE:  # the force acts along the mean normal
            steep = math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
            both = plus(row[TOWARDS : TOWARDS + 3], 1.0 / steep, (-slope_x, -slope_y, 1.0))
            normal = plus(NOTHING, 1.0 / math.sqrt(dot(both, both)), both)
            write_to(contacts.vector[NORMAL, m - 1], normal)
            if kind.radius > 0.0 and kind.corner_to - kind.corner_from == 1:
                write_to(contacts.vector[ARM_SECOND, m - 1], plus(NOTHING, -kind.radius, normal))
        lift = speed if row[KNOWN] == AT_EDGE else speed + slope_x * along_x + slope_y * along_y
        write_to(contacts.vector[VELOCITY, m - 1], (along_x, along_y, lift))
    return m


@inlined
def _move_as_one(m, slips, contacts):
    """Give all contacts one sideways velocity where those of the plate differ by no more than `slips` [m/s].

    A plate that bends moves places under a part apart, so that nothing can stick at all of them.
    """
    velocities, normals = contacts.vector[VELOCITY], contacts.vector[NORMAL]
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for i in range(m):
        x, y = velocities[i, 0], velocities[i, 1]
        low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
    if max(high_x - low_x, high_y - low_y) > slips:
        return
    x, y = 0.5 * (low_x + high_x), 0.5 * (low_y + high_y)
    for i in range(m):
        u, n = velocities[i], normals[i]
        u[2] -= (n[0] * (x - u[0]) + n[1] * (y - u[1])) / n[2]  # the gap closes as before
        u[0], u[1] = x, y


@inlined
def _turn_inwards(part, kind, m, time, work):
    """Take from the velocity of all contacts what corners gain as they turn, half of it in the mean of a time [s]."""
    spin = spin_of(part, kind)
    for i in range(m):
        inwards = cross(spin, cross(spin, vector(work.point[work.row_of[i], AT : AT + 3])))
        add_to(work.contacts.vector[VELOCITY, i], -0.5 * time, inwards)


@inlined
def _turn_along(row, point, m, part, kind, going, time, contacts):
    """Normal and arm of contact m on the edge as they are at the middle of a time [s].

    The gap closes along the normal of the end, the force acts along that of the middle: returns by how much less the
    normal velocity of the contact has to be than the rate of the gap [m/s].
    """
    normal, swing = vector(row[TOWARDS : TOWARDS + 3]), vector(row[SWING : SWING + 3])
    at, v = vector(row[AT : AT + 3]), difference(plus(part.velocity, 1.0, going), vector(row[WITH : WITH + 3]))
    middle = plus(normal, 0.5 * time, swing)
    middle = plus(NOTHING, 1.0 / math.sqrt(dot(middle, middle)), middle)
    write_to(contacts.vector[NORMAL, m], middle)
    if point.turns == BALL:
        write_to(contacts.vector[ARM_SECOND, m], plus(plus(at, kind.radius, normal), -kind.radius, middle))
        return 0.5 * time * dot(swing, v)
    if point.turns == LINES:  # they meet farther along that of the part
        slides = plus(NOTHING, dot(v, vector(point.axis)), cross(normal, vector(point.lever)))
    else:  # the vertex slides along the face
        slides = plus(v, -dot(v, normal), normal)
    write_to(contacts.vector[ARM_SECOND, m], plus(at, 0.5 * time, difference(going, slides)))
    return time * dot(swing, v)
