"""Workers that cost nothing, and questions that are asked of them: seeds of tasks with values from a function."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from conftest import amplitude_of

from feeder_sim.jobs.task import SeedValues, Task
from feeder_sim.pool.work import Work
from feeder_sim.scenario import Scenario
from feeder_sim.studies.ask import ask, folder_of
from feeder_sim.studies.question import Question


class Pretended(Executor):
    """Runs tasks at once, with the measures that a function makes of a scenario and a seed; a text is why it failed.

    After some seeds it asks to stop; at some of them it breaks. Above an amplitude [um] there is a warning.
    """

    def __init__(
        self,
        values_of: Callable[[Scenario, int], dict[str, float] | str],
        stop: threading.Event | None = None,
        after: int = 0,
        break_at: tuple[int, ...] = (),
        strong: float = math.inf,
    ) -> None:
        self.seeds: list[tuple[float, int]] = []  # amplitude of the first drive [um], and seed
        self._values_of, self._stop, self._after, self._break_at = values_of, stop, after, set(break_at)
        self._strong = strong

    @property
    def count(self) -> int:
        return len(self.seeds)

    def submit(self, function: Any, task: Task, /, *_: Any) -> Future[Any]:  # type: ignore[override]
        future: Future[Any] = Future()
        if self.count in self._break_at:
            self._break_at.discard(self.count)
            future.set_exception(BrokenProcessPool("killed"))
            return future
        self.seeds += [(_amplitude(task.scenario), seed) for seed in task.seeds]
        if self._stop and self.count >= self._after:
            self._stop.set()
        future.set_result(tuple(self._done(task.scenario, seed) for seed in task.seeds))
        return future

    def _done(self, scenario: Scenario, seed: int) -> SeedValues:
        found = self._values_of(scenario, seed)
        warnings = ("drive[0] is strong",) if scenario.drive and amplitude_of(scenario) > self._strong else ()
        return (
            SeedValues(seed, {}, 0.1, found) if isinstance(found, str) else SeedValues(seed, found, 0.1, "", warnings)
        )


def _amplitude(scenario: Scenario) -> float:
    return amplitude_of(scenario) if scenario.drive else 0.0


def asked(
    question: Question,
    scenario: Scenario,
    executor: Executor,
    folder: Path | None = None,
    share: tuple[int, int] | None = None,
    stop: threading.Event | None = None,
) -> Any:
    """The answer to a question, in a folder or in none."""
    work = Work(2, executor, stop=stop or threading.Event())
    home = folder_of(question, scenario, folder, share=share) if folder else None
    return ask(question, scenario, home, share=share, work=work)
