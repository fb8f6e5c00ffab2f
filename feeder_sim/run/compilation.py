"""Compiles what a run needs before its clock starts, and tells the user of what takes long."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator

import numpy as np

from feeder_sim.engines.protocol import engine_class
from feeder_sim.machine_code import COMPILED
from feeder_sim.run.guard import Guard
from feeder_sim.scene.prepared import Prepared

ANNOUNCED_S = 1.5  # [s]; what takes longer is announced
TOLD_EVERY_S = 5.0  # [s] of how far it is
COMPILING = "compiling the engine"
# Functions of an engine and the guard, roughly: scenes differ in the laws and walls that they need.
FUNCTIONS = {"exact": 270, "impulse": 240, "reaction": 240, "slide": 50, "mujoco": 40, "drops": 200}


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
def compilation_announced(method: str, notify: Callable[[str], None] | None) -> Iterator[None]:
    """Tell the user that an engine is being compiled, if it takes long, and how far it is."""
    begun, over = COMPILED[0], threading.Event()

    def tell() -> None:
        if notify is None or over.wait(ANNOUNCED_S):
            return
        notify(f"{COMPILING}, which takes up to a minute; the result is kept for the next time")
        while not over.wait(TOLD_EVERY_S):
            notify(f"{COMPILING}: {COMPILED[0] - begun} of about {FUNCTIONS.get(method, 250)} functions")

    thread = threading.Thread(target=tell, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@contextlib.contextmanager
def announced(line: str, notify: Callable[[str], None] | None) -> Iterator[None]:
    """Tell the user what is being done, if it takes long."""
    note = threading.Timer(ANNOUNCED_S, lambda: notify and notify(line))
    note.start()
    try:
        yield
    finally:
        note.cancel()
