"""Runs the seeds of a study: as many in a task as take a while."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.task import SeedValues, Task, run_task
from feeder_sim.pool.pool import run_tasks
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import Workers

if TYPE_CHECKING:
    from feeder_sim.measures.protocol import Measure


# Why seeds in a journal do not count.
FOREIGN = "of other points, of another version, or of files that have changed"

TASK_S = 0.5  # [s] that a task should take, so that handing it out costs little

P = TypeVar("P")


class SeedTasks(Protocol[P]):
    """As `Tasks`, in tasks of a number of seeds; `P` is what a task belongs to."""

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

    def run(self, tasks: SeedTasks[P], progress: Callable[[float], None] | None = None) -> bool:
        """Run all there is to do; returns whether it came to the end, and was not stopped.

        `progress` in place of that of the work. Errors as for `run_tasks`.
        """
        work = replace(self.work, progress=progress or self.work.progress)
        call = functools.partial(run_task, measures=self.measures)
        return run_tasks(self.workers, _Blocks(tasks), call, work)


class _Blocks(Generic[P]):
    """Tasks of so many seeds that handing them out costs little."""

    def __init__(self, tasks: SeedTasks[P]) -> None:
        self._tasks = tasks
        self._completed, self._seconds = 0, 0.0

    def next(self) -> tuple[P, Task] | None:
        return self._tasks.next(max(1, int(TASK_S * self._completed / self._seconds)) if self._seconds > 0.0 else 1)

    def take(self, place: P, result: tuple[SeedValues, ...]) -> None:
        self._completed += len(result)
        self._seconds += sum(seed.wall_s for seed in result)
        self._tasks.take(place, result)

    @property
    def share_done(self) -> float:
        return self._tasks.share_done
