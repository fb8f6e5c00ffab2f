"""Calibration: constants from measurements, by runs at points of the priors, an emulator and weighted draws.

First a Sobol design over the priors, then as many points again where the posterior of the first ones is. The folder
holds calibrate.toml with all scenarios in it, journals as that of a sweep, and

    draws.csv         equally likely draws of the constants, a column each
    posterior.csv     the same of those that belong to all experiments, with what is tied to them, for other scenarios
    experiments.csv   measured beside predicted, before and after
    points.csv        mean and standard deviation over the seeds at every point
    calibrate.png     prior and posterior of every constant, and pairs of them
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field

from feeder_sim.document.document import Table, Text
from feeder_sim.document.figure import Figure
from feeder_sim.errors import InputError
from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import Runner
from feeder_sim.jobs.task import RepeatedWarning
from feeder_sim.measures.effort import Effort
from feeder_sim.measures.statistic import Statistic, finite_or_none
from feeder_sim.notebook import counted
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.scenario.uncertain import by_full_key
from feeder_sim.studies.calibration.emulator import Emulator
from feeder_sim.studies.calibration.experiments import (
    MOST_CONSTANTS,
    Answer,
    Candidate,
    Experiment,
    Prior,
    read_experiments,
)
from feeder_sim.studies.calibration.posterior import FAR, FEW, Observed, Posterior, interval, within_correlation
from feeder_sim.studies.question import Question
from feeder_sim.studies.study import Record, Study, csv_bytes
from feeder_sim.studies.sweep.cases import Case, Cases, check_measure

DRAWS, POSTERIOR, EXPERIMENTS, POINTS, PICTURE = (
    "draws.csv",
    "posterior.csv",
    "experiments.csv",
    "points.csv",
    "calibrate.png",
)
ROUNDS = 2  # over the priors, and where the first posterior is
SEED = 0  # of the design
Run = Experiment | Candidate | Answer
QUANTILES = ("median", "low", "high")


class CalibrateQuestion(Question):
    """What is asked of measurements."""

    kind = "calibrate"
    file = "calibrate.toml"
    base = "calibrations"

    experiment: Annotated[tuple[Experiment, ...], Field(min_length=1, max_length=100)]
    candidate: Annotated[tuple[Candidate, ...], Field(max_length=100)] = ()
    answer: Answer | None = None
    prior: Annotated[dict[str, Prior], Field(min_length=1, max_length=MOST_CONSTANTS), BeforeValidator(by_full_key)]
    points: Annotated[int, Field(strict=True, ge=16, le=4096, description="Points of each of two rounds.")] = 32
    seeds: Annotated[int, Field(strict=True, ge=2, description="Seeds of every point.")] = 8

    @property
    def same(self) -> str:
        """More seeds are no other question."""
        return json.dumps(self.model_dump(mode="json", exclude={"seeds"}), sort_keys=True)

    @property
    def all(self) -> tuple[Run, ...]:
        """Experiments, candidates and what they are for: all of them are run."""
        return (*self.experiment, *self.candidate, *([self.answer] if self.answer else []))

    def constants_of(self, experiment: Run) -> tuple[int, ...]:
        """Places of the constants that an experiment takes."""
        return tuple(
            k for k, prior in enumerate(self.prior.values()) if not prior.only or experiment.name in prior.only
        )

    def draw(self, shares: NDArray[np.float64]) -> dict[str, Any]:
        """The constants at shares of their priors (constants,)."""
        return {key: prior.at(float(share)) for (key, prior), share in zip(self.prior.items(), shares, strict=True)}

    def changes(self, experiment: Run, shares: NDArray[np.float64]) -> dict[str, Any]:
        """What of a scenario changes at a point."""
        places, draw = self.constants_of(experiment), self.draw(shares)
        changes: dict[str, Any] = {}
        for place, (key, prior) in enumerate(self.prior.items()):
            if place in places:
                changes |= dict.fromkeys((key, *prior.also), draw[key])
        return changes

    def plan(self, scenario: Scenario, file: Path) -> CalibrationPlan:
        names = [each.name for each in self.all]
        for key, prior in self.prior.items():
            if prior.choice is not None:
                raise InputError("is a choice, must be a distribution of numbers", file=file, key=f"prior.{key}")
            for name in prior.only:
                if name not in names:
                    raise InputError(
                        f"is {name!r}, must be one of {', '.join(names)}", file=file, key=f"prior.{key}.only"
                    )
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"{name!r} stands there twice, must be unique", file=file, key="experiment.name")
        for each in self.all:
            for share in (0.0, 0.5, 1.0):
                each.scenario.changed(self.changes(each, np.full(len(self.prior), share)), file=file)
        return CalibrationPlan(self)


def calibration_of(file: Path, points: int | None = None, seeds: int | None = None) -> CalibrateQuestion:
    """The question of a file of experiments and priors.

    Raises:
        InputError: it or a scenario cannot be read, or a key or a value is not allowed.
    """
    given = {name: value for name, value in (("points", points), ("seeds", seeds)) if value is not None}
    return validated(read_experiments(file) | given, CalibrateQuestion, file)


@dataclass
class CalibrationPlan:
    """The rounds of a calibration; each is known when the one before is done.

    Attributes:
        question: what is asked.
        rounds: shares of the priors (points, constants) and cases, by round.
    """

    question: CalibrateQuestion
    rounds: list[tuple[NDArray[np.float64], Cases]] = field(default_factory=list)
    _ledger: Ledger = field(default_factory=Ledger)
    _recorded: bool = False

    def __post_init__(self) -> None:
        self._next_round()

    def _next_round(self) -> None:
        from scipy.stats import qmc

        question, constants = self.question, len(self.question.prior)
        if self.rounds:
            posterior = Posterior.of(self._observed(), constants, SEED, question.points)
            shares = posterior.shares
        else:
            exponent = math.ceil(math.log2(question.points))
            shares = qmc.Sobol(constants, rng=SEED).random_base2(exponent)[: question.points]
        cases = tuple(tuple(self._case(each, row) for each in question.all) for row in shares)
        points = tuple(question.draw(row) for row in shares)
        made = Cases(points, cases, Effort(question.seeds))
        made.take(self._ledger, recorded=self._recorded)
        self.rounds.append((shares, made))

    def _case(self, experiment: Run, shares: NDArray[np.float64]) -> Case:
        changes = self.question.changes(experiment, shares)
        return Case(functools.partial(experiment.scenario.changed, changes), {"experiment": experiment.name} | changes)

    def take(self, ledger: Ledger, *, recorded: bool = False) -> None:
        self._ledger, self._recorded = ledger, recorded
        self.rounds.clear()
        self._next_round()
        while recorded and self._round_done and len(self.rounds) < ROUNDS:
            self._next_round()

    @property
    def _round_done(self) -> bool:
        return self.rounds[-1][1].all_done

    @property
    def all_done(self) -> bool:
        return len(self.rounds) == ROUNDS and self._round_done

    @property
    def identities(self) -> None:
        return None

    def part(self, number: int, of: int) -> CalibrationPlan:
        raise InputError("cannot be shared, a second round needs the first", argument="task")

    def run(self, runner: Runner) -> bool:
        for number in range(ROUNDS):
            if number == len(self.rounds):
                self._next_round()
            show = functools.partial(_scaled, runner.work.progress, number)
            if not runner.run(self.rounds[number][1].tasks(runner.ledger), show):
                return False
        return True

    def _observed(self) -> list[Observed]:
        return observed(self.question, self.rounds)[: len(self.question.experiment)]

    def study(self, complete: bool, foreign_seeds: int) -> Calibration:
        return Calibration(self.question, tuple(self.rounds), complete)


def _scaled(progress: Callable[[float], None], number: int, share: float) -> None:
    progress((number + share) / ROUNDS)


def observed(question: CalibrateQuestion, rounds: Sequence[tuple[NDArray[np.float64], Cases]]) -> list[Observed]:
    """Experiments and candidates with their emulators, from the rounds that are done.

    Raises:
        InputError: there is no such measure, or too few points have a value of it.
    """
    return [_observed(question, k, rounds) for k in range(len(question.all))]


def _observed(question: CalibrateQuestion, place: int, rounds: Sequence[tuple[NDArray[np.float64], Cases]]) -> Observed:
    experiment = question.all[place]
    measured, constants = experiment.statistics, question.constants_of(experiment)
    points, values = [], []
    for shares, cases in rounds:
        for row, cases_of in zip(shares, cases.cases, strict=True):
            seeds = cases_of[place].seeds(cases.effort)
            for measure in measured if seeds else ():
                check_measure(measure, seeds[0].values, f"{experiment.name}.measure")
            if seeds:
                points.append(row)
                values.append(np.array([[s.values.get(each, math.nan) for each in measured] for s in seeds]))
    shares_of = np.array(points).reshape(-1, len(question.prior))[:, constants]
    emulators = tuple(
        Emulator.of(shares_of, [seeds[:, j].tolist() for seeds in values], f"{experiment.name}: {measure}")
        for j, measure in enumerate(measured)
    )
    return Observed(measured, emulators, within_correlation(values), constants)


@dataclass(frozen=True, repr=False)
class Calibration(Study):
    """What measurements say about constants.

    Attributes:
        question: what was asked.
        rounds: shares of the priors and cases, by round.
        complete: whether all of it is done.
    """

    picture = PICTURE
    question: CalibrateQuestion
    rounds: tuple[tuple[NDArray[np.float64], Cases], ...]
    complete: bool

    @property
    def warnings(self) -> list[RepeatedWarning]:
        return [warning for _, cases in self.rounds for warning in cases.warnings]

    @property
    def keys(self) -> tuple[str, ...]:
        """Of the constants."""
        return tuple(self.question.prior)

    @cached_property
    def _observed(self) -> list[Observed]:
        return observed(self.question, self.rounds)

    @cached_property
    def _distribution(self) -> Posterior:
        return Posterior.of(self._observed[: len(self.question.experiment)], len(self.keys), SEED)

    @cached_property
    def posterior(self) -> dict[str, NDArray[np.float64]]:
        """Equally likely values of every constant, by its key, (draws,) each; those of one draw belong together."""
        shares = self._distribution.shares
        return {
            key: np.array([prior.at(float(share)) for share in shares[:, k]])
            for k, (key, prior) in enumerate(self.question.prior.items())
        }

    @property
    def failures(self) -> list[str]:
        if not self.complete:
            return []
        reasons = [reason for _, cases in self.rounds for reason in cases.failures]
        for each, nearest in zip(self.question.experiment, self._distribution.nearest, strict=True):
            if nearest > FAR:
                values = ", ".join(f"{measure} {value.mean:.4g}" for measure, value in each.statistics.items())
                away = f"the nearest that the priors give is {nearest:.1f} standard errors away"
                reasons.append(f"{each.name}: measured {values}; {away}")
        if self._distribution.effective < FEW:
            rests = f"the posterior rests on {self._distribution.effective:.0f} draws of the priors, too few"
            reasons.append(f"{rests}: narrower priors around it tell more")
        return reasons

    @property
    def size(self) -> str:
        return counted(sum(len(cases.points) for _, cases in self.rounds), "point")

    def predicted(self) -> list[Record]:
        """Every experiment: measured, and predicted over priors and posterior; 90 % intervals of the mean."""
        prior = Posterior.of([], len(self.keys), SEED)
        rows: list[Record] = []
        for each, of in zip(self.question.experiment, self._observed, strict=False):
            before, after = (of.prediction(shares)[0] for shares in (prior.shares, self._distribution.shares))
            for j, (measure, measured) in enumerate(each.statistics.items()):
                row = {"experiment": each.name, "measure": measure, "mean": measured.mean}
                row["se"] = float(of.standard_error[j])
                for name, means in (("prior", before), ("posterior", after)):
                    row |= {f"{name}_{key}": value for key, value in interval(means[:, j]).items()}
                rows.append(row)
        return rows

    @property
    def answers(self) -> NDArray[np.float64]:
        """The mean of what it is for, at every draw, (draws, 1); none without it, (draws, 0)."""
        shares = self._distribution.shares
        return self._observed[-1].prediction(shares)[0] if self.question.answer else np.empty((len(shares), 0))

    def answer(self) -> Record | None:
        """What the constants are for: the 90 % interval of its mean; None without it."""
        if self.question.answer is None:
            return None
        named = {"answer": self.question.answer.name, "measure": self.question.answer.measure}
        return named | dict(interval(self.answers[:, 0]))

    def recommendations(self) -> list[Record]:
        """Every candidate, the most telling first.

        What it would leave of the standard deviation of each constant, and of that of the answer, and what it costs.
        """
        rows: list[Record] = []
        answers, after = self.answers, len(self.question.experiment)
        for each, of in zip(self.question.candidate, self._observed[after:], strict=False):
            left = dict(zip(self.keys, self._distribution.narrowed_by(of).tolist(), strict=True))
            if self.question.answer:
                left["answer"] = float(self._distribution.narrowed_by(of, answers)[0])
            parts, minutes = each.cost
            named = {"candidate": each.name, "measure": each.measure}
            rows.append(named | left | {"parts": parts, "minutes": minutes})
        return sorted(rows, key=lambda row: row.get("answer", math.prod(float(row[key]) for key in self.keys)))

    def table(self) -> list[Record]:
        """One row per constant."""
        if not self.complete:
            return []
        left = self._distribution.left
        return [
            {"constant": key} | dict(interval(values)) | {"left_of_prior": float(left[k])}
            for k, (key, values) in enumerate(self.posterior.items())
        ]

    def measure(self, name: str | None = None) -> str:
        return name or ""

    def as_json(self, measure: str | None = None) -> dict[str, Any]:
        if not self.complete:
            return {"complete": False}
        rows = {str(row["constant"]): {k: v for k, v in row.items() if k != "constant"} for row in self.table()}
        return {
            "complete": True,
            "posterior": rows,
            "words": self._distribution.words(self.keys),
            "experiments": self.predicted(),
            "candidates": self.recommendations(),
            "answer": self.answer(),
            "effective_draws": self._distribution.effective,
        }

    def lines(self, measure: str | None = None) -> list[str]:
        """What was found, and what the data cannot decide."""
        if not self.complete:
            return ["nothing is known before both rounds are done"]
        rows = [
            (
                str(row["constant"]),
                *(f"{row[name]:.4g}" for name in ("median", "low", "high")),
                f"{row['left_of_prior']:.0%}",
            )
            for row in self.table()
        ]
        head = ("constant", "median", "5 %", "95 %", "left of the prior")
        lines = [*Table("", head, tuple(rows), numbers_from=1).lines(), *self._distribution.words(self.keys)]
        checks = [
            (
                str(row["experiment"]),
                str(row["measure"]),
                f"{row['mean']:.4g} +- {row['se']:.2g}",
                *(f"{row[f'{of}_low']:.4g} to {row[f'{of}_high']:.4g}" for of in ("prior", "posterior")),
            )
            for row in self.predicted()
        ]
        head = ("experiment", "measure", "measured", "prior", "posterior")
        lines += Table("", head, tuple(checks), numbers_from=2).lines()
        answer = self.answer()
        if answer is not None:
            span = f"{answer['low']:.4g} to {answer['high']:.4g}"
            value = f"{answer['measure']} {answer['median']:.4g}, 90 % interval of its mean {span}"
            lines.append(f"{answer['answer']}: {value}")
        for row in self.recommendations():
            left = ", ".join(f"{key} {row[key]:.0%}" for key in (*self.keys, "answer") if key in row)
            cost = f"{counted(row['parts'], 'part')}, {row['minutes']:.3g} min"
            lines.append(f"{row['candidate']} would leave of these: {left} ({cost})")
        return lines

    def remarks(self, measure: str | None = None) -> Iterator[Text]:
        yield from super().remarks(measure)
        yield Text("the model itself is taken to be right; what it leaves out goes into the constants", "note")

    def files(self, carried: Callable[[Any], str]) -> dict[str, bytes]:
        if not self.complete:
            return {}
        draws = [dict(zip(self.keys, row, strict=True)) for row in zip(*self.posterior.values(), strict=True)]
        general = {key: prior for key, prior in self.question.prior.items() if not prior.only}
        columns = {name: key for key, prior in general.items() for name in (key, *prior.also)}
        of_any = [{name: draw[key] for name, key in columns.items()} for draw in draws]
        predicted = self.predicted()
        return {
            DRAWS: csv_bytes(self.keys, draws),
            **({POSTERIOR: csv_bytes(tuple(columns), of_any)} if columns else {}),
            EXPERIMENTS: csv_bytes(tuple(predicted[0]), predicted),
            POINTS: csv_bytes(("experiment", "measure", *self.keys, "mean", "sd", "n"), self._points()),
        }

    def _points(self) -> Iterator[Mapping[str, Any]]:
        for _, cases in self.rounds:
            for point, row in zip(cases.points, cases.cases, strict=True):
                for each, case in zip(self.question.all, row, strict=True):
                    for measure in each.statistics:
                        values = Statistic.of(seed.values.get(measure, math.nan) for seed in case.seeds(cases.effort))
                        numbers = {"mean": finite_or_none(values.mean), "sd": finite_or_none(values.sd), "n": values.n}
                        yield {"experiment": each.name, "measure": measure} | point | numbers

    def figures(self, measure: str) -> list[Figure]:
        if not self.complete:
            return []
        from feeder_sim.plots.calibration import calibration_figure

        return [calibration_figure(self)]

    def _line(self) -> str:
        suffix = "" if self.complete else ", not complete"
        return (
            f"Calibration of {', '.join(self.keys)} by {counted(len(self.question.experiment), 'experiment')}{suffix}"
        )
