"""Many ensembles of which nothing but the drift is kept: for maps over frequency and amplitude.

Every seed is that of `simulate`: its frames are measured as soon as it has ended, and dropped.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from feeder_sim.errors import InputError, check_type
from feeder_sim.measures.drift import Drift, DriftFindings
from feeder_sim.notebook import block
from feeder_sim.pool.pool import run_tasks
from feeder_sim.pool.work import Work
from feeder_sim.records.seed import Seed, Status, endings
from feeder_sim.run.compilation import compile_engine
from feeder_sim.run.keep import Keeper, StatisticsOnly
from feeder_sim.run.prepare import prepare
from feeder_sim.run.seed_threads import seed_threads
from feeder_sim.scenario import Scenario
from feeder_sim.scene.prepared import Prepared
from feeder_sim.single_thread import single_threaded


@dataclass(frozen=True, repr=False)
class Ensemble:
    """What is known of an ensemble of which no frame was kept.

    Attributes:
        prepared: what was run.
        findings: as the measure of drift has them.
        status: how every seed ended.
        simulated_s: of all seeds [s].
    """

    prepared: Prepared
    findings: DriftFindings
    status: tuple[Status, ...]
    simulated_s: float

    @property
    def warnings(self) -> tuple[str, ...]:
        """Settings that are known to mislead, a line each."""
        return self.prepared.warnings

    def __repr__(self) -> str:
        title = f" {self.prepared.scenario.title!r}" if self.prepared.scenario.title else ""
        return f"<Ensemble{title}: {endings(self.status)}, {self.simulated_s:.6g} s simulated>"

    def _repr_html_(self) -> str:
        warnings = [f"warning: {warning}" for warning in self.warnings]
        return block(repr(self)[1:-1], [*Drift().lines(self.prepared, self.findings), *warnings])


@single_threaded
def measure_drift(
    scenarios: Iterable[Scenario | Prepared],
    *,
    workers: int | None = None,
    progress: Callable[[int], None] | None = None,
    stop: threading.Event | None = None,
) -> list[Ensemble]:
    """Run all seeds of many scenarios and measure their drift.

    Every seed is the same seed of `simulate`; its frames are dropped as soon as they are measured. Inputs that are
    `[uncertain]` have the values of the scenario.

    Args:
        scenarios: each without a schedule. They are prepared one by one while others run.
        workers: threads. Default: all cores.
        progress: called with the number of ensembles done, from this thread.
        stop: set it to end within a second; ensembles that have not ended then are left out, and those that have ended
            after them.

    Raises:
        InputError: a scenario cannot be built, or has a schedule.
    """
    check_type(scenarios, Iterable, "a list of scenarios", "measure_drift")
    work = Work(workers, stop=stop or threading.Event())
    ensembles = _Ensembles(scenarios, progress)
    with seed_threads(work) as pool:

        def run_seed(seed: _Place) -> Seed:
            ensemble, index = seed
            return ensemble.retained(pool.run(ensemble.prepared, index))

        run_tasks(pool.workers, ensembles, run_seed, work)
    return ensembles.completed


def check_drifting(prepared: Prepared) -> None:
    """Refuse what has no drift.

    Raises:
        InputError: the scenario has a schedule.
    """
    if not Drift().applies(prepared):
        raise InputError("is given, must be none where drifts are measured", key="schedule")


class _EnsembleRun:
    """An ensemble under way, whose drifts are read by the threads that run its seeds."""

    def __init__(self, prepared: Prepared) -> None:
        self.prepared, self.retained = prepared, Keeper(prepared, StatisticsOnly(), [Drift()])
        self.seeds: dict[int, Seed] = {}

    def result(self) -> Ensemble | None:
        """The ensemble; None while a seed has not ended."""
        if len(self.seeds) < self.prepared.scenario.run.seeds:
            return None
        seeds = [seed for _, seed in sorted(self.seeds.items())]
        status, reached = tuple(seed.status for seed in seeds), sum(seed.reached or 0.0 for seed in seeds)
        if Status.UNFINISHED in status:
            return None
        return Ensemble(self.prepared, Drift().compute(self.prepared, seeds), status, reached)


class _Ensembles:
    """The seeds of many scenarios as tasks; a scenario is prepared when its first seed is handed out.

    Attributes:
        completed: ensembles that have ended, up to the first that has not.
    """

    share_done = 0.0  # how many there are is not known

    def __init__(self, scenarios: Iterable[Scenario | Prepared], progress: Callable[[int], None] | None) -> None:
        self.completed: list[Ensemble] = []
        self._under_way: deque[_EnsembleRun] = deque()
        self._seeds, self._progress = self._all_seeds(scenarios), progress

    def _all_seeds(self, scenarios: Iterable[Scenario | Prepared]) -> Iterator[tuple[_Place, _Place]]:
        for number, scenario in enumerate(scenarios):
            prepared = scenario if isinstance(scenario, Prepared) else prepare(scenario)
            check_drifting(prepared)
            if number == 0:
                compile_engine(prepared)
            self._under_way.append(ensemble := _EnsembleRun(prepared))
            yield from (((ensemble, index),) * 2 for index in range(prepared.scenario.run.seeds))

    def next(self) -> tuple[_Place, _Place] | None:
        return next(self._seeds, None)

    def take(self, place: _Place, result: Seed) -> None:
        ensemble, index = place
        ensemble.seeds[index] = result
        while self._under_way and (completed := self._under_way[0].result()):
            self._under_way.popleft()
            self.completed.append(completed)
            if self._progress:
                self._progress(len(self.completed))


_Place = tuple[_EnsembleRun, int]
