"""The folder of a sweep, read back: its table, what was asked, and the scenario that was varied."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError
from feeder_sim.measures.statistic import Statistic
from feeder_sim.report.question_folder import Line, TableFile, number_in, scenario_of, value_in
from feeder_sim.scenario import Scenario
from feeder_sim.studies.sweep.design import Point
from feeder_sim.studies.sweep.folder import CSV, QUESTION
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
    """

    folder: Path
    keys: tuple[str, ...]
    rows: tuple[Row, ...]
    uncertain: bool
    question: Question
    scenario: Scenario
    text: str

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
    def failed(self) -> dict[tuple[Any, ...], int]:
        """Seeds that failed, by the values of the points where some did."""
        counts = {tuple(row.point.values()): row.failed for row in self.rows}
        return {point: failed for point, failed in counts.items() if failed}


def read_sweep(folder: Path) -> SweepTable:
    """Read the folder of a sweep.

    Raises:
        InputError: a file of it is missing or cannot be read, or its table has no point.
    """
    scenario, text = scenario_of(folder, (QUESTION, CSV))
    question = Question.of_toml(folder / QUESTION)
    table = TableFile(folder / CSV)
    head = table.head
    keys = head[: head.index(COLUMNS[0])] if COLUMNS[0] in head else ()
    uncertain = head[len(keys) :] == COLUMNS + UNCERTAIN_COLUMNS
    if not keys or not (uncertain or head[len(keys) :] == COLUMNS):
        raise table.refused(f"a column per varied key, then {', '.join(COLUMNS)}")
    draws = question.inputs if uncertain else 0
    rows = table.rows(lambda line: _row(line, keys, draws))
    if not rows:
        raise InputError("holds no point, allowed is a sweep with at least one that is done", file=folder / CSV)
    return SweepTable(folder, keys, rows, uncertain, question, scenario, text)


def _row(line: Line, keys: tuple[str, ...], draws: int) -> Row:
    """A line of the table; 0 draws where no input is uncertain."""
    mean, se, n, failed = (number_in(line[name]) for name in COLUMNS[1:])
    spread = None
    if draws:
        low, high, of_inputs, of_seeds = (number_in(line[name]) for name in UNCERTAIN_COLUMNS)
        spread = Spread(math.nan, math.nan, math.nan, low, high, of_inputs, of_seeds, se, min(draws, int(n)))
    found = Statistic(mean, se * math.sqrt(n), se, int(n))
    return Row({key: value_in(line[key]) for key in keys}, line["measure"] or "", found, int(failed), spread)
