"""Mode shapes from a table of comma-separated values.

    # frequency_hz, 438.9, 812.4
    # damping_ratio, 0.0021, 0.0018
    # modal_mass_kg, 0.051, 0.047
    x_mm, y_mm, mode_1, mode_2
    0, 0, 0.93, -0.41
    ...

The line `frequency_hz` is needed, the other two are not. Further columns slope_x_1_per_mm and slope_y_1_per_mm give the
rotations of mode 1 (dw/dx and dw/dy of a thin plate), in the unit of mode_1 per millimetre. Lines that begin with # and
have another first word are comments.
"""

from __future__ import annotations

import csv
import io
import math
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.comma_separated import check_commas
from feeder_sim.errors import InputError, quoted
from feeder_sim.plate.imported.measured_shapes import LARGEST_COORDINATE, MOST_MODES, MOST_POINTS, MeasuredShapes

HEADERS = ("frequency_hz", "damping_ratio", "modal_mass_kg")
LIMITS = {"frequency_hz": (0.1, 1e7), "damping_ratio": (1e-6, 0.999999), "modal_mass_kg": (1e-12, 1e6)}
COLUMN = re.compile(r"mode_(\d{1,4})|slope_([xy])_(\d{1,4})_per_mm")
LARGEST_VALUE = 1e30


def read_shapes_csv(text: str, path: Path) -> MeasuredShapes:
    """Read the modes in a table; `path` names it in messages.

    Raises:
        InputError: a line that is broken, with its number, its column and what is allowed.
    """
    check_commas(text, path)
    lines = csv.reader(io.StringIO(text), skipinitialspace=True)
    header: dict[str, list[float]] = {}
    names: list[str] = []
    rows: list[list[float]] = []
    try:
        for cells in lines:
            number = lines.line_num
            cells = [cell.strip() for cell in cells]
            if not any(cells):
                continue
            if cells[0].startswith("#"):
                key = cells[0][1:].strip()
                if key in HEADERS:
                    if key in header:
                        raise InputError(f"line {number}: is given twice, must be once", file=path, key=key)
                    header[key] = [_header_value(cell, key, number, path) for cell in cells[1:]]
            elif not names:
                names = cells
                _check_names(names, number, path)
            else:
                rows.append(_row(cells, names, number, path))
                if len(rows) > MOST_POINTS:
                    raise InputError(f"has more than {MOST_POINTS} points, must be fewer", file=path)
    except csv.Error as error:
        raise InputError(
            f"line {lines.line_num}: cannot be read as comma-separated values: {error}", file=path
        ) from None
    if not names:
        raise InputError("has no line with names of columns, must be x_mm, y_mm, mode_1, ...", file=path)
    return _shapes(header, names, np.array(rows, float).reshape(-1, len(names)), path).in_order()


def _header_value(cell: str, key: str, number: int, path: Path) -> float:
    if cell == "" and key != "frequency_hz":
        return math.nan  # unknown for this mode
    low, high = LIMITS[key]
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise InputError(f"line {number}: is {quoted(cell)}, must be {low:g} to {high:g}", file=path, key=key)
    return value


def _check_names(names: list[str], number: int, path: Path) -> None:
    """Refuse names of columns other than x_mm, y_mm, mode_N and slopes of such modes, and modes that are missing."""
    for name in names:
        if name not in ("x_mm", "y_mm") and not COLUMN.fullmatch(name):
            raise InputError(
                f"line {number}: unknown column {quoted(name)}; must be x_mm, y_mm, mode_1, mode_2, ..., "
                "slope_x_1_per_mm, slope_y_1_per_mm, ...",
                file=path,
            )
        if names.count(name) > 1:
            raise InputError(f"line {number}: column {name} stands twice, must be once", file=path)
    count = sum(name.startswith("mode_") for name in names)
    needed = ["x_mm", "y_mm", *(f"mode_{i + 1}" for i in range(max(count, 1)))]
    for name in needed:
        if name not in names:
            raise InputError(f"line {number}: column {name} is missing, must be {', '.join(needed[:4])}", file=path)
    if count > MOST_MODES:
        raise InputError(f"line {number}: has {count} modes, must be up to {MOST_MODES}", file=path)
    for name in names:
        if name.startswith("slope_"):
            other = name.replace("_x_", "_y_") if "_x_" in name else name.replace("_y_", "_x_")
            if other not in names or f"mode_{name.split('_')[2]}" not in names:
                raise InputError(f"line {number}: column {name} needs {other} and its mode beside it", file=path)


def _row(cells: list[str], names: list[str], number: int, path: Path) -> list[float]:
    if len(cells) != len(names):
        raise InputError(f"line {number}: has {len(cells)} values, must be {len(names)}, one a column", file=path)
    values = []
    for cell, name in zip(cells, names, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        largest = 1e3 * LARGEST_COORDINATE if name in ("x_mm", "y_mm") else LARGEST_VALUE
        if not abs(value) <= largest:
            raise InputError(
                f"line {number}, column {name}: is {quoted(cell)}, must be a number up to +-{largest:g}", file=path
            )
        values.append(value)
    return values


def _shapes(header: dict[str, list[float]], names: list[str], table: NDArray[np.float64], path: Path) -> MeasuredShapes:
    column = {name: table[:, i] for i, name in enumerate(names)}
    n_modes = sum(name.startswith("mode_") for name in names)
    if "frequency_hz" not in header:
        raise InputError("is missing, must be a line such as '# frequency_hz, 438.9, 812.4'", file=path, key=HEADERS[0])
    for key, values in header.items():
        if len(values) != n_modes:
            raise InputError(f"has {len(values)} values, must be {n_modes}, one a mode", file=path, key=key)
    unknown = np.full(n_modes, np.nan)
    rotation = np.full((n_modes, 2, len(table)), np.nan)
    for i in range(n_modes):
        for axis, along in enumerate("xy"):
            if (name := f"slope_{along}_{i + 1}_per_mm") in column:
                rotation[i, axis] = 1e3 * column[name]
    return MeasuredShapes(
        points=1e-3 * np.column_stack([column["x_mm"], column["y_mm"]]),
        frequency=np.array(header["frequency_hz"]),
        deflection=np.stack([column[f"mode_{i + 1}"] for i in range(n_modes)]),
        rotation=rotation,
        damping_ratio=np.array(header.get("damping_ratio", unknown)),
        modal_mass=np.array(header.get("modal_mass_kg", unknown)),
        collinearity=np.ones(n_modes),
    )
