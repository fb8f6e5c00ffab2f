"""The folder of a sweep, read back: its table, what was asked, and the scenario that was varied."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError, cause_of, quoted
from feeder_sim.jobs.cautions import Caution
from feeder_sim.jobs.folder import SCENARIO
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.studies.sweep.case import FIRST_LOOK
from feeder_sim.studies.sweep.design import Point
from feeder_sim.studies.sweep.folder import CSV, QUESTION, STATE
from feeder_sim.studies.sweep.question import Question
from feeder_sim.studies.sweep.table import COLUMNS, UNCERTAIN_COLUMNS, Row
from feeder_sim.studies.uncertainty.spread import Spread


@dataclass(frozen=True)
class SweepTable:
    """A sweep on disk.

    Attributes:
        folder: that holds it.
        keys: that were varied, in the order of the columns.
        rows: in the order of the table.
        uncertain: whether inputs were.
        question: what was asked.
        scenario: that was varied.
        text: of that scenario.
        complete: whether it had come to its end when the table was written; True where that is not known.
        short: points that have all seeds they may have, and not the standard error that was asked for.
        cautions: about settings of the scenarios.
    """

    folder: Path
    keys: tuple[str, ...]
    rows: tuple[Row, ...]
    uncertain: bool
    question: Question
    scenario: Scenario
    text: str
    complete: bool = True
    short: int = 0
    cautions: tuple[Caution, ...] = ()

    @property
    def points(self) -> list[Point]:
        """All points, each once, in the order of the table."""
        return list({tuple(row.point.values()): row.point for row in self.rows}.values())

    @property
    def measures(self) -> list[str]:
        """Names of all measures, each once, in the order of the table."""
        return list(dict.fromkeys(row.measure for row in self.rows if row.measure))

    def of(self, measure: str) -> list[Row]:
        """The rows of a measure that have a mean."""
        return [row for row in self.rows if row.measure == measure and math.isfinite(row.found.mean)]

    @property
    def missing(self) -> list[int]:
        """Of each point of the table that has not all seeds asked for: how many are missing."""
        asked = self.question.effort(self.scenario)
        each = FIRST_LOOK if asked.until_se else asked.seeds
        planned = each * (self.question.inputs if self.uncertain else 1)
        seeds = {tuple(row.point.values()): row.seeds for row in self.rows}
        return [planned - held for held in seeds.values() if held < planned]

    @property
    def failed(self) -> dict[tuple[Any, ...], int]:
        """Seeds that failed, by the values of the points where some did."""
        counts = {tuple(row.point.values()): row.failed for row in self.rows}
        return {point: failed for point, failed in counts.items() if failed}


def is_sweep(folder: Path) -> bool:
    """Whether a folder holds a sweep."""
    return (folder / QUESTION).is_file()


def read_sweep(folder: Path) -> SweepTable:
    """Read the folder of a sweep.

    Raises:
        InputError: a file of it is missing or cannot be read, or its table has no point.
    """
    for name in (QUESTION, SCENARIO, CSV, STATE):
        if (folder / name).is_symlink():
            raise InputError("is a link, allowed is a file of the sweep itself", file=folder / name)
    question = Question.of_toml(folder / QUESTION)
    scenario = load_scenario(folder / SCENARIO)
    table = folder / CSV
    if not table.is_file():
        raise InputError("is missing: the sweep has not come so far, run it again to go on", file=table)
    reader = csv.DictReader(_text(table).splitlines())
    head = tuple(reader.fieldnames or ())
    keys = head[: head.index(COLUMNS[0])] if COLUMNS[0] in head else ()
    uncertain = head[len(keys) :] == COLUMNS + UNCERTAIN_COLUMNS
    if not keys or not (uncertain or head[len(keys) :] == COLUMNS):
        allowed = f"a column per varied key, then {', '.join(COLUMNS)}"
        raise InputError(f"has the columns {quoted(', '.join(head))}, allowed is {allowed}", file=table)
    draws = question.inputs if uncertain else 0
    try:
        rows = tuple(_row(line, keys, table, number, draws) for number, line in enumerate(reader, 2))
    except csv.Error as error:
        raise InputError(f"is no table: {error}", file=table) from error
    if not rows:
        raise InputError("holds no point, allowed is a sweep with at least one that is done", file=table)
    found = SweepTable(folder, keys, rows, uncertain, question, scenario, _text(folder / SCENARIO))
    return _with_state(found, folder / STATE)


def _with_state(sweep: SweepTable, file: Path) -> SweepTable:
    """What is to be known beside the table, as far as there is a file of it."""
    if not file.is_file():
        return sweep
    try:
        state = json.loads(_text(file))
        cautions = tuple(Caution.of_dict(entry) for entry in state["cautions"])
        return replace(
            sweep, complete=bool(state["complete"]), short=int(state["points_short_of_se"]), cautions=cautions
        )
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"holds no state of a sweep: {error}", file=file) from error


def _row(line: Mapping[str, str | None], keys: tuple[str, ...], table: Path, number: int, draws: int) -> Row:
    """A line of the table, whose number in the file is for messages; 0 draws where no input is uncertain."""
    try:
        mean, se, n, seeds, failed = (_number(line[name]) for name in COLUMNS[1:])
        spread = None
        if draws:
            low, high, of_inputs, of_seeds = (_number(line[name]) for name in UNCERTAIN_COLUMNS)
            spread = Spread(math.nan, math.nan, math.nan, low, high, of_inputs, of_seeds, se, min(draws, int(n)))
        found = Statistic(mean, se * math.sqrt(n), se, int(n))
        return Row(
            {key: _value(line[key]) for key in keys}, line["measure"] or "", found, int(seeds), int(failed), spread
        )
    except (ValueError, TypeError, OverflowError):
        raise InputError(f"line {number} is {quoted(list(line.values()))}, allowed are numbers", file=table) from None


def _number(text: str | None) -> float:
    """A number; NaN for an empty field, and for what is not finite."""
    value = float(text) if text else math.nan
    return value if math.isfinite(value) else math.nan


def _value(text: str | None) -> float | str:
    """The value of a key: a number where it is one."""
    try:
        return float(text or "")
    except ValueError:
        return text or ""


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {cause_of(error)}", file=file) from error
