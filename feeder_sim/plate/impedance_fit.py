"""Resonances from the series resistance of a patch over the frequency, as an LCR meter measures it.

The patch takes the admittance of its capacitance C with the loss tangent d, and that of the modes that it drives,

    Y = i w C (1 - i d) + sum_j i w s_j / (w_j^2 - w^2 + 2 i zeta_j w_j w),    Z = R_0 + 1 / Y,

with s_j the square of the modal force per volt over the modal mass, and R_0 of the leads (IEEE Std 176-1987, section 6;
feeder_sim.plate.response). Least squares of the logarithm of Re Z give w_j, zeta_j, s_j, d and R_0.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.comma_separated import check_commas
from feeder_sim.errors import InputError

MOST_BYTES = 20_000_000
LEAST_POINTS, MOST_POINTS = 20, 100_000
LEAST_ACROSS = 4  # points across the half height of a maximum
STANDS_OUT = 10.0  # times the noise; a lower maximum is none
LEAST_RISE = 0.02  # relative; a lower maximum is none, however little noise there is
UNLIKE_ONE = 3.0  # times the noise; a maximum that is farther from that of one resonance has two
TOO_UNLIKE = 0.03  # relative; the same, however little noise there is
COLUMNS = ("resistance_ohm", "impedance_ohm", "phase_deg")


@dataclass(frozen=True)
class Sweep:
    """A measured sweep.

    Attributes:
        frequency: rising (n,) [Hz].
        resistance: in series (n,) [ohm].
        capacitance: by the reactance [F]; None where that was not measured.
    """

    frequency: NDArray[np.float64]
    resistance: NDArray[np.float64]
    capacitance: float | None


@dataclass(frozen=True)
class FittedResonance:
    """A resonance with the standard errors of its numbers.

    Attributes:
        frequency: natural frequency of the mode with the patch at a voltage [Hz].
        frequency_error: [Hz].
        damping_ratio: [1].
        damping_error: [1].
    """

    frequency: float
    frequency_error: float
    damping_ratio: float
    damping_error: float


@dataclass(frozen=True)
class SweepFit:
    """All resonances of a sweep, in order of frequency.

    Attributes:
        resonances: the resonances.
        loss_tangent: of the ceramic [1].
        resistance: that of the fit, at the frequencies of the sweep (n,) [ohm].
        scatter: root mean square of the relative deviation of the measured resistance from it [1].
    """

    resonances: tuple[FittedResonance, ...]
    loss_tangent: float
    resistance: NDArray[np.float64]
    scatter: float


def read_sweep(path: Path) -> Sweep:
    """Read a CSV file with columns frequency_hz, and resistance_ohm, or impedance_ohm and phase_deg.

    Raises:
        InputError: a file that cannot be read or meant.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"has more than {MOST_BYTES // 1_000_000} MB, must be less", file=path)
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("cannot be read, must be a text file with commas", file=path) from error
    check_commas(text, path)
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    rows = csv.DictReader(lines, skipinitialspace=True)
    names = [name.strip() for name in rows.fieldnames or ()]
    rows.fieldnames = names
    columns = ["frequency_hz", *(["resistance_ohm"] if "resistance_ohm" in names else COLUMNS[1:])]
    if missing := [name for name in columns if name not in names]:
        raise InputError(
            f"has no column {missing[0]}, must be frequency_hz and resistance_ohm, or impedance_ohm and phase_deg",
            file=path,
        )
    table = np.array([[_number(row[name], name, i, path) for name in columns] for i, row in enumerate(rows)])
    if not LEAST_POINTS <= len(table) <= MOST_POINTS:
        raise InputError(f"has {len(table)} rows, must be {LEAST_POINTS} to {MOST_POINTS}", file=path)
    frequency = table[:, 0]
    if frequency[0] <= 0.0 or (np.diff(frequency) <= 0.0).any():
        at = 0 if frequency[0] <= 0.0 else int(np.argmax(np.diff(frequency) <= 0.0)) + 1
        raise InputError(f"goes to {frequency[at]:g} in row {at + 1}, must be rising ones", file=path, key=columns[0])
    capacitance, resistance = None, table[:, 1]
    if len(columns) == 3:
        impedance = table[:, 1] * np.exp(1j * np.radians(table[:, 2]))
        resistance = impedance.real
        capacitance = float(np.median(-1.0 / (2.0 * math.pi * frequency * impedance.imag)))
        if capacitance <= 0.0:
            raise InputError("is above 0, must be that of a capacitance, below 0", file=path, key="phase_deg")
    if (resistance <= 0.0).any():
        at = int(np.argmax(resistance <= 0.0))
        raise InputError(f"makes a resistance of {resistance[at]:.3g} in row {at + 1}, must be above 0", file=path)
    return Sweep(frequency, resistance, capacitance)


def _number(text: str | None, name: str, row: int, path: Path) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"is {(text or '')[:20]!r} in row {row + 1}, must be a number", file=path, key=name)
    return value


def fit_sweep(sweep: Sweep, capacitance: float) -> SweepFit:
    """Fit all resonances of a sweep.

    Args:
        sweep: the measurement; where it has no capacitance of its own, it is
        capacitance: of the patch [F].

    Raises:
        InputError: no maximum, too few points across one, or one that is not that of one resonance.
    """
    from scipy.optimize import least_squares
    from scipy.signal import find_peaks, peak_widths

    capacitance = sweep.capacitance or capacitance
    omega, measured = 2.0 * math.pi * sweep.frequency, np.log(sweep.resistance)
    dissipated = measured + np.log(omega * capacitance)  # log of the loss tangent, beside the maxima
    noise = 1.4826 * float(np.median(np.abs(np.diff(dissipated, 2)))) / math.sqrt(6.0)
    places, _ = find_peaks(dissipated, prominence=max(STANDS_OUT * noise, math.log1p(LEAST_RISE)))
    if not len(places):
        raise InputError("has no maximum that stands out of its noise, must be a sweep over resonances")
    loss = float(np.exp(np.quantile(dissipated, 0.2)))
    above = np.maximum(np.exp(dissipated) - loss, 1e-3 * loss)
    left, right = (np.interp(ends, np.arange(len(omega)), sweep.frequency) for ends in peak_widths(above, places)[2:])
    for place, low, high in zip(places, left, right, strict=True):
        across = int(((sweep.frequency >= low) & (sweep.frequency <= high)).sum())
        if across < LEAST_ACROSS:
            raise InputError(
                f"has {across} points across the maximum at {sweep.frequency[place]:g} Hz, must be steps of "
                f"{(high - low) / LEAST_ACROSS:.2g} Hz or less there"
            )
    natural, damping = sweep.frequency[places], 0.5 * (right - left) / sweep.frequency[places]
    # Above its background R is s / (2 zeta w) / (w C)^2; in units in which w C R is the loss tangent.
    strength = above[places] * 2.0 * damping
    start = np.concatenate([np.zeros(len(places)), np.log(damping), np.log(strength), [math.log(loss), 0.0]])
    unit = np.concatenate([damping, np.ones(2 * len(places)), [1.0, float(sweep.resistance.min())]])

    def resistance(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        shift, zeta, share, (tangent, leads) = np.split(parameters, np.arange(1, 4) * len(places))
        w = 2.0 * math.pi * natural * (1.0 + damping * shift)
        branches = np.exp(share) * w**2 / (w**2 - omega[:, None] ** 2 + 2j * np.exp(zeta) * w * omega[:, None])
        admittance = 1j * omega * capacitance * (1.0 - 1j * np.exp(tangent) + branches.sum(axis=1))
        return np.asarray((1.0 / admittance).real + leads * unit[-1])

    def deviation(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.log(np.maximum(resistance(parameters), 1e-3 * sweep.resistance)) - measured

    result = least_squares(deviation, start, x_scale="jac", max_nfev=200)
    scatter = float(np.sqrt(np.mean(result.fun**2)))
    shift, zeta, _, (tangent, _) = np.split(result.x, np.arange(1, 4) * len(places))
    variance = np.diag(np.linalg.pinv(result.jac.T @ result.jac)) * result.fun.var()
    error_of_shift, error_of_zeta = np.sqrt(np.maximum(np.split(variance, np.arange(1, 4) * len(places))[:2], 0.0))
    fitted = natural * (1.0 + damping * shift)
    for f, ratio in zip(fitted, np.exp(zeta), strict=True):
        near = np.abs(sweep.frequency / f - 1.0) < 4.0 * ratio
        local = float(np.sqrt(np.mean(result.fun[near] ** 2))) if near.any() else math.inf
        if local > max(UNLIKE_ONE * noise, TOO_UNLIKE):
            raise InputError(
                f"departs by {local:.1%} from one resonance about the maximum at {f:.6g} Hz, with a noise of "
                f"{noise:.1%}; must be maxima of one resonance each, without gaps"
            )
    rows = zip(fitted, natural * damping * error_of_shift, np.exp(zeta), np.exp(zeta) * error_of_zeta, strict=True)
    resonances = sorted((FittedResonance(*map(float, row)) for row in rows), key=lambda row: row.frequency)
    return SweepFit(tuple(resonances), math.exp(float(tangent)), resistance(result.x), scatter)
