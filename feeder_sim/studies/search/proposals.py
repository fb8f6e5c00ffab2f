"""What Optuna proposes: generations of trials, each from the results of those before it.

The sampler is seeded by the number of each trial. So it proposes the same after a break, or after a kill that has left
half a generation in its record.
"""

from __future__ import annotations

import hashlib
import importlib.util
import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from feeder_sim.errors import InputError, MissingExtra
from feeder_sim.run.provenance import identity_of
from feeder_sim.studies.search.space import Parameter, Space
from feeder_sim.studies.search.trials import Aim, Trial
from feeder_sim.studies.sweep.design import Point

if TYPE_CHECKING:
    from optuna.samplers import BaseSampler
    from optuna.study import Study
    from optuna.trial import FrozenTrial
    from optuna.trial import Trial as OptunaTrial

Sampler = Literal["tpe", "cmaes"]
LOG = "optuna.log"
RANDOM_TRIALS = 16  # at the begin, before the sampler learns


class Proposals:
    """Trials as Optuna proposes them, in the order of their numbers."""

    def __init__(self, log: Path | None, space: Space, aim: Aim, sampler: Sampler, starts: Sequence[Point]) -> None:
        """Open the record of a search, or begin one with the scenario itself and the recipes of `starts`.

        Raises:
            InputError: Optuna or what the sampler needs is not installed, the sampler does not suit the space, or the
                record cannot be read.
        """
        _check_sampler(sampler, space)
        self._space, self._aim, self._sampler, self._handed = space, aim, sampler, 0
        self._study = _study(log, space, aim, sampler)
        if not self._study.trials:
            for point in (space.present, *starts):
                if point is not None:
                    self._study.enqueue_trial(space.proposed(point), skip_if_exists=True)

    def next(self, size: int) -> list[tuple[int, Point]]:
        """The next trials by number: those that a break has left in the record, then new ones."""
        parameters = self._space.parameters
        points: list[tuple[int, Point]] = []
        for number in range(self._handed, self._handed + size):
            recorded = self._recorded(number)
            if recorded is not None and set(recorded.params) >= {parameter.key for parameter in parameters}:
                point = {p.key: _value(p, recorded.params[p.key]) for p in parameters}
            else:
                point = self._space.suggest(self._open_trial(number, recorded))
            points.append((number, point))
        self._handed += size
        return points

    def _recorded(self, number: int) -> FrozenTrial | None:
        """What the record has of a trial that was asked for before; None where it was not."""
        from optuna.trial import TrialState

        trials = self._study.get_trials(deepcopy=False)
        trial = trials[number] if number < len(trials) else None
        return trial if trial is not None and trial.state != TrialState.WAITING else None

    def _open_trial(self, number: int, recorded: FrozenTrial | None) -> OptunaTrial:
        """A trial that takes its values now: a new one, or one that a kill has left without some of its values."""
        import optuna

        self._study.sampler = _sampler_of(self._sampler, self._space, number)
        return self._study.ask() if recorded is None else optuna.Trial(self._study, recorded._trial_id)

    def tell(self, trials: Sequence[Trial]) -> None:
        """Tell Optuna what became of trials; a recipe without a value counts as worse than all others."""
        from optuna.trial import TrialState

        for trial in trials:
            mean = trial.mean(self._aim)
            if math.isnan(mean):
                self._study.tell(trial.number, state=TrialState.PRUNED, skip_if_finished=True)
            else:
                self._study.tell(trial.number, mean, skip_if_finished=True)


def _study(log: Path | None, space: Space, aim: Aim, sampler: str) -> Study:
    """Optuna's record of the search, in a journal file; another question in the same file has a record of its own."""
    try:
        import optuna
        from optuna.storages import InMemoryStorage, JournalStorage
        from optuna.storages.journal import JournalFileBackend
        from optuna.study import StudyDirection
    except ImportError:
        raise MissingExtra("search", key="optimise") from None
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    direction = StudyDirection.MAXIMIZE if aim.largest else StudyDirection.MINIMIZE
    question = f"{identity_of(space.scenario)} {aim} {space.parameters} {sampler}"
    name = hashlib.sha256(question.encode()).hexdigest()[:16]
    try:
        storage = JournalStorage(JournalFileBackend(str(log))) if log else InMemoryStorage()
        return optuna.create_study(study_name=name, storage=storage, direction=direction, load_if_exists=True)
    except Exception as error:  # of a damaged file Optuna raises what it likes
        raise InputError(f"is no record of a search, must be another folder ({error})", file=log) from error


def _sampler_of(name: str, space: Space, number: int) -> BaseSampler:
    """A sampler that depends on nothing but the trials so far and the number of the one it is to propose."""
    import optuna

    seed = int(np.random.SeedSequence([space.scenario.run.seed, number]).generate_state(1)[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        if name == "tpe":
            return optuna.samplers.TPESampler(
                seed=seed, n_startup_trials=RANDOM_TRIALS, multivariate=True, constant_liar=True
            )
        return optuna.samplers.CmaEsSampler(seed=seed, n_startup_trials=RANDOM_TRIALS)


def _check_sampler(name: str, space: Space) -> None:
    """Refuse a sampler that could not propose: Optuna finds out in the middle of a search, after its random trials.

    Raises:
        InputError: as said.
    """
    if name != "cmaes":
        return
    if any(parameter.span is None for parameter in space.parameters):
        raise InputError('is "cmaes", must be "tpe" where there are choices', argument="sampler")
    if importlib.util.find_spec("cmaes") is None:
        raise MissingExtra("search", argument="sampler")


def _value(parameter: Parameter, recorded: Any) -> Any:
    """A value from what Optuna has kept of it."""
    return recorded if parameter.span else parameter.choices[parameter.names.index(recorded)]
