"""The one time loop: an engine, what to record, a guard, and when to stop; one seed or an ensemble of them."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from feeder_sim.bounces import bounce_measures
from feeder_sim.engines import Engine, choose_engine, engine_class
from feeder_sim.errors import SimulationDiverged
from feeder_sim.impacts import Impacts
from feeder_sim.measures import PASSAGE_TO, Cell, check_stop_rule, ensemble_measures, transport_cell
from feeder_sim.scenario import Scenario
from feeder_sim.scene import GRAVITY, Scene, build_scene
from feeder_sim.trajectory import Frames, Status

COMPILING_S = 1.5
COMPILING = "compiling the engine, some 20 s; the result is kept for the next time"
BLOCK_STEPS = 500_000  # solver steps between two looks at the guard, the stop rule and the stop event, at most


class Recorder(Protocol):
    """Where blocks of frames go while a run is under way; called from several threads."""

    def append(self, seed_index: int, frames: Frames, impacts: Impacts) -> None: ...

    def finish(self, seed_index: int, status: Status) -> None: ...


@dataclass(frozen=True)
class SeedResult:
    """One seed of an ensemble.

    Attributes:
        frames: everything recorded.
        impacts: contacts of a guided part with the plate.
        status: how it ended; UNFINISHED when it was interrupted.
        wall_s: wall time spent in its loop [s].
        failure: why it diverged, None otherwise.
    """

    frames: Frames
    impacts: Impacts
    status: Status
    wall_s: float
    failure: SimulationDiverged | None = None


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
) -> Result:
    """Run every seed of a scenario; the result does not depend on the number of workers.

    Args:
        scenario: what to run.
        recorder: takes every block as it is computed.
        progress: called with the fraction done, from this thread, a few times a second.
        stop: set it to end the run after the blocks under way.
        workers: threads; the engines' inner loops run outside Python, so threads use all cores. Default: all cores.
        notify: takes a line for the user, such as that the engine is being compiled.

    Raises:
        InputError: the scenario cannot be built, or its start does not suit its stop rule.
    """
    scene = build_scene(scenario)
    return simulate_scene(scene, recorder=recorder, progress=progress, stop=stop, workers=workers, notify=notify)


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
) -> Result:
    """Run every seed of a scene that is already built; arguments as for `simulate`."""
    run = scene.scenario.run
    cell = transport_cell(scene)
    check_stop_rule(scene, cell)
    stop = stop or threading.Event()
    generators = [np.random.default_rng(s) for s in np.random.SeedSequence(run.seed).spawn(run.seeds)]
    done = np.zeros(run.seeds)
    _warm_up(scene, notify)
    started = time.perf_counter()

    def one(index: int) -> SeedResult:
        return _run_seed(scene, index, generators[index], cell, recorder, done, stop)

    with ThreadPoolExecutor(workers or available_cores()) as pool:
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


def _run_seed(
    scene: Scene,
    index: int,
    rng: np.random.Generator,
    cell: Cell | None,
    recorder: Recorder | None,
    done: np.ndarray,
    stop: threading.Event,
) -> SeedResult:
    """Advance one seed block by block until its time is up, its stop rule holds, or it diverges."""
    started = time.perf_counter()
    engine: Engine = engine_class(scene.scenario)(scene, rng)
    first = engine.current()
    guard = Guard(scene, first)
    longest = min(engine.frames_per_block, max(2, BLOCK_STEPS // scene.steps_per_frame))
    blocks: list[Frames] = []
    impacts: list[Impacts] = []
    status, failure, n_done = Status.UNFINISHED, None, 0
    while status == Status.UNFINISHED and not stop.is_set():
        # Between two blocks there is a look at the guard, the stop rule and the stop event.
        size = min(longest, scene.n_frames - n_done)
        block = engine.advance(size) if n_done else Frames.joined([first, engine.advance(size - 1)])
        valid, failure = guard.check(block, index)
        gone = guard.left_plate(block[slice(valid)])
        if gone.any():
            valid = int(np.argmax(gone)) + 1
        block = block[slice(valid)]
        n_done += valid
        done[index] = n_done / scene.n_frames
        if gone.any():
            status, failure = Status.LEFT_PLATE, None
        elif failure:
            status = Status.DIVERGED
        elif n_done >= scene.n_frames or _passed(scene, cell, block):
            status = Status.DONE
        hits = engine.take_impacts(end=status != Status.UNFINISHED)
        if valid < size:
            hits = hits[hits.time <= (block.time[-1] if valid else 0.0)]
        if recorder and valid:
            recorder.append(index, block, hits)
        blocks.append(block)
        impacts.append(hits)
    done[index] = 1.0
    if recorder:
        recorder.finish(index, status)
    frames, wall = Frames.joined(blocks or [first[slice(0)]]), time.perf_counter() - started
    return SeedResult(frames, Impacts.joined(impacts or [Impacts.none()]), status, wall, failure)


class Guard:
    """Notices states that no part over a vibrating plate can be in, and parts that have fallen off it."""

    # A part gains at most a few plate velocities per impact, and impacts take energy out; 20 is far above any hop seen.
    SPEED_FACTOR = 20.0

    def __init__(self, scene: Scene, first: Frames) -> None:
        self._scene = scene
        drives = [mode.drive for mode in scene.driven]
        plate_speed = sum(2 * np.pi * max(d.drive_frequency, d.natural_frequency) * d.amplitude for d in drives)
        height = float(np.abs(first.position[..., 2]).max())
        self._speed = self.SPEED_FACTOR * plate_speed + 2.0 * np.sqrt(2.0 * GRAVITY * height) + 0.1
        self._crest = sum(drive.amplitude for drive in drives)

    def check(self, frames: Frames, seed_index: int) -> tuple[int, SimulationDiverged | None]:
        """Return how many leading frames are valid, and what is wrong with the next one."""
        found = [
            (int(np.argmax(bad)), cause, body.name)
            for part, body in enumerate(self._scene.parts)
            for cause, bad in self._violations(frames, part).items()
            if bad.any()
        ]
        if not found:
            return len(frames), None
        row, cause, name = min(found)
        return row, SimulationDiverged(cause=cause, time_s=float(frames.time[row]), part=name, seed=seed_index)

    def left_plate(self, frames: Frames) -> np.ndarray:
        """Frames in which the first part is off the plate and below it, shape (n,)."""
        position = frames.position[:, 0]
        return ~self._over(position) & (position[:, 2] < 0.0)

    def _over(self, position: np.ndarray) -> np.ndarray:
        half = 0.5 * np.array([self._scene.surface.length, self._scene.surface.width])
        return np.asarray((np.abs(position[:, :2]) < half).all(axis=1))

    def _violations(self, frames: Frames, part: int) -> dict[str, np.ndarray]:
        position, velocity = frames.position[:, part], frames.velocity[:, part]
        speed = np.linalg.norm(velocity, axis=1)
        finite = np.isfinite(position).all(axis=1) & np.isfinite(speed)
        over = finite & self._over(position)
        return {
            "its state is not finite": ~finite,
            f"its speed exceeds {self._speed:.3g} m/s, more than this plate can give": over & (speed > self._speed),
            "its centre lies below the plate's surface": over & (position[:, 2] < -self._crest),
        }


def _passed(scene: Scene, cell: Cell | None, block: Frames) -> bool:
    """True once the first part has reached the end of the measured way."""
    if scene.scenario.run.stop != "passage" or cell is None or not len(block):
        return False
    return bool((cell.way(block) <= PASSAGE_TO).any())
