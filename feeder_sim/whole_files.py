"""Files that are there as a whole, or not at all."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from feeder_sim.errors import not_written


def partial_of(path: Path) -> Path:
    """Where a file is written before it gets its name."""
    return path.with_name(f"{path.name}.partial")


def _opened_itself(path: str, flags: int) -> int:
    """Open a file, and never what a link by its name leads to."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)


def write_whole(path: Path, content: bytes | memoryview) -> None:
    """Write a file in place of the one before; a kill or a full disk leaves one or the other.

    Raises:
        RecordingFailed: it cannot be written, as when the disk is full.
        InputError: no file of this name can be written.
    """
    partial = partial_of(path)
    try:
        partial.unlink(missing_ok=True)
        with open(partial, "xb", opener=_opened_itself) as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        raise not_written(path, error) from error
