"""Many ensembles of which nothing but the drift is kept: for maps over frequency and amplitude.

Every seed is that of `simulate`: its frames are measured as soon as it has ended, and dropped.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass

import numpy as np

from feeder_sim.engines.protocol import ENDED, new_interrupt
from feeder_sim.errors import InputError, check_type, check_whole
from feeder_sim.measures.drift import Drift, DriftFindings, SeedDrift
from feeder_sim.measures.protocol import SeedReader
from feeder_sim.notebook import block
from feeder_sim.records.seed import Status, endings
from feeder_sim.run.compilation import compile_engine
from feeder_sim.run.prepare import prepare
from feeder_sim.run.seed_run import SeedRun
from feeder_sim.run.simulation import generators
from feeder_sim.run.work import available_cores
from feeder_sim.scenario import Scenario
from feeder_sim.scene.prepared import Prepared
from feeder_sim.single_thread import single_threaded

AHEAD = 3  # ensembles per core that are prepared before they are run


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
    stop = stop or threading.Event()
    cores = available_cores() if workers is None else check_whole(workers, "workers")
    completed: list[Ensemble] = []
    running: deque[_RunningEnsemble] = deque()

    def collect_first() -> None:
        if ensemble := running[0].result(stop):
            running.popleft()
            completed.append(ensemble)
            if progress:
                progress(len(completed))

    with ThreadPoolExecutor(cores) as pool:
        try:
            for scenario in scenarios:
                prepared = scenario if isinstance(scenario, Prepared) else prepare(scenario)
                check_drifting(prepared)
                if not completed and not running:
                    compile_engine(prepared)
                running.append(_RunningEnsemble(prepared, pool, stop))
                while len(running) > AHEAD * cores and not stop.is_set():
                    collect_first()
                if stop.is_set():
                    break
            while running and not stop.is_set():
                collect_first()
        finally:
            for ensemble in running:  # stopped, or an error: what is left ends where it is
                ensemble.give_up()
    return completed


def check_drifting(prepared: Prepared) -> None:
    """Refuse what has no drift.

    Raises:
        InputError: the scenario has a schedule.
    """
    if not Drift().applies(prepared):
        raise InputError("is given, must be none where drifts are measured", key="schedule")


class _RunningEnsemble:
    """The seeds of a scenario in the hands of threads."""

    def __init__(self, prepared: Prepared, pool: ThreadPoolExecutor, stop: threading.Event) -> None:
        self._prepared, self._read, self._stop = prepared, SeedReader(Drift(), prepared), stop
        seeds = prepared.scenario.run.seeds
        self._interrupts = [new_interrupt() for _ in range(seeds)]
        random = generators(prepared.scene)
        self._seeds = [pool.submit(self._run, index, random[index]) for index in range(seeds)]

    def _run(self, index: int, rng: np.random.Generator) -> tuple[Status, float, SeedDrift | None]:
        """How a seed ended, when, and its drift."""
        run = SeedRun(self._prepared, index, interrupt=self._interrupts[index])
        seed = run.run(rng, np.zeros(index + 1), self._stop)
        return seed.status, seed.reached or 0.0, self._read(seed)

    def give_up(self) -> None:
        """End what is under way, and start nothing more."""
        self._stop.set()
        for interrupt in self._interrupts:
            interrupt[ENDED] = 1
        for seed in self._seeds:
            seed.cancel()

    def result(self, stop: threading.Event) -> Ensemble | None:
        """Wait for the seeds; None if that is to stop before."""
        while wait(self._seeds, timeout=0.1).not_done:
            if stop.is_set():
                return None
        status, reached, drifts = zip(*(seed.result() for seed in self._seeds), strict=True)
        if Status.UNFINISHED in status:
            return None
        findings = Drift().findings(self._prepared, [drift for drift in drifts if drift is not None])
        return Ensemble(self._prepared, findings, status, float(sum(reached)))
