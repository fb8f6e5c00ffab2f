"""Reading of files in a process of its own, which ends with the file that costs too much time or memory."""

from __future__ import annotations

import contextlib
import multiprocessing
import resource
import signal
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

MOST_SECONDS = 5.0  # of a processor, for a file
MOST_BYTES = 1_000_000_000  # resident
FOREVER_S = 60.0  # without an answer, however busy the machine is
NO_MORE_BYTES = 3_000_000_000  # of the process: protects the machine


@dataclass(frozen=True)
class Answer:
    """What became of a file: the value that was read, or why it was refused, or what else went wrong."""

    value: Any = None
    refusal: str = ""
    failure: str = ""


Reader = Callable[[Path], Any]


def _serve(reader: Reader, warm: Path | None, pipe: Connection) -> None:
    """Answer paths until there are no more; the system ends the process if one takes too long."""
    from feeder_sim.errors import InputError

    resource.setrlimit(resource.RLIMIT_DATA, (NO_MORE_BYTES, NO_MORE_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if warm is not None:
        with contextlib.suppress(Exception):
            reader(warm)
    pipe.send("ready")
    while (path := pipe.recv()) is not None:
        signal.setitimer(signal.ITIMER_PROF, MOST_SECONDS)
        try:
            answer = Answer(value=reader(path))
        except InputError as error:
            answer = Answer(refusal=str(error))
        except BaseException as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            text = f"{type(error).__name__}: {error}"[:150]
            answer = Answer(failure=f"{text} at {Path(last.filename).name}:{last.lineno}")
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        if (peak := _most_resident()) > MOST_BYTES:
            answer = Answer(failure=f"took {peak / 1e9:.1f} GB")
        pipe.send(answer)


def _most_resident() -> int:
    """Of this process since it began [byte]; `getrusage` counts also the process that it was forked from."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return 1024 * int(line.split()[1])


class LimitedReader:
    """A reader in a process that is replaced when it ends or has grown.

    Args:
        reader: a function of a module, from a path to something that can be pickled.
        warm: a file it reads first, so that the import of libraries counts for no file.
    """

    def __init__(self, reader: Reader, warm: Path | None = None) -> None:
        self.reader, self.warm = reader, warm
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=_serve, args=(self.reader, self.warm, other), daemon=True)
        self.process.start()
        other.close()
        assert self.pipe.recv() == "ready"

    def __call__(self, path: Path) -> Answer:
        self.pipe.send(path)
        try:
            answer: Answer = self.pipe.recv() if self.pipe.poll(FOREVER_S) else Answer(failure="does not end")
        except (EOFError, ConnectionResetError):
            self.process.join()
            slow = self.process.exitcode == -signal.SIGPROF
            answer = Answer(failure=f"took over {MOST_SECONDS:g} s" if slow else f"ended with {self.process.exitcode}")
        if answer.failure:
            self.close()
            self._start()
        return answer

    def close(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()
