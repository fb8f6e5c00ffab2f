"""A scenario at many points: what is asked, and the table that answers it.

The folder holds

    sweep.toml          what was asked
    scenario.toml       the scenario that was varied, with all its defaults
    journal.jsonl       measures of every seed that is done; of job arrays one per task, journal-I-of-N.jsonl
    sweep.csv           the table, see `feeder_sim.studies.sweep.table`
    sweep.parquet       the same
    sweep.png           a picture of one measure
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from feeder_sim.document.document import Table, Text
from feeder_sim.document.figure import Figure
from feeder_sim.document.words import measure_label
from feeder_sim.errors import InputError, NotAllowed, quoted
from feeder_sim.jobs.task import RepeatedWarning
from feeder_sim.measures.effort import FEWEST, FIRST_CHECK, MOST_SEEDS, Effort
from feeder_sim.measures.statistic import LARGEST_OF_MANY
from feeder_sim.notebook import cell, counted
from feeder_sim.scenario import Scenario
from feeder_sim.studies.question import Question
from feeder_sim.studies.study import Record, Study, csv_bytes
from feeder_sim.studies.sweep.cases import Cases, CasesPlan, check_measure
from feeder_sim.studies.sweep.design import Axis, Point, grid, read_axis, side_by_side, sobol_sample
from feeder_sim.studies.sweep.table import (
    COLUMNS,
    UNCERTAIN_COLUMNS,
    Row,
    as_parquet,
    empty_row,
    main_measure,
    means_of_some,
)
from feeder_sim.studies.uncertainty.spread import draws_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_LINES = 60  # of a table on the terminal
CSV, PARQUET, PICTURE = "sweep.csv", "sweep.parquet", "sweep.png"


class SweepQuestion(Question):
    """What is asked of a scenario at many points."""

    kind = "sweep"
    file = "sweep.toml"
    base = "sweeps"

    vary: tuple[str, ...] = Field(
        description="KEY=LOW:HIGH:COUNT, LOW:HIGH:logCOUNT or A,B,C; for --sobol also LOW:HIGH."
    )
    zip: Annotated[bool, Field(strict=True, description="Take the axes side by side, not crossed.")] = False
    sobol: Annotated[int, Field(strict=True, ge=0, description="Points of a Sobol sample over the axes.")] = 0
    seeds: Annotated[int | None, Field(strict=True, ge=1, description="Seeds of every point [the scenario's].")] = None
    measure: Annotated[
        str | None, Field(strict=True, description="Measure to print and draw, and for --until-se [the usual one].")
    ] = None
    until_se: Annotated[
        float | None,
        Field(strict=True, gt=0, lt=1, description="More seeds until the standard error is below, such as 3%."),
    ] = None
    most_seeds: Annotated[
        int, Field(strict=True, ge=FEWEST, le=1_000_000, description="Of a point, whatever --until-se asks for.")
    ] = MOST_SEEDS
    inputs: Annotated[int, Field(strict=True, ge=2, le=4096, description="Draws of inputs that are [uncertain].")] = 16

    @property
    def same(self) -> str:
        """The points: more seeds or another measure are no other question."""
        return f"{self.vary} {self.zip} {self.sobol}"

    @property
    def axes(self) -> list[Axis]:
        return [read_axis(text) for text in self.vary]

    def points(self, scenario: Scenario) -> list[Point]:
        """The points, in order.

        Raises:
            InputError: axes that do not make points.
        """
        if self.sobol and self.zip:
            raise InputError("are both given, must be one of them", argument="zip, sobol")
        if self.sobol:
            return sobol_sample(self.axes, self.sobol, scenario.run.seed)
        return side_by_side(self.axes) if self.zip else grid(self.axes)

    def effort(self, scenario: Scenario) -> Effort:
        """How many seeds each point gets.

        Raises:
            InputError: `until_se` without a measure to look at.
        """
        if self.until_se and not self.measure:
            raise InputError("is missing, must be the measure whose standard error is looked at", argument="measure")
        seeds = self.seeds or scenario.run.seeds
        return Effort(seeds, self.until_se, max(self.most_seeds, seeds), self.measure or "")

    def plan(self, scenario: Scenario, file: Path) -> CasesPlan:
        draws = draws_of(scenario, self.inputs)
        cases = Cases.at(scenario, self.points(scenario), draws, self.effort(scenario), file=file)
        return CasesPlan(
            cases, lambda cases, complete, foreign: Sweep.from_cases(self, scenario, cases, complete, foreign)
        )


@dataclass(frozen=True, repr=False)
class Sweep(Study):
    """What a sweep has come to.

    Attributes:
        question: what was asked.
        scenario: that was varied.
        points: values of the varied keys at each point.
        uncertain: whether inputs were.
        by_point: the rows of the table of each point; none where nothing is done yet.
        complete: whether all of it is done.
        missing: seeds that are still to be run, as far as is known.
        short: points that have all seeds they may have, and not the standard error that was asked for.
        retained: points that keep more seeds than were asked for, since they had been run before.
        foreign_seeds: in the folder, that do not count: of other points, another version, or changed files.
        failures: why seeds have failed, each reason once, with the first point where it is so.
        warnings: settings that are known to mislead, each once, with the number of points where it holds.
    """

    picture = PICTURE
    question: SweepQuestion
    scenario: Scenario
    points: tuple[Point, ...]
    uncertain: bool
    by_point: tuple[list[Row], ...]
    complete: bool
    missing: int = 0
    short: int = 0
    retained: int = 0
    foreign_seeds: int = 0
    failures: Sequence[str] = ()
    warnings: Sequence[RepeatedWarning] = ()

    @staticmethod
    def from_cases(question: SweepQuestion, scenario: Scenario, cases: Cases, complete: bool, foreign: int) -> Sweep:
        """From the cases at all points."""
        attributes = {name: getattr(cases, name) for name in ("missing", "short", "retained", "failures", "warnings")}
        of_points = cases.points, cases.uncertain, tuple(cases.rows)
        return Sweep(question, scenario, *of_points, complete, foreign_seeds=foreign, **attributes)

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied keys."""
        return tuple(dict.fromkeys(key for point in self.points for key in point))

    @property
    def rows(self) -> tuple[Row, ...]:
        """The table: every measure at every point."""
        return tuple(row for rows in self.by_point for row in rows)

    @property
    def measures(self) -> tuple[str, ...]:
        """Names of all measures."""
        return tuple(dict.fromkeys(row.measure for row in self.rows if row.measure))

    def measure(self, name: str | None = None) -> str:
        name = name or self.question.measure or ""
        check_measure(name, dict.fromkeys(self.measures, 0.0))
        return name or main_measure(self.measures, self.rows)

    def of(self, measure: str) -> list[Row]:
        """The rows of one measure, one per point that has it."""
        return [row for row in self.rows if row.measure == measure]

    def valued(self, measure: str) -> list[Row]:
        """The rows of a measure that have a mean."""
        return [row for row in self.of(measure) if math.isfinite(row.statistic.mean)]

    def at_every_point(self, measure: str) -> list[Row]:
        """A row for each point, also where it has no value of the measure, or has not begun."""
        selected = []
        for point, rows in zip(self.points, self.by_point, strict=True):
            seeds, failed = (rows[0].seeds, rows[0].failed) if rows else (0, 0)
            matches = (row for row in rows if row.measure == measure)
            selected.append(next(matches, empty_row(point, seeds, failed)))
        return selected

    @property
    def missing_at_points(self) -> list[int]:
        """Of each point of the table that has not all seeds asked for: how many are missing."""
        effort = self.question.effort(self.scenario)
        each = FIRST_CHECK if effort.until_se else effort.seeds
        planned = each * (self.question.inputs if self.uncertain else 1)
        return [planned - rows[0].seeds for rows in self.by_point if rows and rows[0].seeds < planned]

    @property
    def failed(self) -> list[int]:
        """Seeds that failed, of each point where some did."""
        return [rows[0].failed for rows in self.by_point if rows and rows[0].failed]

    def table(self) -> list[Record]:
        return [row.as_dict() for row in self.rows]

    @property
    def size(self) -> str:
        return counted(len(self.points), "point")

    def as_json(self, measure: str | None = None) -> dict[str, Any]:
        return {
            "measure": self.measure(measure),
            "rows": self.table(),
            "complete": self.complete,
            "missing_seeds": self.missing,
            "points_short_of_se": self.short,
            "warnings": [warning.as_dict() for warning in self.warnings],
        }

    def lines(self, measure: str | None = None) -> list[str]:
        """One measure over the points."""
        name = self.measure(measure)
        columns = (*self.keys, "mean", "se", *(("low", "high") if self.uncertain else ()), "n", "seeds", "failed")
        head = tuple({"mean": name or "measure", "se": "+-"}.get(column, column) for column in columns)
        rows = [row.as_dict() for row in self.at_every_point(name)]
        texts = tuple(tuple(cell(row.get(column)) for column in columns) for row in rows[:MOST_LINES])
        lines, more = Table("", head, texts, numbers_from=0).lines(), len(rows) - MOST_LINES
        return [*lines, f"and {more} more points, in the table of the folder"] if more > 0 else lines

    def remarks(self, measure: str | None = None) -> Iterator[Text]:
        name, points = self.measure(measure), sum(bool(rows) for rows in self.by_point)
        missing, at = self.missing_at_points, f"of {len(self.points)} points"
        if failed := self.failed:
            text = f"{counted(sum(failed), 'seed')} failed, at {len(failed)} {at}; they do not count in the means"
            yield Text(text, "failure")
        yield from super().remarks(measure)
        if points < len(self.points):
            yield Text(f"{points} of {len(self.points)} points are there: the sweep has not ended", "note")
        if missing:
            text = f"{sum(missing)} seeds are missing, at {len(missing)} {at}: the sweep has not ended"
            yield Text(text, "note")
        elif not self.complete and points == len(self.points):
            yield Text("more seeds are to be run: the sweep has not ended", "note")
        if some := means_of_some(self.of(name)):
            yield Text(f"{measure_label(name)}: {some}", "warning")
        if self.short:
            most = self.question.effort(self.scenario).most_seeds
            text = f"{self.short} {at} have as many seeds as --most-seeds allows, {most}"
            yield Text(f"{text}, and not the standard error of --until-se", "warning")
        if self.retained:
            yield Text(f"{self.retained} points keep the seeds that they had, which are more than asked for now")
        if alone := sum(row.statistic.n == 1 for row in self.rows):
            yield Text(f"{alone} values come from a single seed and have no interval", "warning")
        if points > 1:
            note = "all points have the same random starts, so that differences between them are surer"
            yield Text(f"{note} than the intervals say", "note")
            yield Text(LARGEST_OF_MANY, "note")

    def files(self, carried: Callable[[Any], str]) -> dict[str, bytes]:
        if not self.rows:
            return {}
        columns = (*self.keys, *COLUMNS, *(UNCERTAIN_COLUMNS if self.uncertain else ()))
        return {
            CSV: csv_bytes(columns, self.table()),
            PARQUET: as_parquet(columns, self.table()),
        }

    def figures(self, measure: str) -> list[Figure]:
        from feeder_sim.plots.sweep import sweep_figure

        rows = self.valued(measure)
        return [sweep_figure(rows, self.keys, measure)] if rows else []

    def plot(self, measure: str | None = None) -> Sequence[Axes]:
        """Draw a measure: means with 95 % intervals over each key, or a map over two; returns matplotlib axes.

        Args:
            measure: its name; default: the usual one.

        Raises:
            InputError: there is no such measure, or it has no value anywhere.
        """
        from matplotlib import pyplot

        name = self.measure(measure)
        figures = self.figures(name)
        if not figures:
            raise InputError("has no value at any point, there is nothing to draw", key=name or "plot")
        figure = pyplot.figure(figsize=(figures[0].width, figures[0].height), layout="constrained")
        figures[0].draw(figure)
        return figure.axes

    def _line(self) -> str:
        suffix = "" if self.complete else ", not complete"
        counts = [counted(len(self.points), "point"), counted(len(self.measures), "measure")]
        counts += [counted(len(self.warnings), "warning")] if self.warnings else []
        return f"Sweep over {' and '.join(self.keys)}: {', '.join(counts)}{suffix}"

    def _notebook_rows(self) -> list[Record]:
        return [row.as_dict() for row in self.at_every_point(self.measure())]


def axis_texts(vary: Mapping[str, Any]) -> tuple[str, ...]:
    """Axes as the command line has them, from values by key: sequences of values, or such texts."""
    return tuple(f"{key}={values if isinstance(values, str) else _listed(key, values)}" for key, values in vary.items())


def _listed(key: str, values: Any) -> str:
    if not isinstance(values, Iterable):
        raise NotAllowed(values, "a sequence of values, or a text of them", key=str(key))
    try:
        return json.dumps([value.item() if isinstance(value, np.generic) else value for value in values])
    except TypeError as error:
        raise InputError(f"is {quoted(values)}, must be numbers, texts and tables", key=str(key)) from error
