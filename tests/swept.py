"""Sweeps of a nut on a strip over the amplitude, with seeds that cost nothing."""

from __future__ import annotations

import math
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import numpy as np
from conftest import strip_scenario

from feeder_sim.jobs.task import SeedValues, Task
from feeder_sim.studies.sweep.cases import Cases
from feeder_sim.studies.sweep.question import Question

AMPLITUDE = "drive[0].amplitude_um"


class Pretended(Executor):
    """Runs tasks at once, with values made from amplitude and seed; breaks at some of them."""

    def __init__(self, break_at: tuple[int, ...] = ()) -> None:
        self.seeds: list[tuple[float, int]] = []
        self._break_at = break_at

    def submit(self, function: Any, task: Task, /) -> Future[Any]:  # type: ignore[override]
        future: Future[Any] = Future()
        amplitude = float(task.scenario.drive[0].amplitude_um or 0.0)
        if len(self.seeds) in self._break_at:
            self._break_at = tuple(n for n in self._break_at if n != len(self.seeds))
            from concurrent.futures.process import BrokenProcessPool

            future.set_exception(BrokenProcessPool("killed"))
            return future
        self.seeds += [(amplitude, seed) for seed in task.seeds]
        told = ("drive[0] is strong",) if amplitude > 3.0 else ()
        values = [SeedValues(seed, {"speed": speed_of(amplitude, seed)}, 0.1, "", told) for seed in task.seeds]
        future.set_result(tuple(values))
        return future


def speed_of(amplitude: float, seed: int) -> float:
    """No speed below 1 um; above, one that scatters the more, the stronger the drive."""
    if amplitude < 1.0:
        return math.nan
    return 10.0 + 0.5 * amplitude * float(np.random.default_rng(seed).normal())


def cases_at(question: Question) -> Cases:
    return Cases.of(strip_scenario(seeds=4), question, file=Path("scenario"))
