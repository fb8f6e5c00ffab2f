"""Many ensembles of which nothing but the drift is kept: for maps over frequency and amplitude.

Every seed is that of `simulate`: its frames are measured as soon as it has ended, and dropped.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from feeder_sim.errors import InputError, check_type
from feeder_sim.measures.drift import Drift, DriftFindings, SeedDrift
from feeder_sim.measures.protocol import SeedReader
from feeder_sim.notebook import block
from feeder_sim.pool.pool import run_tasks
from feeder_sim.pool.work import Work
from feeder_sim.records.seed import Status, endings
from feeder_sim.run.compilation import compile_engine
from feeder_sim.run.prepare import prepare
from feeder_sim.run.seed_threads import SeedThreads, seed_threads
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
    with seed_threads(work) as pool:
        ensembles = _Ensembles(scenarios, pool, progress)
        run_tasks(pool.workers, ensembles, _run_seed, work)
    return ensembles.completed


def check_drifting(prepared: Prepared) -> None:
    """Refuse what has no drift.

    Raises:
        InputError: the scenario has a schedule.
    """
    if not Drift().applies(prepared):
        raise InputError("is given, must be none where drifts are measured", key="schedule")


@dataclass(frozen=True)
class _SeedEnd:
    """How a seed ended, the time that it reached [s], and its drift."""

    status: Status
    reached: float
    drift: SeedDrift | None


class _EnsembleRun:
    """An ensemble under way.

    Args:
        prepared: what is run.
        pool: runs its seeds, and reads their drifts.
    """

    def __init__(self, prepared: Prepared, pool: SeedThreads) -> None:
        self._prepared, self._pool, self._read = prepared, pool, SeedReader(Drift(), prepared)
        self.ends: dict[int, _SeedEnd] = {}

    def run(self, index: int) -> _SeedEnd:
        """Run a seed."""
        seed = self._pool.run(self._prepared, index)
        return _SeedEnd(seed.status, seed.reached or 0.0, self._read(seed))

    def result(self) -> Ensemble | None:
        """The ensemble; None while a seed has not ended."""
        if len(self.ends) < self._prepared.scenario.run.seeds:
            return None
        ends = [end for _, end in sorted(self.ends.items())]
        if any(end.status == Status.UNFINISHED for end in ends):
            return None
        findings = Drift().findings(self._prepared, [end.drift for end in ends if end.drift is not None])
        return Ensemble(self._prepared, findings, tuple(end.status for end in ends), sum(end.reached for end in ends))


class _Ensembles:
    """The seeds of many scenarios as tasks; a scenario is prepared when its first seed is handed out.

    Attributes:
        completed: ensembles that have ended, up to the first that has not.
    """

    def __init__(
        self, scenarios: Iterable[Scenario | Prepared], pool: SeedThreads, progress: Callable[[int], None] | None
    ) -> None:
        self.completed: list[Ensemble] = []
        self._under_way: deque[_EnsembleRun] = deque()
        self._seeds = self._all_seeds(scenarios, pool)
        self._progress = progress

    def _all_seeds(
        self, scenarios: Iterable[Scenario | Prepared], pool: SeedThreads
    ) -> Iterator[tuple[_EnsembleRun, int]]:
        for number, scenario in enumerate(scenarios):
            prepared = scenario if isinstance(scenario, Prepared) else prepare(scenario)
            check_drifting(prepared)
            if number == 0:
                compile_engine(prepared)
            self._under_way.append(ensemble := _EnsembleRun(prepared, pool))
            yield from ((ensemble, index) for index in range(prepared.scenario.run.seeds))

    def next(self) -> tuple[tuple[_EnsembleRun, int], tuple[_EnsembleRun, int]] | None:
        return next(((seed, seed) for seed in self._seeds), None)

    def take(self, place: tuple[_EnsembleRun, int], result: _SeedEnd) -> None:
        ensemble, index = place
        ensemble.ends[index] = result
        while self._under_way and (completed := self._under_way[0].result()):
            self._under_way.popleft()
            self.completed.append(completed)
            if self._progress:
                self._progress(len(self.completed))

    @property
    def share_done(self) -> float:
        return 0.0  # how many there are is not known


def _run_seed(seed: tuple[_EnsembleRun, int]) -> _SeedEnd:
    ensemble, index = seed
    return ensemble.run(index)
