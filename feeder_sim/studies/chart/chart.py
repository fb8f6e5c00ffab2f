"""Speed against accuracy of one measure of a scenario: methods and simplifications against a reference.

The reference is the finest setting of the most exact method, or a known value. It checks itself: the next finest one
has to agree with it within the errors of both, or to a fifth of the error that is good enough. Seeds of all settings
are run in turn, so that their wall times are taken under the same load.

The folder holds chart.toml, scenario.toml and journals as that of a sweep, and

    chart.csv    a row per setting, see `Row`
    chart.png    error over cost
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from feeder_sim.document.document import Table, Text
from feeder_sim.document.figure import Figure
from feeder_sim.errors import InputError
from feeder_sim.jobs.task import RepeatedWarning
from feeder_sim.measures.effort import Effort
from feeder_sim.measures.statistic import Statistic, finite_or_none
from feeder_sim.notebook import axes_for, counted
from feeder_sim.scenario import Scenario
from feeder_sim.studies.chart.settings import METHODS, MUJOCO, Setting, is_default, reference_of, settings_of
from feeder_sim.studies.question import Question
from feeder_sim.studies.study import Record, Study, csv_bytes
from feeder_sim.studies.sweep.cases import Case, Cases, CasesPlan, check_measure
from feeder_sim.studies.sweep.table import main_measure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CSV, PICTURE = "chart.csv", "chart.png"
ALIKE = 1.25  # ratio of costs that count as equal: those of one setting scatter by as much
SURE = 2.0  # standard errors
MOST_HAVE = 0.5  # of the seeds have a value, at least: a mean of those that arrive is one of the fast ones
STILL = 0.2  # of the error that is good enough: by so much the reference may move
OFTEN = 4  # times as many seeds for the reference and what checks it: its error is in that of all others


class ChartQuestion(Question):
    """Which setting computes a measure of a scenario well enough, and what it costs."""

    kind = "chart"
    file = "chart.toml"
    base = "charts"

    measure: Annotated[str | None, Field(strict=True, description="Measure to compute well [the usual one].")] = None
    seeds: Annotated[int | None, Field(strict=True, ge=1, description="Seeds of every setting [the scenario's].")] = (
        None
    )
    method: tuple[Literal["no-step", "steps", "mujoco", "simplified"], ...] = Field(
        default=("no-step", "steps", "simplified"),
        description=f"One of {', '.join(METHODS)}; repeatable [all but {MUJOCO}, which is dear].",
    )
    within: Annotated[float, Field(strict=True, gt=0, lt=1, description="Error that is good enough [1].")] = 0.05
    known: Annotated[
        float | None, Field(strict=True, allow_inf_nan=False, description="The exact value [the finest setting].")
    ] = None

    @property
    def same(self) -> str:
        """More seeds, other methods or another measure are no other question."""
        return ""

    def plan(self, scenario: Scenario, file: Path) -> CasesPlan:
        settings, left_out = settings_of(scenario, self.method, file)
        varied = [scenario.changed({"uncertain": None, **setting.changes}, file=file) for setting in settings]
        default = tuple(is_default(scenario, setting, file) or not setting.method for setting in settings)
        points = tuple({"setting": setting.name} for setting in settings)
        surer = reference_of(settings) if self.known is None else ()

        def case(i: int) -> Case:
            return Case(lambda: varied[i], points[i], times=OFTEN if i in surer else 1)

        effort = Effort(self.seeds or scenario.run.seeds, measure=self.measure or "")
        cases = Cases(points, tuple((case(i),) for i in range(len(varied))), effort, in_turn=True)

        def answer(cases: Cases, complete: bool, _: int) -> Chart:
            here = [point in cases.points for point in points]  # of a task of a job array not all are
            selected, usual = list(itertools.compress(settings, here)), list(itertools.compress(default, here))
            return charted(self, scenario, selected, usual, cases, complete, tuple(left_out))

        return CasesPlan(cases, answer)


@dataclass(frozen=True)
class Row:
    """What one setting has come to.

    Attributes:
        method, setting: names.
        mean, se, n: of the measure over the n seeds that have a value.
        seeds, failed: seeds that were run, and those that failed.
        error, error_se: difference to the reference and its standard error, in the unit of the measure.
        wall_s: mean wall time of a seed on one core [s].
        cost: that over the one of the scenario as it is [1].
        verdict: "good" within the error that is good enough, "off" beyond it and two standard errors, "unclear" where
            the seeds cannot tell, "fails" where seeds failed or most have no value.
        default: whether the scenario asks for it.
        reference: whether it is the reference.
    """

    method: str
    setting: str
    mean: float
    se: float
    n: int
    seeds: int
    failed: int
    error: float
    error_se: float
    wall_s: float
    cost: float
    verdict: str
    default: bool
    reference: bool

    def as_dict(self) -> dict[str, Any]:
        """By column; None where there is no value."""
        return {name: finite_or_none(v) if isinstance(v, float) else v for name, v in asdict(self).items()}


COLUMNS = tuple(entry.name for entry in fields(Row))


@dataclass(frozen=True, repr=False)
class Chart(Study):
    """Speed against accuracy.

    Attributes:
        question: what was asked.
        scenario: that was computed.
        name: of the measure.
        rows: of the table, one per setting that has a seed.
        complete: whether all seeds are done.
        holds: whether the reference agrees with the next finest setting within the errors of both, or to a fifth of
            the error that is good enough; None where it is a known value, or has no other setting beside it.
        left_out: settings that the scenario cannot be computed with, a line each.
        failures: why seeds have failed, each reason once.
        warnings: settings that are known to mislead.
    """

    picture = PICTURE
    question: ChartQuestion
    scenario: Scenario
    name: str
    rows: tuple[Row, ...]
    complete: bool
    holds: bool | None = None
    left_out: tuple[str, ...] = ()
    failures: Sequence[str] = ()
    warnings: Sequence[RepeatedWarning] = ()
    places = "settings"

    @property
    def recommended(self) -> Row | None:
        """The cheapest setting that is good: the scenario as it is where that is good and hardly dearer."""
        good = [row for row in self.rows if row.verdict == "good"]
        cheapest = min(good, key=lambda row: row.wall_s, default=None)
        return next(
            (row for row in good if cheapest and row.default and row.wall_s < ALIKE * cheapest.wall_s), cheapest
        )

    def measure(self, name: str | None = None) -> str:
        if name and name != self.name:
            raise InputError(f"is {name}, must be {self.name}: a chart is one of a measure", argument="measure")
        return self.name

    def table(self) -> list[Record]:
        return [row.as_dict() for row in self.rows]

    @property
    def size(self) -> str:
        return counted(len(self.rows), "setting")

    def as_json(self, measure: str | None = None) -> dict[str, Any]:
        best = self.recommended
        return {
            "measure": self.measure(measure),
            "rows": self.table(),
            "complete": self.complete,
            "recommended": best.setting if best else None,
            "reference_holds": self.holds,
            "left_out": list(self.left_out),
            "warnings": [warning.as_dict() for warning in self.warnings],
        }

    def lines(self, measure: str | None = None) -> list[str]:
        """One line per setting, and which to take."""
        rows = []
        for row in self.rows:
            notes = [row.verdict, *(["as it is"] if row.default else []), *(["reference"] if row.reference else [])]
            value = f"{row.mean:.4g} +- {row.se if math.isfinite(row.se) else 0.0:.2g}" if row.n else "none"
            error = f"{row.error:+.2g} +- {row.error_se:.2g}" if math.isfinite(row.error) else ""
            rows.append((row.setting, ", ".join(notes), value, error, f"{row.cost:.3g}"))
        head = ("setting", "verdict", self.measure(measure) or "measure", "error", "cost")
        lines = Table("", head, tuple(rows), numbers_from=2).lines()
        best = self.recommended
        return [*lines, f"take: {best.setting}" if best else "take: none is known to be good, more seeds may tell"]

    def remarks(self, measure: str | None = None) -> Iterator[Text]:
        yield from super().remarks(measure)
        for line in self.left_out:
            yield Text(f"left out: {line}")
        if self.holds is False:
            yield Text("the reference still moves with its setting, so that errors are known no better", "warning")
        if any(row.seeds == 1 for row in self.rows):
            yield Text("of one seed no error is known, --seeds gives more", "warning")

    def files(self, carried: Callable[[Any], str]) -> dict[str, bytes]:
        if not self.rows:
            return {}
        return {CSV: csv_bytes(COLUMNS, self.table())}

    def figures(self, measure: str) -> list[Figure]:
        from feeder_sim.plots.error_over_cost import chart_figure, right_value

        return [chart_figure(self)] if abs(right_value(self)) > 0.0 else []

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw errors over costs; returns matplotlib axes.

        Args:
            ax: matplotlib axes to draw into; default: new ones.

        Raises:
            InputError: nothing has a value, or the reference is 0, of which there is no share.
        """
        from feeder_sim.plots.error_over_cost import draw_errors

        if not self.figures(self.name):
            raise InputError("has no value, or a reference of 0: there is nothing to draw", key="plot")
        axes = axes_for(ax)
        draw_errors(axes, self)
        return axes

    def _line(self) -> str:
        best = self.recommended
        suffix = "" if self.complete else ", not complete"
        return f"Chart of {self.name}: {self.size}, take {best.setting if best else 'none'}{suffix}"


def charted(
    question: ChartQuestion,
    scenario: Scenario,
    settings: Sequence[Setting],
    default: Sequence[bool],
    cases: Cases,
    complete: bool,
    left_out: tuple[str, ...],
) -> Chart:
    """The chart of what is done.

    Raises:
        InputError: there is no such measure.
    """
    completed = [[seed for case in row for seed in case.seeds(cases.effort)] for row in cases.cases]
    named = {name: 0.0 for seeds in completed for seed in seeds for name in seed.values}
    check_measure(question.measure or "", named)
    name = question.measure or main_measure(tuple(named), [row for rows in cases.rows for row in rows])
    statistics = [Statistic.of(seed.values.get(name, math.nan) for seed in seeds) for seeds in completed]
    wall = [sum(seed.wall_s for seed in seeds) / len(seeds) if seeds else math.nan for seeds in completed]
    usual = next((w for w, of in zip(wall, default, strict=True) if of), math.nan)
    at, beside = reference_of(settings)
    holds = (
        None
        if beside is None or question.known is not None
        else _holds(statistics[at], statistics[beside], STILL * question.within)
    )
    right = Statistic(question.known, 0.0, 0.0, 1) if question.known is not None else statistics[at]
    rows = []
    for i, (setting, seeds, value) in enumerate(zip(settings, completed, statistics, strict=True)):
        if not seeds:
            continue
        is_reference = question.known is None and i == at
        error = 0.0 if is_reference else value.mean - right.mean
        error_se = 0.0 if is_reference else math.hypot(_se(value), _se(right))
        failed = sum(bool(seed.failure) for seed in seeds)
        fails = bool(failed) or value.n < MOST_HAVE * len(seeds)
        own_se = _se(value) if is_reference else error_se
        verdict = "fails" if fails else _verdict(error, own_se, abs(right.mean) * question.within)
        of_measure = value.mean, value.se, value.n, len(seeds), failed, error, error_se, wall[i], wall[i] / usual
        rows.append(Row(setting.method, setting.name, *of_measure, verdict, default[i], is_reference))
    problems: dict[str, Any] = {"failures": cases.failures, "warnings": cases.warnings}
    return Chart(question, scenario, name, tuple(rows), complete, holds, left_out, **problems)


def _holds(reference: Statistic, other: Statistic, share: float) -> bool | None:
    """Whether a reference and the next finest setting agree to a share, or within both errors; None without a value."""
    if not reference.n or not other.n:
        return None
    allowed = max(SURE * math.hypot(_se(other), _se(reference)), share * abs(reference.mean))
    return abs(other.mean - reference.mean) <= allowed


def _verdict(error: float, error_se: float, good: float) -> str:
    """Whether an error is small enough; see `Row`."""
    if not math.isfinite(error):
        return "unclear"
    if abs(error) > max(good, SURE * error_se):
        return "off"
    return "good" if SURE * error_se <= good else "unclear"


def _se(statistic: Statistic) -> float:
    """Its standard error; 0 of a single value."""
    return statistic.se if math.isfinite(statistic.se) else 0.0
