"""The one loop that runs many tasks: it hands them out, takes what comes back, outlives workers, and stops."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from typing import Protocol, TypeVar

from feeder_sim.errors import FeederSimError
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import Workers

AHEAD = 2  # tasks per worker that are handed out
MOST_BREAKS = 5  # of an executor, without a task that was done in between
PROGRESS_S = 0.1  # [s] between two looks at the progress, and whether to stop
GRACE_S = 0.3  # [s] from the wish to stop until tasks under way are interrupted

P = TypeVar("P")
T = TypeVar("T", covariant=True)
R = TypeVar("R", contravariant=True)
Task = TypeVar("Task")
Result = TypeVar("Result")


class Tasks(Protocol[P, T, R]):
    """What there is to do: tasks with the place that each belongs to, and results at their places."""

    def next(self) -> tuple[P, T] | None:
        """The next task with its place, which stays here; None while there is none."""
        ...

    def take(self, place: P, result: R) -> None:
        """Take the result of a task; there may be more to do after it."""
        ...

    @property
    def share_done(self) -> float:
        """Of all that is known to be there to do [1]."""
        ...


def run_tasks(workers: Workers, tasks: Tasks[P, Task, Result], call: Callable[[Task], Result], work: Work) -> bool:
    """Run all there is to do; returns whether it came to the end, and was not stopped.

    A task whose worker has died is handed out again. Tasks under way when it is stopped are interrupted if the workers
    can be, and their results taken as they are; otherwise they are lost.

    Args:
        workers: run the tasks.
        tasks: what there is to do.
        call: makes the result of a task, where the workers are.
        work: whose progress is called, and whose event stops.

    Raises:
        FeederSimError: workers die on and on.
    """
    pending: dict[Future[Result], tuple[P, Task]] = {}
    requeued: list[tuple[P, Task]] = []
    breaks, reported = 0, -PROGRESS_S
    try:
        while not work.stop.is_set():
            broken: BrokenExecutor | None = None
            while len(pending) < AHEAD * workers.count and not broken:
                placed = requeued.pop() if requeued else tasks.next()
                if placed is None:
                    break
                try:
                    pending[workers.executor.submit(call, placed[1])] = placed
                except BrokenExecutor as error:
                    requeued.append(placed)
                    broken = error
            if not pending and not broken:
                work.progress(tasks.share_done)
                return True
            finished, _ = wait(pending, timeout=0.0 if broken else PROGRESS_S, return_when=FIRST_COMPLETED)
            for future in finished:
                place, task = pending.pop(future)
                try:
                    result = future.result()
                except BrokenExecutor as error:
                    requeued.append((place, task))
                    broken = error
                    continue
                except workers.lost as error:
                    raise FeederSimError(f"the workers gave a task up: {type(error).__name__}: {error}") from error
                breaks = 0
                tasks.take(place, result)
            if broken:
                requeued += pending.values()  # the executor has given them up as well
                pending.clear()
                breaks = _restarted(workers, breaks, broken)
            if time.monotonic() - reported >= PROGRESS_S:
                reported = time.monotonic()
                work.progress(tasks.share_done)
    except BaseException:
        _give_up(pending, workers)
        raise
    for future in _give_up(pending, workers, GRACE_S):
        tasks.take(pending[future][0], future.result())
    return False


def _give_up(pending: Collection[Future[Result]], workers: Workers, grace_s: float = 0.0) -> list[Future[Result]]:
    """End what is under way; returns what has come to a result, of workers that can be interrupted."""
    for future in pending:
        future.cancel()
    if workers.interrupt is None:
        return []
    if wait(pending, grace_s).not_done:
        workers.interrupt()
    return [future for future in wait(pending).done if not future.cancelled()]


def _restarted(workers: Workers, breaks: int, error: BrokenExecutor) -> int:
    """Go on with a new executor; returns how many have broken in a row."""
    if workers.restart is None:
        raise FeederSimError(f"workers end before their task is done: {type(error).__name__} {error}") from error
    if breaks >= MOST_BREAKS:
        raise FeederSimError("workers end before their task is done, again and again: is memory short?") from error
    workers.executor = workers.restart()
    return breaks + 1
