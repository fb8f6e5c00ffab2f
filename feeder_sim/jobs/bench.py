"""What work on many runs has at hand: who runs them, where they are kept, who is told, and who may end it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import Work, run_work
from feeder_sim.jobs.workers import Workers

if TYPE_CHECKING:
    from feeder_sim.measures.protocol import Measure

# Why seeds in a journal do not count.
FOREIGN = "of other points, of another version, or of files that have changed"


@dataclass
class Bench:
    """Attributes:
    workers: run the tasks.
    ledger: takes what comes.
    folder: that holds the question; None without one.
    stop: set by somebody else to end.
    progress: called with the share that is done.
    notify: called with a line for the user.
    measures: that are taken besides those of the package.
    """

    workers: Workers
    ledger: Ledger = field(default_factory=Ledger)
    folder: Path | None = None
    stop: threading.Event = field(default_factory=threading.Event)
    progress: Callable[[float], None] | None = None
    notify: Callable[[str], None] | None = None
    measures: tuple[Measure[Any, Any], ...] = ()

    def run(self, work: Work[Any], progress: Callable[[float], None] | None = None) -> bool:
        """Run all there is to do; returns whether it came to the end."""
        progress = progress or self.progress
        return run_work(work, self.workers, stop=self.stop, progress=progress, measures=self.measures)

    def say_foreign(self, others: int) -> None:
        """Tell that seeds in the folder are done, and are run anew all the same."""
        if others:
            self.say(f"{others} seeds in the folder do not count: they are {FOREIGN}")

    def say(self, line: str) -> None:
        """Tell the user."""
        if self.notify:
            self.notify(line)
