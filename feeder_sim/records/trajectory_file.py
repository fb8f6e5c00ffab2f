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
    /seeds/NNN/wall_time  (2,)                of the seed, and of the ensemble when that was noted
    /seeds/NNN/removals/time, part, cause   of parts picked or lost; see feeder_sim.removals
    /seeds/NNN/stops      (s,)                when the drives of the stages stopped; the others keep to the schedule
    /seeds/NNN/impacts/time, until, approach_speed, departure_velocity   of a part in a guide; see feeder_sim.impacts

Quaternions have w first; velocities are in world axes. The file is written in HDF5's single-writer mode and flushed
after every block: a killed run leaves everything up to its last block readable.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim import __version__
from feeder_sim.errors import InputError, RecordingFailed
from feeder_sim.hdf5_text import get_text, put_text
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.records.impacts import Impacts
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

if TYPE_CHECKING:
    import h5py

TRAJECTORY = "trajectory.h5"  # its name in a run folder
SCHEMA = "feeder_sim/trajectory"
SCHEMA_VERSION = 3
IMPACT_FIELDS = {"time": "s", "until": "s", "approach_speed": "m/s", "departure_velocity": "m/s"}
REMOVAL_FIELDS = {"time": ("s", "f8"), "part": ("1", "i8"), "cause": ("1", "i8")}
DRIVE_FIELDS = {
    "shape": "1",
    "drive_frequency": "Hz",
    "natural_frequency": "Hz",
    "amplitude": "m",
    "phase": "rad",
    "damping_ratio": "1",
}
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
        self._file = h5py.File(path, "w-", libver="latest")
        texts = {"schema": SCHEMA, "creator": f"feeder_sim {__version__}", "engine": engine, "scenario": scenario_text}
        put_text(self._file.attrs, texts | {"libraries": json.dumps(libraries), "inputs": json.dumps(inputs)})
        self._file.attrs.update(schema_version=SCHEMA_VERSION, seed=seed)
        _write_plate(self._file, plate)
        self._write_parts(parts)
        for index in range(n_seeds):
            self._create_seed(index, len(parts))
        self._file.swmr_mode = True  # from here on nothing is created, only appended

    def _write_parts(self, parts: Sequence[PartRecord]) -> None:
        """Write every mesh once; parts of one kind are links to the same data."""
        written: dict[int, str] = {}
        for part in parts:
            first = written.setdefault(id(part.vertices), part.name)
            if first == part.name:
                _write(self._file, f"parts/{part.name}/vertices", part.vertices, "m")
                _write(self._file, f"parts/{part.name}/faces", part.faces, "1")
            else:
                self._file[f"parts/{part.name}"] = self._file[f"parts/{first}"]

    def append(self, seed_index: int, block: Record) -> None:
        """Append a block of one seed and put it on disk.

        Raises:
            RecordingFailed: it cannot be written, as when the disk is full.
        """
        with self._lock:
            if self._failed:  # the cause, whichever seed is heard first
                raise self._failed
            try:
                self._append(seed_index, block)
            except (OSError, RuntimeError) as error:
                self._failed = RecordingFailed(f"{self._path}: cannot be written, is the disk full? ({error})")
                raise self._failed from error

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

    def finish(self, seed_index: int, status: Status) -> None:
        """Note how a seed ended."""
        with self._lock:
            if self._failed:
                return
            dataset = self._file[f"{_seed_name(seed_index)}/status"]
            dataset[0] = int(status)
            dataset.flush()

    def note_wall_time(self, seed_index: int, wall_time: WallTime) -> None:
        """Note what a seed has cost so far."""
        with self._lock:
            if self._failed:
                return
            dataset = self._file[f"{_seed_name(seed_index)}/wall_time"]
            dataset[:] = wall_time
            dataset.flush()

    def read_back(self, seed_index: int) -> Record:
        """Everything that has been appended of a seed."""
        with self._lock:
            return _read_record(self._file[_seed_name(seed_index)])

    def close(self) -> None:
        with self._lock:
            if not self._failed:  # HDF5 crashes when it closes what it could not write
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
                compression="gzip",
                shuffle=True,
            )
            put_text(dataset.attrs, {"unit": unit})
        events = {f"impacts/{name}": (unit, "f8") for name, unit in IMPACT_FIELDS.items()}
        events |= {f"removals/{name}": described for name, described in REMOVAL_FIELDS.items()}
        events["stops"] = ("s", "f8")
        for name, (unit, dtype) in events.items():
            name = f"{_seed_name(index)}/{name}"
            dataset = self._file.create_dataset(
                name, (0,), maxshape=(None,), chunks=(EVENT_CHUNK,), dtype=dtype, compression="gzip", shuffle=True
            )
            put_text(dataset.attrs, {"unit": unit})
        _write(self._file, f"{_seed_name(index)}/status", np.array([int(Status.UNFINISHED)]), "1")
        _write(self._file, f"{_seed_name(index)}/wall_time", np.zeros(2), "s")


def read_recording(path: Path) -> Recording:
    """Read a trajectory file, also one whose writer was killed.

    Raises:
        InputError: missing, truncated, not HDF5, not a trajectory, another schema version.
    """
    if not path.is_file():
        raise InputError("no such trajectory file", file=path)
    try:
        with _open(path) as file:
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
                plate=_read_plate(file),
                parts=tuple(_read_part(name, file["parts"][name]) for name in sorted(file["parts"], key=_part_number)),
                records=tuple(_read_record(group) for group in groups),
                status=tuple(Status(int(group["status"][0])) for group in groups),
                wall_times=tuple(WallTime(*group["wall_time"][()].tolist()) for group in groups),
            )
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
        raise InputError("not a readable trajectory file (truncated or of another format)", file=path) from error


def recording_of(run: Path) -> Recording:
    """Read the trajectory of a run folder, or a trajectory file itself.

    Raises:
        InputError: there is none, or it cannot be read.
    """
    trajectory = run if run.suffix == ".h5" else run / TRAJECTORY
    if not trajectory.is_file():
        raise InputError(f"no run here, allowed is a folder that holds {TRAJECTORY}", file=run)
    return read_recording(trajectory)


def _open(path: Path) -> h5py.File:
    """Open for reading; a file whose writer was killed is still marked as being written."""
    import h5py

    try:
        return h5py.File(path, "r")
    except OSError:
        if _is_cut(path):  # in the mode below the library waits for what is missing, for ever
            raise
        return h5py.File(path, "r", swmr=True, libver="latest")


def _is_cut(path: Path) -> bool:
    """Whether a file is shorter than its head says; one that is being written says how long it was at first."""
    with path.open("rb") as file:
        head = file.read(36)  # HDF5's superblock, version 3: signature, versions and flags, two addresses, end of file
    return len(head) < 36 or path.stat().st_size < int.from_bytes(head[28:36], "little")


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


def _write_plate(file: h5py.File, plate: PlateRecord) -> None:
    group = file.create_group("plate")
    group.attrs.update(length=plate.length, width=plate.width, thickness=plate.thickness)
    put_text(group.attrs, {"unit": "m"})
    lines = plate.nodal_lines
    points = np.concatenate(lines) if lines else np.zeros((0, 2))
    numbers = np.concatenate([np.full(len(line), i) for i, line in enumerate(lines)]) if lines else np.zeros(0)
    _write(file, "plate/x", plate.x, "m")
    _write(file, "plate/y", plate.y, "m")
    _write(file, "plate/mode_shape", plate.mode_shape, "1")
    _write(file, "plate/nodal_point", points, "m")
    _write(file, "plate/nodal_line", numbers.astype(np.int64), "1")
    _write(file, "plate/antinode", plate.antinode, "m")
    for name, unit in DRIVE_FIELDS.items():
        values = [getattr(drive, name) for drive in plate.drives]
        _write(file, f"drive/{name}", np.array([np.nan if value is None else value for value in values]), unit)


def _read_plate(file: h5py.File) -> PlateRecord:
    group = file["plate"]
    points, numbers = group["nodal_point"][()], group["nodal_line"][()]
    return PlateRecord(
        length=float(group.attrs["length"]),
        width=float(group.attrs["width"]),
        thickness=float(group.attrs["thickness"]),
        x=group["x"][()],
        y=group["y"][()],
        mode_shape=group["mode_shape"][()],
        nodal_lines=tuple(points[numbers == i] for i in np.unique(numbers)),
        antinode=group["antinode"][()],
        drives=_read_drives(file["drive"]),
    )


def _read_drives(group: Any) -> tuple[ModalDrive, ...]:
    rows = zip(*(group[name][()].tolist() for name in DRIVE_FIELDS), strict=True)
    drives = [dict(zip(DRIVE_FIELDS, row, strict=True)) for row in rows]
    return tuple(
        ModalDrive(**drive | {"damping_ratio": None if np.isnan(drive["damping_ratio"]) else drive["damping_ratio"]})
        for drive in drives
    )


def _seed_name(index: int) -> str:
    return f"seeds/{index:03d}"


def _write(file: h5py.File, name: str, values: NDArray[Any], unit: str) -> None:
    compression = {"compression": "gzip", "shuffle": True} if values.size > 1000 else {}
    put_text(file.create_dataset(name, data=values, **compression).attrs, {"unit": unit})
