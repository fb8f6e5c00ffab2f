"""Seeds that are done, by what decides their numbers; what comes is added to a journal, and no kill loses it."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from feeder_sim.jobs.journal import Journal, read_journal
from feeder_sim.jobs.task import SeedValues


class Ledger:
    """Seeds by the identity of their scenario; as a context it takes new ones.

    Args:
        journals: that hold what is done.
        path: journal that takes what comes; None to keep it in memory alone.
        mark: of seeds that are measured in another way than usual: only those of the same mark count.
    """

    def __init__(self, journals: Sequence[Path] = (), path: Path | None = None, mark: str = "") -> None:
        self._path, self._mark = path, mark
        self._journal: Journal | None = None
        self._done: dict[str, dict[int, SeedValues]] = {}
        for journal in journals:
            for entry in read_journal(journal):
                with contextlib.suppress(KeyError, TypeError, ValueError, AttributeError):  # of another program
                    seed = SeedValues.of_entry(entry)
                    self._done.setdefault(str(entry["case"]), {})[seed.seed] = seed

    def __len__(self) -> int:
        return sum(map(len, self._done.values()))

    def __iter__(self) -> Iterator[SeedValues]:
        return (seed for seeds in self._done.values() for seed in seeds.values())

    def seeds_of(self, identity: str) -> dict[int, SeedValues]:
        """The seeds of a scenario that are done."""
        return dict(self._done.get(identity + self._mark, {}))

    def foreign(self, identities: Collection[str] | None) -> int:
        """How many seeds are of other scenarios, of another version, or of files that have changed; 0 if not known."""
        if identities is None:
            return 0
        ours = {identity + self._mark for identity in identities}
        return sum(len(seeds) for identity, seeds in self._done.items() if identity not in ours)

    def add(self, identity: str, seed: SeedValues) -> None:
        """Keep a seed that has come back.

        Raises:
            RecordingFailed: it cannot be written.
        """
        if self._journal is not None:
            self._journal.add({"case": identity + self._mark, **seed.as_entry()})

    def __enter__(self) -> Self:
        self._journal = Journal(self._path) if self._path is not None else None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._journal is not None:
            self._journal.close()
