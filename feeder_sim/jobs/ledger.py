"""Seeds that are done, by what decides their numbers; what comes is added to a journal, and no kill loses it.

An entry is a seed with the identity of its scenario and the point of its study that it belongs to; or a note, which has
no seed. A study goes on with seeds of the same identity. It is opened by points, whatever version has run them.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from feeder_sim.errors import not_written
from feeder_sim.jobs.task import SeedValues

# A journal of what is done: lines are added to a text file, and a kill loses at most the line under way.
#
# A line is the CRC-32 of an entry as eight hexadecimal digits, a blank, and the entry as JSON. What cannot be read, as
# the end of a line that a kill has cut short, counts as not done.

SYNC_S = 1.0  # [s] that a power cut may lose


def read_journal(path: Path) -> Iterator[dict[str, Any]]:
    """The entries of a journal, in order; none of a file that is not there."""
    if not path.is_file():
        return
    with path.open("rb") as file:
        for line in file:
            check, _, text = line.rstrip(b"\n").partition(b" ")
            if line.endswith(b"\n") and check == _check(text):
                entry = json.loads(text)
                if isinstance(entry, dict):
                    yield entry


class Journal:
    """A journal that is written by this process alone.

    Args:
        path: of the file, which is made if missing.

    Raises:
        RecordingFailed: it cannot be written, as when the disk is full.
        InputError: no file of this name can be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)  # never what a link leads to
            self._file = os.fdopen(os.open(path, flags, 0o666), "r+b")
            self._begin_a_line()
            self._synced = time.monotonic()
        except OSError as error:
            raise not_written(path, error) from error

    def add(self, entry: dict[str, Any]) -> None:
        """Add an entry, which a kill of this process does not lose from now on.

        Raises:
            RecordingFailed: it cannot be written, as when the disk is full.
        """
        text = json.dumps(entry, allow_nan=False).encode()
        try:
            self._file.write(_check(text) + b" " + text + b"\n")
            self._file.flush()
            if time.monotonic() - self._synced > SYNC_S:
                os.fsync(self._file.fileno())
                self._synced = time.monotonic()
        except OSError as error:
            raise not_written(self._path, error) from error

    def close(self) -> None:
        try:
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
        except OSError as error:
            raise not_written(self._path, error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _begin_a_line(self) -> None:
        """Go to the end; what a kill has left of a line is ended, so that the next one is whole."""
        size = self._file.seek(0, os.SEEK_END)
        if size:
            self._file.seek(size - 1)
            if self._file.read(1) != b"\n":
                self._file.write(b"\n")


def _check(text: bytes) -> bytes:
    return f"{zlib.crc32(text):08x}".encode()


def _key(point: Mapping[str, Any]) -> str:
    """The same for 1 and 1.0, as an axis may have either."""
    values = {key: float(v) if isinstance(v, int) and not isinstance(v, bool) else v for key, v in point.items()}
    return json.dumps(values, sort_keys=True)


class Ledger:
    """Seeds by the identity of their scenario; as a context it takes new ones.

    Args:
        journals: that hold what is done.
        path: journal that takes what comes; None to keep it in memory alone.
        measures_identity: of seeds that are measured in another way than usual: only those of the same one count.
    """

    def __init__(self, journals: Sequence[Path] = (), path: Path | None = None, measures_identity: str = "") -> None:
        self._path, self._measures_identity = path, measures_identity
        self._journal: Journal | None = None
        self._completed: dict[str, dict[int, SeedValues]] = {}
        self._last_case: dict[str, str] = {}  # by point
        self.notes: list[dict[str, Any]] = []
        for journal in journals:
            for entry in read_journal(journal):
                if "seed" not in entry:
                    self.notes.append(entry)
                    continue
                with contextlib.suppress(KeyError, TypeError, ValueError, AttributeError):  # of another program
                    seed, case, point = SeedValues.of_entry(entry), str(entry["case"]), _key(entry["point"])
                    self._completed.setdefault(case, {})[seed.seed] = seed
                    self._last_case[point] = case

    def __len__(self) -> int:
        return sum(map(len, self._completed.values()))

    def __iter__(self) -> Iterator[SeedValues]:
        return (seed for seeds in self._completed.values() for seed in seeds.values())

    def seeds_of(self, identity: str) -> dict[int, SeedValues]:
        """The seeds of a scenario that are done."""
        return dict(self.recorded(self.case_of(identity)))

    def recorded(self, case: str) -> dict[int, SeedValues]:
        """The seeds of a case, as an entry names it."""
        return self._completed.get(case, {})

    def recorded_at(self, point: Mapping[str, Any]) -> dict[int, SeedValues]:
        """The seeds of the last case that was run at a point."""
        return self.recorded(self._last_case.get(_key(point), ""))

    def case_of(self, identity: str) -> str:
        """The name of a scenario in entries."""
        return identity + self._measures_identity

    def foreign(self, identities: Collection[str] | None) -> int:
        """How many seeds are of other scenarios, of another version, or of files that have changed; 0 if not known."""
        if identities is None:
            return 0
        ours = set(map(self.case_of, identities))
        return sum(len(seeds) for identity, seeds in self._completed.items() if identity not in ours)

    def add(self, identity: str, point: Mapping[str, Any], seed: SeedValues) -> None:
        """Keep a seed that has come back.

        Raises:
            RecordingFailed: it cannot be written.
        """
        if self._journal is not None:
            self._journal.add({"case": self.case_of(identity), "point": dict(point), **seed.as_entry()})

    def note(self, entry: dict[str, Any]) -> None:
        """Keep an entry without a seed, if it is not there.

        Raises:
            RecordingFailed: it cannot be written.
        """
        if entry not in self.notes:
            self.notes.append(entry)
            if self._journal is not None:
                self._journal.add(entry)

    def __enter__(self) -> Self:
        self._journal = Journal(self._path) if self._path is not None else None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._journal is not None:
            self._journal.close()
