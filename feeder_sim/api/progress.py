"""A progress bar with the time left, for terminals and notebooks alike: one line of plain text, written again."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

from feeder_sim.errors import NotAllowed, printable, shortened
from feeder_sim.pool.work import Work, silent

Progress = Callable[[float], None] | bool | None
CELLS, LONGEST_TITLE = 24, 40
REDRAW_S = 0.2  # [s] between two looks of the bar


@contextlib.contextmanager
def displayed(work: Work, progress: Progress, title: str) -> Iterator[Work]:
    """The work, with what a user of Python gives as progress: True is a bar, None shows nothing."""
    if progress and progress is not True and not callable(progress):
        raise NotAllowed(progress, "True, or a function of the fraction done", key="progress")
    if progress is not True:
        yield replace(work, progress=progress or silent)
        return
    bar = _Bar(shortened(printable(title), LONGEST_TITLE) or "simulate")
    try:
        yield replace(work, progress=bar.show, notify=bar.notify)
    finally:
        bar.close()


class _Bar:
    def __init__(self, title: str) -> None:
        self._title, self._began, self._written = title, time.monotonic(), -1.0
        self._computing: float | None = None  # when the first fraction was computed; before that, the engine compiles
        self._fraction, self._width, self._bar = 0.0, 0, title

    def show(self, fraction: float) -> None:
        now = time.monotonic()
        if fraction < 1.0 and now - self._written < REDRAW_S:
            return
        self._written, self._fraction = now, fraction
        self._computing = self._computing or now
        filled, spent = round(CELLS * fraction), now - self._computing
        remaining = f", {spent * (1.0 - fraction) / fraction:.0f} s left" if 0.02 < fraction < 1.0 else ""
        self._bar = f"{self._title} {'#' * filled}{'.' * (CELLS - filled)} {100.0 * fraction:3.0f} %"
        self._write(self._bar + remaining)

    def notify(self, line: str) -> None:
        self._write(f"{self._title}: {line}")

    def close(self) -> None:
        if self._fraction >= 1.0:
            self._write(f"{self._bar}, {time.monotonic() - self._began:.1f} s")
        print(file=sys.stderr, flush=True)

    def _write(self, line: str) -> None:
        padding = " " * (self._width - len(line))
        self._width = len(line)
        print(f"\r{line}{padding}", end="", file=sys.stderr, flush=True)
