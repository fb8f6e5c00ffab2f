"""The best recipe over some keys of a scenario: what is asked, and what was found.

The folder holds

    search.toml     what was asked
    scenario.toml   the scenario that the search began with, with all its defaults
    journal.jsonl   measures of every seed that is done
    optuna.log      Optuna's journal of the trials
    trials.csv      one row per trial: its values, mean and standard error of the measure, seeds, whether it was
                    stopped, and why it has no mean, if it has none: it is not allowed, or a seed has no value
    check.csv       one row per fresh seed: the measure of the scenario as it is, and of the best recipe; none before
                    that
    best.toml       the best recipe; runs as it is
    history.png     the trials in order, and the check with fresh seeds
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from feeder_sim.document.document import Text
from feeder_sim.document.figure import Figure
from feeder_sim.errors import InputError
from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import Runner
from feeder_sim.jobs.task import RepeatedWarning, most_frequent, warnings_over
from feeder_sim.measures.protocol import labelled
from feeder_sim.measures.statistic import Statistic, finite_or_none
from feeder_sim.notebook import axes_for, counted
from feeder_sim.run.provenance import content_hash
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.changes import labels, value_at
from feeder_sim.studies.question import Plan, Question
from feeder_sim.studies.search.proposals import LOG, RANDOM_TRIALS, Sampler
from feeder_sim.studies.search.screening import first_recipes
from feeder_sim.studies.search.search import Budget, Checked, History, SearchRun, read_history
from feeder_sim.studies.search.space import Space
from feeder_sim.studies.search.trials import MOST_SEEDS, Aim, Trial
from feeder_sim.studies.study import Record, Study, csv_bytes
from feeder_sim.studies.sweep.cases import check_measure
from feeder_sim.studies.sweep.design import Point

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TRIALS, CHECK, BEST, PICTURE = "trials.csv", "check.csv", "best.toml", "history.png"
COLUMNS = ("mean", "se", "seeds", "stopped", "refused")  # of a trial, after its number and its values
FEW_FRESH = 8  # fresh seeds, below which an interval is wide
CHECKED = ("seed", "present", "best")


class OptimiseQuestion(Question):
    """What is asked of a search."""

    kind = "optimise"
    file = "search.toml"
    base = "optimise"
    own = (LOG,)

    over: tuple[str, ...] = Field(description="KEY=LOW:HIGH, LOW:HIGH:log or A,B,C; .mode takes its frequency along.")
    maximise: Annotated[str | None, Field(strict=True, description="Measure that is to be large.")] = None
    minimise: Annotated[str | None, Field(strict=True, description="Measure that is to be small.")] = None
    trials: Annotated[int, Field(strict=True, ge=1, le=100_000, description="Recipes to try, at most.")] = 200
    budget_s: Annotated[float | None, Field(gt=0, description="Time for the trials, such as 90s, 30min or 1h.")] = None
    seeds: Annotated[
        int | None,
        Field(strict=True, ge=2, le=1000, description=f"Seeds of a recipe [the scenario's, up to {MOST_SEEDS}]."),
    ] = None
    check_seeds: Annotated[int, Field(strict=True, ge=2, le=10_000, description="Fresh seeds of the best recipe.")] = 16
    screen: Annotated[
        Path | None,
        Field(description="Drift map that screens recipes to begin with, for --minimise arrival_time_s."),
    ] = None
    recipes: Annotated[int, Field(strict=True, ge=2, le=65536, description="Recipes that --screen walks.")] = 256
    sampler: Annotated[Sampler, Field(description="tpe, or cmaes for numbers only.")] = "tpe"

    def settled(self, scenario: Scenario) -> OptimiseQuestion:
        return self.model_copy(update={"seeds": self.aim(scenario).seeds})

    def aim(self, scenario: Scenario) -> Aim:
        """What is searched for.

        Raises:
            InputError: it is not said, or said twice.
        """
        return Aim.of(scenario, self.maximise, self.minimise, self.seeds)

    @property
    def same(self) -> str:
        """All of it, since a search with other words takes another way; but it may go on for longer."""
        screened = (content_hash(self.screen), self.recipes) if self.screen else None
        return f"{self.over} {self.maximise} {self.minimise} {self.seeds} {self.sampler} {screened}"

    def plan(self, scenario: Scenario, file: Path) -> SearchPlan:
        space, aim = Space.of(scenario, self.over, file), self.aim(scenario)
        return SearchPlan(self, space, aim)


class SearchPlan(Plan):
    """What there is to run for a search, which is known trial by trial."""

    identities = None

    def __init__(self, question: OptimiseQuestion, space: Space, aim: Aim) -> None:
        self._question, self._space, self._aim = question, space, aim
        self._history = History()

    @property
    def all_done(self) -> bool:
        return self._history.present is not None

    def take(self, ledger: Ledger, *, recorded: bool = False) -> None:
        for seed in ledger:
            check_measure(self._aim.measure, seed.values, self._aim.argument)
        if recorded:
            self._history = read_history(ledger, self._space, self._aim, self._question.check_seeds)

    def part(self, number: int, of: int) -> SearchPlan:
        raise InputError("is given, must be none: a search learns from all its trials", argument="task")

    def run(self, runner: Runner) -> bool:
        question = self._question
        starts = []
        if question.screen is not None and not (runner.folder and (runner.folder / LOG).exists()):
            starts = first_recipes(self._space, self._aim, question.screen, question.recipes, runner.work.progress)
            runner.work.notify(f"{len(starts)} recipes of {question.recipes} begin the search")
        budget = Budget(question.trials, question.budget_s or math.inf, question.check_seeds)
        run = SearchRun(self._space, self._aim, budget, question.sampler, runner)
        self._history = run.history
        return run.run(starts)

    def study(self, complete: bool, foreign_seeds: int) -> Search:
        trials, present, best = self._history.trials, self._history.present, self._history.best
        rows = [TrialRow.of(trial, self._aim) for trial in trials]
        warnings = tuple(warnings_over(trial.case.done.values() for trial in trials if trial.case))
        return Search(self._question, self._space, self._aim, rows, present, best, complete, warnings)


@dataclass(frozen=True)
class TrialRow:
    """A trial as a row of the table.

    Attributes:
        number: of the trial.
        point: its values.
        statistic: of the measure over its seeds; none where one of them has no value, as such a recipe does not count.
        seeds: that it has had.
        stopped: whether it was given up before it had all its seeds.
        refused: why the recipe does not count: it is not allowed, or a seed has no value; "" where it does.
    """

    number: int
    point: Point
    statistic: Statistic
    seeds: int
    stopped: bool
    refused: str = ""

    @property
    def outcome(self) -> str:
        """What became of it, in words."""
        if math.isnan(self.statistic.mean):
            return "without value" if self.seeds else "refused"
        return "stopped early" if self.stopped else "all seeds"

    def is_whole(self, aim: Aim) -> bool:
        """Whether it has all its seeds, and a value in each."""
        return self.seeds == aim.seeds and not math.isnan(self.statistic.mean)

    @staticmethod
    def of(trial: Trial, aim: Aim) -> TrialRow:
        """A trial that was judged."""
        values = trial.values(aim)
        statistic = Statistic.of(values if not math.isnan(trial.mean(aim)) else [])
        return TrialRow(trial.number, trial.point, statistic, len(values), trial.stopped, trial.why_none(aim))


@dataclass(frozen=True, repr=False)
class Search(Study):
    """What a search has come to.

    Attributes:
        question: what was asked.
        space: what was changed.
        aim: what was searched for.
        trials: all that were judged, in order.
        present, best: the scenario as it is, and the best recipe, both with fresh seeds; None where it did not get so
            far.
        complete: whether it came to its end and was not stopped.
        of_trials: settings of the recipes tried that are known to mislead.
    """

    places = "recipes"
    picture = PICTURE
    question: OptimiseQuestion
    space: Space
    aim: Aim
    trials: Sequence[TrialRow]
    present: Checked | None
    best: Checked | None
    complete: bool
    of_trials: tuple[RepeatedWarning, ...] = ()

    @property
    def scenario(self) -> Scenario:
        """That the search began with."""
        return self.space.scenario

    @property
    def keys(self) -> list[str]:
        """What was changed."""
        return [parameter.key for parameter in self.space.parameters]

    @property
    def warnings(self) -> list[RepeatedWarning]:
        """What is to be known before the best recipe is taken; then what is known to mislead in those tried."""
        return [*([RepeatedWarning(self.doubt, 1, 1)] if self.doubt else []), *self.of_trials]

    @property
    def doubt(self) -> str:
        """Why the best recipe is not surely better than that of the file, a line; "" where it is, or nobody knows."""
        low, high = self.gain.interval
        if self.best is None or math.isnan(low):
            return ""
        if self.best.point == self.space.present:
            return "no recipe was found that is better than that of the file, which is the one in best.toml"
        difference = f"difference {self.gain.mean:+.4g} (95 %: {low:+.4g} to {high:+.4g}) with fresh seeds"
        if self.aim.better(0.0, high if self.aim.largest else low):
            return f"no recipe was found that is better than that of the file: best.toml is worse, {difference}"
        if not self.aim.better(low if self.aim.largest else high, 0.0):
            return f"the best recipe (best.toml) is not told apart from that of the file: {difference}"
        return ""

    @property
    def without_value(self) -> list[str]:
        """Why recipes do not count, a line for each that does not: it is not allowed, or a seed has no value."""
        return [trial.refused for trial in self.trials if trial.refused]

    @property
    def gain(self) -> Statistic:
        """Difference of best and present over the fresh seeds that have a value in both."""
        if self.present is None or self.best is None:
            return Statistic.of(())
        return Statistic.of(np.array(self.best.values) - np.array(self.present.values))

    @property
    def running_best(self) -> list[float]:
        """The best mean up to each trial, of those that have all their seeds; NaN before the first of them."""

        def better(best: float, trial: TrialRow) -> float:
            mean = trial.statistic.mean
            return mean if trial.is_whole(self.aim) and self.aim.better(mean, best) else best

        return list(itertools.accumulate(self.trials, better, initial=math.nan))[1:]

    @property
    def present_point(self) -> Point:
        """The recipe of the file, also where it lies outside of what was searched."""
        return self.space.present or _point_of(self.scenario, self.keys)

    @property
    def best_is_present(self) -> bool:
        """Whether the best recipe is that of the file."""
        return self.best is not None and self.best.point == self.present_point

    @property
    def first(self) -> TrialRow | None:
        """The trial with the best mean, of those that have all their seeds."""
        pick = max if self.aim.largest else min
        return pick(self._complete_trials, key=lambda trial: trial.statistic.mean, default=None)

    @property
    def leader(self) -> TrialRow | None:
        """The trial of the best recipe; before the check the one with the best mean."""
        if self.best is None:
            return self.first
        return next((trial for trial in self._complete_trials if trial.point == self.best.point), None)

    @property
    def _complete_trials(self) -> list[TrialRow]:
        return [trial for trial in self.trials if trial.is_whole(self.aim)]

    @property
    def best_scenario(self) -> Scenario:
        """The scenario with the best recipe.

        Raises:
            InputError: there is none.
        """
        if self.best is None:
            raise InputError(f"no recipe has {self.aim.measure} in all its seeds, or it was stopped", key="best")
        return self.space.changed(self.best.point or {})

    def measure(self, name: str | None = None) -> str:
        return self.aim.measure

    def table(self) -> list[Record]:
        """A row per trial."""
        return [
            {"trial": row.number, **labels(row.point), "mean": row.statistic.mean, "se": row.statistic.se}
            | {"seeds": row.seeds, "stopped": row.stopped, "refused": row.refused}
            for row in self.trials
        ]

    @property
    def size(self) -> str:
        return counted(len(self.trials), "trial")

    @property
    def failures(self) -> list[str]:
        """Where there is no best recipe, or one that has no value in all seeds."""
        if not self.complete:
            return []
        if self.best is None:
            return [f"no recipe has {self.aim.measure} in all its seeds"]
        if not self.best.without_value:
            return []
        seeds = f"{self.best.without_value} of {len(self.best.values)} fresh seeds"
        return [f"the best recipe has no {self.aim.measure} in {seeds}, its mean is of the others"]

    def remarks(self, measure: str | None = None) -> Iterator[Text]:
        yield from super().remarks(measure)
        for line in self.best.warnings if self.best else ():
            yield Text(f"the best recipe: {line}", "warning")
        for name, checked in (("recipe of the file", self.present), ("best recipe", self.best)):
            if checked is not None and checked.without_value:
                none = f"{checked.without_value} of {len(checked.values)} fresh seeds of the {name}"
                yield Text(f"{none} have no {self.aim.measure}", "warning")
        if self.present is not None and len(self.present.values) < FEW_FRESH:
            yield Text(f"{len(self.present.values)} fresh seeds are few: intervals are wide", "warning")
        if len(self.trials) < RANDOM_TRIALS:
            why = f"the first {RANDOM_TRIALS} are drawn at random, and the search learns from them"
            yield Text(f"{len(self.trials)} recipes are few: {why}", "warning")
        best = (self.best.point if self.best else None) or {}
        for parameter in self.space.parameters:
            if end := parameter.end_near(best[parameter.key]) if parameter.key in best else "":
                where = f"{parameter.key} of the best recipe lies at the {end} end of its range"
                yield Text(f"{where}: a wider one may hold a better recipe", "warning")
        for outcome, what in (("without value", "a seed without a value"), ("refused", "values not allowed together")):
            if refused := [trial.refused for trial in self.trials if trial.outcome == outcome]:
                why = f"{len(refused)} recipes have {what} and do not count, mostly: {most_frequent(refused)}"
                yield Text(why, "note")
        if self.best:
            yield Text("a search finds a good recipe, not surely the best there is", "note")

    def lines(self, measure: str | None = None) -> list[str]:
        stopped = sum(trial.stopped for trial in self.trials)
        lines = [labelled("trials", f"{len(self.trials)}, {stopped} of them stopped early")]
        if why := self.without_value:
            lines.append(labelled("without a value", f"{len(why)}, mostly: {most_frequent(why)}"))
        for label, checked in (("as it is", self.present), ("best", self.best)):
            if checked is not None:
                statistic = checked.statistic
                value = f"{statistic.mean:.4g} +- {statistic.se:.2g}" if statistic.n > 1 else "in one seed at most"
                of = f"{statistic.n} of {len(checked.values)} fresh seeds"
                lines.append(labelled(label, f"{self.aim.measure} {value}, {of}"))
        if self.gain.n > 1:
            low, high = self.gain.interval
            interval = f"95 % interval {low:+.4g} to {high:+.4g}, {self.gain.n} pairs of seeds"
            lines.append(labelled("difference", f"{self.gain.mean:+.4g}, {interval}"))
        for key, value in (self.best.point or {}).items() if self.best else ():
            lines.append(labelled("", f"{key} = {value:.4g}" if isinstance(value, float) else f"{key} = {value}"))
        return lines

    def as_json(self, measure: str | None = None) -> dict[str, Any]:
        low, high = self.gain.interval
        improvement = self.gain.as_dict() | {"low": finite_or_none(low), "high": finite_or_none(high)}
        return {
            "measure": self.aim.measure,
            "maximise": self.aim.largest,
            "trials": len(self.trials),
            "stopped": sum(trial.stopped for trial in self.trials),
            "without_value": {"trials": len(self.without_value), "mostly": most_frequent(self.without_value)},
            "complete": self.complete,
            "present": self.present.as_json() if self.present else None,
            "best": self.best.as_json() | {"values": labels(self.best.point or {})} if self.best else None,
            "gain": improvement,
            "warnings": [warning.as_dict() for warning in self.warnings],
        }

    def files(self, carried: Callable[[Any], str]) -> dict[str, bytes]:
        trials = [dict(row) | {"stopped": int(row["stopped"])} for row in self.table()]
        values = (checked.values if checked else () for checked in (self.present, self.best))
        pairs = itertools.zip_longest(*values, fillvalue=math.nan)
        checks = [dict(zip(CHECKED, (seed, *pair), strict=True)) for seed, pair in enumerate(pairs)]
        tables = {TRIALS: csv_bytes(["trial", *self.keys, *COLUMNS], trials), CHECK: csv_bytes(CHECKED, checks)}
        return tables | ({BEST: carried(self.best_scenario).encode()} if self.best and self.best.point else {})

    def figures(self, measure: str) -> list[Figure]:
        from feeder_sim.plots.search import search_figures

        return search_figures(self)

    def plot(self, *, ax: Axes | None = None) -> Axes:
        """The trials in order, the best so far, and the check with fresh seeds; returns matplotlib axes."""
        from feeder_sim.plots.search import draw_history

        axes = axes_for(ax)
        draw_history(axes, self)
        return axes

    def _line(self) -> str:
        aim = f"{'largest' if self.aim.largest else 'smallest'} {self.aim.measure}"
        low, high = self.gain.interval
        improvement = f", best less present {self.gain.mean:+.3g} ({low:+.3g} to {high:+.3g}) with fresh seeds"
        is_finite = math.isfinite(low) and math.isfinite(high)
        return f"Search for the {aim}: {counted(len(self.trials), 'trial')}{improvement if is_finite else ''}"

    def _notebook_rows(self) -> list[Record]:
        """The recipes with fresh seeds, or else the trials."""
        checked = {"as it is": (self.space.present or {}, self.present), "best": ({}, self.best)}
        rows: list[Record] = []
        for name, (point, check) in checked.items():
            if check is not None:
                values = labels({key: (check.point or point).get(key) for key in self.keys})
                rows.append({"recipe": name, **values, **check.statistic.as_dict()})
        return rows or self.table()


def _point_of(scenario: Scenario, keys: tuple[str, ...] | list[str]) -> Point:
    """The values of keys in a scenario."""
    raw = scenario.model_dump()
    return {key: value_at(raw, key) for key in keys}
