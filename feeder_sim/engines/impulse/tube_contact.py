"""A part in a round tube: gap, approach and impacts of its corners at the wall, for the impulse engine.

A corner at distance rho from the axis has the gap R - rho (a ball: less its radius). The gap closes no faster than with
the corner's own acceleration plus v^2 / rho, which the curved wall adds for a speed v across the axis.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.state import (
    ARM,
    FRICTION,
    GAP,
    NORMAL,
    RATE,
    RESTITUTION,
    VELOCITY,
    WALL_GAP,
    WALL_RATE,
    arm_of,
    point,
    spin_of,
)
from feeder_sim.engines.impulse.vectors import cross, dot
from feeder_sim.machine_code import compiled
from feeder_sim.scene.scene import GRAVITY

FINEST = 1.0 / 32.0  # of a step: rattling between two impacts is followed no further


@compiled
def _from_axis(part, corners, wall, i, across):
    """Write the vector from the axis to corner i into across (3,); returns its length rho."""
    along = 0.0
    for k in range(3):
        across[k] = point(part, corners, i, k) - wall.foot[k]
        along += across[k] * wall.axis[k]
    squared = 0.0
    for k in range(3):
        across[k] -= along * wall.axis[k]
        squared += across[k] * across[k]
    return math.sqrt(squared)


@compiled
def approach_wall(part, kind, corners, wall, touch, work):
    """Fill gap and rate of every corner at the wall; returns how many touch (gap up to `touch` [m]) and approach."""
    across, spin = np.empty(3), spin_of(part, kind)
    touching = 0
    for i in range(corners.shape[0]):
        rho = _from_axis(part, corners, wall, i, across)
        work.corner[i, WALL_GAP] = wall.radius - rho - kind.radius
        outwards = dot(part.velocity, across) + dot(cross(spin, arm_of(part, corners, i)), across)
        work.corner[i, WALL_RATE] = -outwards / rho if rho > 0.0 else 0.0
        if work.corner[i, WALL_GAP] <= touch and work.corner[i, WALL_RATE] < 0.0:
            touching += 1
    return touching


@compiled
def gather_wall(part, kind, corners, wall, touch, n, work):
    """Append the corners that touch the wall and approach it to the n contacts there are; put the part back inside."""
    across, back = np.empty(3), np.zeros(3)
    deepest = 0.0
    for i in range(corners.shape[0]):
        if work.corner[i, WALL_GAP] > touch or work.corner[i, WALL_RATE] >= 0.0:
            continue
        rho = _from_axis(part, corners, wall, i, across)
        for k in range(3):
            work.contact[NORMAL, n, k] = -across[k] / rho
            work.contact[ARM, n, k] = (
                point(part, corners, i, k) - part.position[k] - kind.radius * work.contact[NORMAL, n, k]
            )
        if -work.corner[i, WALL_GAP] > deepest:
            deepest = -work.corner[i, WALL_GAP]
            for k in range(3):
                back[k] = deepest * work.contact[NORMAL, n, k]
        for k in range(3):
            work.contact[VELOCITY, n, k] = 0.0
        work.law[RESTITUTION, n], work.law[FRICTION, n] = wall.restitution, wall.friction
        n += 1
    for k in range(3):
        part.position[k] += back[k]
    return n


@compiled
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


@compiled
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
