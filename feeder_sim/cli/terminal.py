"""What a command says while it works, and how it is asked to end."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from feeder_sim.errors import Interrupted, printable

if TYPE_CHECKING:
    from feeder_sim.pool.work import Work


class Stop(threading.Event):
    """Asks a run to stop."""

    computing = False  # whether it has come so far that it will listen


@contextlib.contextmanager
def stop_on_signal() -> Iterator[Stop]:
    """Ctrl-C or a polite kill ends the run within a second, with everything recorded kept.

    Once it computes, that is: before, there is nothing to keep.
    """
    stop = Stop()

    def restore() -> None:
        for s, handler in previous.items():
            signal.signal(s, handler)

    def ask(*_: object) -> None:
        stop.set()
        restore()  # the second signal does what it always does
        if not stop.computing:
            raise KeyboardInterrupt

    previous = {s: signal.signal(s, ask) for s in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    except KeyboardInterrupt:
        raise Interrupted("interrupted") from None
    finally:
        restore()


def notify(line: str) -> None:
    """Say what takes long, also off a terminal, where there is no progress bar."""
    print(f"feeder-sim: {printable(line)}", file=sys.stderr, flush=True)


@contextlib.contextmanager
def at_terminal(work: Work, title: str, dask: str | None = None) -> Iterator[Work]:
    """The work, shown here and ended by Ctrl-C; on the Dask cluster of an address, if one is given."""
    from feeder_sim.pool.workers import on_cluster

    with stop_on_signal() as stop, progress_bar(title, stop) as progress, on_cluster(work, dask) as of_cluster:
        yield replace(of_cluster, stop=stop, progress=progress, notify=notify)


@contextlib.contextmanager
def progress_bar(title: str, stop: Stop | None = None) -> Iterator[Callable[[float], None]]:
    """Progress bar with the time left, on stderr and only on a terminal.

    Args:
        title: before the bar.
        stop: is told that the run computes.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    is_tty = console.is_terminal
    with Progress(*columns, console=console, disable=not is_tty, transient=True, speed_estimate_period=30.0) as bars:
        task = bars.add_task(printable(title), total=1.0)

        def show(fraction: float) -> None:
            if stop:
                stop.computing = fraction < 1.0
            bars.update(task, completed=fraction)

        yield show
