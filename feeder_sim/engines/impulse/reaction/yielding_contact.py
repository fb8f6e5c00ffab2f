"""One free part over a plate that gives way: as in plate_contact.py, with what its impacts take from the plate."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.circles import count_of, is_round, leap_of_circles, lowest_points, tilt_of
from feeder_sim.engines.impulse.contact_problem import ARM_SECOND, IMPULSE, VELOCITY, Modes, meet_world
from feeder_sim.engines.impulse.far_corners import MANY, far_leap, gather_near
from feeder_sim.engines.impulse.flight_time import forecast, longest_leap, shortest_flight
from feeder_sim.engines.impulse.impact import resolve_impact
from feeder_sim.engines.impulse.impact_law import restitution_on_plate
from feeder_sim.engines.impulse.plate_contact import TOUCH, approach, contact_of, look, put_back
from feeder_sim.engines.impulse.plate_edge import edge_leap, points_on_edge
from feeder_sim.engines.impulse.state import GAP, RATE, SURFACE_ACCELERATION, SURFACE_RATE, arm_of, spin_of
from feeder_sim.engines.impulse.vectors import combine, cross, dot, plus, vector
from feeder_sim.engines.reaction import react
from feeder_sim.machine_code import compiled, inlined
from feeder_sim.plate.compiled import BETA_X, BETA_Y, cubic_weights, grid_cell, interpolate

TAKEN, WORK, LIFTED = range(3)  # of the books


class Yielding(NamedTuple):
    """What gives way: the modes; how much their reaction has changed since the bounds were made (n_shapes,) [m].

    books: energies [J] since t = 0 that parts got at the plate: TAKEN from its modes, WORK of the contact law, which is
    negative, and LIFTED where they were put back on the surface.
    """

    modes: Modes
    changed: NDArray[np.complex128]
    books: NDArray[np.float64]


@compiled
def meet_yielding_plate(part, kinds, surface, bounds, t, work, yielding):
    """As `meet_plate`."""
    kind = kinds.record[part.kind]
    height = part.position[2] - kind.reach - kind.radius - bounds.crest
    if height > 2.0 * TOUCH:
        rising = part.velocity[2]
        return max((rising + math.sqrt(rising * rising + 2.0 * GRAVITY * height)) / GRAVITY, bounds.step), False
    moved, lowest = lowest_points(part, kind, surface, bounds, 2.0 * TOUCH, t, work)
    further = points_on_edge(part, kind, kinds, surface, bounds.crest, work)
    corners, n_corners, others = kinds.corners[kind.corner_from : kind.corner_to], count_of(kind), np.inf
    if further > 0 or is_round(kind):
        corners = work.points[: n_corners + further]
    elif n_corners > MANY and not bounds.calm:
        near, others = gather_near(part, kind, corners, bounds, work)
        corners = work.points[:near]
    on_plate, _ = look(part, kind, corners, surface, bounds, t, moved, work)
    if on_plate > 0:
        _impact(part, kind, corners, surface, t, work, yielding)
    leap, to_crest, own = longest_leap(part, kind, corners, work)
    tilt = tilt_of(lowest, part, kind, work)
    leap, to_crest = leap_of_circles(tilt, kind, bounds, own, leap, to_crest, work)
    shortest = shortest_flight(part, kind, bounds)
    to_crest = min(to_crest, far_leap(part, kind, others, bounds))
    if further > 0:
        to_crest = min(to_crest, edge_leap(part, kind, corners, n_corners, bounds.step, work))
    if leap < to_crest:
        flight = max(leap, shortest), shortest, own, to_crest
        leap = forecast(part, kind, corners, surface, bounds, t, flight, tilt, work)
    return max(min(leap, to_crest), shortest), on_plate > 0


@compiled
def _impact(part, kind, corners, surface, t, work, yielding):
    """Impulses to all corners that touch and approach, and to the plate; the deepest is put back on the surface."""
    modes = yielding.modes
    n, depth = 0, 0.0
    for i in range(corners.shape[0]):
        if work.corner[i, GAP] > TOUCH or work.corner[i, RATE] >= 0.0:
            continue
        depth = max(depth, -work.corner[i, GAP])
        arm, normal, velocity = contact_of(i, part, kind, corners, surface, work)
        law = restitution_on_plate(part, kind, arm, normal, velocity), kind.friction[0], 0.0
        meet_world(n, work.contacts, 0, (arm, normal, velocity), law)
        _find_carried(i, part, corners, surface, work, modes.carried[n])
        n += 1
    before = vector(part.velocity), spin_of(part, kind)
    if not resolve_impact(part, kind, n, modes, work):
        work.unresolved[0] += 1
    books, taken = yielding.books, modes.taken
    for s in range(taken.shape[0]):
        books[TAKEN] += (work.modal[1, s] - 0.5 * taken[s]) * taken[s] / modes.inverse_mass[s]
    books[WORK] += _work(n, before, modes, work)
    books[LIFTED] += kind.mass * GRAVITY * depth
    react(surface, t, taken, yielding.changed)
    for i in range(corners.shape[0]):
        if work.corner[i, SURFACE_ACCELERATION] != 0.0:  # else it is above the crest, and nothing is known under it
            for s in range(taken.shape[0]):
                work.corner[i, SURFACE_RATE] -= work.under[i, s] * taken[s]
    put_back(part, corners, depth, work)
    approach(part, kind, corners, work)


@inlined
def _work(n, before, modes, work):
    """Work of the impulses of n contacts in the frame of the surface [J]: sum of p . (u + u')/2.

    before: velocity and spin of the part before them.
    """
    total, body = 0.0, work.bodies
    for i in range(n):
        arm, push = vector(work.contacts.vector[ARM_SECOND, i]), vector(work.contacts.vector[IMPULSE, i])
        first = plus(before[0], 1.0, cross(before[1], arm))
        last = plus(body.velocity[0], 1.0, cross(body.spin[0], arm))
        mean = plus(combine(0.5, first, 0.5, last, 0.0, last), -1.0, work.contacts.vector[VELOCITY, i])
        for s in range(modes.taken.shape[0]):
            mean = plus(mean, 0.5 * modes.taken[s], modes.carried[i, s])
        total += dot(push, mean)
    return total


@inlined
def _find_carried(i, part, corners, surface, work, carried):
    """How the surface at corner i moves with every mode, (n_shapes, 3), as `contact_of` has it."""
    arm = arm_of(part, corners, i)
    first_x, a = grid_cell(part.position[0] + arm[0], surface.grid_x)
    first_y, b = grid_cell(part.position[1] + arm[1], surface.grid_y)
    weight_x, weight_y = cubic_weights(a), cubic_weights(b)
    moves = surface.half_thickness * surface.in_plane
    for s in range(carried.shape[0]):
        if surface.tangent:
            bx, by = work.modes[s, BETA_X], work.modes[s, BETA_Y]
        else:
            bx = interpolate(surface.table, s, BETA_X, first_x, first_y, weight_x, weight_y)
            by = interpolate(surface.table, s, BETA_Y, first_x, first_y, weight_x, weight_y)
        carried[s, 0], carried[s, 1], carried[s, 2] = -moves * bx, -moves * by, work.under[i, s]
