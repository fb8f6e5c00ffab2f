"""The folder of a sweep: what was asked (sweep.toml), the scenario it began from, and one row per point and measure.

sweep.csv is tidy: a column per varied key, then `measure`, `mean`, `se`, `n` and `failed`.
"""

from __future__ import annotations

import csv
import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError, cause_of, quoted
from feeder_sim.measures.statistic import Statistic

TABLE, ASKED, BASE = "sweep.csv", "sweep.toml", "scenario.toml"
COLUMNS = ("measure", "mean", "se", "n", "failed")
Value = float | str


@dataclass(frozen=True)
class Row:
    """A measure at a point: the values of the varied keys there, its mean with error, and seeds that failed."""

    point: tuple[Value, ...]
    measure: str
    statistic: Statistic
    failed: int


@dataclass(frozen=True)
class Sweep:
    """A sweep on disk.

    Attributes:
        folder: that holds it.
        keys: that were varied, in the order of the columns.
        rows: in the order of the table.
        asked: what sweep.toml says.
        base_text: the scenario it began from, as TOML; "" without one.
    """

    folder: Path
    keys: tuple[str, ...]
    rows: tuple[Row, ...]
    asked: dict[str, Any]
    base_text: str

    @property
    def points(self) -> tuple[tuple[Value, ...], ...]:
        """All points, each once, in the order of the table."""
        return tuple(dict.fromkeys(row.point for row in self.rows))

    @property
    def measures(self) -> tuple[str, ...]:
        """Names of all measures, each once, in the order of the table."""
        return tuple(dict.fromkeys(row.measure for row in self.rows))

    def of(self, measure: str) -> tuple[Row, ...]:
        """The rows of a measure that have a mean."""
        return tuple(row for row in self.rows if row.measure == measure and math.isfinite(row.statistic.mean))

    @property
    def failed(self) -> dict[tuple[Value, ...], int]:
        """Seeds that failed, of the points where some did."""
        most: dict[tuple[Value, ...], int] = {}
        for row in self.rows:
            most[row.point] = max(most.get(row.point, 0), row.failed)
        return {point: failed for point, failed in most.items() if failed}


def is_sweep(folder: Path) -> bool:
    """Whether a folder holds the table of a sweep."""
    return (folder / TABLE).is_file()


def read_sweep(folder: Path) -> Sweep:
    """Read the folder of a sweep.

    Raises:
        InputError: its table or what was asked cannot be read.
    """
    table = folder / TABLE
    lines = list(csv.reader(_text(table).splitlines()))
    head = lines[0] if lines else []
    keys = tuple(head[: head.index("measure")]) if "measure" in head else ()
    if not keys or tuple(head[len(keys) : len(keys) + len(COLUMNS)]) != COLUMNS:
        raise InputError(
            f"its columns are {quoted(', '.join(head))}, allowed is a column per varied key, then {', '.join(COLUMNS)}",
            file=table,
        )
    rows = tuple(_row(line, len(keys), table, number) for number, line in enumerate(lines[1:], 2) if line)
    if not rows:
        raise InputError("holds no point yet, allowed is a sweep with at least one", file=table)
    base = folder / BASE
    return Sweep(folder, keys, rows, _asked(folder / ASKED), _text(base) if base.is_file() else "")


def _row(line: Sequence[str], n_keys: int, table: Path, number: int) -> Row:
    """A line of the table."""
    try:
        measure, mean, se, n, failed = line[n_keys : n_keys + len(COLUMNS)]
        held = int(float(n))
        error = _number(se)
        statistic = Statistic(_number(mean), error * math.sqrt(held), error, held)
        return Row(tuple(_value(text) for text in line[:n_keys]), measure, statistic, int(float(failed or 0)))
    except (ValueError, OverflowError):
        problem = f"line {number} is {quoted(','.join(line))}, allowed are numbers under mean, se, n and failed"
        raise InputError(problem, file=table) from None


def _number(text: str) -> float:
    """A number; NaN for an empty cell."""
    return float(text) if text else math.nan


def _value(text: str) -> Value:
    """The value of a key: a number where it is one."""
    try:
        return float(text)
    except ValueError:
        return text


def _asked(file: Path) -> dict[str, Any]:
    if not file.is_file():
        return {}
    try:
        return tomllib.loads(_text(file))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is not TOML: {error}", file=file) from error


def _text(file: Path) -> str:
    try:
        if file.is_symlink():
            raise InputError("is a link, allowed is a file of the sweep itself", file=file)
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {cause_of(error)}", file=file) from error
