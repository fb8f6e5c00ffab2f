"""The HDF5 file that is the record of truth of a run.

Layout, schema version 3 (SI units, in the `unit` attribute of every dataset):

    /                     schema, schema_version, creator, engine, seed, scenario (resolved TOML),
                          libraries (versions), inputs (SHA-256 of mode file and meshes) (JSON)
    /plate                length, width, thickness (attributes)
    /plate/x, y           (nx,), (ny,)        grid of the shapes below
    /plate/mode_shape     (n_shapes, nx, ny)  deflection per unit modal coordinate
    /plate/nodal_point    (k, 2)              points of the nodal lines of the first shape, line after line
    /plate/nodal_line     (k,)                number of the line each point belongs to
    /plate/antinode       (2,)                antinode the part starts from; NaN without nodal lines
    /drive/shape          (k,)                mode shape that each excitation of the scenario drives
    /drive/drive_frequency, natural_frequency, amplitude, phase, damping_ratio   (k,)  NaN: no ring-up
    /parts/NAME/vertices, faces
    /seeds/NNN/time, position, quaternion, velocity, angular_velocity, present, status
    /seeds/NNN/unresolved_impacts  (1,)       impacts whose iteration was given up
    /seeds/NNN/wall_time  (2,)                of the seed, and of the ensemble when that was noted
    /seeds/NNN/removals/time, part, cause   of parts picked or lost; see feeder_sim.removals
    /seeds/NNN/stops      (s,)                when the drives of the stages stopped; the others keep to the schedule
    /seeds/NNN/impacts/time, until, approach_speed, departure_velocity   of a part in a guide; see feeder_sim.impacts

Quaternions have w first; velocities are in world axes. The file is written in HDF5's single-writer mode and flushed
after every block: a killed run leaves everything up to its last block readable. Structure and data are under checksums.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim import __version__
from feeder_sim.errors import InputError, RecordingFailed, cause_of
from feeder_sim.hdf5_text import get_text, put_array, put_text
from feeder_sim.hdf5_trust import check_trusted
from feeder_sim.records.impacts import Impacts
from feeder_sim.records.own_files import check_no_links
from feeder_sim.records.plate_group import read_plate, write_plate
from feeder_sim.records.removals import Removals
from feeder_sim.records.trajectory import (
    BLOCK_FRAMES,
    FRAME_FIELDS,
    Frames,
    PartRecord,
    PlateRecord,
    Record,
    Recording,
    Status,
    WallTime,
)
from feeder_sim.records.unclosed_file import read_hdf5

TRAJECTORY = "trajectory.h5"  # its name in a run folder
SCHEMA = "feeder_sim/trajectory"
SCHEMA_VERSION = 3
IMPACT_FIELDS = {"time": "s", "until": "s", "approach_speed": "m/s", "departure_velocity": "m/s"}
REMOVAL_FIELDS = {"time": ("s", "f8"), "part": ("1", "i8"), "cause": ("1", "i8")}
PACKED: dict[str, Any] = {"compression": "gzip", "shuffle": True, "fletcher32": True}  # of what grows
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
                for index in range(n_seeds):
                    self._create_seed(index, len(parts))
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
                put_array(self._file, f"parts/{part.name}/vertices", part.vertices, "m")
                put_array(self._file, f"parts/{part.name}/faces", part.faces, "1")
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
        group = self._file[_seed_name(seed_index)]
        for name in FRAME_FIELDS:
            _extend(group[name], getattr(block.frames, name))
        for name in IMPACT_FIELDS if len(block.impacts) else ():
            _extend(group[f"impacts/{name}"], getattr(block.impacts, name))
        for name in REMOVAL_FIELDS if len(block.removals) else ():
            _extend(group[f"removals/{name}"], getattr(block.removals, name))
        if len(block.stops):
            _extend(group["stops"], block.stops)

    def finish(self, seed_index: int, status: Status, unresolved_impacts: int = 0) -> None:
        """Note how a seed ended."""
        with self._writing():
            counter = self._file[f"{_seed_name(seed_index)}/unresolved_impacts"]
            counter[0] = unresolved_impacts
            counter.flush()
            dataset = self._file[f"{_seed_name(seed_index)}/status"]
            dataset[0] = int(status)
            dataset.flush()

    def note_wall_time(self, seed_index: int, wall_time: WallTime) -> None:
        """Note what a seed has cost so far."""
        with self._writing():
            dataset = self._file[f"{_seed_name(seed_index)}/wall_time"]
            dataset[:] = wall_time
            dataset.flush()

    def read_back(self, seed_index: int) -> Record:
        """Everything that has been appended of a seed."""
        with self._lock:
            return _read_record(self._file[_seed_name(seed_index)])

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
                f"{_seed_name(index)}/{name}",
                shape=(0, *tail),
                maxshape=(None, *tail),
                chunks=(max(1, min(BLOCK_FRAMES, FRAME_CHUNK_PARTS // n_parts)), *tail),
                dtype=dtype,
                **PACKED,
            )
            put_text(dataset.attrs, {"unit": unit})
        events = {f"impacts/{name}": (unit, "f8") for name, unit in IMPACT_FIELDS.items()}
        events |= {f"removals/{name}": described for name, described in REMOVAL_FIELDS.items()}
        events["stops"] = ("s", "f8")
        for name, (unit, dtype) in events.items():
            name = f"{_seed_name(index)}/{name}"
            dataset = self._file.create_dataset(
                name, (0,), maxshape=(None,), chunks=(EVENT_CHUNK,), dtype=dtype, **PACKED
            )
            put_text(dataset.attrs, {"unit": unit})
        put_array(self._file, f"{_seed_name(index)}/status", np.array([int(Status.UNFINISHED)]), "1")
        put_array(self._file, f"{_seed_name(index)}/unresolved_impacts", np.zeros(1, np.int64), "1")
        put_array(self._file, f"{_seed_name(index)}/wall_time", np.zeros(2), "s")


def read_recording(path: Path) -> Recording:
    """Read a trajectory file, also one whose writer was killed.

    Raises:
        InputError: missing, truncated, not HDF5, not a trajectory, another schema version.
    """
    if not path.is_file():
        raise InputError("no such trajectory file", file=path)
    try:
        return read_hdf5(path, lambda file: _recording(path, file))
    except InputError:
        raise
    except Exception as error:  # of a file that is damaged, h5py raises what it likes
        raise InputError("not a readable trajectory file (truncated or of another format)", file=path) from error


def _recording(path: Path, file: Any) -> Recording:
    check_trusted(file, path)
    found, version = get_text(file.attrs, "schema"), file.attrs.get("schema_version")
    if version is not None and version != SCHEMA_VERSION:  # first: the text of version 1 is not to be read
        raise InputError(f"is {version!r}, allowed is {SCHEMA_VERSION}", file=path, key="schema_version")
    if found != SCHEMA or version is None:
        raise InputError(f"is {found!r}, allowed is a trajectory ({SCHEMA!r})", file=path, key="schema")
    groups = [file[f"seeds/{name}"] for name in sorted(file["seeds"], key=int)]
    return Recording(
        path=path,
        engine=str(get_text(file.attrs, "engine")),
        scenario_text=str(get_text(file.attrs, "scenario")),
        libraries=dict(json.loads(str(get_text(file.attrs, "libraries")))),
        inputs=dict(json.loads(str(get_text(file.attrs, "inputs")))),
        plate=read_plate(file),
        parts=tuple(_read_part(name, file["parts"][name]) for name in sorted(file["parts"], key=_part_number)),
        records=tuple(_read_record(group) for group in groups),
        status=tuple(Status(int(group["status"][0])) for group in groups),
        unresolved_impacts=tuple(int(group["unresolved_impacts"][0]) for group in groups),
        wall_times=tuple(WallTime(*group["wall_time"][()].tolist()) for group in groups),
    )


def recording_of(run: Path) -> Recording:
    """Read the trajectory of a run folder, or a trajectory file itself.

    Raises:
        InputError: there is none, it cannot be read, or it is a link in a folder.
    """
    return read_recording(trajectory_of(run))


def trajectory_of(run: Path) -> Path:
    """The trajectory file of a run folder, or itself.

    Raises:
        InputError: there is none.
    """
    if run.suffix == ".h5" and run.is_file():
        return run
    check_no_links(run)
    trajectory = run / TRAJECTORY
    if not trajectory.is_file():
        raise InputError(f"no run here, allowed is a folder that holds {TRAJECTORY}", file=run)
    return trajectory


def _read_record(group: Any) -> Record:
    """Read one seed; a writer killed between two datasets leaves some longer than others."""

    def columns(names: Iterable[str], under: str = "") -> dict[str, NDArray[Any]]:
        n = min(group[under + name].shape[0] for name in names)
        return {name: group[under + name][:n] for name in names}

    frames = {
        name: values if values.dtype == bool else values.astype(float) for name, values in columns(FRAME_FIELDS).items()
    }
    return Record(
        Frames(**frames),
        Impacts(**columns(IMPACT_FIELDS, "impacts/")),
        Removals(**columns(REMOVAL_FIELDS, "removals/")),
        group["stops"][()],
    )


def _part_number(name: str) -> int:
    return int(name.rpartition("_")[2])


def _extend(dataset: Any, values: NDArray[Any]) -> None:
    """Append to a dataset and put it on disk."""
    start = dataset.shape[0]
    dataset.resize(start + len(values), axis=0)
    dataset[start:] = values
    dataset.flush()


def _read_part(name: str, group: Any) -> PartRecord:
    return PartRecord(name, group["vertices"][()], group["faces"][()])


def _seed_name(index: int) -> str:
    return f"seeds/{index:03d}"
