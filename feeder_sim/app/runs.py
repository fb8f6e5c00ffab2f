"""Runs that the page has started: each a process of its own, which goes on when the page is closed."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from feeder_sim.errors import FeederSimError


@dataclass
class Run:
    """A run, under way or ended.

    Attributes:
        folder: of the run.
        done: fraction that is computed.
        said: what it has said last, of the compiler for example.
        ended: "" while it goes on, else "done", "stopped" or "failed".
        lines: what came out, or why it failed.
    """

    folder: Path
    process: Any
    pipe: Any  # our end, whose class goes by the platform
    done: float = 0.0
    message: str = ""
    ended: str = ""
    lines: list[str] = field(default_factory=list)

    def poll(self) -> Run:
        """Take in what the process has sent."""
        alive = self.process.is_alive()  # asked first: all that an ended process has sent is there
        with contextlib.suppress(EOFError, OSError):
            while not self.ended and self.pipe.poll():
                kind, value = self.pipe.recv()
                if kind == "progress":
                    self.done = value
                elif kind == "said":
                    self.message = value
                else:
                    self.ended, self.lines = kind, value
        if not self.ended and not alive:
            self.ended, self.lines = "failed", ["the process of this run has ended by itself"]
        return self

    @property
    def words(self) -> str:
        """How it goes, or went, in one line."""
        if not self.ended:
            return self.message or "starting"
        return f"failed: {self.lines[0]}" if self.ended == "failed" and self.lines else self.ended

    def stop(self) -> None:
        """Ask it to end; what was computed stays, and can be resumed."""
        if self.process.is_alive():
            self.process.terminate()


class Runs:
    """All runs of a server, by the names of their folders."""

    def __init__(self) -> None:
        self.by_name: dict[str, Run] = {}

    def start(self, text: str, file: Path, folder: Path) -> Run:
        """Run a scenario as the command does, into a new folder."""
        context = multiprocessing.get_context("spawn")  # a server has threads, which must not be forked
        mine, other = context.Pipe(duplex=False)
        process = context.Process(target=_compute, args=(text, file, folder, other))
        process.start()
        other.close()
        run = self.by_name[folder.name] = Run(folder, process, mine)
        return run

    def stop_all(self) -> None:
        """End what is still under way, as the server ends."""
        for run in self.by_name.values():
            run.stop()
        for run in self.by_name.values():
            run.process.join(10.0)


def _compute(text: str, file: Path, folder: Path, pipe: Any) -> None:
    from feeder_sim.pool.work import Work
    from feeder_sim.run.run_folder import record_run
    from feeder_sim.scenario import parse_scenario

    work = Work(
        progress=lambda fraction: pipe.send(("progress", fraction)), notify=lambda line: pipe.send(("said", line))
    )
    signal.signal(signal.SIGTERM, lambda *_: work.stop.set())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        result = record_run(parse_scenario(text, file=file), folder, replay=False, work=work)
        failures = [str(failure) for failure in result.failures]
        pipe.send(("stopped" if result.interrupted else "failed" if failures else "done", [*failures, *result.lines()]))
    except FeederSimError as error:
        pipe.send(("failed", [str(error)]))
