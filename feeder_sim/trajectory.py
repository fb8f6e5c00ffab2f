"""Recorded motion: arrays in memory, and the HDF5 file that is the record of truth of a run.

Layout, schema version 1 (SI units, in the `unit` attribute of every dataset):

    /                     schema, schema_version, creator, engine, seed, scenario (resolved TOML), libraries (JSON)
    /plate                length, width, thickness (attributes)
    /plate/x, y           (nx,), (ny,)        grid of the shapes below
    /plate/mode_shape     (n_shapes, nx, ny)  deflection per unit modal coordinate
    /plate/nodal_point    (k, 2)              points of the nodal lines of the first shape, line after line
    /plate/nodal_line     (k,)                number of the line each point belongs to
    /plate/antinode       (2,)                antinode the part starts from; NaN without nodal lines
    /drive/time, amplitude   (m,), (m, n_shapes)  envelope of each modal coordinate
    /drive/shape          (k,)                mode shape that each excitation of the scenario drives
    /parts/NAME/vertices, faces
    /seeds/NNN/time, position, quaternion, velocity, angular_velocity, present, status
    /seeds/NNN/removals/time, part, cause   of parts picked or lost; see feeder_sim.removals
    /seeds/NNN/impacts/time, until, approach_speed, departure_velocity   of a part in a guide; see feeder_sim.impacts

Quaternions have w first; velocities are in world axes. The file is written in HDF5's single-writer mode and flushed
after every block: a killed run leaves everything up to its last block readable.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim import __version__
from feeder_sim.errors import InputError, RecordingFailed
from feeder_sim.impacts import Impacts
from feeder_sim.removals import Removals

if TYPE_CHECKING:
    import h5py

SCHEMA = "feeder_sim/trajectory"
SCHEMA_VERSION = 1
BLOCK_FRAMES = 100  # frames per block and per HDF5 chunk: whole blocks compress once and waste nothing


class Status(IntEnum):
    """How the recording of one seed ended."""

    UNFINISHED = 0
    DONE = 1
    DIVERGED = 2
    LEFT_PLATE = 3


@dataclass(frozen=True)
class Frames:
    """States of all parts at recorded times, in SI units and world axes.

    Attributes:
        time: [s], shape (n,).
        position: of the centres of mass [m], shape (n, parts, 3).
        quaternion: w first, shape (n, parts, 4).
        velocity: [m/s], shape (n, parts, 3).
        angular_velocity: [rad/s], shape (n, parts, 3).
        present: False once a part has been taken out of the scene, shape (n, parts).
    """

    time: NDArray[np.float64]
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    velocity: NDArray[np.float64]
    angular_velocity: NDArray[np.float64]
    present: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.time)

    def as_stored(self) -> Frames:
        """Rounded as a trajectory file rounds it, so that measures do not depend on where frames come from."""
        stored = {name: getattr(self, name).astype(kind) for name, (_, kind, _) in FRAME_FIELDS.items()}
        return Frames(**{name: v if v.dtype == bool else v.astype(float) for name, v in stored.items()})

    def __getitem__(self, rows: slice) -> Frames:
        return Frames(*(getattr(self, field.name)[rows] for field in fields(self)))

    @staticmethod
    def joined(blocks: Sequence[Frames]) -> Frames:
        """Concatenate blocks in time."""
        return Frames(*(np.concatenate([getattr(b, field.name) for b in blocks]) for field in fields(Frames)))


# name: (unit, stored type, shape per part); single precision is ample for what no measure differentiates.
FRAME_FIELDS: dict[str, tuple[str, str, tuple[int, ...]]] = {
    "time": ("s", "f8", ()),
    "position": ("m", "f8", (3,)),
    "quaternion": ("1", "f4", (4,)),
    "velocity": ("m/s", "f4", (3,)),
    "angular_velocity": ("rad/s", "f4", (3,)),
    "present": ("1", "?", ()),
}


IMPACT_FIELDS = {"time": "s", "until": "s", "approach_speed": "m/s", "departure_velocity": "m/s"}
REMOVAL_FIELDS = {"time": ("s", "f8"), "part": ("1", "i8"), "cause": ("1", "i8")}
EVENT_CHUNK = 256  # rows of impacts and removals
FRAME_CHUNK_PARTS = 500  # parts times frames in a chunk, about: small chunks can be written while little is computed


@dataclass(frozen=True)
class PlateRecord:
    """What a recording holds about the plate; see the module's layout for shapes."""

    length: float
    width: float
    thickness: float
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    mode_shape: NDArray[np.float64]
    nodal_lines: tuple[NDArray[np.float64], ...]
    antinode: NDArray[np.float64]
    drive_time: NDArray[np.float64]
    drive_amplitude: NDArray[np.float64]
    shape_of_excitation: NDArray[np.int64]


@dataclass(frozen=True)
class PartRecord:
    """What a recording holds about a part: its drawn mesh [m]."""

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


@dataclass(frozen=True)
class Recording:
    """A trajectory file in memory."""

    path: Path
    engine: str
    scenario_text: str
    libraries: dict[str, str]
    plate: PlateRecord
    parts: tuple[PartRecord, ...]
    seeds: tuple[Frames, ...]
    impacts: tuple[Impacts, ...]
    removals: tuple[Removals, ...]
    status: tuple[Status, ...]


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
        plate: PlateRecord,
        parts: Sequence[PartRecord],
    ) -> None:
        import h5py

        self._lock = threading.Lock()
        self._path = path
        self._failed: RecordingFailed | None = None
        self._file = h5py.File(path, "w-", libver="latest")
        self._file.attrs.update(
            schema=SCHEMA,
            schema_version=SCHEMA_VERSION,
            creator=f"feeder_sim {__version__}",
            engine=engine,
            seed=seed,
            scenario=scenario_text,
            libraries=json.dumps(libraries),
        )
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

    def append(self, seed_index: int, frames: Frames, impacts: Impacts, removals: Removals) -> None:
        """Append a block of one seed and put it on disk.

        Raises:
            RecordingFailed: it cannot be written, as when the disk is full.
        """
        with self._lock:
            if self._failed:  # the cause, whichever seed is heard first
                raise self._failed
            try:
                self._append(seed_index, frames, impacts, removals)
            except (OSError, RuntimeError) as error:
                self._failed = RecordingFailed(f"{self._path}: cannot be written, is the disk full? ({error})")
                raise self._failed from error

    def _append(self, seed_index: int, frames: Frames, impacts: Impacts, removals: Removals) -> None:
        group = self._file[_seed_name(seed_index)]
        for name in FRAME_FIELDS:
            _extend(group[name], getattr(frames, name))
        for name in IMPACT_FIELDS if len(impacts) else ():
            _extend(group[f"impacts/{name}"], getattr(impacts, name))
        for name in REMOVAL_FIELDS if len(removals) else ():
            _extend(group[f"removals/{name}"], getattr(removals, name))

    def finish(self, seed_index: int, status: Status) -> None:
        """Note how a seed ended."""
        with self._lock:
            if self._failed:
                return
            dataset = self._file[f"{_seed_name(seed_index)}/status"]
            dataset[0] = int(status)
            dataset.flush()

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
            dataset.attrs["unit"] = unit
        events = {f"impacts/{name}": (unit, "f8") for name, unit in IMPACT_FIELDS.items()}
        events |= {f"removals/{name}": described for name, described in REMOVAL_FIELDS.items()}
        for name, (unit, dtype) in events.items():
            name = f"{_seed_name(index)}/{name}"
            dataset = self._file.create_dataset(
                name, (0,), maxshape=(None,), chunks=(EVENT_CHUNK,), dtype=dtype, compression="gzip", shuffle=True
            )
            dataset.attrs["unit"] = unit
        _write(self._file, f"{_seed_name(index)}/status", np.array([int(Status.UNFINISHED)]), "1")


def read_recording(path: Path) -> Recording:
    """Read a trajectory file, also one whose writer was killed.

    Raises:
        InputError: missing, truncated, not HDF5, not a trajectory, another schema version.
    """
    if not path.is_file():
        raise InputError("no such trajectory file", file=path)
    try:
        with _open(path) as file:
            found, version = file.attrs.get("schema"), file.attrs.get("schema_version")
            if found != SCHEMA:
                raise InputError(f"is {found!r}, allowed is a trajectory ({SCHEMA!r})", file=path, key="schema")
            if version != SCHEMA_VERSION:
                raise InputError(f"is {version!r}, allowed is {SCHEMA_VERSION}", file=path, key="schema_version")
            groups = [file[f"seeds/{name}"] for name in sorted(file["seeds"], key=int)]
            return Recording(
                path=path,
                engine=str(file.attrs["engine"]),
                scenario_text=str(file.attrs["scenario"]),
                libraries=dict(json.loads(file.attrs["libraries"])),
                plate=_read_plate(file),
                parts=tuple(_read_part(name, file["parts"][name]) for name in sorted(file["parts"], key=_part_number)),
                seeds=tuple(_read_frames(group) for group in groups),
                impacts=tuple(_read_impacts(group) for group in groups),
                removals=tuple(_read_removals(group) for group in groups),
                status=tuple(Status(int(group["status"][0])) for group in groups),
            )
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
        raise InputError("not a readable trajectory file (truncated or of another format)", file=path) from error


def _open(path: Path) -> h5py.File:
    """Open for reading; a file whose writer was killed is still marked as being written."""
    import h5py

    try:
        return h5py.File(path, "r")
    except OSError:
        return h5py.File(path, "r", swmr=True, libver="latest")


def _read_frames(group: Any) -> Frames:
    """Read one seed; a writer killed between two datasets leaves some longer than others."""
    names = [name for name in FRAME_FIELDS if name in group]
    n = min(group[name].shape[0] for name in names)
    read = {name: group[name][:n] for name in names}
    # Recordings of before parts could be taken out do not say that they are there.
    present = read.pop("present", np.ones(read["position"].shape[:2], bool))
    return Frames(**{name: values.astype(float) for name, values in read.items()}, present=present)


def _read_impacts(group: Any) -> Impacts:
    """Read the impacts of one seed, cut like its frames; recordings of before there were any have none."""
    if "impacts" not in group:
        return Impacts.none()
    n = min(group[f"impacts/{name}"].shape[0] for name in IMPACT_FIELDS)
    return Impacts(*(group[f"impacts/{name}"][:n] for name in IMPACT_FIELDS))


def _read_removals(group: Any) -> Removals:
    """Read the removals of one seed, cut like its frames."""
    if "removals" not in group:
        return Removals.none()
    n = min(group[f"removals/{name}"].shape[0] for name in REMOVAL_FIELDS)
    return Removals(*(group[f"removals/{name}"][:n] for name in REMOVAL_FIELDS))


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
    group.attrs.update(length=plate.length, width=plate.width, thickness=plate.thickness, unit="m")
    lines = plate.nodal_lines
    points = np.concatenate(lines) if lines else np.zeros((0, 2))
    numbers = np.concatenate([np.full(len(line), i) for i, line in enumerate(lines)]) if lines else np.zeros(0)
    _write(file, "plate/x", plate.x, "m")
    _write(file, "plate/y", plate.y, "m")
    _write(file, "plate/mode_shape", plate.mode_shape, "1")
    _write(file, "plate/nodal_point", points, "m")
    _write(file, "plate/nodal_line", numbers.astype(np.int64), "1")
    _write(file, "plate/antinode", plate.antinode, "m")
    _write(file, "drive/time", plate.drive_time, "s")
    _write(file, "drive/amplitude", plate.drive_amplitude, "m")
    _write(file, "drive/shape", plate.shape_of_excitation, "1")


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
        drive_time=file["drive/time"][()],
        drive_amplitude=file["drive/amplitude"][()],
        # Of before there were schedules: one shape per drive.
        shape_of_excitation=file["drive/shape"][()]
        if "shape" in file["drive"]
        else np.arange(len(group["mode_shape"])),
    )


def _seed_name(index: int) -> str:
    return f"seeds/{index:03d}"


def _write(file: h5py.File, name: str, values: NDArray[Any], unit: str) -> None:
    compression = {"compression": "gzip", "shuffle": True} if values.size > 1000 else {}
    file.create_dataset(name, data=values, **compression).attrs["unit"] = unit
