"""An ensemble: the seeds of a scenario in parallel threads, and what they add up to."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from feeder_sim.document.words import split_unit
from feeder_sim.errors import SimulationDiverged
from feeder_sim.measures.catalogue import Measured, measures_of
from feeder_sim.measures.protocol import Measure, as_json, labelled
from feeder_sim.pool.pool import run_tasks
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import Workers
from feeder_sim.records.seed import Counts, Seed, Status, endings
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.compilation import announced, compilation_announced, compile_engine
from feeder_sim.run.keep import AllFrames, Keeper, Retention
from feeder_sim.run.one_seed import run_seed_elsewhere
from feeder_sim.run.prepare import prepare
from feeder_sim.run.provenance import identity_of
from feeder_sim.run.seed_run import SeedRun
from feeder_sim.run.seed_threads import seed_threads
from feeder_sim.scenario import Scenario
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.start import generator, start_poses
from feeder_sim.single_thread import single_threaded

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
        save: takes every seed, by its index, as it ends; returns what stands for it.
        ended: seeds, by their index, that are not run: what there is of them stands.
        wall_s_before: wall time [s] that the ensemble has taken before.

    Raises:
        FeederSimError: workers of the executor end before their seed has.
        InputError: the scenario cannot be built, or what is to be kept is not recorded in such a scene.
    """
    prepared = scenario if isinstance(scenario, Prepared) else prepare(scenario)
    run, keeper = prepared.scenario.run, Keeper(prepared, record)
    work = work or Work()
    with compilation_announced(prepared.engine.method, work.notify):  # before the threads need it
        if not work.executor and len(ended or {}) < run.seeds:
            compile_engine(prepared)
    started = time.perf_counter()
    completed = {index: keeper(seed) for index, seed in (ended or {}).items()}
    seeds = _Seeds(run.seeds, completed, lambda index, seed: keeper(save(index, seed) if save else seed))
    if work.executor:
        workers = Workers(work.executor, work.n_workers, lost=work.lost)
        identity = identity_of(prepared.scenario)
        call = functools.partial(run_seed_elsewhere, prepared.scenario, identity, stall_after=work.stall_after)
        run_tasks(workers, seeds, call, work)
    else:
        threads = max(1, work.n_workers // run.seeds)  # for one seed, where there are fewer seeds than cores
        with seed_threads(work) as pool:

            def run_seed(index: int) -> Seed:
                progress = functools.partial(seeds.fractions.__setitem__, index)
                return pool.run(prepared, index, threads=threads, progress=progress)

            run_tasks(pool.workers, seeds, run_seed, work)
    if 0 not in seeds.completed:  # stopped before; the first stands for the others
        seeds.take(0, SeedRun(prepared, 0).run(work.stop))
    results = tuple(seed for _, seed in sorted(seeds.completed.items()))
    return Result(prepared, results, wall_s_before + time.perf_counter() - started)


class _Seeds:
    """The seeds of an ensemble by their indices, as tasks.

    Args:
        number: of all seeds.
        completed: takes what is retained; seeds that are in it are not run.
        retained: what of a seed, by its index, is kept.
    """

    def __init__(self, number: int, completed: dict[int, Seed], retained: Callable[[int, Seed], Seed]) -> None:
        self._remaining = iter([index for index in range(number) if index not in completed])
        self.completed, self._retained = completed, retained
        self.fractions = np.zeros(number)
        self.fractions[list(completed)] = 1.0

    def next(self) -> tuple[int, int] | None:
        return next(((index, index) for index in self._remaining), None)

    def take(self, place: int, result: Seed) -> None:
        self.fractions[place] = 1.0
        self.completed[place] = self._retained(place, result)

    @property
    def share_done(self) -> float:
        return float(self.fractions.mean())


def check_starts(scene: Scene, work: Work) -> None:
    """Draw the starts of every seed, to refuse those that cannot be had before anything is written.

    Raises:
        InputError: there is no room for the parts.
    """
    seeds, parts = scene.scenario.run.seeds, len(scene.parts)
    with announced(f"{LOOKING} of {parts} parts in {seeds} seeds", work.notify):
        for index in range(seeds):
            start_poses(scene, generator(scene, index))
