"""Runs what there is to do until there is no more: hands out tasks, takes what comes back, outlives workers."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from feeder_sim.errors import FeederSimError
from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.task import SeedValues, Task, run_task
from feeder_sim.jobs.workers import Workers
from feeder_sim.run.work import Work

if TYPE_CHECKING:
    from feeder_sim.measures.protocol import Measure


# Why seeds in a journal do not count.
FOREIGN = "of other points, of another version, or of files that have changed"

AHEAD = 2  # tasks per worker that are handed out
TASK_S = 0.5  # [s] that a task should take, so that handing it out costs little
MOST_BREAKS = 5  # of an executor, without a task that was done in between
STOP_CHECK_S = 0.2  # [s] between two looks whether to stop

P = TypeVar("P")


class Tasks(Protocol[P]):
    """What there is to do; `P` is what a task belongs to."""

    def next(self, seeds: int) -> tuple[P, Task] | None:
        """The next task, of up to so many seeds; None while there is none."""
        ...

    def take(self, place: P, done: tuple[SeedValues, ...]) -> None:
        """Take what a task has come to; there may be more to do after it."""
        ...

    @property
    def share_done(self) -> float:
        """Of all that is known to be there to do [1]."""
        ...


@dataclass(frozen=True)
class Runner:
    """Runs tasks for a study.

    Attributes:
        workers: run the tasks.
        work: how it is shown and ended.
        ledger: takes what comes.
        folder: that holds the question; None without one.
        measures: that are taken besides those of the package.
    """

    workers: Workers
    work: Work = field(default_factory=Work)
    ledger: Ledger = field(default_factory=Ledger)
    folder: Path | None = None
    measures: tuple[Measure[Any, Any], ...] = ()

    def notify_foreign(self, foreign_seeds: int) -> None:
        """Tell the user that seeds in the folder are done, and are run anew all the same."""
        if foreign_seeds:
            self.work.notify(f"{foreign_seeds} seeds in the folder do not count: they are {FOREIGN}")

    def run(self, tasks: Tasks[P], progress: Callable[[float], None] | None = None) -> bool:
        """Run all there is to do; returns whether it came to the end, and was not stopped.

        A task whose worker has died is handed out again. `progress` in place of that of the work.

        Raises:
            FeederSimError: workers die on and on.
        """
        workers, stop, progress = self.workers, self.work.stop, progress or self.work.progress
        pending: dict[Future[tuple[SeedValues, ...]], tuple[P, Task]] = {}
        requeued: list[tuple[P, Task]] = []
        breaks, n_completed, seconds = 0, 0, 0.0
        while not stop.is_set():
            block = max(1, int(TASK_S * n_completed / seconds)) if seconds > 0.0 else 1
            broken = False
            while len(pending) < AHEAD * workers.count and not broken:
                handed = requeued.pop() if requeued else tasks.next(block)
                if handed is None:
                    break
                try:
                    pending[workers.executor.submit(run_task, handed[1], self.measures)] = handed
                except BrokenExecutor:
                    requeued.append(handed)
                    broken = True
            if not pending and not broken:
                return True
            finished, _ = wait(pending, timeout=0.0 if broken else STOP_CHECK_S, return_when=FIRST_COMPLETED)
            for future in finished:
                place, task = pending.pop(future)
                try:
                    completed = future.result()
                except BrokenExecutor:
                    requeued.append((place, task))
                    broken = True
                    continue
                except workers.lost as error:
                    raise FeederSimError(f"the workers gave a task up: {type(error).__name__}: {error}") from error
                breaks = 0
                n_completed, seconds = n_completed + len(completed), seconds + sum(seed.wall_s for seed in completed)
                tasks.take(place, completed)
            if broken:
                requeued += pending.values()  # the executor has given them up as well
                pending.clear()
                breaks = _restarted(workers, breaks)
            progress(tasks.share_done)
        for future in pending:
            future.cancel()
        return False


def _restarted(workers: Workers, breaks: int) -> int:
    """Go on with a new executor; returns how many have broken in a row."""
    if workers.restart is None or breaks >= MOST_BREAKS:
        raise FeederSimError("workers end before their task is done, again and again: is memory short?")
    workers.executor = workers.restart()
    return breaks + 1
