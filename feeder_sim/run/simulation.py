"""An ensemble: the seeds of a scenario in parallel threads, and what they add up to."""

from __future__ import annotations

import contextlib
import math
import queue
import time
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from feeder_sim.document.words import split_unit
from feeder_sim.engines.protocol import ENDED, new_interrupt
from feeder_sim.errors import FeederSimError, SimulationDiverged
from feeder_sim.measures.catalogue import Measured, measures_of
from feeder_sim.measures.protocol import Measure, as_json, labelled
from feeder_sim.records.seed import Counts, Seed, Status, endings
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.compilation import announced, compilation_announced, compile_engine
from feeder_sim.run.keep import AllFrames, Keeper, Retention
from feeder_sim.run.one_seed import run_seed_elsewhere
from feeder_sim.run.prepare import prepare
from feeder_sim.run.provenance import identity_of
from feeder_sim.run.seed_run import SeedRun
from feeder_sim.run.work import Work
from feeder_sim.scenario import Scenario
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.start import start_poses
from feeder_sim.single_thread import single_threaded

GRACE_S = 0.3  # [s] from the wish to stop until blocks under way are given up
PROGRESS_S = 0.1  # [s] between two looks at the progress
LOOKING = "looking for places"


@dataclass(frozen=True, repr=False)
class Result(Measured):
    """An ensemble.

    Attributes:
        prepared: what was simulated.
        seeds: one result per seed, in order; of a run that was interrupted, the seeds that had begun.
        wall_s: elapsed wall time of the ensemble [s], that before a break included.
    """

    prepared: Prepared
    seeds: tuple[Seed, ...]
    wall_s: float

    def __repr__(self) -> str:
        title = f" {self.title!r}" if self.title else ""
        cost = f"{self.simulated_s:.6g} s simulated in {self.wall_s:.3g} s"
        return f"<Result{title}: {endings([seed.status for seed in self.seeds])}, {cost}>"

    @property
    def title(self) -> str:
        """That of the scenario."""
        return self.scenario.title

    @property
    def scenario(self) -> Scenario:
        """What was run."""
        return self.prepared.scenario

    @property
    def scene(self) -> Scene:
        """The scenario in SI units."""
        return self.prepared.scene

    @property
    def trajectories(self) -> list[Frames]:
        """Frames that were kept, one entry per seed."""
        return [seed.frames for seed in self.seeds]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Settings that are known to mislead, a line each."""
        return self.prepared.warnings

    @property
    def failures(self) -> list[SimulationDiverged]:
        """Why seeds diverged, those that did."""
        return [seed.failure for seed in self.seeds if seed.failure is not None]

    @property
    def interrupted(self) -> bool:
        """Whether a seed has not ended, or not even begun."""
        missing = len(self.seeds) < self.scenario.run.seeds
        return missing or any(seed.status == Status.UNFINISHED for seed in self.seeds)

    @property
    def simulated_s(self) -> float:
        """Simulated time of all seeds together [s]."""
        return sum(seed.reached or 0.0 for seed in self.seeds)

    @cached_property
    def findings(self) -> tuple[tuple[Measure[Any, Any], Any], ...]:
        """Every measure that applies, with what it finds."""
        return tuple((measure, measure.compute(self.prepared, self.seeds)) for measure in measures_of(self.prepared))

    def measures(self) -> dict[str, Any]:
        """What all measures find, by name, as JSON takes it; units in the names."""
        return {name: value for _, findings in self.findings for name, value in as_json(findings).items()}

    def lines(self) -> list[str]:
        """What all measures find, in words."""
        lines = [line for measure, findings in self.findings for line in measure.lines(self.prepared, findings)]
        return lines + [labelled(split_unit(name)[0], f"no value: {why}") for name, why in self.without_value().items()]

    def without_value(self) -> dict[str, str]:
        """Values of measures that have no number, by name, each with the reason."""
        reasons = {}
        for measure, findings in self.findings:
            counts = any(seed.status in measure.counts for seed in self.seeds)
            for name, reason in measure.without_value(self.prepared, findings).items():
                reasons[name] = reason if counts else "no seed ran to an end that counts"
        return reasons

    def summary(self) -> dict[str, Any]:
        """Measures, cost and provenance as one JSON-ready dictionary."""
        scenario, simulated = self.scenario, self.simulated_s
        return {
            "title": scenario.title,
            "engine": self.prepared.engine.name,
            "seed": scenario.run.seed,
            "seeds": scenario.run.seeds,
            **self.measures(),
            "without_value": self.without_value(),
            "simulated_s": simulated,
            "wall_s": self.wall_s,
            "real_time_factor": simulated / self.wall_s if self.wall_s > 0 else None,
            "wall_s_per_simulated_s_one_core": sum(s.wall_s for s in self.seeds) / simulated if simulated else None,
            "timestep_s": self.scene.timestep,
            **Counts.total(self.seeds)._asdict(),
            "left_plate": sum(seed.status == Status.LEFT_PLATE for seed in self.seeds),
            "interrupted": self.interrupted,
            "warnings": list(self.warnings),
            "failures": [str(failure) for failure in self.failures],
        }


@single_threaded  # the seeds take all cores; threads of linear algebra only wait for small matrices
def simulate(
    scenario: Scenario | Prepared,
    *,
    record: Retention = AllFrames(),  # noqa: B008, it cannot be changed
    work: Work | None = None,
    save: Callable[[int, Seed], Seed] | None = None,
    ended: Mapping[int, Seed] | None = None,
    wall_s_before: float = 0.0,
) -> Result:
    """Run every seed, perhaps into a run folder; the result does not depend on the number of workers.

    Args:
        scenario: what to run.
        record: what to keep of each seed in memory.
        work: by default threads, one for each core: the engines' inner loops run outside Python. Of an executor each
            seed comes back whole.
        save: takes every seed, by its index, as it ends, in the thread that ran it; returns what stands for it.
        ended: seeds, by their index, that are not run: what there is of them stands.
        wall_s_before: wall time [s] that the ensemble has taken before.

    Raises:
        FeederSimError: workers of the executor end before their seed has.
        InputError: the scenario cannot be built, or what is to be kept is not recorded in such a scene.
    """
    prepared = scenario if isinstance(scenario, Prepared) else prepare(scenario)
    run, keeper = prepared.scenario.run, Keeper(prepared, record)
    work, ended = work or Work(), ended or {}
    stop, executor = work.stop, work.executor
    lost: tuple[type[BaseException], ...] = (BrokenExecutor, *work.lost)
    random = generators(prepared.scene)
    fractions = np.zeros(run.seeds)
    identity = identity_of(prepared.scenario) if executor else ""
    if not executor:
        with compilation_announced(prepared.engine.method, work.notify):  # before the threads need it
            compile_engine(prepared)
    started = time.perf_counter()
    interrupts, stop_requested = [new_interrupt() for _ in range(run.seeds)], math.inf  # when somebody asked to stop
    threads = max(1, work.n_workers // run.seeds)  # for one seed, where there are fewer seeds than cores

    def of_executor(index: int) -> Seed | None:
        """A seed that is run elsewhere; None if it was stopped."""
        assert executor is not None
        try:
            future = executor.submit(run_seed_elsewhere, prepared.scenario, identity, index, work.stall_after)
            while not stop.is_set():
                if wait([future], PROGRESS_S).done:
                    return future.result()
        except lost as error:
            raise FeederSimError(f"workers end before their seed has ({type(error).__name__}) {error}") from error
        future.cancel()
        return None

    def run_seed(index: int) -> Seed | None:
        if seed := ended.get(index):
            fractions[index] = 1.0
            return keeper(seed)
        if index > 0 and stop.is_set():
            return None  # of a seed that has not begun there is nothing; the first stands for the others
        if not executor or (seed := of_executor(index)) is None:
            seed_run = SeedRun(
                prepared, index, threads=threads, interrupt=interrupts[index], stall_after=work.stall_after
            )
            seed = seed_run.run(random[index], fractions, stop)
        fractions[index] = 1.0
        return keeper(save(index, seed) if save else seed)

    def end_all() -> None:
        for interrupt in interrupts:
            interrupt[ENDED] = 1

    finished: queue.SimpleQueue[Future[Seed | None]] = queue.SimpleQueue()  # to wait for all would look at each of them
    with ThreadPoolExecutor(work.n_workers) as pool:
        try:
            futures = [pool.submit(run_seed, index) for index in range(run.seeds)]
            for future in futures:
                future.add_done_callback(finished.put)
            remaining, last_report = len(futures), -math.inf
            while remaining:
                with contextlib.suppress(queue.Empty):
                    finished.get(timeout=PROGRESS_S).result()  # an error ends the whole ensemble at once
                    remaining -= 1
                if stop.is_set():
                    stop_requested = min(stop_requested, time.perf_counter())
                    if time.perf_counter() - stop_requested > GRACE_S:
                        end_all()
                if not remaining or time.perf_counter() - last_report > PROGRESS_S:
                    work.progress(float(fractions.mean()))
                    last_report = time.perf_counter()
        except BaseException:
            stop.set()
            end_all()
            raise
    results = tuple(seed for seed in (future.result() for future in futures) if seed is not None)
    return Result(prepared, results, wall_s_before + time.perf_counter() - started)


def check_starts(scene: Scene, work: Work) -> None:
    """Draw the starts of every seed, to refuse those that cannot be had before anything is written.

    Raises:
        InputError: there is no room for the parts.
    """
    seeds, parts = scene.scenario.run.seeds, len(scene.parts)
    with announced(f"{LOOKING} of {parts} parts in {seeds} seeds", work.notify):
        for rng in generators(scene):
            start_poses(scene, rng)


def generators(scene: Scene) -> list[np.random.Generator]:
    """The random numbers of every seed."""
    run = scene.scenario.run
    return [np.random.default_rng(s) for s in np.random.SeedSequence(run.seed).spawn(run.seeds)]
