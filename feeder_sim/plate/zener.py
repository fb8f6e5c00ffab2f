"""Restitution of an elastic ball on a plate that carries the energy of the impact away as bending waves (Zener).

The ball, of mass m and radius R, indents the plate by s = z_b - w under the force F = k s^(3/2) (Hertz),

    k = 4/3 E* sqrt(R),   1/E* = 1/E1' + 1/E2',   E' = E / (1 - nu^2),

and the plate gives way as an infinite thin one does under a force at a point: dw/dt = F / Z with Z = 8 sqrt(rho h D),
which is real. From m z_b'' = -F follows s'' = -F/m - F'/Z. With s = v T sigma, t = T tau and T = (m/k)^(2/5) v^(-1/5)

    sigma'' + (1 + lambda d/dtau) sigma^(3/2) = 0,   sigma(0) = 0,  sigma'(0) = 1,   lambda = m / (Z T)

(Zener, Phys. Rev. 59 (1941) 669). Written out, with 1 for the ball and 2 for the plate of thickness h,

    lambda = pi^(3/5)/sqrt(3) (R/h)^2 (v sqrt(rho2/E2'))^(1/5) (rho1/rho2)^(3/5) (E1'/(E1' + E2'))^(2/5).

The ball leaves when the force is gone, with e = -sigma'. Small losses are the work of the damping
along the motion without it, e = 1 - c lambda with c = 6/5 (5/4)^(3/5) B(3/5, 3/2) = 1.730. With large ones ball and
plate creep apart and part late: with sigma = lambda^-4 y and tau = lambda x the end of it no longer depends on lambda,
so that e = 0.6793 lambda^-5.

No plasticity, and no wave that comes back from an edge.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.materials import Material
from feeder_sim.plate.rectangle import RectangularPlate

TABLE_POINTS, TABLE_END = 513, 100.0  # of e(lambda), even in log(1 + lambda)
TABLE_STEP = math.log1p(TABLE_END) / (TABLE_POINTS - 1)
LARGE, LARGE_FACTOR = 5.0, 0.67929306  # lambda from which e = factor lambda^-5, to 1e-8
NODES = 28  # of the polynomial in log(1 + lambda) below that
LONGEST = 30.0  # of an impact, over T (1 + lambda)^2; without losses it takes 3.22 T


def restitution(inelasticity: float) -> float:
    """Restitution e(lambda) of Zener's equation, by integration.

    Raises:
        ValueError: lambda is negative.
    """
    from scipy.integrate import solve_ivp

    if inelasticity < 0.0:
        raise ValueError(f"inelasticity is {inelasticity}, must be at least 0")
    if inelasticity > LARGE:
        return LARGE_FACTOR * inelasticity**-5

    def motion(_: float, state: NDArray[np.float64]) -> list[float]:  # indentation, velocity of the ball
        force = max(state[0], 0.0) ** 1.5
        return [state[1] - inelasticity * force, -force]

    def parted(_: float, state: NDArray[np.float64]) -> float:
        return float(state[0])

    parted.terminal, parted.direction = True, -1.0  # type: ignore[attr-defined]
    end = LONGEST * (1.0 + inelasticity) ** 2
    solution = solve_ivp(motion, (0.0, end), [0.0, 1.0], method="LSODA", events=parted, rtol=1e-11, atol=1e-14)
    return min(1.0, -float(solution.y[1, -1]))


@functools.cache
def log_restitution_table() -> NDArray[np.float64]:
    """Log of e, even in log(1 + lambda) from 0 to TABLE_END, shape (TABLE_POINTS,); linear in between to 1e-4."""
    from numpy.polynomial import Chebyshev

    def log_restitution(place: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([math.log(restitution(math.expm1(x))) for x in place])

    place = TABLE_STEP * np.arange(TABLE_POINTS)
    small = place < math.log1p(LARGE)
    table = np.empty(TABLE_POINTS)
    table[small] = Chebyshev.interpolate(log_restitution, NODES, [0.0, math.log1p(LARGE)])(place[small])
    table[~small] = math.log(LARGE_FACTOR) - 5.0 * np.log(np.expm1(place[~small]))
    table[0] = 0.0
    return table


def plane_modulus(material: Material) -> float:
    """E' = E / (1 - nu^2) [Pa].

    Raises:
        InputError: an orthotropic material, for which contact and plate have no one modulus.
    """
    if not material.isotropic:
        raise InputError('is "zener", must be a number for an orthotropic material', key="contact.restitution")
    return material.youngs_modulus / (1.0 - material.poisson_ratio**2)


def contact_stiffness(ball: Material, radius: float, plate: Material) -> float:
    """Hertz's k of F = k s^(3/2), for a ball of a radius [m] on a flat [N/m^(3/2)]; errors as `plane_modulus`."""
    reduced = 1.0 / (1.0 / plane_modulus(ball) + 1.0 / plane_modulus(plate))
    return 4.0 / 3.0 * reduced * math.sqrt(radius)


def point_impedance(plate: RectangularPlate) -> float:
    """Z = 8 sqrt(rho h D) of an infinite thin plate under a force at a point [kg/s]."""
    return 8.0 * math.sqrt(plate.mass_per_area * plate.bending_stiffness)


def contact_time(ball: Material, radius: float, plate: Material, speed: float) -> float:
    """The unit T of time of an impact [s]; without losses it takes 3.218 T. Errors as `plane_modulus`."""
    stiffness = contact_stiffness(ball, radius, plate)
    return (ball_mass(ball, radius) / stiffness) ** 0.4 * speed**-0.2


def inelasticity(ball: Material, radius: float, plate: RectangularPlate, speed: float = 1.0) -> float:
    """Zener's lambda of a ball of a radius [m] at a normal speed [m/s]; it grows with the fifth root of the speed.

    Raises:
        InputError: an orthotropic material.
    """
    unit = contact_time(ball, radius, plate.material, speed)
    return ball_mass(ball, radius) / (point_impedance(plate) * unit)


def ball_mass(ball: Material, radius: float) -> float:
    """Mass of a solid ball [kg]."""
    return 4.0 / 3.0 * math.pi * radius**3 * ball.density
