"""Modes of plates that scenarios describe, kept by what they are made from: the plate, and the code for modes."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os

from feeder_sim.errors import InputError, RecordingFailed
from feeder_sim.machine_code.key import base_folder, files_hash
from feeder_sim.plate.mode_file import ModeFile, read_mode_file, write_mode_file
from feeder_sim.scenario import PlateFile
from feeder_sim.scene.plate_modes import compute_modes

MAX_FILES = 100  # files, of up to some MB; those used last
MAX_IN_MEMORY = 8  # plates
SOURCES = ("plate/**/*.py", "scene/plate_modes.py", "scene/attachments.py", "scene/outlines.py")


def modes_of_plate(file: PlateFile) -> ModeFile:
    """The modes of a plate, computed or kept; errors as of `compute_modes`."""
    return _cached_modes(file.model_dump_json())


@functools.lru_cache(MAX_IN_MEMORY)
def _cached_modes(plate: str) -> ModeFile:
    file = PlateFile.model_validate_json(plate)
    source_hashes = [files_hash(pattern) for pattern in SOURCES]
    name = hashlib.sha256(repr((plate, source_hashes)).encode()).hexdigest()[:24]
    path = base_folder() / "modes" / f"{name}.h5"
    with contextlib.suppress(InputError, OSError):  # one that is damaged is made again
        if path.is_file():
            path.touch()
            return read_mode_file(path)
    mode_file = compute_modes(file)
    with contextlib.suppress(OSError, RecordingFailed, InputError):  # without a cache it is computed every time
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f"{name}.{os.getpid()}.h5")
        write_mode_file(partial, mode_file)
        partial.replace(path)
        files = sorted(path.parent.glob("*.h5"), key=lambda saved: saved.stat().st_mtime, reverse=True)
        for old in files[MAX_FILES:]:
            old.unlink(missing_ok=True)
    return mode_file
