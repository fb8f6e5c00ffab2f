"""Writes the trajectory file of a run, block by block; trajectory_file.py describes it."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim import __version__
from feeder_sim.errors import RecordingFailed, cause_of
from feeder_sim.hdf5_text import put_array, put_text
from feeder_sim.records.counts import NOTHING_COUNTED, Counts
from feeder_sim.records.part_group import write_part
from feeder_sim.records.plate_group import write_plate
from feeder_sim.records.trajectory import BLOCK_FRAMES, FRAME_FIELDS, PartRecord, PlateRecord, Record, Status, WallTime
from feeder_sim.records.trajectory_file import (
    ARRIVAL_FIELDS,
    IMPACT_FIELDS,
    REMOVAL_FIELDS,
    SCHEMA,
    SCHEMA_VERSION,
    read_record,
    seed_name,
)

GROWING: dict[str, Any] = {"fletcher32": True}  # not packed: of motion that is noise packing saves a sixth
EVENT_CHUNK = 256  # rows of impacts and removals
FRAME_CHUNK_PARTS = 500  # parts times frames in a chunk, about: small chunks can be written while little is computed


class TrajectoryWriter:
    """Writes one run; `append` may be called from several threads."""

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
                self._create_seed(0, len(parts))
                for index in range(1, n_seeds):
                    self._file.copy(self._file[seed_name(0)], self._file, seed_name(index))
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

    def append(self, seed_index: int, block: Record) -> None:
        """Append a block of one seed and put it on disk.

        Raises:
            RecordingFailed: it cannot be written, as when the disk is full.
        """
        with self._writing():
            self._append(seed_index, block)

    def _append(self, seed_index: int, block: Record) -> None:
        group = self._file[seed_name(seed_index)]
        for name in FRAME_FIELDS:
            _extend(group[name], getattr(block.frames, name))
        for name in IMPACT_FIELDS if len(block.impacts) else ():
            _extend(group[f"impacts/{name}"], getattr(block.impacts, name))
        for name in REMOVAL_FIELDS if len(block.removals) else ():
            _extend(group[f"removals/{name}"], getattr(block.removals, name))
        for name in ARRIVAL_FIELDS if len(block.arrivals) else ():
            _extend(group[f"arrivals/{name}"], getattr(block.arrivals, name))
        if len(block.stops):
            _extend(group["stops"], block.stops)

    def finish(self, seed_index: int, status: Status, counts: Counts = NOTHING_COUNTED) -> None:
        """Note how a seed ended."""
        with self._writing():
            for name, count in counts._asdict().items():
                counter = self._file[f"{seed_name(seed_index)}/{name}"]
                counter[0] = count
                counter.flush()
            dataset = self._file[f"{seed_name(seed_index)}/status"]
            dataset[0] = int(status)
            dataset.flush()

    def note_wall_time(self, seed_index: int, wall_time: WallTime) -> None:
        """Note what a seed has cost so far."""
        with self._writing():
            dataset = self._file[f"{seed_name(seed_index)}/wall_time"]
            dataset[:] = wall_time
            dataset.flush()

    def read_back(self, seed_index: int) -> Record:
        """Everything that has been appended of a seed."""
        with self._lock:
            return read_record(self._file[seed_name(seed_index)])

    def close(self) -> None:
        """Put the rest on disk.

        Raises:
            RecordingFailed: it cannot be written, now or before; HDF5 crashes when it closes what it could not write.
        """
        with self._writing():
            self._file.close()

    def _create_seed(self, index: int, n_parts: int) -> None:
        for name, (unit, dtype, shape) in FRAME_FIELDS.items():
            tail = () if name == "time" else (n_parts, *shape)
            dataset = self._file.create_dataset(
                f"{seed_name(index)}/{name}",
                shape=(0, *tail),
                maxshape=(None, *tail),
                chunks=(max(1, min(BLOCK_FRAMES, FRAME_CHUNK_PARTS // n_parts)), *tail),
                dtype=dtype,
                **GROWING,
            )
            put_text(dataset.attrs, {"unit": unit})
        events = {f"impacts/{name}": (unit, "f8") for name, unit in IMPACT_FIELDS.items()}
        events |= {f"removals/{name}": described for name, described in REMOVAL_FIELDS.items()}
        events |= {f"arrivals/{name}": described for name, described in ARRIVAL_FIELDS.items()}
        events["stops"] = ("s", "f8")
        for name, (unit, dtype) in events.items():
            name = f"{seed_name(index)}/{name}"
            dataset = self._file.create_dataset(
                name, (0,), maxshape=(None,), chunks=(EVENT_CHUNK,), dtype=dtype, **GROWING
            )
            put_text(dataset.attrs, {"unit": unit})
        put_array(self._file, f"{seed_name(index)}/status", np.array([int(Status.UNFINISHED)]), "1")
        for name in Counts._fields:
            put_array(self._file, f"{seed_name(index)}/{name}", np.zeros(1, np.int64), "1")
        put_array(self._file, f"{seed_name(index)}/wall_time", np.zeros(2), "s")


def _extend(dataset: Any, values: NDArray[Any]) -> None:
    """Append to a dataset and put it on disk."""
    start = dataset.shape[0]
    dataset.resize(start + len(values), axis=0)
    dataset[start:] = values
    dataset.flush()
