"""A part in a round tube: gap, approach and impacts of its corners at the wall, for the impulse engine.

A corner at distance rho from the axis has the gap R - rho (a ball: less its radius). The gap closes no faster than with
the corner's own acceleration plus v^2 / rho, which the curved wall adds for a speed v across the axis.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.contact_problem import meet_world
from feeder_sim.engines.impulse.state import (
    GAP,
    RATE,
    WALL_GAP,
    WALL_RATE,
    arm_of,
    spin_of,
)
from feeder_sim.engines.impulse.vectors import add_to, cross, difference, dot, plus
from feeder_sim.machine_code import inlined, uncounted

FINEST = 1.0 / 32.0  # of a step: rattling between two impacts is followed no further


@inlined
def _from_axis(arm, part, wall):
    """The vector from the axis to the end of an arm from the centre of mass [m], and its length rho."""
    r = difference(plus(part.position, 1.0, arm), wall.foot)
    across = plus(r, -dot(r, wall.axis), wall.axis)
    return across, math.sqrt(dot(across, across))


@uncounted
def approach_wall(part, kind, corners, wall, touch, work):
    """Fill gap and rate of every corner at the wall; returns how many touch (gap up to `touch` [m]) and approach."""
    spin, touching = spin_of(part, kind), 0
    for i in range(corners.shape[0]):
        arm = arm_of(part, corners, i)
        across, rho = _from_axis(arm, part, wall)
        work.corner[i, WALL_GAP] = wall.radius - rho - kind.radius
        outwards = dot(part.velocity, across) + dot(cross(spin, arm), across)
        work.corner[i, WALL_RATE] = -outwards / rho if rho > 0.0 else 0.0
        if work.corner[i, WALL_GAP] <= touch and work.corner[i, WALL_RATE] < 0.0:
            touching += 1
    return touching


@uncounted
def gather_wall(part, kind, corners, wall, touch, n, work):
    """Append the corners that touch the wall and approach it to the n contacts there are; put the part back inside."""
    deepest, back = 0.0, (0.0, 0.0, 0.0)
    for i in range(corners.shape[0]):
        if work.corner[i, WALL_GAP] > touch or work.corner[i, WALL_RATE] >= 0.0:
            continue
        arm = arm_of(part, corners, i)
        across, rho = _from_axis(arm, part, wall)
        normal = (-across[0] / rho, -across[1] / rho, -across[2] / rho)
        place = plus(arm, -kind.radius, normal), normal, (0.0, 0.0, 0.0)
        meet_world(n, work.contacts, 0, place, (wall.restitution, wall.friction))
        if -work.corner[i, WALL_GAP] > deepest:
            deepest = -work.corner[i, WALL_GAP]
            back = (deepest * normal[0], deepest * normal[1], deepest * normal[2])
        n += 1
    add_to(part.position, 1.0, back)
    return n


@uncounted
def leap_to_wall(part, kind, corners, wall, work):
    """Longest flight [s] during which no corner can touch the wall."""
    least = min(kind.inertia[0], kind.inertia[1], kind.inertia[2])
    squared = (part.momentum[0] ** 2 + part.momentum[1] ** 2 + part.momentum[2] ** 2) / (least * least)
    along, speed = 0.0, 0.0
    for k in range(3):
        along += part.velocity[k] * wall.axis[k]
    for k in range(3):
        speed += (part.velocity[k] - along * wall.axis[k]) ** 2
    speed = math.sqrt(speed) + kind.reach * math.sqrt(squared)
    # What gravity can add on the way from wall to wall, at most.
    fastest = speed * speed + 4.0 * GRAVITY * wall.radius
    a = GRAVITY + 2.0 * kind.reach * squared + fastest / wall.radius
    shortest = np.inf
    for i in range(corners.shape[0]):
        gap, rate = max(work.corner[i, WALL_GAP], 0.0), work.corner[i, WALL_RATE]
        shortest = min(shortest, (rate + math.sqrt(rate * rate + 2.0 * a * gap)) / a)
    return shortest


@uncounted
def meeting_time(work, n_corners, step):
    """When a corner is expected to meet plate or wall at its present rate [s]: between a share of a step and one.

    In a play of micrometres a corner must not cover a whole step inside the wall.
    """
    first = step
    for i in range(n_corners):
        if work.corner[i, RATE] < 0.0 and work.corner[i, GAP] < np.inf:
            first = min(first, -max(work.corner[i, GAP], 0.0) / work.corner[i, RATE])
        if work.corner[i, WALL_RATE] < 0.0:
            first = min(first, -max(work.corner[i, WALL_GAP], 0.0) / work.corner[i, WALL_RATE])
    return max(first, FINEST * step)
