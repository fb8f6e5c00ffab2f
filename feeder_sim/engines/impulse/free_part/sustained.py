"""Sustained contact: the forces that press the part while it stays on the plate (docs/contact.md).

They last for a time T' in which a steady change of force follows the surface to the tolerance; after it no point that
touches approaches. They are not negative, and in the cone of friction. A share of a gap that is left is given back by
the velocity; they act at the middle of that time, so that the order is the second. Where a contact lifts or stops to
slip within it, it ends there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from feeder_sim.engines.impulse.contact_equations import STEP, STIFF, solve_equations
from feeder_sim.engines.impulse.contact_problem import (
    ARM_SECOND,
    FRICTION,
    IMPULSE,
    MOMENT,
    NORMAL,
    TARGET,
    VELOCITY,
    solve,
)
from feeder_sim.engines.impulse.free_part.at_edge import edge_point_after
from feeder_sim.engines.impulse.free_part.impact import LONGEST_CHATTER, chatter_time, gather, load_part
from feeder_sim.engines.impulse.free_part.leap import RemainderBounds, first_contact, shortest_leap
from feeder_sim.engines.impulse.free_part.on_circle import lowest_point_after
from feeder_sim.engines.impulse.free_part.on_plate import corner_after
from feeder_sim.engines.impulse.free_part.path import Turning, ahead
from feeder_sim.engines.impulse.free_part.points import touches
from feeder_sim.engines.impulse.free_part.walls import leans, wall_point_after, walled
from feeder_sim.engines.impulse.scratch import ABOVE, AT_EDGE, ON_CIRCLE, ON_WALL, UNRESOLVED
from feeder_sim.engines.impulse.state import FREE, PRESSED, top_speed
from feeder_sim.engines.impulse.surface import ACCELERATION, along_at, flow_at, move_surface
from feeder_sim.engines.impulse.vectors import add_to, cross, difference, dot, plus, times, vector, write_to
from feeder_sim.machine_code import inlined

# [rad] by which a part turns under forces; there the normal turns too
TURNED, ROLLED, TURNED_AT_EDGE = 0.02, 0.002, 0.0005
CARRIED = 30.0  # tolerances; points that have been pressed and are this close still are
RETURN = 0.3  # share of its gap that a pressed point gives back in the time of forces
SETTLED = 0.1  # of the speed that the plate gives a point in the time of summed bounces: what is slower stays
NO_LIFT = 1e-3  # of the time of forces: what is lifted sooner than that is lifted now
LEAST_ROLL = 1e-6  # [s]
FIRMLY = 0.99  # of full friction: what takes less is not sliding
SOLVED = 0.05  # tolerances by which the motion under forces may be off that the laws of contact ask for
TURNS, STOPS = 3, 0.98  # rounds, and share of the time, by which the end of a slip is found
MORE_TURNS, BACK = 8, 0.999  # rounds where it slips back after that, and share of the way to it that is taken
DIPS = 10.0  # tolerances by which a point without a load may come inside while forces last
LIGHT = 1e-3  # of all loads: what bears less bears none
OFFERED, LOADED = 1, 2  # in POINT, carried
NOTHING = (0.0, 0.0, 0.0)


class Moment(NamedTuple):
    """A time [s]; until when nothing begins or ends [s]; how many points a part has, how it turns, its remainder."""

    t: float
    until: float
    n: int
    turning: Turning
    remainder: RemainderBounds


@inlined
def press(free, plate, now, least):
    """Set forces on the part for a time, that of what the plate does next or, if that is less, `least` [s].

    Returns the time [s], 0 if nothing is pressed; and whether nothing slips.
    """
    part, kind, work = free.parts[0], free.kinds.record[free.parts[0].kind], free.work
    usual, chatter = time_of_forces(part, kind, plate.bounds, now, work)
    lift = last_lift(plate.bounds, now, chatter, work)
    if usual == 0.0 or lift < NO_LIFT * usual:
        return 0.0, False
    mark_carried(now.n, usual, chatter, plate.bounds, work)
    time = max(min(usual, lift, now.until - now.t), least)
    m, exact = 0, plate.bounds.exact
    slips = exact.slip if plate.bounds.speed > 0.0 else exact.slip_at_rest
    for turn in range(MORE_TURNS):
        m = _solve_forces(free, plate, now, (time, usual, slips))
        stops, back = _slip_stops(part, kind, now.turning.spin, (m, time, slips), work)
        soon = (1.0 - (BACK if back else STOPS)) * usual
        if stops < max(soon, least) or (not back and (stops > STOPS * time or turn >= TURNS - 1)):
            break
        time = stops
    loaded, sticks = _sort_loads(m, slips, work)
    if not loaded:
        for i in range(now.n):
            work.point[i].carried = 0
        return 0.0, False
    _apply_forces(part, m, time, work)
    push_unloaded(part, kind, now.n, work)
    time = min(time, until_dip(now.n, time, plate.bounds, work))
    time = first_contact(now.n, time, plate, now.t, now.remainder, work)
    return max(time, shortest_leap(part, plate.bounds, now.turning)), sticks


@inlined
def _close(bounds, work):
    """Gap [m] up to which a point may be pressed: one that has been pressed until now is still."""
    return bounds.exact.touch if work.before[0].phase == FREE else CARRIED * bounds.exact.tolerance


@inlined
def _may_stay(point, gap, chatter, bounds, remainder):
    """Whether a point is so close, and so slow, that forces may keep it; whether they do is for the solution to say."""
    slowly = max(SETTLED * chatter * (point.closing + remainder.curving), bounds.exact.approach)
    return touches(point, gap) and abs(point.rate) <= slowly


@inlined
def time_of_forces(part, kind, bounds, now, work):
    """How long forces last [s], 0 if no point is pressed; and how long bounces are summed [s]."""
    close, may_stay = _close(bounds, work), False
    for i in range(now.n):
        may_stay = may_stay or _may_stay(work.point[i], close, LONGEST_CHATTER, bounds, now.remainder)
    if not may_stay:
        return 0.0, 0.0
    # A plate that only moves sideways has no push, and yet slip comes and goes within a period.
    most, longest = 0.0, min(bounds.exact.longest, bounds.exact.sways / bounds.rate)
    for i in range(now.n):
        point = work.point[i]
        if touches(point, close):
            most = max(most, point.most_push)
            if point.sort == AT_EDGE:
                turns = math.sqrt(dot(point.arm, point.arm)) / top_speed(part, kind)
                longest = min(longest, TURNED_AT_EDGE * turns)
            elif point.sort == ON_WALL:
                longest = min(longest, TURNED / max(math.sqrt(dot(point.swing, point.swing)), TURNED))
            elif point.sort == ON_CIRCLE:
                slides = math.sqrt(dot(point.swing, point.swing)) + top_speed(part, kind)
                longest = min(longest, max(ROLLED * math.sqrt(dot(point.arm, point.arm)) / slides, LEAST_ROLL))
    chatter, time = chatter_time(most, now.remainder.twist, bounds), _time_of_change(most, longest, bounds)
    if now.turning.speed * time > TURNED * kind.reach:
        time = TURNED * kind.reach / now.turning.speed
    return time, chatter


@inlined
def _time_of_change(push, longest, bounds):
    """Time T [s] of a force that changes steadily: what it misses moves the surface by less than the tolerance.

    Of a motion whose fourth derivative is S, a cubic with the right speeds at both ends misses S T^4 / 384 at most.
    """
    snap = push * bounds.rate * bounds.rate
    if 384.0 * bounds.exact.tolerance < snap * longest * longest * longest * longest:
        return math.sqrt(math.sqrt(384.0 * bounds.exact.tolerance / snap))
    return longest


@inlined
def last_lift(bounds, now, chatter, work):
    """When the last point that may stay is lifted [s], as if all moved at the fastest rate; 0 if none may."""
    close, lift = _close(bounds, work), 0.0
    for i in range(now.n):
        point = work.point[i]
        if not _may_stay(point, close, chatter, bounds, now.remainder):
            continue
        root, closing, change = math.inf, point.closing + now.remainder.curving, point.closing_rate
        if point.most_push > 0.0 and change < 0.0:
            bend = -0.5 * bounds.rate * bounds.rate * point.push
            inside = change * change - 4.0 * bend * closing
            if inside >= 0.0:
                root = 2.0 * closing / (math.sqrt(inside) - change)
        lift = max(lift, root)
    return lift


@inlined
def mark_carried(n, usual, chatter, bounds, work):
    """Mark the points that are close enough, and slow enough, for the forces to see to them."""
    close = CARRIED * bounds.exact.tolerance
    for i in range(n):
        point = work.point[i]
        near = point.gap <= bounds.exact.touch or (point.gap <= close and point.rate * usual > -close)
        slowly = max(bounds.exact.tolerance, -point.gap) / usual  # what is inside has to get out
        stays = point.rate <= max(SETTLED * chatter * point.closing, slowly)
        point.carried = OFFERED if near and stays and touches(point, close) else 0


@inlined
def _solve_forces(free, plate, now, times_and_slip):
    """Solve for the impulses of a time, of all points that are carried; returns their number.

    times_and_slip: that time, the time that forces may last [s], and the speed below which nothing slips [m/s].
    """
    part, kind, work = free.parts[0], free.kinds.record[free.parts[0].kind], free.work
    time, usual, _ = times_and_slip
    move_surface(now.t + time, plate.surface, work.then)
    m, leant = gather_forces(part, kind, free.loads, plate, now, times_and_slip, 0, work)
    if not solve(work.bodies, work.contacts, m, SOLVED * plate.bounds.exact.tolerance / usual, not leant):
        work.counts[UNRESOLVED] += 1
    keep_loads(free.loads, now.n, 0, m, time, work)
    return m


@inlined
def gather_forces(part, kind, loads, plate, now, times_and_slip, begin, work):
    """Make all points that are carried contacts as they are at the end of a time, from `begin` on.

    Returns where they end, and whether the part leans on a wall.
    """
    time, usual, slips = times_and_slip
    load_part(part, kind, now.turning, time, work)
    m, exact = begin, plate.bounds.exact
    for i in range(now.n):
        point = work.point[i]
        if point.carried:
            gather(i, m, 0.0, kind, work)
            write_to(work.contacts.vector[IMPULSE, m], plus(NOTHING, time, loads[i, :3]))
            write_to(work.contacts.vector[MOMENT, m], plus(NOTHING, time, loads[i, 3:]))
            turned = _set_contact_after(m, part, kind, plate, (now.turning, time), work)
            slowly = exact.longest if point.gap < -CARRIED * exact.tolerance else usual
            target = -RETURN * (point.gap - min(max(point.gap, 0.0), exact.touch)) / slowly
            if point.gap > exact.touch:
                target = min(target, -2.0 * (point.gap - 0.5 * exact.touch) / time - point.rate)
            work.contacts.number[TARGET, m] = target - turned
            m += 1
    leant = walled(plate) and leans(now.n, CARRIED * exact.tolerance, work)
    if plate.bounds.speed > 0.0 and not leant:
        _move_as_one(begin, m, slips, work.contacts)
    if kind.corner_to - kind.corner_from > 1:
        _turn_inwards(kind, now.turning.spin, begin, m, time, work)
    return m, leant


@inlined
def keep_loads(loads, n, begin, end, time, work):
    """Keep what n points bore at contacts from one to before another, force [N] and moment [N m].

    The solution of the next forces starts from it.
    """
    for i in range(n):
        for k in range(6):
            loads[i, k] = 0.0
    for i in range(begin, end):
        at = work.point_of[i]
        add_to(loads[at, :3], 1.0 / time, work.contacts.vector[IMPULSE, i])
        add_to(loads[at, 3:], 1.0 / time, work.contacts.vector[MOMENT, i])


@inlined
def _set_contact_after(m, part, kind, plate, turning_and_time, work):
    """Write contact m as it is for forces of a time [s]; returns a speed [m/s], see `edge_point_after`."""
    i, contacts, (turning, time) = work.point_of[m], work.contacts, turning_and_time
    point, under, turned = work.point[i], work.under[i], 0.0
    if point.sort == AT_EDGE:
        arm, normal, turned = edge_point_after(i, part, turning, time, work)
        velocity = flow_at(under, work.then, plate.surface)
    elif point.sort == ON_WALL:
        arm, normal, turned = wall_point_after(i, part, kind, plate, turning, time, work)
        velocity = NOTHING
    elif point.sort == ON_CIRCLE:
        arm, normal, velocity = lowest_point_after(i, kind, plate, turning, time, work)
    else:
        arm, normal, velocity = corner_after(i, kind, plate, turning, time, work)
    point.push_rate = (along_at(under, work.then, ACCELERATION) - point.push) / time
    write_to(contacts.vector[ARM_SECOND, m], arm)
    write_to(contacts.vector[NORMAL, m], normal)
    write_to(contacts.vector[VELOCITY, m], velocity)
    return turned


@inlined
def _move_as_one(begin, end, slips, contacts):
    """Give contacts, from one to before another, one sideways velocity where those of the plate hardly differ.

    slips: by no more than that [m/s].

    A plate that bends moves places under a part apart, so that nothing can stick at all of them.
    """
    velocities, normals = contacts.vector[VELOCITY], contacts.vector[NORMAL]
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for i in range(begin, end):
        x, y = velocities[i, 0], velocities[i, 1]
        low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
    if max(high_x - low_x, high_y - low_y) > slips:
        return
    x, y = 0.5 * (low_x + high_x), 0.5 * (low_y + high_y)
    for i in range(begin, end):
        u, n = velocities[i], normals[i]
        u[2] -= (n[0] * (x - u[0]) + n[1] * (y - u[1])) / n[2]  # the gap closes as before
        u[0], u[1] = x, y


@inlined
def _turn_inwards(kind, spin, begin, end, time, work):
    """Take from the velocity of contacts what the part gains there as it turns, in the mean of a time [s].

    begin, end: the first of them, and where they end. The part touches with one point after the other; a normal that
    turns with them is in the targets.
    """
    for i in range(begin, end):
        point, arm = work.point[work.point_of[i]], work.contacts.vector[ARM_SECOND, i]
        gained = cross(spin, difference(arm, point.arm))
        if point.sort >= AT_EDGE:
            normal = vector(work.contacts.vector[NORMAL, i])
            radius = work.edge[point.edge].radius if point.sort == AT_EDGE else kind.radius
            centre = plus(point.arm, radius, point.normal)
            along = 0.5 * time * dot(normal, cross(spin, cross(spin, centre)))
            gained = plus(gained, along - dot(normal, gained), normal)
        add_to(work.contacts.vector[VELOCITY, i], -1.0, gained)


@inlined
def _relative(i, work):
    """Relative velocity at contact i, as the solution moves the part."""
    arm = work.contacts.vector[ARM_SECOND, i]
    u = plus(work.bodies.velocity[0], 1.0, cross(work.bodies.spin[0], arm))
    return difference(u, work.contacts.vector[VELOCITY, i])


@inlined
def _slip_stops(part, kind, spin, contacts, work):
    """When the first contact that slips will have stopped [s], if it does within a time of forces; or that time.

    And whether one slips back at the end, or will, since friction cannot hold it there. It would have had the wrong
    friction all the time, or less than it takes, and a search from there stays late: so the time is cut short. Walls
    stand still, and there a part that is jammed would go back and forth.

    contacts: how many there are, that time, and the speed below which none slips [m/s].

    Along its slip s, with the other accelerations a and a share r of full friction F, it goes on by s - (a + r F) t.
    F is taken for that of a part that does not turn.
    """
    (m, time, slips), pressed = contacts, 0.0
    time_left, back = time, False
    for i in range(m):
        pressed += dot(work.contacts.vector[IMPULSE, i], work.contacts.vector[NORMAL, i])
    for i in range(m):
        point = work.point[work.point_of[i]]
        p, normal = vector(work.contacts.vector[IMPULSE, i]), vector(work.contacts.vector[NORMAL, i])
        along, mu = dot(p, normal), work.contacts.number[FRICTION, i]
        if along <= 0.0 or mu == 0.0:
            continue
        u = difference(plus(part.velocity, 1.0, cross(spin, point.arm)), point.surface_velocity)
        u = plus(u, -dot(u, normal), normal)
        s = math.sqrt(dot(u, u))
        share = -dot(p, u) / (s * mu * along) if s > slips else 1.0
        if share > FIRMLY:
            continue
        full = mu * pressed / kind.mass / time
        slowing = (s - dot(_relative(i, work), u) / s) / time - share * full
        if slowing + full > 0.0:
            goes_back = (share < 0.0 or slowing > full) and point.sort != ON_WALL
            time_left = min(time_left, (BACK if goes_back else 1.0) * s / (slowing + full))
            back = back or goes_back
    return time_left, back


@inlined
def _sort_loads(m, slips, work):
    """Whether any of m contacts is loaded; and whether none of those slips, and friction holds the part firmly."""
    sticks, firmly, friction, load = True, 0.0, NOTHING, 0.0
    for i in range(m):
        load += dot(work.contacts.vector[IMPULSE, i], work.contacts.vector[NORMAL, i])
    for i in range(m):
        p, normal = vector(work.contacts.vector[IMPULSE, i]), vector(work.contacts.vector[NORMAL, i])
        along = dot(p, normal)
        if along > LIGHT * load:
            work.point[work.point_of[i]].carried = LOADED
        if along > 0.0:
            firmly += FIRMLY * work.contacts.number[FRICTION, i] * along
            friction = plus(friction, 1.0, plus(p, -along, normal))
            u = _relative(i, work)
            u = plus(u, -dot(u, normal), normal)
            sticks = sticks and dot(u, u) < slips * slips
    return load > 0.0, sticks and dot(friction, friction) <= firmly * firmly


@inlined
def _apply_forces(part, m, time, work):
    """Press the part by what the last solution of m contacts says, over a time [s]; forces change as the plate does."""
    part.phase, part.lead = PRESSED, 0.5 * time
    for vector_of in (part.force, part.moment, part.jerk, part.twist):
        write_to(vector_of, NOTHING)
    for i in range(m):
        arm, impulse = work.contacts.vector[ARM_SECOND, i], work.contacts.vector[IMPULSE, i]
        add_to(part.force, 1.0 / time, impulse)
        add_to(part.moment, 1.0 / time, plus(work.contacts.vector[MOMENT, i], 1.0, cross(arm, impulse)))
    _change_forces(part, m, work)


@inlined
def _change_forces(part, m, work):
    """Write how force and moment change, so that at m contacts the part is accelerated more and more as the plate is.

    The change of a force f along the normal n follows from f = STIFF (b - n.a') / k, where b is the change of the push,
    a' that of the acceleration which all f cause, and k the inverse effective mass: of redundant ones, the least.
    """
    matrix, change, bodies = work.contacts.room.matrix, work.contacts.room.motion[STEP], work.bodies
    for x in range(6):
        change[x] = 0.0
        for y in range(6):
            matrix[x, y] = 1.0 if x == y else 0.0
    for i in range(m):
        stiff, row, push = _stiff_row(i, bodies, work)
        for x in range(6):
            change[x] += stiff * push[x] * work.point[work.point_of[i]].push_rate
            for y in range(6):
                matrix[x, y] += stiff * push[x] * row[y]
    if not solve_equations(matrix, change, 6):
        return
    for i in range(m):
        stiff, row, _ = _stiff_row(i, bodies, work)
        f = stiff * work.point[work.point_of[i]].push_rate
        for x in range(6):
            f -= stiff * row[x] * change[x]
        add_to(part.jerk, f * bodies.inverse_mass[0], row[:3])
        add_to(part.twist, f, row[3:])


@inlined
def _stiff_row(i, bodies, work):
    """Stiffness of contact i, 0 without a load; how it moves along its normal with the part, and what a force does."""
    normal = vector(work.contacts.vector[NORMAL, i])
    turns = cross(work.contacts.vector[ARM_SECOND, i], normal)
    turned, share = times(bodies.inverse_inertia[0], turns), bodies.inverse_mass[0]
    stiff = STIFF / (share + dot(turns, turned)) if work.point[work.point_of[i]].carried == LOADED else 0.0
    push = share * normal[0], share * normal[1], share * normal[2], turned[0], turned[1], turned[2]
    return stiff, (normal[0], normal[1], normal[2], turns[0], turns[1], turns[2]), push


@inlined
def push_unloaded(part, kind, n, work):
    """Give the paths of the points that bear no load what forces do to them.

    A part that tips brings its far side down faster than it would fall by itself.
    """
    turning_rate = times(work.bodies.inverse_inertia[0], part.twist)
    turning = times(work.bodies.inverse_inertia[0], plus(vector(part.moment), -part.lead, part.twist))
    pushed = plus(plus(NOTHING, 1.0 / kind.mass, part.force), -part.lead, part.jerk)
    for i in range(n):
        point = work.point[i]
        if point.carried == LOADED:
            continue
        more = plus(pushed, 1.0, cross(turning, point.arm))
        change = dot(point.normal, plus(part.jerk, 1.0, cross(turning_rate, point.arm)))
        towards = dot(point.normal, more)
        point.most_own += abs(towards)
        if point.sort == ABOVE:
            continue
        if point.sort > ON_CIRCLE:
            more = 0.0, 0.0, towards
        add_to(point.path_acceleration, 1.0, more)
        point.path_jerk += change
        point.closing, point.closing_rate = point.closing - towards, point.closing_rate - change


@inlined
def until_dip(n, time, bounds, work):
    """When a point that is carried, and has no load since it leaves at the end of a time [s], is inside by too much."""
    time_left, most = time, DIPS * bounds.exact.tolerance
    for i in range(n):
        point = work.point[i]
        if point.carried == OFFERED:
            gap, _, _, _ = ahead(point, work.under[i], time, work.now, work.then)
            if min(point.gap, 0.0) - gap > most:
                time_left = min(time_left, time * math.sqrt(most / (min(point.gap, 0.0) - gap)))
    return time_left
