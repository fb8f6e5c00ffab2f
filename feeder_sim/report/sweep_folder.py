"""The folder of a sweep, read back: its table, what was asked, and the scenario that was varied."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError
from feeder_sim.jobs.cautions import Caution
from feeder_sim.jobs.folder import JOURNAL
from feeder_sim.measures.statistic import Statistic
from feeder_sim.report.question_folder import Line, TableFile, number_in, scenario_of, text_of, value_in
from feeder_sim.scenario import Scenario
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


def read_sweep(folder: Path) -> SweepTable:
    """Read the folder of a sweep.

    Raises:
        InputError: a file of it is missing or cannot be read, or its table has no point.
    """
    scenario, text = scenario_of(folder, (QUESTION, CSV, STATE))
    question = Question.of_toml(folder / QUESTION)
    if not (folder / CSV).is_file() and any(folder.glob(f"{JOURNAL}-*.jsonl")):
        problem = f"is missing: `feeder-sim merge {folder}` makes it of what the tasks of a job array have done"
        raise InputError(problem, file=folder / CSV)
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
    return _with_state(SweepTable(folder, keys, rows, uncertain, question, scenario, text), folder / STATE)


def _with_state(sweep: SweepTable, file: Path) -> SweepTable:
    """What is to be known beside the table, as far as there is a file of it."""
    if not file.is_file():
        return sweep
    try:
        state = json.loads(text_of(file))
        cautions = tuple(Caution.of_dict(entry) for entry in state["cautions"])
        return replace(
            sweep, complete=bool(state["complete"]), short=int(state["points_short_of_se"]), cautions=cautions
        )
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"holds no state of a sweep: {error}", file=file) from error


def _row(line: Line, keys: tuple[str, ...], draws: int) -> Row:
    """A line of the table; 0 draws where no input is uncertain."""
    mean, se, n, seeds, failed = (number_in(line[name]) for name in COLUMNS[1:])
    spread = None
    if draws:
        low, high, of_inputs, of_seeds = (number_in(line[name]) for name in UNCERTAIN_COLUMNS)
        spread = Spread(math.nan, math.nan, math.nan, low, high, of_inputs, of_seeds, se, min(draws, int(n)), int(n))
    found = Statistic(mean, se * math.sqrt(n), se, int(n))
    point = {key: value_in(line[key]) for key in keys}
    return Row(point, line["measure"] or "", found, int(seeds), int(failed), spread)
