"""The conformance set and results of engines as CSV."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

from conformance_set.cases import Row
from conformance_set.judge import Result
from feeder_sim.errors import InputError, nearest, not_written, quoted

NEEDED, OPTIONAL = ("case", "quantity", "value", "se"), ("engine", "setting", "n", "failure")
ROW_COLUMNS = tuple(field.name for field in fields(Row))


def write_set(rows: Sequence[Row], path: Path) -> None:
    """Write the set.

    Raises:
        InputError: the file cannot be written.
    """
    table = [{name: _text(value) for name, value in asdict(row).items()} for row in rows]
    _write(path, ROW_COLUMNS, table)


def write_results(results: Sequence[Result], path: Path) -> None:
    """Write results as `read_results` reads them.

    Raises:
        InputError: the file cannot be written.
    """
    columns = ("engine", "setting", *NEEDED, "n", "failure")
    _write(path, columns, [{name: _text(getattr(result, name)) for name in columns} for result in results])


def _write(path: Path, columns: Sequence[str], table: Sequence[dict[str, str]]) -> None:
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, columns, lineterminator="\n")
            writer.writeheader()
            writer.writerows(table)
    except OSError as error:
        raise not_written(path, error) from error


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ""
    return str(value)


def _records(path: Path, needed: Sequence[str], allowed: Sequence[str]) -> list[tuple[int, dict[str, str]]]:
    """Lines of a CSV file with their numbers; all needed columns and no unknown ones."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, strict=True)
            names = reader.fieldnames or []
            for name in needed:
                if name not in names:
                    raise InputError(f"is missing, needed are the columns {', '.join(needed)}", file=path, key=name)
            for name in names:
                if name not in allowed:
                    raise InputError(f"is unknown, must be {', '.join(allowed)}", file=path, key=f"column {name!r}")
                if names.count(name) > 1:
                    raise InputError("stands there twice, must be once", file=path, key=f"column {name!r}")
            records = []
            for record in reader:
                if None in record or None in record.values():
                    raise InputError(
                        f"has not as many fields as the {len(names)} columns", **_at(path, reader.line_num)
                    )
                records.append((reader.line_num, record))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot be read as CSV: {error}", file=path) from error
    if not records:
        raise InputError("has no rows, needed is one at least", file=path)
    return records


def _at(path: Path, line: int, column: str = "") -> dict[str, str]:
    return {"file": str(path), "key": f"line {line}" + (f", column {column}" if column else "")}


def _number(path: Path, line: int, record: dict[str, str], column: str, *, blank: bool = False) -> float:
    text = record[column].strip()
    if not text and blank:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        allowed = "a finite number" + (" or nothing" if blank else "")
        raise InputError(f"is {quoted(text)}, must be {allowed}", **_at(path, line, column))
    return value


def _count(path: Path, line: int, record: dict[str, str], column: str) -> int:
    """A whole number, 0 where nothing stands."""
    text = record.get(column, "").strip()
    if not (text.isdecimal() and len(text) < 10) and text:
        raise InputError(f"is {quoted(text)}, must be a whole number or nothing", **_at(path, line, column))
    return int(text or 0)


def read_set(path: Path) -> list[Row]:
    """Read the rows of the set.

    Raises:
        InputError: a file that cannot be read, a column that is missing, a value that is no number.
    """
    rows = []
    for line, record in _records(path, ROW_COLUMNS, ROW_COLUMNS):
        names = ("right", "low", "high", "scale", "seed_sd")
        right, low, high, scale, seed_sd = (_number(path, line, record, name) for name in names)
        if not low <= right <= high:
            raise InputError(f"is {right:g}, must be low to high, {low:g} to {high:g}", **_at(path, line, "right"))
        if scale <= 0.0:
            raise InputError(f"is {scale:g}, must be above 0", **_at(path, line, "scale"))
        if record["chance"] not in ("yes", "no"):
            raise InputError(f"is {quoted(record['chance'])}, must be yes or no", **_at(path, line, "chance"))
        texts = {name: record[name] for name in ("case", "quantity", "unit", "source", "rule")}
        chance = record["chance"] == "yes"
        rows.append(Row(right=right, low=low, high=high, scale=scale, chance=chance, seed_sd=seed_sd, **texts))
    return rows


def read_results(path: Path, rows: Sequence[Row]) -> list[Result]:
    """Read results of engines: columns case, quantity, value, se; if wanted engine, setting, failure.

    Args:
        path: CSV file; without the column `engine` its name is that of the engine.
        rows: the set, whose cases and quantities are allowed.

    Raises:
        InputError: a file that cannot be read; a column that is missing or unknown; a case, a quantity or a value that
            is not allowed; the same quantity twice.
    """
    quantities: dict[str, list[str]] = {}
    for row in rows:
        quantities.setdefault(row.case, []).append(row.quantity)
    results, seen = [], set()
    for line, record in _records(path, NEEDED, (*NEEDED, *OPTIONAL)):
        case, quantity = record["case"].strip(), record["quantity"].strip()
        for column, name, allowed in (("case", case, quantities), ("quantity", quantity, quantities.get(case, []))):
            if name not in allowed:
                names = ", ".join(dict.fromkeys(allowed))
                problem = f"is {quoted(name)}, must be {names}{nearest(name, allowed)}"
                raise InputError(problem, **_at(path, line, column))
        failure = record.get("failure", "").strip()
        value = _number(path, line, record, "value", blank=bool(failure))
        se = _number(path, line, record, "se", blank=True)
        if se < 0.0:
            raise InputError(f"is {se:g}, must be 0 and more, or nothing", **_at(path, line, "se"))
        steps, n = (_count(path, line, record, column) for column in ("setting", "n"))
        engine = record.get("engine", "").strip() or path.stem
        key = (engine, steps, case, quantity)
        if key in seen:
            raise InputError("stands there twice for this engine and setting, must be once", **_at(path, line))
        seen.add(key)
        results.append(Result(case, quantity, value, se, engine, steps, n, failure))
    return results
