"""The last states of a seed that diverged: to look at, and to run again."""

from __future__ import annotations

import io
import itertools
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import Divergence, InputError, SimulationDiverged
from feeder_sim.records.trajectory import Frames
from feeder_sim.records.whole_file import write_whole

LAST_FRAMES = 100  # kept of a block that failed, at most: half of them before the first one that is not valid
STATE_PREFIX = "state_"  # of the engine's arrays among the last states of a seed that diverged


@dataclass(frozen=True)
class LastStates:
    """What is kept of a block in which a seed diverged, to look at and to run again.

    In the scene `stopped` at `stops`, an engine that has restored `state` gives `frames` again, bit by bit, as the last
    ones of `advance(skipped + len(frames))`.

    Attributes:
        state: of the engine before the block.
        stops: when the drives of stages had stopped before the block [s].
        skipped: frames of the block before `frames`.
        frames: up to LAST_FRAMES of the block.
        valid: number of `frames` before the first one that is not valid.
    """

    state: dict[str, NDArray[np.float64]]
    stops: NDArray[np.float64]
    skipped: int
    frames: Frames
    valid: int

    @staticmethod
    def of(block: Frames, valid: int, state: dict[str, NDArray[np.float64]], stops: NDArray[np.float64]) -> LastStates:
        """Cut the frames around the failure out of a block of which the first `valid` frames are valid."""
        skipped = max(0, min(valid - LAST_FRAMES // 2, len(block) - LAST_FRAMES))
        kept = block[slice(skipped, skipped + LAST_FRAMES)]
        copied = Frames(
            *(getattr(kept, field.name).copy() for field in fields(Frames))
        )  # `present` is still written to
        return LastStates(state, stops, skipped, copied, valid - skipped)


def save_last_states(folder: Path, failure: SimulationDiverged, last: LastStates) -> str:
    """Write the last states of a seed that diverged into a run folder, as NumPy's .npz; returns the file's name.

    Arrays: those of `Frames` [SI units], `state_NAME` of the engine, `stops`, `skipped` and `valid` (see `LastStates`),
    `divergence` (its name), `cause`, `part`, `time_s`. A run that is resumed may come here again: a file that holds
    anything else stays, and this one gets the next free number.

    Raises:
        RecordingFailed: it cannot be written, as when the disk is full.
    """
    arrays: dict[str, Any] = {field.name: getattr(last.frames, field.name) for field in fields(Frames)}
    arrays |= {f"{STATE_PREFIX}{name}": values for name, values in last.state.items()}
    arrays |= {"stops": last.stops, "skipped": np.array(last.skipped), "valid": np.array(last.valid)}
    arrays |= {
        "divergence": np.array(failure.divergence.name),
        "cause": np.array(failure.cause),
        "part": np.array(failure.part),
    }
    arrays |= {"time_s": np.array(failure.time_s)}
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
    """Read the last states of a seed that diverged, to run its last block again.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as held:
            arrays = {name: held[name] for name in held.files}
        frames = Frames(**{field.name: arrays[field.name] for field in fields(Frames)})
        state = {name[len(STATE_PREFIX) :]: arrays[name] for name in arrays if name.startswith(STATE_PREFIX)}
        return LastStates(state, arrays["stops"], int(arrays["skipped"]), frames, int(arrays["valid"]))
    except Exception as error:  # of a file that is damaged or of another kind, NumPy raises what it likes
        raise InputError("holds no readable last states", file=path) from error
