"""A motion from a table of comma-separated values: one period, as a Fourier series.

    t_ms, x_um, z_um, ry_mrad
    0, 0, 0, 0
    0.5, 31, 12, 0.1
    ...

Times are evenly spaced and begin at 0; the period ends one spacing after the last line. Columns are any of those in
`COLUMNS`. The mean, which moves nothing, is left out.

Parts feel accelerations: a small fast motion on a large slow one counts as much. So the series takes, of the first
`MOST_HARMONICS`, those that count in displacement or in acceleration, until it comes within `CLOSE` of the
displacements and within `CLOSE_ACCELERATION` of the accelerations at the lines of the table; and then those higher ones
that stand out of the others, so that the noise of a measured table is not taken for motion.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.comma_separated import check_commas
from feeder_sim.errors import InputError

COLUMNS = ("x_um", "y_um", "z_um", "rx_mrad", "ry_mrad", "rz_mrad")
TO_SI = (1e-6, 1e-6, 1e-6, 1e-3, 1e-3, 1e-3)
FEWEST_LINES, MOST_LINES = 4, 100_000
MOST_HARMONICS = 40
CLOSE = 0.005  # of the largest value of a column
CLOSE_ACCELERATION = 0.02  # of the largest acceleration
COUNTS = 1e-4  # of the largest amplitude, or acceleration, of a harmonic: what is less is left out
STANDS_OUT = 10.0  # times the acceleration of three quarters of the higher harmonics
EVEN = 1e-3  # of the spacing of times
LARGEST = 1e9


@dataclass(frozen=True)
class Waveform:
    """A periodic motion: sum over j of Re[coefficient[j] exp(2 pi i harmonic[j] t / period)].

    Attributes:
        period: [s].
        harmonic: multiples of the frequency, in order, shape (n,).
        coefficient: of moves along x, y, z [m] and turns about them [rad], shape (n, 6).
        residual: largest deviation at the lines of the table over the largest value of its column [1].
        acceleration: the largest of the series at the lines of the table, of a move or at the arm of a turn [m/s^2].
        left_out: the same of the harmonics that are left out.
        left_out_frequency: of the one of them with the largest acceleration [Hz].
    """

    period: float
    harmonic: NDArray[np.int64]
    coefficient: NDArray[np.complex128]
    residual: float
    acceleration: float
    left_out: float
    left_out_frequency: float


def read_table(
    text: str, path: Path, columns: Sequence[Sequence[str]], most: int, *, first: str = "t_ms"
) -> tuple[list[str], NDArray[np.float64]]:
    """Read columns of numbers: the first one, and some of one of several sets; `path` names the table in messages.

    Returns:
        The names of the columns, and the table, shape (lines, columns).

    Raises:
        InputError: other columns, more or fewer lines, a line that is broken, with its number, or uneven times.
    """
    check_commas(text, path)
    rows = [row for row in csv.reader(io.StringIO(text), skipinitialspace=True) if row and not row[0].startswith("#")]
    names = [name.strip() for name in rows[0]] if rows else []
    fits = any(set(names[1:]) <= set(those) for those in columns) and 1 < len(names) == len(set(names))
    if not fits or names[0] != first:
        allowed = ", or ".join(", ".join(those) for those in columns)
        raise InputError(f"begins with {', '.join(names)!r:.80}, must be {first} and {allowed}", file=path)
    fewest = FEWEST_LINES if first == "t_ms" else 2
    if not fewest <= len(rows) - 1 <= most:
        raise InputError(f"has {len(rows) - 1} lines, must be {fewest} to {most}", file=path)
    table = np.empty((len(rows) - 1, len(names)))
    for number, row in enumerate(rows[1:]):
        try:
            table[number] = [float(cell) for cell in row]
        except ValueError:
            table[number] = math.nan
        if not (np.abs(table[number]) <= LARGEST).all():
            raise InputError(f"line {number + 2}: is {','.join(row):.60}, must be {len(names)} numbers", file=path)
    steps = np.diff(table[:, 0])
    if first == "t_ms" and (table[0, 0] != 0.0 or steps[0] <= 0.0 or (np.abs(steps / steps[0] - 1.0) > EVEN).any()):
        raise InputError("has uneven times, must be times that begin at 0 and are evenly spaced", file=path)
    return names, table


def read_waveform(text: str, path: Path, arm: float) -> Waveform:
    """Read a table; `path` names it in messages, `arm` [m] is where turns are judged.

    Raises:
        InputError: a line that is broken, with its number, or times that are not even.
    """
    names, table = read_table(text, path, (COLUMNS,), MOST_LINES)
    values = np.zeros((len(table), len(COLUMNS)))
    for name, column in zip(names[1:], table.T[1:], strict=True):
        values[:, COLUMNS.index(name)] = column * TO_SI[COLUMNS.index(name)]
    period = 1e-3 * float(table[-1, 0]) / (len(table) - 1) * len(table)
    return _series(values - values.mean(axis=0), period, np.array([1.0, 1.0, 1.0, arm, arm, arm]))


def _series(values: NDArray[np.float64], period: float, arms: NDArray[np.float64]) -> Waveform:
    """The series of values (n, 6) over a period [s]; `arms` make lengths of them (6,)."""
    n = len(values)
    spectrum = np.fft.rfft(values, axis=0) / n
    spectrum[1 : (n + 1) // 2] *= 2.0
    spectrum[0] = 0.0
    rate = np.square(2.0 * math.pi / period * np.arange(len(spectrum), dtype=np.float64))
    moves = np.abs(spectrum) * arms
    accelerations = moves * rate[:, None]
    counts = (moves > COUNTS * moves.max()).any(axis=1) | (accelerations > COUNTS * accelerations.max()).any(axis=1)
    largest = np.abs(values).max(axis=0)
    largest[largest == 0.0] = 1.0
    total = _accelerations(spectrum, rate, arms, n)
    selected = np.zeros(len(spectrum), bool)

    def residuals() -> tuple[float, float]:
        """Of displacements, over the largest of each column, and of accelerations [m/s^2]."""
        series = np.fft.irfft(np.where(selected[:, None], _halved(spectrum, n), 0.0), n, axis=0) * n
        apart = total - _accelerations(np.where(selected[:, None], spectrum, 0.0), rate, arms, n)
        return float((np.abs(values - series) / largest).max()), float(np.abs(apart).max())

    for k in np.flatnonzero(counts[: MOST_HARMONICS + 1]):
        selected[k] = True
        residual, left_out = residuals()
        if residual <= CLOSE and left_out <= CLOSE_ACCELERATION * np.abs(total).max():
            break
    higher = accelerations[MOST_HARMONICS + 1 :].max(axis=1, initial=0.0)
    if len(higher) and not (residuals()[1] <= CLOSE_ACCELERATION * np.abs(total).max()):
        out = higher > max(STANDS_OUT * float(np.quantile(higher, 0.75)), CLOSE_ACCELERATION * accelerations.max())
        selected[MOST_HARMONICS + 1 :] = out
    residual, left_out = residuals()
    remaining = np.where(selected, 0.0, accelerations.max(axis=1))
    return Waveform(
        period,
        np.flatnonzero(selected),
        spectrum[selected],
        residual,
        float(np.abs(_accelerations(np.where(selected[:, None], spectrum, 0.0), rate, arms, n)).max()),
        left_out,
        int(remaining.argmax()) / period,
    )


def _accelerations(
    spectrum: NDArray[np.complex128], rate: NDArray[np.float64], arms: NDArray[np.float64], n: int
) -> NDArray[np.float64]:
    """Accelerations (n, 6) [m/s^2] of a series at the lines of its table."""
    return np.asarray(np.fft.irfft(_halved(spectrum, n) * rate[:, None] * arms, n, axis=0) * n)


def _halved(spectrum: NDArray[np.complex128], n: int) -> NDArray[np.complex128]:
    """Amplitudes of harmonics, as the inverse transform takes them."""
    halved = 0.5 * spectrum
    if n % 2 == 0:
        halved[-1] = spectrum[-1]
    return halved
