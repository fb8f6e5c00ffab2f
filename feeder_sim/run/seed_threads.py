"""Seeds in threads of this process: the engines' inner loops run outside Python, and can be ended at any moment."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.protocol import ENDED, new_interrupt
from feeder_sim.pool.work import Work, silent
from feeder_sim.pool.workers import Workers
from feeder_sim.records.seed import Seed
from feeder_sim.run.seed_run import SeedRun
from feeder_sim.scene.prepared import Prepared


class SeedThreads:
    """Runs seeds until they are interrupted, all of them at once.

    Attributes:
        workers: threads that call `run`.
    """

    def __init__(self, executor: ThreadPoolExecutor, work: Work) -> None:
        self.workers = Workers(executor, work.n_workers, lost=(), interrupt=self.interrupt)
        self._work, self._interrupted = work, False
        self._interrupts: dict[int, NDArray[np.int64]] = {}

    def run(
        self, prepared: Prepared, index: int, *, threads: int = 1, progress: Callable[[float], None] = silent
    ) -> Seed:
        """Run a seed; arguments as for `SeedRun`."""
        interrupt = new_interrupt()
        self._interrupts[id(interrupt)] = interrupt
        if self._interrupted:
            interrupt[ENDED] = 1
        stall_after = self._work.stall_after
        run = SeedRun(prepared, index, threads=threads, progress=progress, interrupt=interrupt, stall_after=stall_after)
        try:
            return run.run(self._work.stop)
        finally:
            del self._interrupts[id(interrupt)]

    def interrupt(self) -> None:
        """End all that is under way, in the middle of a block; it comes back as not finished."""
        self._interrupted = True
        for interrupt in list(self._interrupts.values()):
            interrupt[ENDED] = 1


@contextmanager
def seed_threads(work: Work) -> Iterator[SeedThreads]:
    """Threads, one for each core or as many as are asked for."""
    with ThreadPoolExecutor(work.n_workers) as executor:
        yield SeedThreads(executor, work)
