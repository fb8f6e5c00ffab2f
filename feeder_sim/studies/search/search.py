"""The search: generations of trials that Optuna proposes, then fresh seeds for the best of them.

Trials are made in generations of a fixed size, after the present recipe, which is the first one alone. Each generation
is proposed from the results of those before it, by a sampler that is seeded by its number, and its trials are held
against the best one before it. So the search takes the same way whatever runs it, and goes on after a break as if there
had been none.

The best of many noisy means is too good to be true (the winner's curse). Finalists get twice the seeds, and the best of
them is run with fresh seeds, beside the recipe that the search began with.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from feeder_sim.errors import InputError
from feeder_sim.jobs.cautions import Caution, cautions_over
from feeder_sim.jobs.identity import identity_of
from feeder_sim.jobs.journal import Journal, read_journal
from feeder_sim.jobs.runner import run_work
from feeder_sim.jobs.task import SeedValues
from feeder_sim.jobs.workers import Workers
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario import Scenario
from feeder_sim.studies.search.proposals import LOG, Proposals, Sampler
from feeder_sim.studies.search.space import Space
from feeder_sim.studies.search.trials import Aim, Trial, TrialWork
from feeder_sim.studies.sweep.case import Case
from feeder_sim.studies.sweep.cases import check_measure
from feeder_sim.studies.sweep.design import Point
from feeder_sim.studies.sweep.folder import not_counted

GENERATION = 8  # trials that are proposed together
FINALISTS = 4
FRESH = 1_000_003  # added to the root of the random numbers for seeds that no trial has had
SEED_LIMIT = 2**63  # of the root; what would be beyond begins again at 0
TRIALS_SHARE = 0.95  # of the progress; the rest is the check


@dataclass(frozen=True)
class Budget:
    """When trials end: after so many, or so long [s] of this call; a generation under way is finished."""

    trials: int
    seconds: float = math.inf


@dataclass(frozen=True)
class Checked:
    """A recipe with fresh seeds.

    Attributes:
        point: its values; None for the scenario as it is.
        values: of the measure, seed by seed; NaN where a seed has none.
        cautions: settings of the recipe that are known to mislead, a line each.
    """

    point: Point | None
    values: tuple[float, ...]
    cautions: tuple[str, ...] = ()

    @property
    def found(self) -> Statistic:
        """Over the seeds that have a value."""
        return Statistic.of(self.values)

    @property
    def without_value(self) -> int:
        """Number of seeds that have none."""
        return sum(not math.isfinite(value) for value in self.values)


@dataclass
class Search:
    """What a search has come to.

    Attributes:
        space: what was changed.
        aim: what was searched for.
        trials: all that were judged, in order.
        present, best: the scenario as it is, and the best recipe, both with fresh seeds; None where it did not get so
            far.
        complete: whether it came to its end and was not stopped.
    """

    space: Space
    aim: Aim
    trials: list[Trial] = field(default_factory=list)
    present: Checked | None = None
    best: Checked | None = None
    complete: bool = False

    @property
    def cautions(self) -> list[Caution]:
        """What is to be known before the best recipe is taken; then what is known to mislead in those tried."""
        doubt = [Caution(self.doubt, 1, 1)] if self.doubt else []
        return doubt + cautions_over(trial.case.done.values() for trial in self.trials if trial.case)

    @property
    def doubt(self) -> str:
        """Why the best recipe is not surely better than that of the file, a line; "" where it is, or nobody knows."""
        low, high = self.gain.interval
        if self.best is None or math.isnan(low):
            return ""
        if self.best.point == self.space.present:
            return "no recipe was found that is better than that of the file, which is the one in best.toml"
        found = f"difference {self.gain.mean:+.4g} (95 %: {low:+.4g} to {high:+.4g}) with fresh seeds"
        if self.aim.better(0.0, high if self.aim.largest else low):
            return f"no recipe was found that is better than that of the file: best.toml is worse, {found}"
        if not self.aim.better(low if self.aim.largest else high, 0.0):
            return f"the best recipe (best.toml) is not told apart from that of the file: {found}"
        return ""

    @property
    def without_value(self) -> list[str]:
        """Why recipes do not count, a line for each that does not: it is not allowed, or a seed has no value."""
        return [why for trial in self.trials if (why := trial.why_none(self.aim))]

    @property
    def gain(self) -> Statistic:
        """Difference of best and present over the fresh seeds that have a value in both."""
        if self.present is None or self.best is None:
            return Statistic.of(())
        return Statistic.of(np.array(self.best.values) - np.array(self.present.values))


def search(
    space: Space,
    aim: Aim,
    workers: Workers,
    folder: Path,
    journal: Path,
    *,
    budget: Budget,
    check_seeds: int,
    sampler: Sampler = "tpe",
    starts: Sequence[Point] = (),
    stop: threading.Event | None = None,
    progress: Callable[[float], None] | None = None,
    notify: Callable[[str], None] | None = None,
) -> Search:
    """Search a space for the best recipe.

    Args:
        space: what may be changed.
        aim: what is searched for.
        workers: run the seeds.
        folder: for Optuna's own journal, optuna.log.
        journal: of the seeds; what is in it counts as done.
        budget: when to end.
        check_seeds: fresh seeds of the best recipe, and of the scenario as it is.
        sampler: of Optuna; CMA-ES takes numbers only.
        starts: recipes to begin with, besides the scenario itself.
        stop: set it to end.
        progress: called with the share of the budget that is spent.
        notify: called with a line where the journal has seeds, and the search begins anew all the same.

    Raises:
        InputError: Optuna is not installed, or the sampler does not suit the space.
    """
    stop, began = stop or threading.Event(), time.monotonic()
    found = Search(space, aim)

    def spent() -> float:
        seconds = (time.monotonic() - began) / budget.seconds
        return min(max(seconds, len(found.trials) / budget.trials), 1.0)

    def show(_: float) -> None:
        if progress:
            progress(TRIALS_SHARE * spent())

    done = _done(journal, aim)
    with Journal(journal) as written:
        runs = _Runs(done, written, workers, stop, show)
        proposals = Proposals(folder / LOG, space, aim, sampler, starts)
        while len(found.trials) < budget.trials and spent() < 1.0 and not stop.is_set():
            size = GENERATION if found.trials or space.present is None else 1
            size = min(size, budget.trials - len(found.trials))
            trials = [_trial(space, runs, number, point) for number, point in proposals.next(size)]
            anew = not found.trials and not any(trial.case and trial.case.done for trial in trials)
            if notify and done and anew:
                notify(not_counted(sum(len(seeds) for seeds in done.values())))
            if not runs.run(trials, aim, _best(found.trials, aim)):
                return found
            found.trials += trials
            proposals.tell(trials)
        found.complete = not stop.is_set() and _check(found, runs, check_seeds)
    if progress and found.complete:
        progress(1.0)
    return found


class _Runs:
    """Runs seeds of trials, and keeps them in the journal."""

    def __init__(
        self,
        done: dict[str, dict[int, SeedValues]],
        journal: Journal,
        workers: Workers,
        stop: threading.Event,
        progress: Callable[[float], None],
    ) -> None:
        self._done, self._journal, self._workers, self._stop, self._progress = done, journal, workers, stop, progress

    def case_of(self, scenario: Scenario) -> Case:
        """A scenario with the seeds of it that are done."""
        identity = identity_of(scenario)
        return Case(scenario, identity, done=dict(self._done.get(identity, {})))

    def run(self, trials: Sequence[Trial], aim: Aim, best: Trial | None) -> bool:
        """Run the seeds that trials need; returns whether it came to the end."""
        work = TrialWork([*trials], aim, best, self._keep)
        return run_work(work, self._workers, stop=self._stop, progress=self._progress)

    def _keep(self, case: Case, seed: SeedValues) -> None:
        self._journal.add({"case": case.identity, **seed.as_entry()})


def _done(journal: Path, aim: Aim) -> dict[str, dict[int, SeedValues]]:
    """The seeds that a journal has, by the identity of their scenario."""
    done: dict[str, dict[int, SeedValues]] = {}
    for entry in read_journal(journal):
        with contextlib.suppress(KeyError, TypeError, ValueError, AttributeError):  # not written by this program
            seed = SeedValues.of_entry(entry)
            check_measure(aim.measure, seed.values, aim.argument)
            done.setdefault(str(entry["case"]), {})[seed.seed] = seed
    return done


def _trial(space: Space, runs: _Runs, number: int, point: Point) -> Trial:
    try:
        return Trial(number, point, runs.case_of(space.changed(point)))
    except InputError as error:  # values that are not allowed together
        return Trial(number, point, None, stopped=True, refused=str(error))


def _check(found: Search, runs: _Runs, check_seeds: int) -> bool:
    """Run the finalists longer, then the best of them and the present recipe with fresh seeds; whether all was run."""
    space, aim = found.space, found.aim
    whole = (trial for trial in found.trials if trial.is_whole(aim))
    finalists = sorted(whole, key=lambda trial: trial.mean(aim), reverse=aim.largest)[:FINALISTS]
    longer = replace(aim, seeds=2 * aim.seeds)
    tried = [_Whole(trial.number, trial.point, trial.case) for trial in finalists]
    if not runs.run(tried, longer, None):
        return False
    best = _best(tried, longer)
    fresh = replace(aim, seeds=check_seeds)
    scenarios = [space.scenario] + ([space.changed(best.point)] if best else [])
    root = (space.scenario.run.seed + FRESH) % SEED_LIMIT
    anew = [scenario.changed({"run.seed": root}, file=space.file) for scenario in scenarios]
    checks = [_Whole(-1, {}, runs.case_of(scenario)) for scenario in anew]
    if not runs.run(checks, fresh, None):
        return False
    found.present = _checked(None, checks[0], fresh)
    found.best = _checked(best.point, checks[1], fresh) if best else None
    return True


def _checked(point: Point | None, trial: Trial, aim: Aim) -> Checked:
    seeds = trial.case.done.values() if trial.case else ()
    cautions = next((seed.cautions for seed in seeds), ())  # those of the scenario, so all seeds have the same
    return Checked(point, tuple(trial.values(aim)), cautions)


class _Whole(Trial):
    """A trial that is not given up, also where seeds have no value."""

    def judge(self, aim: Aim, best: Trial | None) -> int:
        return aim.seeds


def _best(trials: Sequence[Trial], aim: Aim) -> Trial | None:
    """The best of the trials that have all their seeds; the first of equals."""
    best = None
    for trial in trials:
        if trial.is_whole(aim) and (best is None or aim.better(trial.mean(aim), best.mean(aim))):
            best = trial
    return best
