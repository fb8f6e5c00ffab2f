"""Checkpoints of a run: what each seed's engine goes on from, and how much had been recorded by then."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError

FOLDER = "checkpoints"
RECORDED = "recorded"  # key of the sizes of the record; the others are the engine's


@dataclass(frozen=True)
class Checkpoint:
    """One seed at one moment.

    Attributes:
        sizes: of the record up to it (`Record.sizes`).
        state: of the engine.
    """

    sizes: tuple[int, ...]
    state: dict[str, NDArray[np.float64]]


class CheckpointFolder:
    """Checkpoints of a run folder, one file per seed, replaced as a whole."""

    def __init__(self, run: Path) -> None:
        self._folder = run / FOLDER

    def save(self, seed_index: int, checkpoint: Checkpoint) -> None:
        """Write the checkpoint of a seed in place of the one before; a kill leaves one or the other."""
        self._folder.mkdir(exist_ok=True)
        path = self._path(seed_index)
        partial = path.with_suffix(".partial")
        recorded = np.array(checkpoint.sizes)
        with partial.open("wb") as file:
            np.savez(file, allow_pickle=False, **{RECORDED: recorded}, **checkpoint.state)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)

    def load(self, seed_index: int) -> Checkpoint | None:
        """Read the checkpoint of a seed; None without one.

        Raises:
            InputError: the file cannot be read.
        """
        path = self._path(seed_index)
        if not path.is_file():
            return None
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as held:
                state = {name: held[name] for name in held.files}
            sizes = tuple(state.pop(RECORDED).tolist())
        except (OSError, ValueError, EOFError, KeyError, BadZipFile) as error:
            raise InputError("is not a readable checkpoint", file=path) from error
        return Checkpoint(sizes, state)

    def clear(self) -> None:
        """Delete what is of no use once the run has ended."""
        for path in self._folder.glob("*") if self._folder.is_dir() else ():
            path.unlink()
        if self._folder.is_dir():
            self._folder.rmdir()

    def _path(self, seed_index: int) -> Path:
        return self._folder / f"seed_{seed_index:03d}.npz"
