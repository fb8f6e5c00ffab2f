"""A scenario with uncertain inputs: its measures with intervals over the inputs and over the seeds, apart.

The folder holds

    uncertainty.toml    what was asked
    scenario.toml       the scenario, with all its defaults
    journal.jsonl       measures of every seed that is done
    draws.csv           one row per draw and seed: the inputs, then the measures
    uncertainty.csv     one row per measure, see `COLUMNS`
    inputs.csv          one row per measure and input: on which inputs it hangs, see `SHARES`
    uncertainty.png     a picture of one measure
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from feeder_sim.document.document import Table, Text
from feeder_sim.document.figure import Figure
from feeder_sim.document.words import measure_label
from feeder_sim.errors import InputError, Unknown
from feeder_sim.jobs.task import RepeatedWarning, SeedValues, warnings_over
from feeder_sim.measures.effort import Effort
from feeder_sim.measures.protocol import labelled
from feeder_sim.measures.statistic import Statistic, finite_or_none
from feeder_sim.notebook import axes_for, counted
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.changes import labels
from feeder_sim.studies.question import Question
from feeder_sim.studies.study import Record, Study, csv_bytes
from feeder_sim.studies.sweep.cases import Cases, CasesPlan
from feeder_sim.studies.sweep.table import main_measure
from feeder_sim.studies.uncertainty.indices import Index, saltelli_draws, sobol_indices
from feeder_sim.studies.uncertainty.linear_shares import LinearShares, linear_shares
from feeder_sim.studies.uncertainty.spread import Draw, Spread, draws_of, spread_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DRAWS, TABLE, PICTURE, INPUTS = "draws.csv", "uncertainty.csv", "uncertainty.png", "inputs.csv"
SEEDS = 2  # of a draw: the fewest that tell inputs and seeds apart
# low, high: 90 % interval of one run, inputs and seeds together; inputs_low, inputs_high: of the mean over the seeds,
# empty where sd_inputs is 0 because the inputs are not told apart from the seeds.
COLUMNS = (
    *("measure", "mean", "se", "median", "low", "high", "inputs_low", "inputs_high", "sd_inputs", "sd_seeds"),
    *("draws", "failed"),
)
# Shares of the variance over the inputs, each with half its 95 % interval; empty where they are not told.
SHARES = (
    *("measure", "input", "linear", "linear_interval"),
    *("first_order", "first_order_interval", "total", "total_interval"),
)
FEW_DRAWS = 20  # below it not even one draw lies beyond each end of 90 %
FEW_FOR_INDICES = 64  # draws, each (inputs + 2) times
WIDE = 0.3  # of the interval of an index, on each side, that tells nothing apart
MOSTLY = 0.9  # of the variance that straight lines explain where they tell what the result depends on
MOST_CAUSES = 5  # of failures, one by one


class UncertaintyQuestion(Question):
    """What is asked of uncertain inputs."""

    kind = "uncertainty"
    file = "uncertainty.toml"
    base = "uncertainty"

    inputs: Annotated[int, Field(strict=True, ge=2, le=65536, description="Draws of the uncertain inputs.")] = 32
    seeds: Annotated[int, Field(strict=True, ge=1, description="Seeds of every draw.")] = SEEDS
    indices: Annotated[
        bool,
        Field(strict=True, description="Also Sobol indices; takes (number of inputs + 2) times the draws."),
    ] = False
    measure: Annotated[str | None, Field(strict=True, description="Measure to print and draw [the usual one].")] = None
    measured: Annotated[float | None, Field(description="Value to mark in the picture.")] = None

    @property
    def same(self) -> str:
        """The draws: more seeds or another measure are no other question."""
        return f"{self.inputs} {self.indices}"

    def plan(self, scenario: Scenario, file: Path) -> CasesPlan:
        if not scenario.uncertain:
            raise InputError("is missing, must be a table with the inputs that are uncertain", key="[uncertain]")
        if self.indices and any(uncertain.joint for uncertain in scenario.uncertain.values()):
            raise InputError("are of independent inputs, must not be asked for with draws", argument="indices")
        if self.indices and self.inputs & (self.inputs - 1):
            raise InputError(f"is {self.inputs}, must be a power of two with indices", argument="inputs")
        if self.indices and self.seeds < SEEDS:
            problem = "is 1, must be 2 or more with indices: one seed does not tell how far seeds scatter"
            raise InputError(problem, argument="seeds")
        draws = saltelli_draws(scenario, self.inputs) if self.indices else draws_of(scenario, self.inputs)
        cases = Cases.at(scenario, [{}], draws, Effort(self.seeds, measure=self.measure or ""), file=file)
        return CasesPlan(cases, lambda cases, complete, _: Uncertainty(self, scenario, tuple(draws), cases, complete))

    def draws(self, scenario: Scenario) -> int:
        """How many draws there are."""
        return self.inputs * (len(scenario.uncertain or {}) + 2) if self.indices else self.inputs


@dataclass(frozen=True, repr=False)
class Uncertainty(Study):
    """What uncertain inputs come to.

    Attributes:
        question: what was asked.
        scenario: with the uncertain inputs.
        draws: values of the inputs, by key.
        cases: one per draw, at a single point.
        complete: whether all of it is done.
    """

    places = "draws"
    picture = PICTURE
    question: UncertaintyQuestion
    scenario: Scenario
    draws: tuple[Draw, ...]
    cases: Cases
    complete: bool

    @property
    def done(self) -> list[tuple[Draw, SeedValues]]:
        """All seeds that are done, with the values of their draw, in order."""
        pairs = zip(self.draws, self.cases, strict=True)
        return [(draw, seed) for draw, case in pairs for seed in case.seeds(self.cases.effort)]

    @property
    def failed(self) -> list[SeedValues]:
        """The seeds that ended without any value."""
        return [seed for _, seed in self.done if seed.failure]

    @property
    def warnings(self) -> list[RepeatedWarning]:
        """Settings that are known to mislead, each once, with the number of draws where it holds."""
        return warnings_over(case.done.values() for case in self.cases)

    @cached_property
    def measures(self) -> tuple[str, ...]:
        """Names of all measures that have a value."""
        names = dict.fromkeys(n for case in self.cases for seed in case.done.values() for n in seed.values)
        return tuple(name for name in names if self.spread(name).draws)

    def measure(self, name: str | None = None) -> str:
        name = name or self.question.measure
        if name and name not in self.measures and (self.measures or name != self.question.measure):
            raise Unknown(name, self.measures, argument="measure")
        return name or self.main()

    def main(self) -> str:
        """The measure to show where none is asked for."""
        return main_measure(self.measures, [row for rows in self.cases.rows for row in rows])

    def values(self, measure: str) -> list[list[float]]:
        """The values of a measure: of the seeds of each draw; those that have none left out."""
        effort = self.cases.effort
        rows = [[seed.values.get(measure, math.nan) for seed in case.seeds(effort)] for case in self.cases]
        return [[value for value in row if math.isfinite(value)] for row in rows]

    def spread(self, measure: str) -> Spread:
        """How far a measure spreads."""
        return spread_of(self.values(measure))

    def linear_shares(self, measure: str) -> LinearShares | None:
        """What a straight line in each input explains of a measure; None where it cannot be told, or of joint ones."""
        if any(uncertain.joint for uncertain in (self.scenario.uncertain or {}).values()):
            return None
        group = len(self.scenario.uncertain or {}) + 2 if self.question.indices else 1
        return linear_shares(self.scenario, self.draws, self.values(measure), group)

    def indices(self, measure: str) -> list[Index]:
        """Sobol indices of a measure by every input; empty where they cannot be told."""
        if not (self.question.indices and self.complete):
            return []
        indices = sobol_indices(self.scenario, self.values(measure))
        return [index for index in indices if math.isfinite(index.total)]

    @cached_property
    def shares(self) -> list[dict[str, Any]]:
        """A row per measure and input: on which inputs it hangs, by column; see `SHARES`."""
        return [row for measure in self.measures for row in self._shares_of(measure)]

    def _shares_of(self, measure: str) -> list[dict[str, Any]]:
        linear, indices = self.linear_shares(measure), {index.key: index for index in self.indices(measure)}
        rows = []
        for place, key in enumerate(self.scenario.uncertain or {}):
            line, index = linear.inputs[place] if linear else None, indices.get(key)
            numbers = (line.share, line.interval) if line else (math.nan,) * 2
            numbers += astuple(index)[1:] if index else (math.nan,) * 4
            finite = [finite_or_none(value) for value in numbers]
            rows.append(dict(zip(SHARES, (measure, key, *finite), strict=True)))
        return rows

    def table(self) -> list[Record]:
        """One row per measure."""
        rows: list[Record] = []
        for measure in self.measures:
            spread, mean = self.spread(measure), Statistic.of(v for row in self.values(measure) for v in row).mean
            numbers = {"mean": mean} | {name: getattr(spread, name) for name in COLUMNS[2:10]}
            finite = {name: finite_or_none(value) for name, value in numbers.items()}
            rows.append({"measure": measure} | finite | {"draws": spread.draws, "failed": len(self.failed)})
        return rows

    @property
    def size(self) -> str:
        return counted(len(self.draws), "draw")

    @property
    def failures(self) -> list[str]:
        return self.cases.failures

    def as_json(self, measure: str | None = None) -> dict[str, Any]:
        measures = {row["measure"]: {k: v for k, v in row.items() if k != "measure"} for row in self.table()}
        return {"complete": self.complete, "measures": measures, "shares": self.shares}

    def lines(self, measure: str | None = None) -> list[str]:
        """What was found of one measure, in words; and where a value of it lies that was measured."""
        measure, measured = self.measure(measure), self.question.measured
        if not measure:
            return ["no measure has a value"]
        spread = self.spread(measure)
        runs = f"{spread.of_runs} {spread.low:.4g} to {spread.high:.4g}"
        lines = [labelled(measure, f"median {spread.median:.4g}, {runs}")]
        if math.isfinite(spread.sd_inputs):
            interval = (
                f"{spread.of_means} {spread.inputs_low:.4g} to {spread.inputs_high:.4g}, SD {spread.sd_inputs:.3g}"
            )
            lines.append(labelled("over inputs", spread.separation_reason or interval))
            lines.append(labelled("over seeds", f"SD {spread.sd_seeds:.3g} at the same inputs"))
        if measured is not None:
            values = [value for row in self.values(measure) for value in row]
            below = sum(value < measured for value in values)
            where = "within" if spread.low <= measured <= spread.high else "outside of"
            position = f"{measured:.4g} is {where} the {spread.of_runs}; {below} of {len(values)} runs are below it"
            lines.append(labelled("measured", position))
        linear, indices = self.linear_shares(measure), self.indices(measure)
        return [*lines, *share_table("", linear, indices).lines()] if linear or indices else lines

    def remarks(self, measure: str | None = None) -> Iterator[Text]:
        question, completed = self.question, len(self.done)
        causes = Counter(seed.failure for seed in self.failed).most_common()
        if causes:
            listed = "; ".join(f"{cause} ({n})" if n > 1 else cause for cause, n in causes[:MOST_CAUSES])
            more = f"; and {len(causes) - MOST_CAUSES} more" if len(causes) > MOST_CAUSES else ""
            yield Text(f"{len(self.failed)} of {completed} runs failed: {listed}{more}", "failure")
        yield from super().remarks(measure)
        if self.cases.retained:
            yield Text("draws keep the seeds that they had, which are more than asked for now", "warning")
        if question.measure and question.measure not in self.measures:
            yield Text(f"no run has a value of {question.measure}, which was asked for", "warning")
        if question.inputs * (2 if question.indices else 1) < FEW_DRAWS:  # that are independent of each other
            ends = "the ends of the 90 % intervals are little more than the smallest and the largest value"
            yield Text(f"few draws: {ends}; --inputs asks for more", "warning")
        if question.seeds == 1:
            yield Text("with one seed of each draw, inputs and seeds cannot be told apart", "warning")
        if selected := measure or (question.measure if question.measure in self.measures else self.main()):
            yield from self._remarks_of(selected)
        note = "all intervals hold only if the inputs are as uncertain as said, and independent of each other"
        yield Text(note, "note")

    def _remarks_of(self, measure: str) -> Iterator[Text]:
        """What limits one measure."""
        label = measure_label(measure)
        spread, linear, question = self.spread(measure), self.linear_shares(measure), self.question
        n_values, ended = sum(len(row) for row in self.values(measure)), len(self.done) - len(self.failed)
        if n_values < ended:
            why = "as where a part does not come so far in time; the intervals are those of the others"
            yield Text(f"{label}: {ended - n_values} of {ended} runs have no value, {why}", "warning")
        if spread.separation_reason:
            why = "the inputs hardly change it, or more seeds are needed to see it"
            yield Text(f"{label}: draws differ no more than seeds of the same draw do; {why}", "note")
        if linear and linear.explained + linear.explained_interval < MOSTLY:
            why = "does not go in a straight line with the inputs, or they act together: the shares are not all of it"
            yield Text(f"{label} {why}{'' if question.indices else '; --indices asks for more'}", "warning")
        if not question.indices:
            return
        if not self.complete:
            yield Text("Sobol indices can be told only when all draws are done", "note")
        elif not (indices := self.indices(measure)):
            why = "the inputs change it no more than the seeds do, or a draw has no value of it"
            yield Text(f"{label} has no Sobol indices: {why}", "warning")
        elif (widest := max(half for i in indices for half in (i.first_interval, i.total_interval))) > WIDE:
            more = f"; {FEW_FOR_INDICES} or more --inputs make them narrower"
            wide = f"the intervals of the Sobol indices are wide, up to ± {widest:.2f}"
            yield Text(f"{wide}{more if question.inputs < FEW_FOR_INDICES else ''}", "warning")

    def files(self, carried: Callable[[Any], str]) -> dict[str, bytes]:
        rows = [labels(draw) | {"seed": seed.seed} | seed.values for draw, seed in self.done]
        return {
            TABLE: csv_bytes(COLUMNS, self.table()),
            INPUTS: csv_bytes(SHARES, self.shares),
            DRAWS: csv_bytes([*self.draws[0], "seed", *self.measures], rows),
        }

    def figures(self, measure: str) -> list[Figure]:
        from feeder_sim.plots.uncertainty import uncertainty_figures

        return uncertainty_figures(self, measure) if measure in self.measures else []

    def plot(self, measure: str | None = None, *, measured: float | None = None, ax: Axes | None = None) -> Axes:
        """Histogram of a measure over all runs, with its intervals.

        Args:
            measure: its name; default: the usual one.
            measured: a value of it from an experiment, in its unit, to mark.
            ax: matplotlib axes to draw into; default: new ones.

        Raises:
            InputError: there is no such measure, or none has a value.
        """
        from feeder_sim.plots.uncertainty import draw_values

        name = self.measure(measure)
        if not name:
            raise InputError("no measure has a value, there is nothing to draw", key="plot")
        axes = axes_for(ax)
        draw_values(axes, self, name, measured)
        return axes

    def plot_shares(self, measure: str | None = None, *, ax: Axes | None = None) -> Axes:
        """Bars of the share of the variance that each input has in a measure, with their 95 % intervals.

        Args:
            measure: its name; default: the usual one.
            ax: matplotlib axes to draw into; default: new ones.

        Raises:
            InputError: there is no such measure, or its shares are not told, as where the inputs are not told apart
                from the seeds or draws are few.
        """
        from feeder_sim.plots.uncertainty import draw_shares

        name = self.measure(measure)
        linear, indices = self.linear_shares(name), self.indices(name)
        if linear is None and not indices:
            raise InputError(f"{name or 'no measure'} has no shares that can be told", key="plot_shares")
        axes = axes_for(ax)
        draw_shares(axes, linear, indices)
        return axes

    def _line(self) -> str:
        suffix = "" if self.complete else ", not complete"
        inputs = counted(len(self.scenario.uncertain or {}), "uncertain input")
        return f"Uncertainty by {inputs}: {counted(len(self.draws), 'draw')}{suffix}"


def share_table(measure: str, linear: LinearShares | None, indices: Sequence[Index]) -> Table:
    """Of the variance of a measure over the inputs, what depends on each of them."""

    def to_text(share: float, half: float) -> str:
        return f"{share:.2f} ± {half:.2f}"

    columns: dict[str, list[str]] = {"share of variance": [i.key for i in (linear.inputs if linear else indices)]}
    if linear:
        columns["straight line"] = [to_text(i.share, i.interval) for i in linear.inputs]
    if indices:
        columns["first order"] = [to_text(i.first, i.first_interval) for i in indices]
        columns["total"] = [to_text(i.total, i.total_interval) for i in indices]
    rows = list(zip(*columns.values(), strict=True))
    if linear:
        explained = to_text(linear.explained, linear.explained_interval)
        rows.append(("all of them", explained, *("" for _ in list(columns)[2:])))
    return Table(measure, tuple(columns), tuple(rows), numbers_from=1)
