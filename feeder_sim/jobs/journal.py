"""A journal of what is done: lines are added to a text file, and a kill loses at most the line under way.

A line is the CRC-32 of an entry as eight hexadecimal digits, a blank, and the entry as JSON. What cannot be read, as
the end of a line that a kill has cut short, counts as not done.
"""

from __future__ import annotations

import json
import os
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from feeder_sim.errors import not_written

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
