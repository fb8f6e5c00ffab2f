"""What every run and study is handed: what computes its seeds, what shows how far it is, and what ends it."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor
from dataclasses import dataclass, field

import numpy as np

from feeder_sim.errors import NotAllowed, check_whole

STALL_AFTER_S = 60.0  # [s] of wall time for a frame; the slowest scenario takes less than one


def silent(_: object) -> None:
    """Show nothing."""


def available_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Work:
    """Made where a user calls, and handed on as it is.

    Attributes:
        workers: threads of a run, processes of a study; None for as many as there are cores.
        executor: runs the seeds in place of threads and processes of this machine, `workers` of them at once.
        lost: errors by which the executor says that a task is lost for good.
        stop: set it to end within a second, after the blocks under way if they are short.
        progress: called with the fraction done, from the calling thread, a few times a second.
        notify: takes a line for the user, such as that the engine is being compiled.
        stall_after: wall time [s] after which a seed of a run that has not advanced by a frame ends as failed.

    Raises:
        InputError: a number of workers or a time that is not allowed.
    """

    workers: int | None = None
    executor: Executor | None = None
    lost: tuple[type[BaseException], ...] = (CancelledError,)
    stop: threading.Event = field(default_factory=threading.Event)
    progress: Callable[[float], None] = silent
    notify: Callable[[str], None] = silent
    stall_after: float = STALL_AFTER_S

    def __post_init__(self) -> None:
        if self.workers is not None:
            check_whole(self.workers, "workers")
        number = isinstance(self.stall_after, int | float | np.number) and not isinstance(self.stall_after, bool)
        if not number or not self.stall_after > 0.0:
            raise NotAllowed(self.stall_after, "a time in seconds over 0", argument="stall_after")

    @property
    def n_workers(self) -> int:
        """How many seeds are run at once, at most."""
        return self.workers or getattr(self.executor, "_max_workers", None) or available_cores()
