"""A dimer in a plane on a plate that moves up and down, by steps of a microsecond: a small program of its own.

Shares no code with the engines. After every step each ball that is below the plate and approaches it gets an impulse,
one after the other, by Newton's or Poisson's restitution (vertex_impacts.py). Balls are not put back.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from vertex_impacts import newton_impulse, poisson_impulse

from feeder_sim.constants import GRAVITY
from feeder_sim.machine_code import entry_point


class Shape(NamedTuple):
    """Radius of the balls and distance of their centres [m], and moment of inertia over mass [m^2]."""

    radius: float
    apart: float
    inertia: float


class Shaker(NamedTuple):
    """Amplitude [m] and circular frequency [1/s] of the plate."""

    amplitude: float
    omega: float


@entry_point
def drift_by_steps(shape, shaker, law, rise, step, periods):
    """Mean speed over the second half of the time [m/s], positive toward the ball that starts higher.

    law: `Law`; rise: of that ball at its start over the other one, which is on the plate [m]. step: [s].
    """
    turn = math.asin(rise / shape.apart)  # of the axis; the ball at -x is up
    x, z = 0.0, shape.radius + 0.5 * rise
    vx = vz = spin = half_way = 0.0
    period = 2.0 * math.pi / shaker.omega
    n = int(periods * period / step)
    for i in range(1, n + 1):
        t = i * step
        x, z, turn = x + vx * step, z + vz * step - 0.5 * GRAVITY * step * step, turn + spin * step
        vz -= GRAVITY * step
        height = shaker.amplitude * math.sin(shaker.omega * t)
        rate = shaker.amplitude * shaker.omega * math.cos(shaker.omega * t)
        for side in (-0.5, 0.5):
            along, up = side * shape.apart * math.cos(turn), -side * shape.apart * math.sin(turn) - shape.radius
            approach = vz - spin * along - rate
            if z + up < height and approach < 0.0:
                m = 1.0 + up * up / shape.inertia, 1.0 + along * along / shape.inertia, along * up / shape.inertia
                if law.poisson:
                    tangential, normal = poisson_impulse(vx + spin * up, approach, m, law.friction, law.restitution)
                else:
                    tangential, normal = newton_impulse(vx + spin * up, approach, m, law.friction, law.restitution)
                vx, vz = vx + tangential, vz + normal
                spin += (up * tangential - along * normal) / shape.inertia
        if i == n // 2:
            half_way = x
    return -(x - half_way) / ((n - n // 2) * step)
