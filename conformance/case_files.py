"""The files of the conformance set: cases as TOML, right values and results of engines as CSV.

Whatever is wrong in a file is said in one line: the file, the line and the column, the value, and what is allowed.
"""

from __future__ import annotations

import csv
import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FOLDER = Path(__file__).parent
COMMON: dict[str, Any] = tomllib.loads((FOLDER / "common.toml").read_text(encoding="utf-8"))
GRAVITY: float = COMMON["gravity_m_s2"]
CASES: tuple[str, ...] = tuple(COMMON["cases"])
RIGHT_VALUES = FOLDER / "cases.csv"
NEEDED, OPTIONAL = ("case", "quantity", "value", "se"), ("engine", "setting", "n", "failure")
LONGEST = 80  # characters of a value in a message


class ConformanceError(Exception):
    """Input that cannot be used; the message is one line.

    Args:
        problem: the value, and what is allowed.
        file: where it stands.
        place: line and column there, or the key.
    """

    def __init__(self, problem: str, file: Path | None = None, place: str = "") -> None:
        source = ": ".join(str(name) for name in (file, place) if name)
        super().__init__(_printable(f"{source}: {problem}" if source else problem))


def _printable(text: str) -> str:
    line = " ".join(text.split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)


def quoted(text: str) -> str:
    """A value as a message shows it."""
    return repr(text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}...")


def not_a_name(name: str, names: Iterable[str]) -> str:
    """What is wrong with a name that is none of some, and which it may be."""
    allowed = list(dict.fromkeys(names))
    close = difflib.get_close_matches(name, allowed, 1)
    return f"is {quoted(name)}, must be {', '.join(allowed)}" + (f" (did you mean {close[0]}?)" if close else "")


# --- cases ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Part:
    """Mass [kg], moments of inertia (3,) [kg m2]; radius of a ball [m], or corners (n, 3) [m] of a hull."""

    mass: float
    inertia: NDArray[np.float64]
    radius: float
    corners: NDArray[np.float64]


@cache
def case(name: str) -> dict[str, Any]:
    """The tables of a case."""
    if name not in CASES:
        raise ConformanceError(not_a_name(name, CASES), place="case")
    tables: dict[str, Any] = tomllib.loads((FOLDER / "cases" / f"{name}.toml").read_text(encoding="utf-8"))
    return tables


@cache
def part(name: str) -> Part:
    """A part of `common.toml`."""
    table = COMMON["parts"][name]
    corners = np.zeros((1, 3))
    if "corners_mm" in table:
        corners = 1e-3 * np.array(table["corners_mm"])
    elif "mesh" in table:
        corners = 1e-3 * read_off(FOLDER / table["mesh"])
    return Part(1e-3 * table["mass_g"], np.array(table["inertia_kg_m2"]), 1e-3 * table.get("radius_mm", 0.0), corners)


def read_off(path: Path) -> NDArray[np.float64]:
    """Corners of a mesh."""
    words = path.read_text(encoding="utf-8").split()
    n = int(words[1])
    return np.array(words[4 : 4 + 3 * n], float).reshape(n, 3)


# --- right values and results -----------------------------------------------------------------------------------------


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
        """First word of the source: "closed", "law", "symmetry", "ensemble" or "measurement"."""
        return self.source.split(" ", 1)[0].rstrip(":;,")


@dataclass(frozen=True)
class Result:
    """What an engine gave.

    Attributes:
        case, quantity, value: as in the set; NaN where the engine gave none.
        se: standard error; NaN for a value without chance.
        engine: its name.
        setting: steps per period, or per millisecond over a plate at rest; 0 if not said.
        n: number of seeds; 0 if not said.
        failure: why there is no value.
    """

    case: str
    quantity: str
    value: float
    se: float = math.nan
    engine: str = ""
    setting: int = 0
    n: int = 0
    failure: str = ""


ROW_COLUMNS = tuple(field.name for field in fields(Row))


def write_set(rows: Sequence[Row], path: Path) -> None:
    """Write right values.

    Raises:
        ConformanceError: the file cannot be written.
    """
    _write(path, ROW_COLUMNS, [{name: _text(value) for name, value in asdict(row).items()} for row in rows])


def write_results(results: Sequence[Result], path: Path) -> None:
    """Write results as `read_results` reads them.

    Raises:
        ConformanceError: the file cannot be written.
    """
    columns = ("engine", "setting", *NEEDED, "n", "failure")
    _write(path, columns, [{name: _text(getattr(result, name)) for name in columns} for result in results])


def _write(path: Path, columns: Sequence[str], table: Sequence[Mapping[str, str]]) -> None:
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, columns, lineterminator="\n")
            writer.writeheader()
            writer.writerows(table)
    except OSError as error:
        raise not_written(path, error) from error


def not_written(path: Path, error: OSError) -> ConformanceError:
    """The error of a file that cannot be written."""
    return ConformanceError(f"cannot be written: {error.strerror or error}", path)


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ""
    return str(value)


def records(path: Path, needed: Sequence[str], allowed: Sequence[str]) -> list[tuple[int, dict[str, str]]]:
    """Lines of a CSV file with their numbers; all needed columns and no unknown ones.

    Raises:
        ConformanceError: as said.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, strict=True)
            names = reader.fieldnames or []
            for name in needed:
                if name not in names:
                    raise ConformanceError(f"is missing, needed are the columns {', '.join(needed)}", path, name)
            for name in names:
                if name not in allowed:
                    raise ConformanceError(f"is unknown, must be {', '.join(allowed)}", path, f"column {name!r}")
                if names.count(name) > 1:
                    raise ConformanceError("stands there twice, must be once", path, f"column {name!r}")
            lines = []
            for record in reader:
                if None in record or None in record.values():
                    problem = f"has not as many fields as the {len(names)} columns"
                    raise ConformanceError(problem, path, _place(reader.line_num))
                lines.append((reader.line_num, record))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConformanceError(f"cannot be read as CSV: {error}", path) from error
    if not lines:
        raise ConformanceError("has no rows, needed is one at least", path)
    return lines


def _place(line: int, column: str = "") -> str:
    return f"line {line}" + (f", column {column}" if column else "")


def number(path: Path, line: int, record: Mapping[str, str], column: str, *, blank: bool = False) -> float:
    """A finite number of a record; NaN where nothing stands and nothing may.

    Raises:
        ConformanceError: no number stands there.
    """
    text = record[column].strip()
    if not text and blank:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        allowed = "a finite number" + (" or nothing" if blank else "")
        raise ConformanceError(f"is {quoted(text)}, must be {allowed}", path, _place(line, column))
    return value


def _count(path: Path, line: int, record: Mapping[str, str], column: str) -> int:
    """A whole number, 0 where nothing stands."""
    text = record.get(column, "").strip()
    if not (text.isdecimal() and len(text) < 10) and text:
        raise ConformanceError(f"is {quoted(text)}, must be a whole number or nothing", path, _place(line, column))
    return int(text or 0)


def read_set(path: Path = RIGHT_VALUES) -> list[Row]:
    """Read right values.

    Raises:
        ConformanceError: a file that cannot be read, a column that is missing, a value that is no number.
    """
    rows = []
    for line, record in records(path, ROW_COLUMNS, ROW_COLUMNS):
        names = ("right", "low", "high", "scale", "seed_sd")
        right, low, high, scale, seed_sd = (number(path, line, record, name) for name in names)
        if not low <= right <= high:
            problem = f"is {right:g}, must be low to high, {low:g} to {high:g}"
            raise ConformanceError(problem, path, _place(line, "right"))
        if scale <= 0.0:
            raise ConformanceError(f"is {scale:g}, must be above 0", path, _place(line, "scale"))
        if record["chance"] not in ("yes", "no"):
            raise ConformanceError(f"is {quoted(record['chance'])}, must be yes or no", path, _place(line, "chance"))
        texts = {name: record[name] for name in ("case", "quantity", "unit", "source", "rule")}
        chance = record["chance"] == "yes"
        rows.append(Row(right=right, low=low, high=high, scale=scale, chance=chance, seed_sd=seed_sd, **texts))
    return rows


def read_results(path: Path, rows: Sequence[Row]) -> list[Result]:
    """Read results of engines: columns case, quantity, value, se; if wanted engine, setting, n, failure.

    Args:
        path: CSV file; without the column `engine` its name is that of the engine.
        rows: right values, whose cases and quantities are allowed.

    Raises:
        ConformanceError: a file that cannot be read; a column that is missing or unknown; a case, a quantity or a
            value that is not allowed; the same quantity twice.
    """
    quantities: dict[str, list[str]] = {}
    for row in rows:
        quantities.setdefault(row.case, []).append(row.quantity)
    results, keys = [], set()
    for line, record in records(path, NEEDED, (*NEEDED, *OPTIONAL)):
        name, quantity = record["case"].strip(), record["quantity"].strip()
        for column, value, allowed in (("case", name, quantities), ("quantity", quantity, quantities.get(name, []))):
            if value not in allowed:
                raise ConformanceError(not_a_name(value, allowed), path, _place(line, column))
        failure = record.get("failure", "").strip()
        measured = number(path, line, record, "value", blank=bool(failure))
        se = number(path, line, record, "se", blank=True)
        if se < 0.0:
            raise ConformanceError(f"is {se:g}, must be 0 and more, or nothing", path, _place(line, "se"))
        steps, n = (_count(path, line, record, column) for column in ("setting", "n"))
        engine = record.get("engine", "").strip() or path.stem
        key = (engine, steps, name, quantity)
        if key in keys:
            raise ConformanceError("stands there twice for this engine and setting, must be once", path, _place(line))
        keys.add(key)
        results.append(Result(name, quantity, measured, se, engine, steps, n, failure))
    return results
