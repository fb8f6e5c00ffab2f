"""Cases of the conformance set: constants, closed forms, and the rows that an engine is judged by.

All have g = 9.81 m/s2, restitution e = 0.2 and friction mu = 0.3. With the speed of impact v:

rebound           a nut that lands flat leaves with e v, without spin and straight up
slide             a ball that slides throughout leaves with e v, v_t - mu (1+e) v along, spin 5/2 mu (1+e) v / r
oblique_sticking  a ball that sticks leaves rolling: 5/7 v_t along, spin 5/7 v_t / r
slide_to_rest     a nut on a plate at rest stops after v^2 / (2 mu g), and then stays there
rising_plate      a ball falls by h onto a plate that rises at U: v = sqrt(U^2 + 2 g h), it leaves with U + e v
throw             a ball on a plate A sin(w t) too slow for bounces without rest: it lifts off where the plate
                  accelerates downward at g, sin(phi) = g / (A w^2), and rises to A sin(phi) + (A w cos(phi))^2 / 2 g
bouncing_ball     period one (Holmes 1982): see `benchmarks/chart_cases.py`
piston_zero       a nut on a plate that moves up and down as a whole: no direction is preferred, its mean drift is 0
drift             transport speed of a nut on a standing wave: ensembles of the impulse engine, and measurements
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chart_cases import APPROACH, BALL_HZ, BALL_UM, FRICTION, RESTITUTION, SLIDE_MM_S, ball_height

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.statistic import Statistic

BALL_RADIUS = 1.5e-3  # [m]
STICK_SPEED = 0.2  # [m/s]
REST_SPEED, REST_S, CREEP_S = 0.2, 0.2, 0.5  # [m/s]; [s] when the nut has stopped, and when its creep is measured
PLATE_SPEED, PLATE_DROP = 0.5, 1e-3  # [m/s], [m]
THROW_UM = 200.0
PISTON_HZ, PISTON_UM, PISTON_S = 4750.0, 1.0, 5.0

CLOSED_FORM = 0.02  # of the scale: half the width of the interval around a closed form
ZERO_SCALE_MM_S = 1.5  # drift at the frequency and amplitude of `piston_zero`, which its zero is compared with
T_FIVE = 2.571  # 95 % of Student's distribution with 5 degrees of freedom: mean of six runs
MEASURED = {"drift_4750": (1.44, 0.27), "drift_8775": (4.17, 0.64)}  # mean and SD of six runs [mm/s]
CASES = (
    "rebound",
    "slide",
    "oblique_sticking",
    "slide_to_rest",
    "rising_plate",
    "throw",
    "bouncing_ball",
    "piston_zero",
    "drift_4750",
    "drift_8775",
)


@dataclass(frozen=True)
class Row:
    """One quantity of a case.

    Attributes:
        case, quantity, unit: its names; a quantity may have several rows, with different sources.
        right, low, high: the right value and the interval of acceptance.
        scale: what a deviation is a percentage of.
        chance: whether the value is a mean over seeds, which needs a standard error.
        seed_sd: standard deviation of one seed, in the ensemble; 0 without chance.
        source: where the right value comes from.
        rule: where the interval comes from.
    """

    case: str
    quantity: str
    unit: str
    right: float
    low: float
    high: float
    scale: float
    chance: bool
    seed_sd: float
    source: str
    rule: str

    @property
    def basis(self) -> str:
        """First word of the source: "closed", "symmetry", "ensemble" or "measurement"."""
        return self.source.split(" ", 1)[0].rstrip(":;,")


def closed(case: str, quantity: str, unit: str, right: float, form: str, scale: float = 0.0) -> Row:
    """A row whose right value is a closed form; `scale` where that value is 0."""
    scale = scale or abs(right)
    half = CLOSED_FORM * scale
    rule = f"right +- {100 * CLOSED_FORM:g} % of the scale"
    return Row(case, quantity, unit, right, right - half, right + half, scale, False, 0.0, f"closed form: {form}", rule)


def closed_rows() -> list[Row]:
    """Rows that need no simulation, without those of the piston and the measurements."""
    v, e, mu, slide = APPROACH, RESTITUTION, FRICTION, 1e-3 * SLIDE_MM_S
    up, push = e * v, mu * (1.0 + e) * v
    onto = math.sqrt(PLATE_SPEED**2 + 2.0 * GRAVITY * PLATE_DROP)
    stop = 1e3 * REST_SPEED**2 / (2.0 * mu * GRAVITY)
    return [
        closed("rebound", "upward_velocity", "m/s", up, "e v"),
        closed("rebound", "sideways_velocity", "m/s", 0.0, "0", up),
        closed("rebound", "corner_velocity_by_spin", "m/s", 0.0, "0", up),
        closed("slide", "upward_velocity", "m/s", up, "e v"),
        closed("slide", "velocity_along", "m/s", slide - push, "v_t - mu (1+e) v"),
        closed("slide", "spin", "rad/s", 2.5 * push / BALL_RADIUS, "5/2 mu (1+e) v / r"),
        closed("oblique_sticking", "upward_velocity", "m/s", up, "e v"),
        closed("oblique_sticking", "velocity_along", "m/s", 5.0 / 7.0 * STICK_SPEED, "5/7 v_t"),
        closed("oblique_sticking", "spin", "rad/s", 5.0 / 7.0 * STICK_SPEED / BALL_RADIUS, "5/7 v_t / r"),
        closed("slide_to_rest", "distance", "mm", stop, "v^2 / (2 mu g)"),
        closed("slide_to_rest", "creep", "mm/s", 0.0, "0", ZERO_SCALE_MM_S),
        closed("rising_plate", "upward_velocity", "m/s", PLATE_SPEED + e * onto, "U + e sqrt(U^2 + 2 g h)"),
        closed("throw", "top", "mm", 1e3 * throw_height(), "A sin(phi) + (A w cos(phi))^2 / 2 g"),
        closed("bouncing_ball", "top", "mm", 1e3 * ball_height(BALL_HZ, 1e-6 * BALL_UM, e), "g T^2 / 8 + A sin(phi)"),
    ]


def throw_height(frequency: float = BALL_HZ, amplitude: float = 1e-6 * THROW_UM) -> float:
    """Largest height [m] over the resting plate of a ball that lies on a plate [Hz], [m] when it is thrown."""
    omega = 2.0 * math.pi * frequency
    sine = GRAVITY / (amplitude * omega**2)
    return amplitude * sine + (amplitude * omega) ** 2 * (1.0 - sine**2) / (2.0 * GRAVITY)


def zero_rows(seed_sd: float) -> list[Row]:
    """Drift on the piston, in both directions; seed_sd: of one seed [mm/s]."""
    half = CLOSED_FORM * ZERO_SCALE_MM_S
    rule = f"0 +- {100 * CLOSED_FORM:g} % of the drift on a standing wave of this frequency and amplitude"
    return [
        Row("piston_zero", f"drift_{axis}", "mm/s", 0.0, -half, half, ZERO_SCALE_MM_S, True, seed_sd, "symmetry", rule)
        for axis in "xy"
    ]


def ensemble_row(case: str, curved: Statistic, tangent: Statistic, steps: int) -> Row:
    """Transport speed by ensembles of the impulse engine [mm/s] at `steps` per period.

    A rigid plane under the part instead of the curved surface is a fair model, so both count as right.
    """
    ends = [found.mean + sign * 2.0 * found.se for found in (curved, tangent) for sign in (-1.0, 1.0)]
    source = (
        f"ensemble of the impulse engine at {steps} steps per period: "
        f"curved surface {curved.mean:.4f} +- {curved.se:.4f} (SE) of {curved.n} seeds, "
        f"plane under the part {tangent.mean:.4f} +- {tangent.se:.4f} of {tangent.n}"
    )
    rule = "both means, the curved surface's and the plane's, +- 2 SE"
    mean, sd = curved.mean, curved.sd
    return Row(case, "transport_speed", "mm/s", mean, min(ends), max(ends), abs(mean), True, sd, source, rule)


def measured_rows(seed_sd: dict[str, float]) -> list[Row]:
    """Transport speeds as measured; seed_sd: of one computed seed of each case [mm/s]."""
    rows = []
    for case, (mean, sd) in MEASURED.items():
        half = T_FIVE * sd / math.sqrt(6.0)
        source = f"measurement: {mean:g} +- {sd:g} (SD) of six runs, EPFL thesis 7124 (2016)"
        rule = "95 % interval of the mean by Student's t"
        interval = (mean - half, mean + half)
        rows.append(Row(case, "transport_speed", "mm/s", mean, *interval, mean, True, seed_sd[case], source, rule))
    return rows
