"""Modes of plates that scenarios describe, kept by what they are made from: the plate, and the code for modes."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
from pathlib import Path

from feeder_sim.errors import InputError, RecordingFailed
from feeder_sim.machine_code import base_folder, source_hash
from feeder_sim.plate.mode_file import ModeFile, read_mode_file, write_mode_file
from feeder_sim.scenario import PlateFile
from feeder_sim.scene.plate_modes import compute_modes

MOST_KEPT = 100  # files, of up to some MB; those used last
KEPT_HERE = 8  # plates
PACKAGE = Path(__file__).parents[1]
MADE_BY = ("plate/**/*.py", "scene/plate_modes.py", "scene/attachments.py", "scene/outlines.py")


def modes_of_plate(file: PlateFile) -> ModeFile:
    """The modes of a plate, computed or kept; errors as of `compute_modes`."""
    return _kept(file.model_dump_json())


@functools.lru_cache(KEPT_HERE)
def _kept(plate: str) -> ModeFile:
    file = PlateFile.model_validate_json(plate)
    made_by = [source_hash(PACKAGE, pattern, ()) for pattern in MADE_BY]
    name = hashlib.sha256(repr((plate, made_by)).encode()).hexdigest()[:24]
    path = base_folder() / "modes" / f"{name}.h5"
    with contextlib.suppress(InputError, OSError):  # one that is damaged is made again
        if path.is_file():
            path.touch()
            return read_mode_file(path)
    held = compute_modes(file)
    with contextlib.suppress(OSError, RecordingFailed, InputError):  # without a cache it is computed every time
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f"{name}.{os.getpid()}.h5")
        write_mode_file(partial, held)
        partial.replace(path)
        files = sorted(path.parent.glob("*.h5"), key=lambda kept: kept.stat().st_mtime, reverse=True)
        for old in files[MOST_KEPT:]:
            old.unlink(missing_ok=True)
    return held
