"""How long a seed of a run will take, from a trial of its engine.

What a step costs changes with what the parts do: at first they fall and the plate rings up, later they lie together on
nodal lines, and in a pause they come to rest. So the trial goes through one pass of all stages, each cut to two seconds
at most; what is cut off counts at the cost of the second half of what was computed of it. A run without stages is
followed for longer while that costs next to nothing.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as FutureTimeoutError
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.lookup import engine_class
from feeder_sim.engines.protocol import ENDED, Engine, new_interrupt
from feeder_sim.run.compilation import compile_engine
from feeder_sim.run.guard import Guard
from feeder_sim.run.simulation import available_cores
from feeder_sim.scenario import Schedule
from feeder_sim.scenario.schedule import Stage
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene, build_scene

LONGEST_STAGE_S = 2.0  # of the drives of a stage, and of a pause
TRIAL_S, LONGEST_TRIAL_S = 2.0, 10.0  # [s] of wall time, and until a piece of it is given up
CHEAP_S = 0.3  # [s] of wall time that a trial may take in any case
PIECES = 8  # of a stretch, so that its second half is known by itself


@dataclass
class Stretch:
    """The drives or the pause of one stage: how long it lasts in the run, and in the trial [s].

    Attributes:
        whole: time in the run, all its cycles together.
        passes: how often it comes in the run.
        computed: simulated time and wall time of the pieces that were computed [s].
    """

    whole: float
    passes: int
    computed: list[tuple[float, float]]

    @property
    def rate(self) -> float:
        """Wall time per simulated second in the second half."""
        half = self.computed[len(self.computed) // 2 :]
        return sum(wall for _, wall in half) / sum(simulated for simulated, _ in half)

    @property
    def seconds(self) -> float:
        """Wall time of all of it in the run [s]."""
        simulated, wall = (sum(column) for column in zip(*self.computed, strict=True))
        return self.passes * wall + max(0.0, self.whole - self.passes * simulated) * self.rate


class _Seed:
    """A seed of the trial: an engine, and what looks at its frames."""

    def __init__(self, prepared: Prepared, number: int, interrupt: NDArray[np.int64]) -> None:
        start, rng = engine_class(prepared.engine), np.random.default_rng(number)
        threads = max(1, available_cores() // prepared.scenario.run.seeds)
        self._engine: Engine = start(prepared.scene, rng, threads=threads, interrupt=interrupt)
        self._guard = Guard(prepared, self._engine.current())

    def advance(self, n_frames: int) -> None:
        frames = self._engine.advance(n_frames)
        self._guard.check(frames, 0)
        self._guard.remember(n_frames)
        frames.as_stored()


def seed_seconds(prepared: Prepared) -> float:
    """Wall time [s] of one seed beside those that run at the same time, after compilation."""
    scene = _cut(prepared.scene)
    prepared, whole = replace(prepared, scene=scene), prepared.scene
    compile_engine(prepared)
    interrupt = new_interrupt()
    together = min(scene.scenario.run.seeds, available_cores())
    seeds = [_Seed(prepared, number, interrupt) for number in range(together)]
    found: list[Stretch] = []
    started, frame = time.perf_counter(), 0
    with ThreadPoolExecutor(together) as pool:  # this thread hears of Ctrl-C
        try:
            for stretch, end in _stretches(whole, scene):
                found.append(stretch)
                last = min(round(end / scene.frame_interval), scene.n_frames - 1)
                enough = min(last, frame + round(LONGEST_STAGE_S / scene.frame_interval))
                piece = max(1, (enough - frame) // PIECES)
                while frame < last and time.perf_counter() - started < (TRIAL_S if frame < enough else CHEAP_S):
                    n = min(piece, last - frame) if frame else 1  # of the first frame nothing is known
                    begun = time.perf_counter()
                    for future in [pool.submit(seed.advance, n) for seed in seeds]:
                        future.result(timeout=LONGEST_TRIAL_S)
                    stretch.computed.append((n * scene.frame_interval, time.perf_counter() - begun))
                    frame += n
        except FutureTimeoutError:  # a frame takes at least that long
            found[-1].computed.append((scene.frame_interval, LONGEST_TRIAL_S))
        finally:
            interrupt[ENDED] = 1
    done = [stretch for stretch in found if stretch.computed]
    seconds = sum(stretch.seconds for stretch in done)
    reached = sum(stretch.whole for stretch in done)
    return seconds * max(1.0, whole.times.duration / reached)  # of the rest nothing better is known


def _cut(scene: Scene) -> Scene:
    """The scene with one pass of its stages, each cut; without a schedule it stays."""
    schedule = scene.scenario.schedule
    if schedule is None:
        return scene

    def cut(stage: Stage) -> Stage:
        least = 2.0 * scene.frame_interval
        length = max(min(stage.duration_s, LONGEST_STAGE_S), least)
        return stage.model_copy(update={"duration_s": length, "pause_s": min(stage.pause_s, LONGEST_STAGE_S)})

    once = Schedule(
        prepare=tuple(map(cut, schedule.prepare)),
        stage=tuple(map(cut, schedule.stage)),
        sequence=schedule.sequence,
    )
    return build_scene(scene.scenario.model_copy(update={"schedule": once}))


def _stretches(scene: Scene, trial: Scene) -> Iterator[tuple[Stretch, float]]:
    """Drives and pauses of the trial in order, as they are in the scene, and their end in the trial [s]."""
    if scene.scenario.schedule is None:
        duration = scene.times.duration
        yield Stretch(duration, 1, []), duration
        return
    cycles = scene.scenario.schedule.cycles
    for long, cut in zip(scene.times.stages, trial.times.stages, strict=False):
        passes = cycles if long.cycle else 1
        yield Stretch(passes * (long.stop - long.start), passes, []), cut.stop
        yield Stretch(passes * (long.end - long.stop), passes, []), cut.end
