"""Ends a computation that does not get on: one that takes too long for its next frame, whatever the engine."""

from __future__ import annotations

import math
import threading
import time
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.protocol import ENDED, WHOLE
from feeder_sim.pool.work import STALL_AFTER_S

STALLED = 2  # what interrupts an engine: not the wish to stop
CHECKS = 10  # in the time that is allowed


class Watchdog:
    """Interrupts an engine that has not got on by a frame in a call of `advance` for some time.

    One thread watches all of them.

    Args:
        interrupt: of the engine, see `new_interrupt`.
        stall_after: wall time [s] that a frame may take.
    """

    _watched: ClassVar[set[Watchdog]] = set()
    _changed: ClassVar[threading.Condition] = threading.Condition()
    _watching: ClassVar[bool] = False

    def __init__(self, interrupt: NDArray[np.int64], stall_after: float = STALL_AFTER_S) -> None:
        self.stall_after = stall_after
        self._interrupt, self._since, self._n_frames = interrupt, math.inf, 0

    def __enter__(self) -> Self:
        if self.stall_after < math.inf:
            with self._changed:
                self._watched.add(self)
                if not Watchdog._watching:
                    Watchdog._watching = True
                    threading.Thread(target=_watch, daemon=True).start()
                elif self.stall_after < STALL_AFTER_S:
                    self._changed.notify()
        return self

    def __exit__(self, *_: object) -> None:
        self._watched.discard(self)

    def begin(self) -> None:
        """A call begins."""
        self._since = time.perf_counter()

    def end(self) -> bool:
        """The call is over; returns whether it was interrupted here."""
        self._since = math.inf
        stalled = int(self._interrupt[ENDED]) == STALLED
        if stalled:
            self._interrupt[ENDED] = 0
        return stalled

    def _check(self) -> None:
        if self._n_frames != self._interrupt[WHOLE] and self._since < math.inf:
            self._n_frames, self._since = int(self._interrupt[WHOLE]), time.perf_counter()
        elif time.perf_counter() - self._since > self.stall_after and self._interrupt[ENDED] == 0:
            self._interrupt[ENDED] = STALLED


def _watch() -> None:
    """Look at all engines again and again; with none for a while, end."""
    while True:
        with Watchdog._changed:
            shortest = min((dog.stall_after for dog in list(Watchdog._watched)), default=STALL_AFTER_S)
            Watchdog._changed.wait(shortest / CHECKS)
            watched = list(Watchdog._watched)
            if not watched:
                Watchdog._watching = False
                return
        for dog in watched:
            dog._check()
