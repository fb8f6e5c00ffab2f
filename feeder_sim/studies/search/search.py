"""The search: generations of trials that Optuna proposes, then fresh seeds for the best of them.

Trials are made in generations of a fixed size. Each generation is proposed from the results of those before it, by a
sampler that is seeded by its number, and its trials are held against the best one before it. So the search takes the
same way whatever runs it, and goes on after a break as if there had been none.

The best of many noisy means is too good to be true (the winner's curse). Finalists get twice the seeds, and the best of
them is run with fresh seeds, beside the recipe that the search began with.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import threading
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.stats import t

from feeder_sim.errors import InputError
from feeder_sim.jobs.identity import identity_of
from feeder_sim.jobs.journal import Journal, read_journal
from feeder_sim.jobs.runner import run_work
from feeder_sim.jobs.task import SeedValues
from feeder_sim.jobs.workers import Workers
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario import Scenario
from feeder_sim.studies.search.space import Parameter, Space
from feeder_sim.studies.search.trials import Aim, Trial, TrialWork
from feeder_sim.studies.sweep.case import Case
from feeder_sim.studies.sweep.cases import check_measure
from feeder_sim.studies.sweep.design import Point

if TYPE_CHECKING:
    from optuna.samplers import BaseSampler
    from optuna.study import Study

GENERATION = 8  # trials that are proposed together
FINALISTS = 4
FRESH = 1_000_003  # added to the root of the random numbers for seeds that no trial has had
RANDOM_TRIALS = 16  # at the begin, before the sampler learns


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
    """

    point: Point | None
    values: tuple[float, ...]

    @property
    def found(self) -> Statistic:
        return Statistic.of(self.values)


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
    def gain(self) -> tuple[float, float, float]:
        """Mean difference of best and present, seed by seed, and its 95 % interval; NaN where there is none."""
        if self.present is None or self.best is None:
            return (math.nan,) * 3
        gain = np.array(self.best.values) - np.array(self.present.values)
        gain = gain[np.isfinite(gain)]
        if len(gain) < 2:
            return (math.nan,) * 3
        reach = float(t.ppf(0.975, len(gain) - 1) * gain.std(ddof=1) / math.sqrt(len(gain)))
        return float(gain.mean()), float(gain.mean()) - reach, float(gain.mean()) + reach


def search(
    space: Space,
    aim: Aim,
    workers: Workers,
    folder: Path,
    journal: Path,
    *,
    budget: Budget,
    check_seeds: int,
    sampler: Literal["tpe", "cmaes"] = "tpe",
    starts: Sequence[Point] = (),
    stop: threading.Event | None = None,
    progress: Callable[[float], None] | None = None,
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

    Raises:
        InputError: Optuna is not installed, or the sampler does not suit the space.
    """
    stop, began = stop or threading.Event(), time.monotonic()
    done: dict[str, dict[int, SeedValues]] = {}
    for entry in read_journal(journal):
        with contextlib.suppress(KeyError, TypeError, ValueError, AttributeError):  # not written by this program
            seed = SeedValues.of_entry(entry)
            check_measure(aim.measure, seed.values, aim.option)
            done.setdefault(str(entry["case"]), {})[seed.seed] = seed
    found = Search(space, aim)
    with Journal(journal) as written:

        def keep(case: Case, seed: SeedValues) -> None:
            written.add({"case": case.identity, **seed.as_entry()})

        def case_of(scenario: Scenario) -> Case:
            identity = identity_of(scenario)
            return Case(scenario, identity, done=dict(done.get(identity, {})))

        def trial_at(number: int, point: Point) -> Trial:
            try:
                return Trial(number, point, case_of(space.changed(point)))
            except InputError as error:  # values that are not allowed together
                return Trial(number, point, None, stopped=True, refused=str(error))

        def spent() -> float:
            seconds = (time.monotonic() - began) / budget.seconds
            return min(max(seconds, len(found.trials) / budget.trials), 1.0)

        def run(trials: list[Trial], aim: Aim, best: Trial | None) -> bool:
            work = TrialWork(trials, aim, best, keep)
            return run_work(work, workers, stop=stop, progress=lambda _: progress(0.95 * spent()) if progress else None)

        study = _study(folder / "optuna.log", space, aim, sampler)
        first = [point for point in (space.present, *starts) if point is not None]
        generation = 0
        while len(found.trials) < budget.trials and spent() < 1.0 and not stop.is_set():
            for point in first if generation == 0 and not study.trials else []:
                study.enqueue_trial(space.proposed(point), skip_if_exists=True)
            size = min(GENERATION, budget.trials - len(found.trials))
            proposed = _proposed(study, space, sampler, generation, size)
            trials = [trial_at(number, point) for number, point in proposed]
            if not run(trials, aim, _best(found.trials, aim)):
                return found
            found.trials += trials
            _tell(study, trials, aim)
            generation += 1
        if stop.is_set():
            return found
        finalists = sorted(
            (trial for trial in found.trials if trial.is_whole(aim)),
            key=lambda trial: trial.mean(aim),
            reverse=aim.largest,
        )[:FINALISTS]
        longer = replace(aim, seeds=2 * aim.seeds)
        tried = [_Whole(trial.number, trial.point, trial.case) for trial in finalists]
        if not run([*tried], longer, None):
            return found
        best = _best(tried, longer)
        fresh = replace(aim, seeds=check_seeds)
        checks: list[_Whole] = []
        recipes: list[Point | None] = [None, best.point if best else None]
        for recipe in recipes:
            scenario = space.changed(recipe) if recipe else space.scenario
            anew = scenario.changed({"run.seed": scenario.run.seed + FRESH})
            checks.append(_Whole(-1, recipe or {}, case_of(anew)))
        if not run([*checks], fresh, None):
            return found
        present, checked = (tuple(check.values(fresh)) for check in checks)
        found.present = Checked(None, present)
        found.best = Checked(best.point, checked) if best else None
        found.complete = True
    if progress:
        progress(1.0)
    return found


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


def _study(log: Path, space: Space, aim: Aim, sampler: str) -> Study:
    """Optuna's record of the search, in a journal file; another question in the same file has a record of its own."""
    try:
        import optuna
        from optuna.storages import JournalStorage
        from optuna.storages.journal import JournalFileBackend
        from optuna.study import StudyDirection
    except ImportError:
        raise InputError("needs the extra `search`: pip install 'feeder_sim[search]'", key="optimise") from None
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    direction = StudyDirection.MAXIMIZE if aim.largest else StudyDirection.MINIMIZE
    asked = f"{identity_of(space.scenario)} {aim} {space.parameters} {sampler}"
    name = hashlib.sha256(asked.encode()).hexdigest()[:16]
    try:
        storage = JournalStorage(JournalFileBackend(str(log)))
        return optuna.create_study(study_name=name, storage=storage, direction=direction, load_if_exists=True)
    except Exception as error:  # of a damaged file Optuna raises what it likes
        raise InputError(f"is no record of a search, allowed is another folder ({error})", file=log) from error


def _sampler(name: str, space: Space, number: int) -> BaseSampler:
    """A sampler that depends on nothing but the trials so far and the number of the one it is to propose."""
    import optuna

    seed = int(np.random.SeedSequence([space.scenario.run.seed, number]).generate_state(1)[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        if name == "tpe":
            return optuna.samplers.TPESampler(
                seed=seed, n_startup_trials=RANDOM_TRIALS, multivariate=True, constant_liar=True
            )
        if any(parameter.span is None for parameter in space.parameters):
            raise InputError('is "cmaes", allowed is "tpe" where there are choices', key="--sampler")
        try:
            return optuna.samplers.CmaEsSampler(seed=seed, n_startup_trials=RANDOM_TRIALS)
        except ImportError:
            raise InputError("needs the package cmaes: pip install cmaes", key="--sampler") from None


def _proposed(study: Study, space: Space, sampler: str, generation: int, size: int) -> list[tuple[int, Point]]:
    """The trials of a generation: those that a break has left in the record, then new ones."""
    keys = {parameter.key for parameter in space.parameters}
    recorded = [trial for trial in study.trials if set(trial.params) >= keys]  # a kill may leave one half proposed
    points: list[tuple[int, Point]] = []
    for number in range(generation * GENERATION, generation * GENERATION + size):
        if number < len(recorded):
            kept = recorded[number]
            points.append((kept.number, {p.key: _value(p, kept.params[p.key]) for p in space.parameters}))
        else:
            study.sampler = _sampler(sampler, space, number)
            asked = study.ask()
            points.append((asked.number, space.suggest(asked)))
    return points


def _value(parameter: Parameter, kept: Any) -> Any:
    """A value from what Optuna has kept of it."""
    return kept if parameter.span else parameter.choices[parameter.names.index(kept)]


def _tell(study: Study, trials: Sequence[Trial], aim: Aim) -> None:
    """Tell Optuna what became of trials; a recipe without a value counts as worse than all others."""
    from optuna.trial import TrialState

    for trial in trials:
        mean = trial.mean(aim)
        if math.isnan(mean):
            study.tell(trial.number, state=TrialState.PRUNED, skip_if_finished=True)
        else:
            study.tell(trial.number, mean, skip_if_finished=True)
