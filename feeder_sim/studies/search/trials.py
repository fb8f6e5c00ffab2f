"""Trials of a search: recipes on their way, seed by seed, until they are worth it or clearly not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feeder_sim.errors import InputError
from feeder_sim.jobs.task import SeedValues, Task
from feeder_sim.measures.effort import Effort
from feeder_sim.measures.statistic import Statistic, half_interval
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.changes import labels
from feeder_sim.studies.sweep.cases import Case, check_measure
from feeder_sim.studies.sweep.design import Point

MOST_SEEDS = 8  # of a trial where the scenario has more and nobody says how many
FIRST_SEEDS = 2  # of a trial, before it is first held against the best
GROWTH = 2  # of its seeds from one look to the next
SURE = 0.95  # confidence of the test that stops a trial


@dataclass(frozen=True)
class Aim:
    """What is searched for: the largest or the smallest mean of a measure, over so many seeds at most."""

    measure: str
    largest: bool
    seeds: int

    @staticmethod
    def of(scenario: Scenario, maximise: str | None, minimise: str | None, seeds: int | None) -> Aim:
        """From the measure that is to be large, or the one that is to be small; by default with the usual seeds.

        Raises:
            InputError: it is not said, or said twice.
        """
        if (maximise is None) == (minimise is None):
            raise InputError("exactly one of them is needed", argument="maximise, minimise")
        return Aim(
            maximise or minimise or "", maximise is not None, seeds or max(2, min(scenario.run.seeds, MOST_SEEDS))
        )

    @property
    def argument(self) -> str:
        """The one that says it."""
        return "maximise" if self.largest else "minimise"

    def better(self, a: float, b: float) -> bool:
        """Whether a value is better than another; no value is worse than any."""
        if math.isnan(a) or math.isnan(b):
            return not math.isnan(a)
        return a > b if self.largest else a < b


@dataclass
class Trial:
    """One recipe.

    Attributes:
        number: of the trial.
        point: its values.
        case: its scenario, with the seeds that are done; None for a recipe that is not allowed.
        stopped: whether it was given up before it had all its seeds.
        refused: why the recipe is not allowed.
    """

    number: int
    point: Point
    case: Case | None
    stopped: bool = False
    refused: str = ""

    def values(self, aim: Aim, seeds: int | None = None) -> list[float]:
        """What its first seeds have come to, as far as they are done in a row."""
        values: list[float] = []
        completed = self.case.done if self.case else {}
        for seed in range(seeds or aim.seeds):
            if seed not in completed:
                break
            values.append(completed[seed].values.get(aim.measure, math.nan))
        return values

    def mean(self, aim: Aim) -> float:
        """Mean over its seeds; NaN without any, or if one of them has no value: such a recipe does not count."""
        values = self.values(aim)
        return float(np.mean(values)) if values else math.nan

    def why_none(self, aim: Aim) -> str:
        """Why it has no mean, a line; "" where it has one, or no seed yet."""
        for seed, value in enumerate(self.values(aim)):
            if self.case and math.isnan(value):
                return self.case.done[seed].failure or f"a seed has no {aim.measure}"
        return self.refused

    def is_whole(self, aim: Aim) -> bool:
        """Whether it has all its seeds, and a value in each."""
        return len(self.values(aim)) == aim.seeds and not math.isnan(self.mean(aim))

    def judge(self, aim: Aim, best: Trial | None) -> int:
        """How many seeds it should have by those that are done; it is stopped where that is all there will be.

        It has been given up when a seed has no value, or when it is worse than the best one before it by Student's
        one-sided test of the differences seed by seed, which have the same starts. Trials are tested several times,
        against a best that was chosen; so the test is a rule that saves seeds, and its error is larger than 5 %.
        """
        if self.case is None:
            return 0
        requested = min(FIRST_SEEDS, aim.seeds)
        while len(values := self.values(aim, requested)) == requested and requested < aim.seeds:
            if any(math.isnan(value) for value in values) or (best and is_worse(values, best.values(aim), aim)):
                self.stopped = True
                break
            requested = min(GROWTH * requested, aim.seeds)
        return requested


def is_worse(values: list[float], best: list[float], aim: Aim) -> bool:
    """Whether values are worse than those of the best, seed by seed, by a test with the confidence `SURE`."""
    n = min(len(values), len(best))
    if n < 2:
        return False
    difference = np.array(values[:n]) - np.array(best[:n])
    improvement = Statistic.of(difference if aim.largest else -difference)
    return improvement.mean + half_interval(improvement.se, improvement.n, 2.0 * SURE - 1.0) < 0.0  # to one side


class TrialTasks:
    """The seeds that trials still need; all are held against the one that was best before them."""

    def __init__(
        self, trials: list[Trial], aim: Aim, best: Trial | None, record: Callable[[str, Point, SeedValues], None]
    ) -> None:
        self._trials, self._aim, self._best, self._record = trials, aim, best, record

    def next(self, seeds: int) -> tuple[Trial, Task] | None:
        for trial in self._trials:
            effort = Effort(trial.judge(self._aim, self._best))
            handed = trial.case.hand_out(effort, seeds) if trial.case else ()
            if trial.case and handed:
                return trial, Task(trial.case.scenario, trial.case.identity, handed)
        return None

    def take(self, place: Trial, done: tuple[SeedValues, ...]) -> None:
        if place.case is None:
            return
        place.case.take(done)
        for seed in done:
            check_measure(self._aim.measure, seed.values, self._aim.argument)
            self._record(place.case.identity, labels(place.point), seed)

    @property
    def share_done(self) -> float:
        """Of the seeds that trials want by now [1]."""
        requested = sum(trial.judge(self._aim, self._best) for trial in self._trials)
        return sum(min(len(trial.values(self._aim)), self._aim.seeds) for trial in self._trials) / max(1, requested)
