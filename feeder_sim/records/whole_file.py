"""Files that are there as a whole, or not at all."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from feeder_sim.errors import not_written


def write_whole(path: Path, content: bytes) -> None:
    """Write a file in place of the one before; a kill or a full disk leaves one or the other.

    Raises:
        RecordingFailed: it cannot be written, as when the disk is full.
        InputError: no file of this name can be written.
    """
    partial = path.with_name(f"{path.name}.partial")
    try:
        with partial.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        raise not_written(path, error) from error
