"""An ensemble: the seeds of a scenario in parallel threads, and what they add up to."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from feeder_sim.advice import cautions
from feeder_sim.bounces import bounce_measures
from feeder_sim.circulation import stage_waves, wave_measures
from feeder_sim.engines import choose_engine, engine_class
from feeder_sim.errors import SimulationDiverged
from feeder_sim.measures import Cell, check_stop_rule, ensemble_measures, transport_cell
from feeder_sim.scenario import Scenario
from feeder_sim.scene import Scene, build_scene
from feeder_sim.seed_run import Begun, Recorder, SeedResult, SeedRun
from feeder_sim.separation import separation_measures
from feeder_sim.start import start_poses
from feeder_sim.trajectory import Frames, Status
from feeder_sim.transport import transport_measures

COMPILING_S = 1.5
COMPILING = "compiling the engine, some 20 s for one part, over a minute for many; the result is kept for the next time"


@dataclass(frozen=True)
class Result:
    """An ensemble.

    Attributes:
        scene: what was simulated.
        seeds: one result per seed, in order.
        wall_s: elapsed wall time of the ensemble [s].
    """

    scene: Scene
    seeds: tuple[SeedResult, ...]
    wall_s: float
    cell: Cell | None = field(repr=False)

    @property
    def trajectories(self) -> list[Frames]:
        """Recorded frames, one entry per seed."""
        return [seed.frames for seed in self.seeds]

    @property
    def failures(self) -> list[SimulationDiverged]:
        return [seed.failure for seed in self.seeds if seed.failure is not None]

    @property
    def interrupted(self) -> bool:
        return any(seed.status == Status.UNFINISHED for seed in self.seeds)

    def measures(self) -> dict[str, Any]:
        """Ensemble measures over the seeds that ran to their end; units in the names."""
        ended = [s for s in self.seeds if s.status == Status.DONE]
        found = ensemble_measures([s.frames for s in ended], self.cell)
        if self.scene.scenario.schedule is not None or len(self.scene.parts) > 1:
            left = [s for s in self.seeds if s.status in (Status.DONE, Status.LEFT_PLATE)]
            found |= separation_measures(self.scene, left)
            if self.scene.scenario.goal is not None:
                found |= transport_measures(self.scene, left)
            if waves := stage_waves(self.scene):
                found |= wave_measures(self.scene, waves, left)
            return found
        return found | bounce_measures(
            self.scene, [s.impacts for s in ended], [float(s.frames.time[-1]) for s in ended]
        )

    def summary(self) -> dict[str, Any]:
        """Measures, cost and provenance as one JSON-ready dictionary."""
        scenario = self.scene.scenario
        simulated = sum(float(seed.frames.time[-1]) for seed in self.seeds if len(seed.frames))
        return {
            "title": scenario.title,
            "engine": choose_engine(scenario).name,
            "seed": scenario.run.seed,
            "seeds": scenario.run.seeds,
            **self.measures(),
            "simulated_s": simulated,
            "wall_s": self.wall_s,
            "real_time_factor": simulated / self.wall_s if self.wall_s > 0 else None,
            "wall_s_per_simulated_s_one_core": sum(s.wall_s for s in self.seeds) / simulated if simulated else None,
            "timestep_s": self.scene.timestep,
            "left_plate": sum(seed.status == Status.LEFT_PLATE for seed in self.seeds),
            "interrupted": self.interrupted,
            "cautions": cautions(self.scene),
            "failures": [str(failure) for failure in self.failures],
        }


def simulate(
    scenario: Scenario,
    *,
    recorder: Recorder | None = None,
    progress: Callable[[float], None] | None = None,
    stop: threading.Event | None = None,
    workers: int | None = None,
    notify: Callable[[str], None] | None = None,
    begun: Mapping[int, Begun] | None = None,
) -> Result:
    """Run every seed of a scenario; the result does not depend on the number of workers.

    Args:
        scenario: what to run.
        recorder: takes every block as it is computed.
        progress: called with the fraction done, from this thread, a few times a second.
        stop: set it to end the run after the blocks under way.
        workers: threads; the engines' inner loops run outside Python, so threads use all cores. Default: all cores.
        notify: takes a line for the user, such as that the engine is being compiled.
        begun: seeds, by their index, that go on from what there is of them.

    Raises:
        InputError: the scenario cannot be built, or its start does not suit its stop rule.
    """
    return simulate_scene(
        build_scene(scenario),
        recorder=recorder,
        progress=progress,
        stop=stop,
        workers=workers,
        notify=notify,
        begun=begun,
    )


def check_starts(scene: Scene) -> None:
    """Draw the starts of every seed, to refuse those that cannot be had before anything is written.

    Raises:
        InputError: there is no room for the parts.
    """
    for rng in _generators(scene):
        start_poses(scene, rng)


def _generators(scene: Scene) -> list[np.random.Generator]:
    run = scene.scenario.run
    return [np.random.default_rng(s) for s in np.random.SeedSequence(run.seed).spawn(run.seeds)]


def available_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def simulate_scene(
    scene: Scene,
    *,
    recorder: Recorder | None = None,
    progress: Callable[[float], None] | None = None,
    stop: threading.Event | None = None,
    workers: int | None = None,
    notify: Callable[[str], None] | None = None,
    begun: Mapping[int, Begun] | None = None,
) -> Result:
    """Run every seed of a scene that is already built; arguments as for `simulate`."""
    run = scene.scenario.run
    cell = transport_cell(scene)
    check_stop_rule(scene, cell)
    stop = stop or threading.Event()
    generators = _generators(scene)
    done = np.zeros(run.seeds)
    _warm_up(scene, notify)
    started = time.perf_counter()

    cores = workers or available_cores()
    threads = max(1, cores // run.seeds)  # for one seed, where there are fewer seeds than cores

    def one(index: int) -> SeedResult:
        held = begun.get(index) if begun else None
        return SeedRun(scene, index, cell, recorder, done, stop, held, threads).run(generators[index])

    with ThreadPoolExecutor(cores) as pool:
        pending = set(futures := [pool.submit(one, index) for index in range(run.seeds)])
        try:
            while pending:
                finished, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
                for future in finished:
                    future.result()  # an error ends the whole ensemble at once
                if progress:
                    progress(float(done.mean()))
        except BaseException:
            stop.set()
            raise
    results = tuple(future.result() for future in futures)
    return Result(scene, results, time.perf_counter() - started, cell)


def _warm_up(scene: Scene, notify: Callable[[str], None] | None) -> None:
    """Import and compile the engine before the threads need it; say so when that takes long."""
    note = threading.Timer(COMPILING_S, lambda: notify and notify(COMPILING))
    note.start()
    try:
        engine_class(scene.scenario)(scene, np.random.default_rng(0)).advance(1)
    finally:
        note.cancel()
