"""Workers that cost nothing: seeds of tasks with values from a function."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

from feeder_sim.jobs.task import SeedValues, Task
from feeder_sim.scenario import Scenario


class Pretended(Executor):
    """Runs tasks at once, with the measures that a function makes of a scenario and a seed; a text is why it failed.

    After some seeds it asks to stop.
    """

    def __init__(
        self,
        values_of: Callable[[Scenario, int], dict[str, float] | str],
        stop: threading.Event | None = None,
        after: int = 0,
    ) -> None:
        self.count, self._values_of, self._stop, self._after = 0, values_of, stop, after

    def submit(self, function: Any, task: Task, /) -> Future[Any]:  # type: ignore[override]
        future: Future[Any] = Future()
        self.count += len(task.seeds)
        if self._stop and self.count >= self._after:
            self._stop.set()
        future.set_result(tuple(self._done(task.scenario, seed) for seed in task.seeds))
        return future

    def _done(self, scenario: Scenario, seed: int) -> SeedValues:
        found = self._values_of(scenario, seed)
        return SeedValues(seed, {}, 0.1, found) if isinstance(found, str) else SeedValues(seed, found, 0.1)
