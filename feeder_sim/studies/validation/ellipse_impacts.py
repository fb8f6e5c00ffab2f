"""How well laws of impact predict measured planar impacts of an ellipse on a flat surface at rest.

Data: N. Fazeli, in DAIRLab/ImpactModeling (benchmarks/validation/README.md). A body of mass m and moment of inertia I
touches at the point (x_c, -H) from its centre; per unit mass the impulse (p_t, p_n) changes

    v_x by p_t,  v_y by p_n,  omega by (m / I) (x_c p_n + H p_t),

the velocity of the point by K p, with K_tt = 1 + H^2 m/I, K_nn = 1 + x_c^2 m/I, K_tn = H x_c m/I. The laws differ in
what they say of the impulse; the error of a prediction is |predicted - measured| / |measured| of the change of
(v_x, v_y, r omega), with the radius of gyration r = sqrt(I/m).
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.single_impacts import after_impacts
from feeder_sim.errors import InputError
from feeder_sim.studies.validation.vertex_impacts import poisson_impulse

SEMI_AXES = 0.035, 0.025  # [m]
# Mass over moment of inertia [1/m^2]: what the measured spins say (`torque_slopes`); 2162 if homogeneous.
INVERSE_INERTIA = 2560.0
HOMOGENEOUS = 4.0 / (SEMI_AXES[0] ** 2 + SEMI_AXES[1] ** 2)
RESTITUTION, FRICTION = 0.54, 0.20
BEFORE, AFTER = ("vx_m_s", "vy_m_s", "omega_rad_s"), ("after_vx_m_s", "after_vy_m_s", "after_omega_rad_s")
MIRRORED = np.array([-1.0, 1.0, 1.0])  # the data have x to the left of theta's sense
ROUNDS = 3  # of a search from the best point so far
Vector = NDArray[np.float64]


@dataclass(frozen=True)
class EllipseImpacts:
    """Measured impacts, x to the right where theta turns from x to y.

    Attributes:
        theta: attitudes (n,) [rad].
        before, after: velocities v_x, v_y [m/s] and omega [rad/s], (n, 3) each.
    """

    theta: Vector
    before: Vector
    after: Vector

    def __getitem__(self, rows: slice) -> EllipseImpacts:
        return EllipseImpacts(self.theta[rows], self.before[rows], self.after[rows])

    @property
    def arm(self) -> Vector:
        """From the centre to the contact point (n, 2) [m], the lowest one of the ellipse."""
        (a, b), sine, cosine = SEMI_AXES, np.sin(self.theta), np.cos(self.theta)
        height = np.hypot(a * sine, b * cosine)
        return np.stack([-(a**2 - b**2) * sine * cosine / height, -height], axis=1)

    @property
    def at_contact(self) -> Vector:
        """Tangential and normal velocity of the contact point before the impact (n, 2) [m/s]."""
        omega, arm = self.before[:, 2], self.arm
        return self.before[:, :2] + np.stack([-omega * arm[:, 1], omega * arm[:, 0]], axis=1)


def read_impacts(path: Path) -> EllipseImpacts:
    """Read the table of impacts.

    Raises:
        InputError: no such file, a column that is missing, or an entry that is no finite number.
    """
    try:
        rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("cannot be read", file=path) from error
    names = ["theta_rad", *BEFORE, *AFTER]
    try:
        values = np.array([[float(row[name]) for name in names] for row in rows])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"holds {error}, allowed are numbers in {', '.join(names)}", file=path) from None
    if values.ndim != 2 or not np.isfinite(values).all():
        raise InputError("holds no row, or what is not finite, allowed are finite numbers", file=path)
    return EllipseImpacts(values[:, 0], values[:, 1:4] * MIRRORED, values[:, 4:] * MIRRORED)


def torque_slopes(impacts: EllipseImpacts) -> tuple[float, float]:
    """Mass over moment of inertia as the measured spins have it [1/m^2].

    The slopes of the change of omega over the torques of the normal and of the tangential impulse, by least squares.
    """
    change, arm = impacts.after - impacts.before, impacts.arm
    terms = np.stack([arm[:, 0] * change[:, 1], -arm[:, 1] * change[:, 0]], axis=1)
    normal, tangential = np.linalg.lstsq(terms, change[:, 2], rcond=None)[0]
    return float(normal), float(tangential)


def error_shares(impacts: EllipseImpacts, change: Vector, inverse_inertia: float = INVERSE_INERTIA) -> Vector:
    """Errors (n,) of predicted changes of velocity (n, 3) over the measured changes [1]."""
    weight = np.array([1.0, 1.0, inverse_inertia**-0.5])
    measured = impacts.after - impacts.before
    errors = np.linalg.norm((change - measured) * weight, axis=1) / np.linalg.norm(measured * weight, axis=1)
    return np.asarray(errors, float)


def newton(
    impacts: EllipseImpacts, e: float | Vector, mu: float, inverse_inertia: float = INVERSE_INERTIA
) -> NDArray[np.float64]:
    """Changes of velocity (n, 3) by Newton's restitution and Coulomb's cone, from the engine's compiled function."""
    n, arm = len(impacts.theta), np.zeros((len(impacts.theta), 3))
    velocity, spin = np.zeros((n, 3)), np.zeros((n, 3))
    velocity[:, :2], spin[:, 2], arm[:, :2] = impacts.before[:, :2], impacts.before[:, 2], impacts.arm
    up = np.array([0.0, 1.0, 0.0])
    v, w = after_impacts(velocity, spin, arm, up, inverse_inertia, np.broadcast_to(e, n), mu)
    return np.stack([v[:, 0], v[:, 1], w[:, 2]], axis=1) - impacts.before


def newton_by_speed(impacts: EllipseImpacts, e: float, slope: float, mu: float) -> Vector:
    """As `newton`, with a restitution that falls by `slope` per m/s from e at the mean speed of 2.57 m/s."""
    speed = -impacts.at_contact[:, 1]
    return newton(impacts, np.clip(e - slope * (speed - MEAN_SPEED), 0.0, 1.0), mu)


MEAN_SPEED = 2.57  # [m/s]; normal approach of the contact point in the data


def newton_with_tangential(impacts: EllipseImpacts, e: float, mu: float, beta: float) -> Vector:
    """As `newton`, but what does not slip leaves with -beta times its tangential velocity."""
    tt, tn, nn = mobility(impacts)
    u_t, u_n = impacts.at_contact.T
    r_t, r_n = -(1.0 + beta) * u_t, -(1.0 + e) * u_n
    p_t, p_n = (nn * r_t - tn * r_n), (tt * r_n - tn * r_t)
    side = np.sign(p_t)  # over the same positive determinant
    slips = np.abs(p_t) > mu * p_n
    determinant = tt * nn - tn**2
    pressed = np.where(slips, r_n / (nn + side * mu * tn), p_n / determinant)
    return _change(impacts, np.where(slips, side * mu * pressed, p_t / determinant), pressed)


def poisson(impacts: EllipseImpacts, e: float, mu: float) -> Vector:
    """Poisson's restitution: the normal impulse of restitution is e times that of compression."""
    rows, impulse_of = zip(*mobility(impacts), *impacts.at_contact.T, strict=True), cast(Any, poisson_impulse).py_func
    impulse = np.array([impulse_of(u_t, u_n, (tt, nn, -tn), mu, e) for tt, tn, nn, u_t, u_n in rows])
    return _change(impacts, impulse[:, 0], impulse[:, 1])


def mobility(impacts: EllipseImpacts) -> tuple[Vector, Vector, Vector]:
    """The inverse effective masses K_tt, K_tn, K_nn of a unit mass, (n,) each [1]."""
    x, height = impacts.arm[:, 0], -impacts.arm[:, 1]
    return 1.0 + INVERSE_INERTIA * height**2, INVERSE_INERTIA * height * x, 1.0 + INVERSE_INERTIA * x**2


def _change(impacts: EllipseImpacts, p_t: Vector, p_n: Vector) -> Vector:
    arm = impacts.arm
    return np.stack([p_t, p_n, INVERSE_INERTIA * (arm[:, 0] * p_n - arm[:, 1] * p_t)], axis=1)


@dataclass(frozen=True)
class Law:
    """A law of impact: its name, what it predicts, and its constants with the first guess of each."""

    name: str
    predict: Callable[..., Vector]
    constants: dict[str, float]


LAWS = (
    Law("Newton", newton, {"e": RESTITUTION, "mu": FRICTION}),
    Law("Poisson", poisson, {"e": RESTITUTION, "mu": FRICTION}),
    Law("Newton, tangential", newton_with_tangential, {"e": RESTITUTION, "mu": FRICTION, "beta": 0.1}),
    Law("Newton, e by speed", newton_by_speed, {"e": RESTITUTION, "slope_s_m": 0.09, "mu": FRICTION}),
)


@dataclass(frozen=True)
class Comparison:
    """A law with constants fitted to one half of the impacts, and its median errors on both halves [1]."""

    law: Law
    constants: dict[str, float]
    fitted: float
    held_out: float


def compare(impacts: EllipseImpacts, laws: Sequence[Law] = LAWS) -> list[Comparison]:
    """Fit the constants of each law to every second impact, by the least median error, and try them on the others."""
    return [_compare(law, impacts[::2], impacts[1::2]) for law in laws]


def _compare(law: Law, fitted: EllipseImpacts, held_out: EllipseImpacts) -> Comparison:
    from scipy.optimize import minimize

    def median(constants: Vector, on: EllipseImpacts = fitted) -> float:
        return float(np.median(error_shares(on, law.predict(on, *np.clip(constants, 0.0, 1.0)))))

    best = np.array(list(law.constants.values()))
    for _ in range(ROUNDS):  # the median has kinks, in which a simplex gets stuck
        simplex = np.vstack([best, best + 0.05 * np.eye(len(best))])
        best = minimize(median, best, method="Nelder-Mead", options={"initial_simplex": simplex, "xatol": 1e-4}).x
    best = np.clip(best, 0.0, 1.0)
    constants = dict(zip(law.constants, map(float, best), strict=True))
    return Comparison(law, constants, median(best), median(best, held_out))
