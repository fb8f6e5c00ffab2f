"""The last states of a seed that diverged, to look at."""

from __future__ import annotations

import io
import itertools
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.errors import Divergence, InputError, SimulationDiverged
from feeder_sim.records.files import write_whole
from feeder_sim.records.trajectory import Frames

LAST_FRAMES = 100  # kept of a block that failed, at most: half of them before the first one that is not valid


@dataclass(frozen=True)
class LastStates:
    """What is kept of a block in which a seed diverged. The seed runs again from its start, to the same bits.

    Attributes:
        frames: up to LAST_FRAMES of the block.
        valid: number of `frames` before the first one that is not valid.
    """

    frames: Frames
    valid: int

    @staticmethod
    def of(block: Frames, valid: int) -> LastStates:
        """Cut the frames around the failure out of a block of which the first `valid` frames are valid."""
        skipped = max(0, min(valid - LAST_FRAMES // 2, len(block) - LAST_FRAMES))
        kept = block[slice(skipped, skipped + LAST_FRAMES)]
        # Copied, since `present` is still written to.
        return LastStates(Frames(*(getattr(kept, field.name).copy() for field in fields(Frames))), valid - skipped)


def save_last_states(folder: Path, failure: SimulationDiverged, last: LastStates) -> str:
    """Write the last states of a seed that diverged into a run folder, as NumPy's .npz; returns the file's name.

    Arrays: those of `Frames` [SI units], `valid` (see `LastStates`), `divergence` (its name), `cause`, `part` and
    `time_s`. A run that is resumed may come here again: a file that holds anything else stays, and this one gets the
    next free number.

    Raises:
        RecordingFailed: it cannot be written, as when the disk is full.
    """
    arrays: dict[str, Any] = {field.name: getattr(last.frames, field.name) for field in fields(Frames)}
    arrays |= {"valid": last.valid, "divergence": failure.divergence.name, "cause": failure.cause}
    arrays |= {"part": failure.part, "time_s": failure.time_s}
    held = io.BytesIO()
    np.savez(held, **arrays)
    stem = _stem(failure.seed)
    for name in itertools.chain([f"{stem}.npz"], (f"{stem}_{number}.npz" for number in itertools.count(2))):
        path = folder / name
        if path.is_symlink() or (path.exists() and not path.is_file()):
            continue
        if path.exists() and path.read_bytes() != held.getvalue():
            continue
        write_whole(path, held.getvalue())
        return name
    raise AssertionError("unreachable")


def _stem(seed: int) -> str:
    return f"failure_seed_{seed}"


def read_failure(folder: Path, seed: int) -> tuple[SimulationDiverged, LastStates]:
    """Why a seed of a run folder diverged, and its last states.

    Raises:
        InputError: its file is not there, or cannot be read.
    """
    path = folder / f"{_stem(seed)}.npz"
    last = read_last_states(path)
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as held:
            name, cause, part = (str(held[key]) if key in held else "" for key in ("divergence", "cause", "part"))
            time = float(held["time_s"])
    except Exception as error:
        raise InputError("holds no readable last states", file=path) from error
    divergence = Divergence.__members__.get(name, Divergence.UNKNOWN)
    return SimulationDiverged(divergence, time_s=time, part=part, seed=seed, detail=cause, file=path.name), last


def read_last_states(path: str | Path) -> LastStates:
    """Read the last states of a seed that diverged, to look at them.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as held:
            arrays = {name: held[name] for name in held.files}
        frames = Frames(**{field.name: arrays[field.name] for field in fields(Frames)})
        return LastStates(frames, int(arrays["valid"]))
    except Exception as error:  # of a file that is damaged or of another kind, NumPy raises what it likes
        raise InputError("holds no readable last states", file=path) from error
