"""Compiles what a run needs before its clock starts, and tells the user of what takes long."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np

from feeder_sim.engines.protocol import engine_class
from feeder_sim.machine_code import COMPILED
from feeder_sim.run.guard import Guard
from feeder_sim.scene.prepared import Prepared

ANNOUNCED_S = 1.5  # [s]; what takes longer is announced
NOTIFY_EVERY_S = 5.0  # [s] of how far it is
COMPILING = "compiling the engine"
# The last fifth of the time goes to an entry point, into which all that it calls has been copied: 21 to 24 % of the
# processor time with the engines `exact` and `impulse`. The functions before it come at an even pace.
FINISHING = 0.22
MOST_SHARE = 0.99  # that is shown
# Functions of an engine and the guard, roughly: scenes differ in the laws and walls that they need.
FUNCTIONS = {"exact": 270, "joint": 400, "impulse": 240, "reaction": 240, "slide": 50, "mujoco": 40, "drops": 200}


def compile_engine(prepared: Prepared) -> None:
    """Import and compile all of an engine and the guard that a scene needs, and compute nothing."""

    def compile_all() -> None:
        start, interrupted = engine_class(prepared.engine), np.ones(2, np.int64)
        engine = start(prepared.scene, np.random.default_rng(0), interrupt=interrupted)
        engine.advance(1)
        Guard(prepared, engine.current())

    in_daemon_thread(compile_all)


def in_daemon_thread(function: Callable[[], None]) -> None:
    """Call what makes numba compile in a thread that ends with the process.

    The compiler takes long, and in the main thread Ctrl-C might be lost in it.
    """
    failures: list[BaseException] = []

    def call() -> None:
        try:
            function()
        except BaseException as error:
            failures.append(error)

    thread = threading.Thread(target=call, daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(0.1)
    if failures:
        raise failures[0]


@contextlib.contextmanager
def compilation_announced(method: str, notify: Callable[[str], None]) -> Iterator[None]:
    """Tell the user that an engine is being compiled, if it takes long, and which share of the time is over."""
    compiled_before, over = COMPILED[0], threading.Event()
    expected = FUNCTIONS.get(method, 250)

    def tell() -> None:
        if over.wait(ANNOUNCED_S):
            return
        while COMPILED[0] == compiled_before:  # what takes long is something else
            if over.wait(ANNOUNCED_S):
                return
        notify(f"{COMPILING}, which takes a minute or more, once: the result is kept for the next time")
        start, share, functions, last = time.monotonic() - ANNOUNCED_S, 0.0, 0, ANNOUNCED_S
        while not over.wait(NOTIFY_EVERY_S):
            elapsed = time.monotonic() - start
            if COMPILED[0] - compiled_before > functions:
                functions, last = COMPILED[0] - compiled_before, elapsed
            share = max(share, time_share(functions / expected, last, elapsed))
            notify(f"{COMPILING}: about {100.0 * share:.0f} % of the time is over")

    thread = threading.Thread(target=tell, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def time_share(functions: float, last: float, elapsed: float) -> float:
    """About which share of the time of a compilation is over [1].

    While no function comes, as at the end, the time goes on at the pace that it had.

    Args:
        functions: share of the functions that are compiled [1]; may be above 1, for how many there are is a guess.
        last: time from the begin at which the last of them was [s].
        elapsed: time from the begin until now [s].
    """
    share = (1.0 - FINISHING) * min(functions, 1.0)
    return min(share * elapsed / last, MOST_SHARE)


@contextlib.contextmanager
def announced(line: str, notify: Callable[[str], None]) -> Iterator[None]:
    """Tell the user what is being done, if it takes long."""
    note = threading.Timer(ANNOUNCED_S, notify, (line,))
    note.start()
    try:
        yield
    finally:
        note.cancel()
