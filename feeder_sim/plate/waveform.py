"""A motion from a table of comma-separated values: one period, as a Fourier series.

    t_ms, x_um, z_um, ry_mrad
    0, 0, 0, 0
    0.5, 31, 12, 0.1
    ...

Times are evenly spaced and begin at 0; the period ends one spacing after the last line. Columns are any of those in
`COLUMNS`. The series has as few harmonics as come within `CLOSE` of the largest value of each column at the lines of
the table; its mean, which moves nothing, is left out.
"""

from __future__ import annotations

import csv
import io
import math
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
EVEN = 1e-3  # of the spacing of times
LARGEST = 1e9


@dataclass(frozen=True)
class Waveform:
    """A periodic motion: sum over k of Re[coefficient[k - 1] exp(2 pi i k t / period)].

    Attributes:
        period: [s].
        coefficient: of moves along x, y, z [m] and turns about them [rad], shape (harmonics, 6).
        residual: largest deviation at the lines of the table over the largest value of its column [1].
    """

    period: float
    coefficient: NDArray[np.complex128]
    residual: float


def read_waveform(text: str, path: Path) -> Waveform:
    """Read a table; `path` names it in messages.

    Raises:
        InputError: a line that is broken, with its number, or times that are not even.
    """
    check_commas(text, path)
    rows = [row for row in csv.reader(io.StringIO(text), skipinitialspace=True) if row and not row[0].startswith("#")]
    names = [name.strip() for name in rows[0]] if rows else []
    if not names or names[0] != "t_ms" or not set(names[1:]) <= set(COLUMNS) or not 1 < len(names) == len(set(names)):
        raise InputError(f"begins with {', '.join(names)!r:.80}, allowed is t_ms and {', '.join(COLUMNS)}", file=path)
    if not FEWEST_LINES <= len(rows) - 1 <= MOST_LINES:
        raise InputError(f"has {len(rows) - 1} lines, allowed are {FEWEST_LINES} to {MOST_LINES}", file=path)
    table = np.empty((len(rows) - 1, len(names)))
    for number, row in enumerate(rows[1:]):
        try:
            table[number] = [float(cell) for cell in row]
        except ValueError:
            table[number] = math.nan
        if not (np.abs(table[number]) <= LARGEST).all():
            raise InputError(f"line {number + 2}: is {','.join(row):.60}, allowed are {len(names)} numbers", file=path)
    steps = np.diff(table[:, 0])
    if table[0, 0] != 0.0 or steps[0] <= 0.0 or (np.abs(steps / steps[0] - 1.0) > EVEN).any():
        raise InputError("has uneven times, allowed are times that begin at 0 and are evenly spaced", file=path)
    values = np.zeros((len(table), len(COLUMNS)))
    for name, column in zip(names[1:], table.T[1:], strict=True):
        values[:, COLUMNS.index(name)] = column * TO_SI[COLUMNS.index(name)]
    coefficient, residual = _series(values - values.mean(axis=0))
    return Waveform(1e-3 * float(steps.mean()) * len(table), coefficient, residual)


def _series(values: NDArray[np.float64]) -> tuple[NDArray[np.complex128], float]:
    """Coefficients (harmonics, 6) of the shortest series that comes close to values (n, 6), and its residual."""
    n = len(values)
    spectrum = np.fft.rfft(values, axis=0) / n
    spectrum[1 : (n + 1) // 2] *= 2.0
    largest = np.abs(values).max(axis=0)
    largest[largest == 0.0] = 1.0
    angle = 2.0 * math.pi * np.arange(n) / n
    left, residual = values.copy(), 1.0
    for k in range(1, min(MOST_HARMONICS, n // 2) + 1):
        left -= np.real(spectrum[k] * np.exp(1j * k * angle)[:, None])
        residual = float((np.abs(left) / largest).max())
        if residual <= CLOSE:
            break
    return spectrum[1 : k + 1], residual
