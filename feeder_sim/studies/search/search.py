"""The work of a search: generations of trials that Optuna proposes, then fresh seeds for the best of them.

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
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from feeder_sim.errors import InputError
from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import Runner
from feeder_sim.measures.statistic import Statistic
from feeder_sim.run.provenance import identity_of
from feeder_sim.scenario import Scenario
from feeder_sim.studies.search.proposals import LOG, Proposals, Sampler
from feeder_sim.studies.search.space import Space
from feeder_sim.studies.search.trials import Aim, Trial, TrialTasks
from feeder_sim.studies.sweep.cases import Case
from feeder_sim.studies.sweep.design import Point

GENERATION = 8  # trials that are proposed together
FINALISTS = 4
FRESH = 1_000_003  # added to the root of the random numbers for seeds that no trial has had
SEED_LIMIT = 2**63  # of the root; what would be beyond begins again at 0
CHECKS = ("present", "best")  # in notes of the journal
TRIALS_SHARE = 0.95  # of the progress; the rest is the check


@dataclass(frozen=True)
class Budget:
    """When trials end: after so many, or so long [s] of this call; a generation under way is finished.

    check_seeds: fresh seeds of the best recipe, and of the scenario as it is.
    """

    trials: int
    seconds: float = math.inf
    check_seeds: int = 16


@dataclass(frozen=True)
class Checked:
    """A recipe with fresh seeds.

    Attributes:
        point: its values; None for the scenario as it is.
        values: of the measure, seed by seed; NaN where a seed has none.
        warnings: settings of the recipe that are known to mislead, a line each.
    """

    point: Point | None
    values: tuple[float, ...]
    warnings: tuple[str, ...] = ()

    @property
    def statistic(self) -> Statistic:
        """Over the seeds that have a value."""
        return Statistic.of(self.values)

    @property
    def without_value(self) -> int:
        """Number of seeds that have none."""
        return sum(not math.isfinite(value) for value in self.values)

    def as_json(self) -> dict[str, Any]:
        """As JSON takes it: `n` of the seeds have a value."""
        return self.statistic.as_dict() | {"seeds": len(self.values), "warnings": list(self.warnings)}


@dataclass
class History:
    """What a search has come to so far.

    Attributes:
        trials: all that were judged, in order.
        present, best: the scenario as it is, and the best recipe, both with fresh seeds; None before that.
    """

    trials: list[Trial] = field(default_factory=list)
    present: Checked | None = None
    best: Checked | None = None


class SearchRun:
    """A search on its way.

    Args:
        space: what may be changed.
        aim: what is searched for.
        budget: when to end.
        sampler: of Optuna; CMA-ES takes numbers only.
        runner: runs the seeds; Optuna's own journal is in its folder, or in memory.

    Attributes:
        history: what it has come to.
    """

    def __init__(self, space: Space, aim: Aim, budget: Budget, sampler: Sampler, runner: Runner) -> None:
        self._space, self._aim, self._budget, self._sampler, self._runner = space, aim, budget, sampler, runner
        self._began = time.monotonic()
        self.history = History()

    def run(self, starts: Sequence[Point] = ()) -> bool:
        """Search; starts: recipes to begin with, besides the scenario itself. Returns whether it came to its end.

        Raises:
            InputError: Optuna is not installed, the sampler does not suit the space, or there is no such measure.
        """
        folder, stop = self._runner.folder, self._runner.work.stop
        proposals = Proposals(folder / LOG if folder else None, self._space, self._aim, self._sampler, starts)
        trials_done = self.history.trials
        while len(trials_done) < self._budget.trials and self._spent() < 1.0 and not stop.is_set():
            size = GENERATION if trials_done or self._space.present is None else 1
            size = min(size, self._budget.trials - len(trials_done))
            trials = [self._trial(number, point) for number, point in proposals.next(size)]
            if not trials_done and not any(trial.case and trial.case.done for trial in trials):
                self._runner.notify_foreign(len(self._runner.ledger))
            if not self._run(trials, self._aim, _best(trials_done, self._aim)):
                return False
            trials_done += trials
            for trial in trials:
                self._note({"trial": trial.number, "point": trial.point}, trial)
            proposals.tell(trials)
        complete = not stop.is_set() and self._check()
        if complete:
            self._runner.work.progress(1.0)
        return complete

    def _spent(self) -> float:
        """Share of the budget."""
        seconds = (time.monotonic() - self._began) / self._budget.seconds
        return min(max(seconds, len(self.history.trials) / self._budget.trials), 1.0)

    def _show(self, _: float) -> None:
        self._runner.work.progress(TRIALS_SHARE * self._spent())

    def _case_of(self, scenario: Scenario, point: Point) -> Case:
        """A scenario with the seeds of it that are done."""
        identity = identity_of(scenario)
        return Case(lambda: scenario, point, done=self._runner.ledger.seeds_of(identity))

    def _trial(self, number: int, point: Point) -> Trial:
        try:
            return Trial(number, point, self._case_of(self._space.changed(point), point))
        except InputError as error:  # values that are not allowed together
            return Trial(number, point, None, stopped=True, refused=str(error))

    def _run(self, trials: Sequence[Trial], aim: Aim, best: Trial | None) -> bool:
        """Run the seeds that trials need; returns whether it came to the end."""
        return self._runner.run(TrialTasks([*trials], aim, best, self._runner.ledger.add), self._show)

    def _check(self) -> bool:
        """Run the finalists longer, then the best of them and the present recipe with fresh seeds; whether all was."""
        space, aim = self._space, self._aim
        complete = (trial for trial in self.history.trials if trial.is_whole(aim))
        finalists = sorted(complete, key=lambda trial: trial.mean(aim), reverse=aim.largest)[:FINALISTS]
        longer = replace(aim, seeds=2 * aim.seeds)
        extended = [_FullTrial(trial.number, trial.point, trial.case) for trial in finalists]
        if not self._run(extended, longer, None):
            return False
        best = _best(extended, longer)
        fresh = replace(aim, seeds=self._budget.check_seeds)
        scenarios = [space.scenario] + ([space.changed(best.point)] if best else [])
        root = (space.scenario.run.seed + FRESH) % SEED_LIMIT
        anew = [scenario.changed({"run.seed": root}, file=space.file) for scenario in scenarios]
        checks = [_FullTrial(-1, {}, self._case_of(scenario, {})) for scenario in anew]
        if not self._run(checks, fresh, None):
            return False
        for name, point, check in zip(CHECKS, (None, best.point if best else None), checks, strict=False):
            self._note({"check": name, "point": point}, check)
        self.history.present = _checked(None, checks[0], fresh)
        self.history.best = _checked(best.point, checks[1], fresh) if best else None
        return True

    def _note(self, entry: dict[str, Any], trial: Trial) -> None:
        """Keep in the journal what a trial, or a check, was."""
        case = self._runner.ledger.case_of(trial.case.identity) if trial.case else ""
        self._runner.ledger.note(entry | {"case": case, "stopped": trial.stopped, "refused": trial.refused})


def read_history(ledger: Ledger, space: Space, aim: Aim, check_seeds: int) -> History:
    """What a journal holds of a search, whatever version has run it."""
    trials: dict[int, Trial] = {}
    checks: dict[str, Checked] = {}
    for note in ledger.notes:
        with contextlib.suppress(KeyError, TypeError):  # of another program
            point, name = note["point"], note["case"]
            case = Case(lambda: space.scenario, point or {}, done=dict(ledger.recorded(name)))
            if "trial" in note:
                refused = note["refused"]
                trials[note["trial"]] = Trial(note["trial"], point, None if refused else case, note["stopped"], refused)
            else:
                fresh = replace(aim, seeds=check_seeds)
                checks[note["check"]] = _checked(point, _FullTrial(-1, {}, case), fresh)
    return History([trials[number] for number in sorted(trials)], *(checks.get(name) for name in CHECKS))


def _checked(point: Point | None, trial: Trial, aim: Aim) -> Checked:
    seeds = trial.case.done.values() if trial.case else ()
    warnings = next((seed.warnings for seed in seeds), ())  # those of the scenario, so all seeds have the same
    return Checked(point, tuple(trial.values(aim)), warnings)


class _FullTrial(Trial):
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
