"""Writes the trajectory file of a run, block by block; trajectory_file.py describes it."""

from __future__ import annotations

import json
import threading
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim import __version__
from feeder_sim.errors import RecordingFailed, cause_of
from feeder_sim.hdf5 import put_array, put_text
from feeder_sim.records.recording import PartRecord, PlateRecord, write_part, write_plate
from feeder_sim.records.seed import Counts, Seed, Status
from feeder_sim.records.trajectory import BLOCK_FRAMES, FRAME_FIELDS
from feeder_sim.records.trajectory_file import EVENTS, SCHEMA, SCHEMA_VERSION, read_seed, seed_name
from feeder_sim.records.unclosed_file import read_hdf5

GROWING: dict[str, Any] = {"fletcher32": True}  # not packed: of motion that is noise packing saves a sixth
EVENT_CHUNK = 256  # rows of impacts and removals
FRAME_CHUNK_PARTS = 500  # parts times frames in a chunk, about: small chunks can be written while little is computed


class TrajectoryWriter:
    """Writes one run; `append` may be called from several threads.

    Args:
        path: of the file, which is new.
        engine, seed, scenario_text, libraries, inputs, plate, parts: what the file says about the run.
        n_seeds: how many there will be.
        copied: another file of the same run, and the seeds in it that have ended, which are copied.
    """

    def __init__(
        self,
        path: Path,
        *,
        engine: str,
        seed: int,
        n_seeds: int,
        scenario_text: str,
        libraries: dict[str, str],
        inputs: dict[str, str],
        plate: PlateRecord,
        parts: Sequence[PartRecord],
        copied: tuple[Path, Collection[int]] | None = None,
    ) -> None:
        import h5py

        self._lock = threading.Lock()
        self._path = path
        self._failed: RecordingFailed | None = None
        texts = {"schema": SCHEMA, "creator": f"feeder_sim {__version__}", "engine": engine, "scenario": scenario_text}
        try:
            with self._writing():
                self._file = h5py.File(path, "w-", libver="latest")
                put_text(self._file.attrs, texts | {"libraries": json.dumps(libraries), "inputs": json.dumps(inputs)})
                self._file.attrs.update(schema_version=SCHEMA_VERSION, seed=seed)
                write_plate(self._file, plate)
                self._write_parts(parts)
                self._create_seed("empty", len(parts))
                before, ended = copied or (path, ())
                for index in set(range(n_seeds)) - set(ended):
                    self._file.copy(self._file["empty"], self._file, seed_name(index))
                del self._file["empty"]
                if ended:
                    read_hdf5(before, lambda file: self._copy(file, ended))
                self._file.swmr_mode = True  # from here on nothing is created, only appended
        except RecordingFailed:
            path.unlink(missing_ok=True)
            raise

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """One thread at a time writes; what cannot be written is the end of it, whichever seed is heard first."""
        with self._lock:
            if self._failed:
                raise self._failed
            try:
                yield
            except (OSError, RuntimeError) as error:
                cause = cause_of(error)
                self._failed = RecordingFailed(f"{self._path}: cannot be written, is the disk full? ({cause})")
                raise self._failed from error

    def move_to(self, path: Path) -> None:
        """Give the file another name, in place of what is there."""
        self._path.replace(path)
        self._path = path

    def _write_parts(self, parts: Sequence[PartRecord]) -> None:
        """Write every mesh once; parts of one kind are links to the same data."""
        written: dict[int, str] = {}
        for part in parts:
            first = written.setdefault(id(part.vertices), part.name)
            if first == part.name:
                write_part(self._file, part)
            else:
                self._file[f"parts/{part.name}"] = self._file[f"parts/{first}"]

    def _copy(self, file: Any, seeds: Collection[int]) -> None:
        """Copy seeds of another file, as far as that has not been done."""
        for name in map(seed_name, seeds):
            if name not in self._file:
                file.copy(file[name], self._file, name)

    def append(self, seed_index: int, block: Seed) -> None:
        """Append a block of one seed and put it on disk.

        Raises:
            RecordingFailed: it cannot be written, as when the disk is full.
        """
        with self._writing():
            self._append(seed_index, block)

    def _append(self, seed_index: int, block: Seed) -> None:
        group = self._file[seed_name(seed_index)]
        for name in FRAME_FIELDS:
            _extend(group[name], getattr(block.frames, name))
        for kind, columns in EVENTS.items():
            happened = getattr(block, kind)
            for name in columns if len(happened) else ():
                _extend(group[f"{kind}/{name}"], happened[name])
        if len(block.stops):
            _extend(group["stops"], block.stops)

    def finish(self, seed_index: int, seed: Seed, wall_s: float) -> None:
        """Note how a seed ended; wall_s: of the ensemble until now [s]."""
        numbers = seed.counts._asdict() | {"wall_time": (seed.wall_s, wall_s), "status": int(seed.status)}
        with self._writing():
            for name, number in numbers.items():
                dataset = self._file[f"{seed_name(seed_index)}/{name}"]
                dataset[:] = number
                dataset.flush()

    def read_back(self, seed_index: int) -> Seed:
        """Everything that has been appended of a seed."""
        with self._lock:
            return read_seed(self._file[seed_name(seed_index)])

    def close(self) -> None:
        """Put the rest on disk.

        Raises:
            RecordingFailed: it cannot be written, now or before; HDF5 crashes when it closes what it could not write.
        """
        with self._writing():
            self._file.close()

    def _create_seed(self, group: str, n_parts: int) -> None:
        for name, (unit, dtype, shape) in FRAME_FIELDS.items():
            tail = () if name == "time" else (n_parts, *shape)
            rows = max(1, min(BLOCK_FRAMES, FRAME_CHUNK_PARTS // n_parts))
            self._create_growing(f"{group}/{name}", unit, dtype, tail, rows)
        for kind, columns in EVENTS.items():
            for name, (unit, dtype) in columns.items():
                self._create_growing(f"{group}/{kind}/{name}", unit, dtype, (), EVENT_CHUNK)
        self._create_growing(f"{group}/stops", "s", "f8", (), EVENT_CHUNK)
        put_array(self._file, f"{group}/status", np.array([int(Status.UNFINISHED)]), "1")
        for name in Counts._fields:
            put_array(self._file, f"{group}/{name}", np.zeros(1, np.int64), "1")
        put_array(self._file, f"{group}/wall_time", np.zeros(2), "s")

    def _create_growing(self, name: str, unit: str, dtype: str, tail: tuple[int, ...], rows: int) -> None:
        """An empty dataset that grows along its first axis by chunks of so many rows."""
        shapes: dict[str, Any] = {"shape": (0, *tail), "maxshape": (None, *tail), "chunks": (rows, *tail)}
        put_text(self._file.create_dataset(name, dtype=dtype, **shapes, **GROWING).attrs, {"unit": unit})


def _extend(dataset: Any, values: NDArray[Any]) -> None:
    """Append to a dataset and put it on disk."""
    start = dataset.shape[0]
    dataset.resize(start + len(values), axis=0)
    dataset[start:] = values
    dataset.flush()
