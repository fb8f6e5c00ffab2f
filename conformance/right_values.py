"""Right values of the conformance set by closed forms and laws, and the check that cases.csv has them.

    python conformance/right_values.py            # exit code 1 if cases.csv differs
    python conformance/right_values.py --write    # write it again; ensembles stay as they are there

With the speed of impact v, restitution e, friction mu:

rebound           a nut that lands flat leaves with e v, without spin and straight up
slide             a ball that slides throughout leaves with e v, v_t - mu (1+e) v along, spin 5/2 mu (1+e) v / r
oblique_sticking  a ball that sticks leaves rolling: 5/7 v_t along, spin 5/7 v_t / r
slide_to_rest     a nut on a plate at rest stops after v^2 / (2 mu g), and then stays there
rising_plate      a ball falls by h onto a plate that rises at U: v = sqrt(U^2 + 2 g h), it leaves with U + e v
throw             a ball on a plate A sin(w t) too slow for bounces without rest: it lifts off where the plate
                  accelerates downward at g, sin(phi) = g / (A w^2), and rises to A sin(phi) + (A w cos(phi))^2 / 2 g
bouncing_ball     period one (Holmes 1982): the plate moves at w = g T/2 (1-e)/(1+e) when it is hit, so that the ball
                  rises to g T^2/8 + A sin(phi) with A omega cos(phi) = w
mesh_cube         a cube falls on one of its edges, which sticks: a rigid body's impact in a plane
two_parts         equal balls part with e times their approach; the impulse is J = (1+e) v m / 2 along their centres and
                  min(mu J, m v_t / 7) across, which turns both alike
energy            impacts with friction give no energy, whatever the attitude: laws by Newton's restitution do
heap              nor does a heap on a plate at rest gain any; it comes to rest, and no part is in the plate or another
two_axes          a nut on a tray that moves in an ellipse of x and z and never throws it: an ODE of stick and slip
fast_slip         a nut slides on a tray that shakes along at kHz with the speed V: friction opposes what is left of it
                  over a period, v' = -mu g 2/pi asin(v/V). With u = asin(v/V) and T = pi V / (2 mu g) that is
                  t = T (Ci(u0) - Ci(u)) and a way of T V / 2 (Si(2 u0) - Si(2 u))
piston_zero       a nut on a plate that moves up and down as a whole: no direction is preferred, its mean drift is 0
drift             transport speed of a nut on a standing wave: ensembles of feeder_sim's impulse engine, measurements
blocks            shares of rolls that were measured (Budden, Math. Gaz. 64 (1980) 196)
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from case_files import (
    FOLDER,
    GRAVITY,
    RIGHT_VALUES,
    ConformanceError,
    Row,
    case,
    number,
    part,
    read_set,
    records,
    write_set,
)
from scipy.optimize import brentq
from scipy.special import sici

HALF_WIDTH = 0.02  # of the scale: half the interval around a closed form
ZERO_SCALE_MM_S = 1.5  # drift at the frequency and amplitude of `piston_zero`, which its zero is compared with
T_FIVE = 2.571  # 95 % of Student's distribution with 5 degrees of freedom: mean of six runs
MEASURED = {"drift_4750": (1.44, 0.27), "drift_8775": (4.17, 0.64)}  # mean and SD of six runs [mm/s]
MOST_GAIN, MOST_RESIDUAL = 1e-3, 1e-4  # energies of a heap, of that at its start
ROUNDING = 1e-6  # of the kinetic energy at the start, that an impact may seem to give
DEEPEST = 0.01  # of the side of a cube, in the plate or another
MOST_RMS = 0.05  # of shares of blocks
ENERGIES = ("energy_at_edge", "energy_at_corner", "energy_of_bounces")


def closed(name: str, quantity: str, right: float, form: str, scale: float = 0.0) -> Row:
    """A row whose right value is a closed form; `scale` where that value is 0."""
    scale = scale or abs(right)
    half, rule = HALF_WIDTH * scale, f"right +- {100 * HALF_WIDTH:g} % of the scale"
    source = f"closed form: {form}"
    return Row(name, quantity, unit(name, quantity), right, right - half, right + half, scale, False, 0.0, source, rule)


def unit(name: str, quantity: str) -> str:
    """Unit of a quantity of a case."""
    return str(case(name)["quantities"][quantity]["unit"])


def approach(name: str) -> float:
    """Speed [m/s] at which a part that falls on a plate at rest meets it."""
    return math.sqrt(2.0 * GRAVITY * 1e-3 * case(name)["start"][0]["height_mm"])


def contact(name: str) -> tuple[float, float]:
    """Restitution and friction of a case."""
    table = case(name)["contact"]
    return table["restitution"], table["friction"]


def along(name: str) -> float:
    """Velocity along x [m/s] of the first part at its start."""
    return float(case(name)["start"][0]["velocity_m_s"][0])


def closed_rows() -> list[Row]:
    """Rows by closed forms."""
    v, (e, mu) = approach("slide"), contact("slide")
    radius, push, stick = part("ball").radius, mu * (1.0 + e) * v, 5.0 / 7.0 * along("oblique_sticking")
    up = e * approach("rebound")
    plate = case("rising_plate")["plate"]["speed_m_s"]
    onto = math.hypot(plate, approach("rising_plate"))
    stop = 1e3 * along("slide_to_rest") ** 2 / (2.0 * contact("slide_to_rest")[1] * GRAVITY)
    cube_up, cube_along, cube_spin = cube_velocities()
    looks, fast = case("fast_slip"), "T V / 2 (Si(2 u0) - Si(2 u))"
    return [
        closed("rebound", "upward_velocity", up, "e v"),
        closed("rebound", "sideways_velocity", 0.0, "0", up),
        closed("rebound", "corner_velocity_by_spin", 0.0, "0", up),
        closed("slide", "upward_velocity", e * v, "e v"),
        closed("slide", "velocity_along", along("slide") - push, "v_t - mu (1+e) v"),
        closed("slide", "spin", 2.5 * push / radius, "5/2 mu (1+e) v / r"),
        closed("oblique_sticking", "upward_velocity", e * approach("oblique_sticking"), "e v"),
        closed("oblique_sticking", "velocity_along", stick, "5/7 v_t"),
        closed("oblique_sticking", "spin", stick / radius, "5/7 v_t / r"),
        closed("slide_to_rest", "distance", stop, "v^2 / (2 mu g)"),
        closed("slide_to_rest", "creep", 0.0, "0", ZERO_SCALE_MM_S),
        closed("rising_plate", "upward_velocity", plate + e * onto, "U + e sqrt(U^2 + 2 g h)"),
        closed("throw", "top", 1e3 * throw_height(*shaker("throw")), "A sin(phi) + (A w cos(phi))^2 / 2 g"),
        closed("bouncing_ball", "top", 1e3 * ball_height(*shaker("bouncing_ball"), e), "g T^2 / 8 + A sin(phi)"),
        closed("mesh_cube", "upward_velocity", cube_up, "p_z / m - v"),
        closed("mesh_cube", "velocity_along", cube_along, "p_x / m"),
        closed("mesh_cube", "spin", cube_spin, "(r x p) / I"),
        *meeting_rows(),
        closed("two_axes", "speed", 1e3 * tray_speed(), "ODE of a point that sticks and slips"),
        closed("fast_slip", "early_way", 1e3 * fast_way(looks["looks"]["early_s"]), fast),
        closed("fast_slip", "way", 1e3 * fast_way(looks["duration_s"]), fast),
    ]


def shaker(name: str) -> tuple[float, float]:
    """Frequency [Hz] and amplitude [m] of a plate that moves up and down."""
    plate = case(name)["plate"]
    return plate["frequency_hz"], 1e-6 * plate["z_um"]


def meeting_rows() -> list[Row]:
    """Two balls that meet along x."""
    first, second = (start["velocity_m_s"][0] for start in case("two_parts_meet")["start"])
    e, _ = contact("two_parts_meet")
    mean = 0.5 * (first + second)
    rows = [
        closed("two_parts_meet", "relative_velocity", e * (first - second), "e v"),
        closed("two_parts_meet", "mean_velocity", mean, "momentum is kept"),
    ]
    for name in ("two_parts_slide", "two_parts_stick"):
        (v, v_t, _), (e, mu) = case(name)["start"][0]["velocity_m_s"], contact(name)
        slides, sticks = 0.5 * mu * (1.0 + e) * v, v_t / 7.0
        assert (slides < sticks) == (name == "two_parts_slide")
        across, form = min((slides, "mu (1+e) v / 2"), (sticks, "v_t / 7"))
        rows += [
            closed(name, "relative_velocity", e * v, "e v"),
            closed(name, "velocity_along", across, form),
            closed(name, "spin", -2.5 * across / part("ball").radius, f"-5/2 ({form}) / r"),
        ]
    return rows


def cube_corner() -> tuple[float, float]:
    """From the centre of the tilted cube to the edge that lands: along x, and down [m]."""
    half_diagonal = 1e-3 * float(np.ptp(1e3 * part("cube").corners[:, 0])) / math.sqrt(2.0)
    turn = math.radians(45.0 - case("mesh_cube")["start"][0]["turn"]["deg"])
    return half_diagonal * math.sin(turn), half_diagonal * math.cos(turn)


def cube_velocities() -> tuple[float, float, float]:
    """Up, along x [m/s] and about y [rad/s] after the impact: the edge leaves with e v, and sticks."""
    (x, z), v, (e, mu), cube = cube_corner(), approach("mesh_cube"), contact("mesh_cube"), part("cube")
    per_moment, change = cube.mass / cube.inertia[1], (1.0 + e) * v
    up_up, along_along, mixed = 1.0 + x * x * per_moment, 1.0 + z * z * per_moment, x * z * per_moment
    p_z = change / (up_up - mixed * mixed / along_along)
    p_x = -p_z * mixed / along_along
    assert abs(p_x) < mu * p_z
    return float(p_z - v), float(p_x), float(-(z * p_x + x * p_z) * per_moment)


@cache
def tray_speed(steps: int = 10_000, settled: int = 15) -> float:
    """Mean speed [m/s] of a point that sticks or slips over a late period, from rest; exact but where that changes."""
    plate, mu = case("two_axes")["plate"], contact("two_axes")[1]
    frequency, phase = plate["frequency_hz"], math.radians(plate["x_phase_deg"])
    omega = 2.0 * math.pi * frequency
    dt, speed, way = 1.0 / (frequency * steps), 0.0, 0.0
    rise = 1e-6 * plate["z_um"] * omega
    for i in range((settled + 1) * steps):
        t = (i + 1) * dt
        pushed = GRAVITY * dt + rise * (math.cos(omega * t) - math.cos(omega * (t - dt)))
        most, tray = mu * pushed, 1e-6 * plate["x_um"] * omega * math.cos(omega * t + phase)
        new = min(max(tray, speed - most), speed + most)
        way += 0.5 * dt * (speed + new) if i >= settled * steps else 0.0
        speed = new
    return way * frequency


def fast_way(t: float) -> float:
    """Way [m] of the nut of `fast_slip` at a time [s]."""
    plate, mu = case("fast_slip")["plate"], contact("fast_slip")[1]
    shaken = 2.0 * math.pi * plate["frequency_hz"] * 1e-6 * plate["x_um"]
    first, scale = math.asin(along("fast_slip") / shaken), math.pi * shaken / (2.0 * mu * GRAVITY)
    now = brentq(lambda u: scale * (sici(first)[1] - sici(u)[1]) - t, 1e-9, first)
    return float(0.5 * scale * shaken * (sici(2.0 * first)[0] - sici(2.0 * now)[0]))


def throw_height(frequency: float, amplitude: float) -> float:
    """Largest height [m] over the resting plate of a ball that lies on a plate [Hz], [m] when it is thrown."""
    omega = 2.0 * math.pi * frequency
    sine = GRAVITY / (amplitude * omega**2)
    return amplitude * sine + (amplitude * omega) ** 2 * (1.0 - sine**2) / (2.0 * GRAVITY)


def ball_height(frequency: float, amplitude: float, restitution: float) -> float:
    """Largest height [m] over the resting plate [Hz], [m] of a ball in period one."""
    period = 1.0 / frequency
    plate_velocity = 0.5 * GRAVITY * period * (1.0 - restitution) / (1.0 + restitution)
    cosine = plate_velocity / (2.0 * math.pi * frequency * amplitude)
    return GRAVITY * period**2 / 8.0 + amplitude * math.sqrt(1.0 - cosine**2)


def law_rows() -> list[Row]:
    """Rows of what no right motion does; the interval begins where it may be."""
    side = 1e3 * float(np.ptp(part("cube").corners[:, 0]))
    inside, none = f"at most {100 * DEEPEST:g} % of the side", "contact gives no energy"
    return [
        *(law(name, "energy_gain", (-1.0, ROUNDING), 1.0, "an impact gives no energy") for name in ENERGIES),
        law("heap_at_rest", "energy_gain", (0.0, MOST_GAIN), 1.0, none),
        law("heap_at_rest", "kinetic_energy", (0.0, MOST_RESIDUAL), 1.0, "it rests"),
        law("heap_at_rest", "depth", (0.0, DEEPEST * side), side, "the plate is rigid", inside),
        law("heap_at_rest", "overlap", (0.0, DEEPEST * side), side, "parts are rigid", inside),
    ]


def law(name: str, quantity: str, interval: tuple[float, float], scale: float, what: str, rule: str = "") -> Row:
    """A row whose right value is 0 at most, or nearly so."""
    low, high = interval
    rule = rule or f"at most {high:g}"
    return Row(name, quantity, unit(name, quantity), 0.0, low, high, scale, False, 0.0, f"law: {what}", rule)


def zero_rows(seed_sd: float) -> list[Row]:
    """Drift on the piston, in both directions; seed_sd: of one seed [mm/s]."""
    half = HALF_WIDTH * ZERO_SCALE_MM_S
    rule = f"0 +- {100 * HALF_WIDTH:g} % of the drift on a standing wave of this frequency and amplitude"
    return [
        Row("piston_zero", f"drift_{axis}", "mm/s", 0.0, -half, half, ZERO_SCALE_MM_S, True, seed_sd, "symmetry", rule)
        for axis in "xy"
    ]


def measured_rows(seed_sd: dict[str, float]) -> list[Row]:
    """Transport speeds as measured; seed_sd: of one computed seed of each case [mm/s]."""
    rows = []
    for name, (mean, sd) in MEASURED.items():
        half = T_FIVE * sd / math.sqrt(6.0)
        source = f"measurement: {mean:g} +- {sd:g} (SD) of six runs, EPFL thesis 7124 (2016)"
        rule = "95 % interval of the mean by Student's t"
        interval = (mean - half, mean + half)
        rows.append(Row(name, "transport_speed", "mm/s", mean, *interval, mean, True, seed_sd[name], source, rule))
    return rows


class Block(NamedTuple):
    """A steel block with sides y, y, ratio * y: how often it was rolled, and the share with a square face up."""

    ratio: float
    rolls: int
    share: float


@cache
def measured_blocks() -> tuple[Block, ...]:
    """Blocks whose share was measured."""
    path, names = FOLDER / "blocks.csv", ("ratio", "rolls", "share")
    numbers = [
        [number(path, line, row, name, blank=True) for name in names] for line, row in records(path, names, names)
    ]
    return tuple(Block(ratio, round(rolls), share) for ratio, rolls, share in numbers if math.isfinite(share))


def rms_difference(shares: Sequence[float]) -> float:
    """Root mean square of computed less measured shares, in the order of `measured_blocks`."""
    differences = [share - block.share for share, block in zip(shares, measured_blocks(), strict=True)]
    return math.sqrt(sum(d * d for d in differences) / len(differences))


def block_rows() -> list[Row]:
    """How far shares may be from those measured, for one throw in place of that unknown one which they were of."""
    spreads = [(block.share * (1.0 - block.share), block.rolls) for block in measured_blocks()]
    by_chance = math.sqrt(sum(p / n for p, n in spreads) / len(spreads))
    seed_sd = math.sqrt(sum(p for p, _ in spreads)) / len(spreads)  # of one throw of each block, if all are off alike
    source = f"measurement: {sum(n for _, n in spreads)} rolls of eight blocks, Budden, Math. Gaz. 64 (1980) 196"
    rule = f"at most {MOST_RMS:g}: chance of the rolls is {by_chance:.3f}, the rest for how they were thrown, not known"
    return [Row("blocks", "rms_difference", "1", 0.0, 0.0, MOST_RMS, 1.0, True, seed_sd, source, rule)]


def rows(ensembles: Sequence[Row], zero_sd: float) -> list[Row]:
    """All rows, with those by ensembles and the standard deviation of one seed of `piston_zero` [mm/s]."""
    seed_sd = {row.case: row.seed_sd for row in ensembles}
    return [
        *closed_rows(),
        *law_rows(),
        *zero_rows(zero_sd),
        *ensembles,
        *measured_rows(seed_sd),
        *block_rows(),
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write cases.csv again; ensembles stay")
    options = parser.parse_args(arguments)
    try:
        stored = read_set()
        ensembles = [row for row in stored if row.basis == "ensemble"]
        computed = rows(ensembles, next(row.seed_sd for row in stored if row.basis == "symmetry"))
        if options.write:
            write_set(computed, RIGHT_VALUES)
            return 0
    except ConformanceError as error:
        print(error, file=sys.stderr)
        return 2
    differing = differences(stored, computed)
    print("\n".join([f"{RIGHT_VALUES.name}: {where}: differs" for where in differing] or ["no row differs"]))
    return int(bool(differing))


def differences(stored: Sequence[Row], computed: Sequence[Row]) -> list[str]:
    """Names of rows that are not the same to five digits, or that only one of both has."""
    ours, theirs = ({(row.case, row.quantity, row.basis): row for row in each} for each in (computed, stored))
    return [", ".join(key) for key in {**ours, **theirs} if not _alike(ours.get(key), theirs.get(key))]


def _alike(one: Row | None, other: Row | None) -> bool:
    if one is None or other is None:
        return False
    numbers = ((row.right, row.low, row.high, row.seed_sd) for row in (one, other))
    texts = ((row.unit, row.chance, row.source, row.rule) for row in (one, other))
    close = all(abs(a - b) <= 1e-5 * one.scale for a, b in zip(*numbers, strict=True))
    return close and len(set(texts)) == 1


if __name__ == "__main__":
    sys.exit(main())
