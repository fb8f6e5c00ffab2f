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
mesh_cube         a cube, given as a mesh, falls on one of its edges, which sticks: a rigid body's impact in a plane
two_axes          a nut on a tray that moves in an ellipse of x and z and never throws it: an ODE of stick and slip
fast_slip         a nut slides on a tray that shakes along at kHz with the speed V: friction opposes what is left of it
                  over a period, v' = -mu g 2/pi asin(v/V). With u = asin(v/V) and T = pi V / (2 mu g) that is
                  t = T (Ci(u0) - Ci(u)) and a way of T V / 2 (Si(2 u0) - Si(2 u))
piston_zero       a nut on a plate that moves up and down as a whole: no direction is preferred, its mean drift is 0
drift             transport speed of a nut on a standing wave: ensembles of the impulse engine, and measurements
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

from chart_cases import APPROACH, BALL_HZ, BALL_UM, FRICTION, RESTITUTION, SLIDE_MM_S, ball_height
from scipy.optimize import brentq
from scipy.special import sici

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.statistic import Statistic

BALL_RADIUS = 1.5e-3  # [m]
STICK_SPEED = 0.2  # [m/s]
REST_SPEED, REST_S, CREEP_S = 0.2, 0.2, 0.5  # [m/s]; [s] when the nut has stopped, and when its creep is measured
PLATE_SPEED, PLATE_DROP = 0.5, 1e-3  # [m/s], [m]
THROW_UM = 200.0
PISTON_HZ, PISTON_UM, PISTON_S = 4750.0, 1.0, 5.0
CUBE_SIDE, CUBE_TILT_DEG = 4e-3, 30.0  # [m]; about y
TRAY_HZ, TRAY_UM, TRAY_PHASE_DEG, TRAY_THROW = 50.0, 200.0, 60.0, 0.8  # x = A sin(w t + phase), z'' is up to 0.8 g
TRAY_FROM_S, TRAY_S = 0.5, 1.0  # [s] over which its speed is measured
FAST_HZ, FAST_UM, FAST_SPEED = 4000.0, 2.5, 0.03  # and the speed of the nut at first [m/s]
FAST_EARLY_S, FAST_S = 0.03, 0.1  # [s] when its way is measured

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
    "mesh_cube",
    "two_axes",
    "fast_slip",
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
    cube_up, cube_along, cube_spin = cube_velocities()
    fast = "T V / 2 (Si(2 u0) - Si(2 u))"
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
        closed("mesh_cube", "upward_velocity", "m/s", cube_up, "p_z / m - v"),
        closed("mesh_cube", "velocity_along", "m/s", cube_along, "p_x / m"),
        closed("mesh_cube", "spin", "rad/s", cube_spin, "(r x p) / I"),
        closed("two_axes", "speed", "mm/s", 1e3 * tray_speed(), "ODE of a point that sticks and slips"),
        closed("fast_slip", "early_way", "mm", 1e3 * fast_way(FAST_EARLY_S), fast),
        closed("fast_slip", "way", "mm", 1e3 * fast_way(FAST_S), fast),
    ]


def cube_corner() -> tuple[float, float]:
    """From the centre of the tilted cube to the edge that lands: along x, and down [m]."""
    turn = math.radians(45.0 - CUBE_TILT_DEG)
    return CUBE_SIDE / math.sqrt(2.0) * math.sin(turn), CUBE_SIDE / math.sqrt(2.0) * math.cos(turn)


def cube_velocities() -> tuple[float, float, float]:
    """Up, along x [m/s] and about y [rad/s] after the impact: the edge leaves with e v, and sticks."""
    (x, z), per_moment, change = cube_corner(), 6.0 / CUBE_SIDE**2, (1.0 + RESTITUTION) * APPROACH
    up_up, along, mixed = 1.0 + x * x * per_moment, 1.0 + z * z * per_moment, x * z * per_moment
    p_z = change / (up_up - mixed * mixed / along)
    p_x = -p_z * mixed / along
    assert abs(p_x) < FRICTION * p_z
    return p_z - APPROACH, p_x, -(z * p_x + x * p_z) * per_moment


def tray_height() -> float:
    """Amplitude of the height of the tray of `two_axes` [m]."""
    return TRAY_THROW * GRAVITY / (2.0 * math.pi * TRAY_HZ) ** 2


@cache
def tray_speed(steps: int = 10_000, settled: int = 15) -> float:
    """Mean speed [m/s] of a point that sticks or slips over a late period, from rest; exact but where that changes."""
    omega, phase = 2.0 * math.pi * TRAY_HZ, math.radians(TRAY_PHASE_DEG)
    dt, speed, way = 1.0 / (TRAY_HZ * steps), 0.0, 0.0
    rise = tray_height() * omega
    for i in range((settled + 1) * steps):
        t = (i + 1) * dt
        pushed = GRAVITY * dt + rise * (math.cos(omega * t) - math.cos(omega * (t - dt)))
        most, tray = FRICTION * pushed, 1e-6 * TRAY_UM * omega * math.cos(omega * t + phase)
        new = min(max(tray, speed - most), speed + most)
        way += 0.5 * dt * (speed + new) if i >= settled * steps else 0.0
        speed = new
    return way * TRAY_HZ


def fast_way(t: float) -> float:
    """Way [m] of the nut of `fast_slip` at a time [s]."""
    shaken = 2.0 * math.pi * FAST_HZ * 1e-6 * FAST_UM
    first, scale = math.asin(FAST_SPEED / shaken), math.pi * shaken / (2.0 * FRICTION * GRAVITY)
    now = brentq(lambda u: scale * (sici(first)[1] - sici(u)[1]) - t, 1e-9, first)
    return float(0.5 * scale * shaken * (sici(2.0 * first)[0] - sici(2.0 * now)[0]))


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
