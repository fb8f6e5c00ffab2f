"""Ends a computation that does not get on: one that takes too long for its next frame, whatever the engine."""

from __future__ import annotations

import math
import threading
import time
from typing import Self

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.protocol import ENDED, WHOLE
from feeder_sim.errors import InputError, quoted

STALL_AFTER_S = 60.0  # [s] of wall time for a frame; the slowest scenario takes less than one
STALLED = 2  # what interrupts an engine: not the wish to stop
LOOKS = 10  # in the time that is allowed


def checked_patience(stall_after: float) -> float:
    """A wall time that is allowed for a frame [s], as a user gives it; `math.inf` for any.

    Raises:
        InputError: it is no such time.
    """
    number = isinstance(stall_after, int | float | np.number) and not isinstance(stall_after, bool)
    if not number or not stall_after > 0.0:
        raise InputError(f"is {quoted(stall_after)}, allowed is a time in seconds over 0", argument="stall_after")
    return float(stall_after)


class Watchdog:
    """Interrupts an engine that has not got on by a frame in a call of `advance` for some time.

    Args:
        interrupt: of the engine, see `new_interrupt`.
        patience: wall time [s] that a frame may take.
    """

    def __init__(self, interrupt: NDArray[np.int64], patience: float = STALL_AFTER_S) -> None:
        self.patience = patience
        self._interrupt, self._since, self._over = interrupt, math.inf, threading.Event()

    def __enter__(self) -> Self:
        if self.patience < math.inf:
            threading.Thread(target=self._watch, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()

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

    def _watch(self) -> None:
        whole = 0
        while not self._over.wait(self.patience / LOOKS):
            if whole != self._interrupt[WHOLE] and self._since < math.inf:
                whole, self._since = int(self._interrupt[WHOLE]), time.perf_counter()
            elif time.perf_counter() - self._since > self.patience and self._interrupt[ENDED] == 0:
                self._interrupt[ENDED] = STALLED
