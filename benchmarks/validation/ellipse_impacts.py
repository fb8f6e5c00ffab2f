"""859 measured planar impacts of an ellipse against laws of impact.

    python benchmarks/validation/ellipse_impacts.py [--data FILE] [--json] [--compare] [--picture FILE]

Prints the median error of the velocity change over the measured velocity change, angular velocity weighed by the radius
of gyration, for the engine's law (Newton, Coulomb) with one restitution and one friction for all impacts. `--compare`
fits the constants of four laws to one half of the impacts each, and tries them on the other half.

Data: N. Fazeli, in DAIRLab/ImpactModeling (README.md). A body of mass m and moment of inertia I
touches at the point (x_c, -H) from its centre; per unit mass the impulse (p_t, p_n) changes

    v_x by p_t,  v_y by p_n,  omega by (m / I) (x_c p_n + H p_t),

the velocity of the point by K p, with K_tt = 1 + H^2 m/I, K_nn = 1 + x_c^2 m/I, K_tn = H x_c m/I. The laws differ in
what they say of the impulse; the error of a prediction is |predicted - measured| / |measured| of the change of
(v_x, v_y, r omega), with the radius of gyration r = sqrt(I/m).
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from arguments import new_file
from numpy.typing import NDArray
from single_impacts import after_impacts

from feeder_sim.document.figure import empty_figure
from feeder_sim.errors import InputError

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
        raise InputError(f"holds {error}, must be numbers in {', '.join(names)}", file=path) from None
    if values.ndim != 2 or not np.isfinite(values).all():
        raise InputError("holds no row, or what is not finite, must be finite numbers", file=path)
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
    return _by_engine(impacts, e, mu, inverse_inertia, poisson=False)


def poisson(impacts: EllipseImpacts, e: float, mu: float) -> Vector:
    """As `newton`, by Poisson's restitution: the normal impulse of restitution is e times that of compression."""
    return _by_engine(impacts, e, mu, INVERSE_INERTIA, poisson=True)


def _by_engine(
    impacts: EllipseImpacts, e: float | Vector, mu: float, inverse_inertia: float, *, poisson: bool
) -> NDArray[np.float64]:
    n, arm = len(impacts.theta), np.zeros((len(impacts.theta), 3))
    velocity, spin = np.zeros((n, 3)), np.zeros((n, 3))
    velocity[:, :2], spin[:, 2], arm[:, :2] = impacts.before[:, :2], impacts.before[:, 2], impacts.arm
    up = np.array([0.0, 1.0, 0.0])
    v, w = after_impacts(velocity, spin, arm, up, inverse_inertia, np.broadcast_to(e, n), mu, poisson=poisson)
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


COLOURS = ("#be3434", "#3a60be", "#e08a1e", "#3a8a5a")


def draw_ellipse_impacts(impacts: EllipseImpacts, laws: Sequence[Comparison], path: Path) -> None:
    """Draw predicted over measured changes of velocity, and the share of impacts over the error by each law."""
    figure = empty_figure(9.0, 4.2)
    left, right = figure.subplots(1, 2)
    weight = np.array([1.0, 1.0, INVERSE_INERTIA**-0.5])
    predicted = newton(impacts, RESTITUTION, FRICTION)
    measured = (impacts.after - impacts.before) * weight
    for k, name in enumerate(("along the surface", "normal to it", "spin, times radius of gyration")):
        left.plot(measured[:, k], predicted[:, k] * weight[k], ".", color=COLOURS[k], markersize=2.5, label=name)
    ends = np.array([measured.min(), measured.max()])
    left.plot(ends, ends, color="black", linewidth=0.8)
    left.set(xlabel="measured change of velocity (m/s)", ylabel="predicted (m/s)")
    left.set_title(f"Newton and Coulomb, e {RESTITUTION:g}, mu {FRICTION:g}", fontsize=10)
    held_out, share = impacts[1::2], (np.arange(len(impacts.theta[1::2])) + 1.0) / len(impacts.theta[1::2])
    for law, colour in zip(laws, COLOURS, strict=True):
        errors = np.sort(error_shares(held_out, law.law.predict(held_out, *law.constants.values())))
        right.plot(100.0 * errors, 100.0 * share, color=colour, label=f"{law.law.name}, {len(law.constants)} constants")
    right.set(
        xlabel="error over measured change (%)", ylabel="share of impacts (%)", xlim=(0.0, 25.0), ylim=(0.0, 100.0)
    )
    right.set_title("constants from one half, errors of the other", fontsize=10)
    for axes in (left, right):
        axes.grid(True, alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)


DATA = Path(__file__).with_suffix(".csv")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--compare", action="store_true", help="four laws, each with constants of its own")
    parser.add_argument(
        "--picture", type=new_file, help="draw measured and predicted changes, and the errors of the laws"
    )
    options = parser.parse_args()
    try:
        impacts = read_impacts(options.data)
        if len(impacts.arm) < 2 and (options.compare or options.picture):
            raise InputError("holds one impact, must be two and more where laws are compared", file=options.data)
    except InputError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    errors = error_shares(impacts, newton(impacts, RESTITUTION, FRICTION))
    alike = error_shares(impacts, newton(impacts, RESTITUTION, FRICTION, HOMOGENEOUS), HOMOGENEOUS)
    slopes = torque_slopes(impacts)
    found: dict[str, Any] = {
        "median_error_share": float(np.median(errors)),
        "n": len(errors),
        "upper_quartile": float(np.quantile(errors, 0.75)),
        "restitution": RESTITUTION,
        "friction": FRICTION,
        "mass_over_inertia_1_m2": INVERSE_INERTIA,
        "mass_over_inertia_measured_1_m2": slopes,
        "median_error_share_homogeneous": float(np.median(alike)),
    }
    laws = compare(impacts) if options.compare or options.picture else []
    if laws:
        found["laws"] = {law.law.name: _row(law) for law in laws}
    if options.picture:
        draw_ellipse_impacts(impacts, laws, options.picture)
    print(json.dumps(found) if options.json else _text(found))
    return 0


def _row(law: Comparison) -> dict[str, Any]:
    return {"constants": law.constants, "median_fitted_half": law.fitted, "median_other_half": law.held_out}


def _text(found: dict[str, Any]) -> str:
    lines = [
        f"{found['n']} impacts, e {RESTITUTION:g}, mu {FRICTION:g}: median error {found['median_error_share']:.2%} of "
        f"the velocity change, upper quartile {found['upper_quartile']:.2%}",
        f"m / I from the spins {found['mass_over_inertia_measured_1_m2'][0]:.0f} and "
        f"{found['mass_over_inertia_measured_1_m2'][1]:.0f} 1/m2, used {INVERSE_INERTIA:g}; homogeneous "
        f"{HOMOGENEOUS:.0f}: {found['median_error_share_homogeneous']:.2%}",
    ]
    for name, row in found.get("laws", {}).items():
        constants = ", ".join(f"{key} {value:.3f}" for key, value in row["constants"].items())
        halves = f"{row['median_fitted_half']:.2%}, other half {row['median_other_half']:.2%}"
        lines.append(f"{name} ({constants}): fitted half {halves}")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
