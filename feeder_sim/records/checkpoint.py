"""Checkpoints of a run: what each seed's engine goes on from, and how much had been recorded by then.

A checkpoint is an .npz archive of NumPy that says what it belongs to: `described` is a JSON text with the format, the
run, the seed, and the sizes of the record; `state_NAME` are the arrays of the engine, each with its shape and type. The
comment at the end of the archive is the SHA-256 of all before it.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import ZIP_STORED, ZipFile

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError, not_written, shortened
from feeder_sim.records.last_states import STATE_PREFIX
from feeder_sim.records.own_files import CHECKPOINTS
from feeder_sim.records.whole_file import partial_of, write_whole

FORMAT = 1
DESCRIBED = "described"
ZIP = b"PK\x03\x04"
CHECKSUM_LENGTH = 64  # hexadecimal digits

State = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Checkpoint:
    """One seed at one moment.

    Attributes:
        sizes: of the record up to it (`Record.sizes`).
        state: of the engine.
    """

    sizes: tuple[int, ...]
    state: State


class CheckpointFolder:
    """Checkpoints of a run folder, one file per seed, replaced as a whole.

    Args:
        run: the folder.
        identity: of the run; see `run_identity`.
    """

    def __init__(self, run: Path, identity: str) -> None:
        self._folder, self._identity = run / CHECKPOINTS, identity

    def save(self, seed_index: int, checkpoint: Checkpoint) -> None:
        """Write the checkpoint of a seed in place of the one before; a kill leaves one or the other.

        Raises:
            RecordingFailed: it cannot be written, as when the disk is full.
        """
        try:
            self._folder.mkdir(exist_ok=True)
        except OSError as error:
            raise not_written(self._folder, error) from error
        described = self._described(seed_index) | {"sizes": list(checkpoint.sizes)}
        arrays: dict[str, Any] = {f"{STATE_PREFIX}{name}": values for name, values in checkpoint.state.items()}
        held = io.BytesIO()
        np.savez(held, **arrays | {DESCRIBED: np.array(json.dumps(described))})
        with ZipFile(held, "a") as archive:
            archive.comment = bytes(CHECKSUM_LENGTH)
        content = held.getvalue()[:-CHECKSUM_LENGTH]
        write_whole(self._path(seed_index), content + _checksum(content))

    def load(self, seed_index: int) -> Checkpoint | None:
        """Read the checkpoint of a seed; None without one.

        Raises:
            InputError: the file cannot be read, or belongs to another seed, run or format.
        """
        path = self._path(seed_index)
        if not path.is_file():
            return None
        try:
            content = path.read_bytes()
            if _checksum(content[:-CHECKSUM_LENGTH]) != content[-CHECKSUM_LENGTH:]:
                raise ValueError("another checksum")
            with ZipFile(io.BytesIO(content)) as archive:
                if any(entry.compress_type != ZIP_STORED for entry in archive.infolist()):
                    raise ValueError("packed, and nobody knows how large")
            with np.load(io.BytesIO(content), allow_pickle=False) as held:
                arrays = {name: held[name] for name in held.files}
            found = json.loads(str(arrays.pop(DESCRIBED)))
            sizes = tuple(int(size) for size in found.pop("sizes"))
            state = {name[len(STATE_PREFIX) :]: values for name, values in arrays.items()}
        except Exception as error:  # of a file that is damaged or of another kind, NumPy raises what it likes
            raise InputError("is not a readable checkpoint of this version", file=path) from error
        for name, wanted in self._described(seed_index).items():
            if found.get(name) != wanted:
                raise InputError(
                    f"is of {name} {shortened(str(found.get(name)), 20)}, allowed is {shortened(str(wanted), 20)}; "
                    "without it the seed begins anew",
                    file=path,
                )
        return Checkpoint(sizes, state)

    def clear(self, n_seeds: int) -> None:
        """Delete the checkpoints of this run, which are of no use once it has ended, and nothing else."""
        for index in range(n_seeds):
            path = self._path(index)
            cut = partial_of(path)  # of a process that was killed while it wrote
            with contextlib.suppress(OSError):
                if cut.is_file() and cut.read_bytes()[:4] in (b"", ZIP):
                    cut.unlink()
            with contextlib.suppress(OSError, InputError):  # what is not of this run stays
                if self.load(index) is not None:
                    path.unlink()
        with contextlib.suppress(OSError):  # it is not there, or holds something else
            self._folder.rmdir()

    def check_fits(self, seed_index: int, state: State, engine: State) -> None:
        """Refuse a state that an engine cannot go on from.

        Args:
            seed_index: for the message.
            state: from its checkpoint.
            engine: of an engine that has just been made; its empty arrays are lists, which may have any length.

        Raises:
            InputError: an array is missing or one too many, or of another shape or type.
        """
        for name in sorted(state.keys() | engine.keys()):
            is_list = name in engine and engine[name].shape[:1] == (0,)
            found, wanted = (_kind(of.get(name), any_length=is_list) for of in (state, engine))
            if found != wanted:
                said = f"{name} is {found}, allowed is {wanted}"
                raise InputError(f"does not fit the engine: {said}", file=self._path(seed_index))

    def _path(self, seed_index: int) -> Path:
        return self._folder / f"seed_{seed_index:03d}.npz"

    def _described(self, seed_index: int) -> dict[str, str | int]:
        return {"format": FORMAT, "run": self._identity, "seed": seed_index}


def run_identity(scenario_text: str, libraries: Mapping[str, str], inputs: Mapping[str, str]) -> str:
    """Hash of all that decides the numbers of a run."""
    described = json.dumps([scenario_text, dict(libraries), dict(inputs)], sort_keys=True)
    return hashlib.sha256(described.encode()).hexdigest()


def _checksum(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()


def _kind(values: NDArray[np.float64] | None, *, any_length: bool) -> str:
    """Type and shape of an array in words."""
    if values is None:
        return "not there"
    if any_length and values.ndim:
        return f"{values.dtype} ({', '.join(map(str, ('any', *values.shape[1:])))})"
    return f"{values.dtype} {values.shape}"
