"""Recorded motion in memory: frames of all parts, and all that a run records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from feeder_sim.notebook import block, counted
from feeder_sim.part.stable_poses import PoseTable
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.plate.outline import Outline
from feeder_sim.records.arrivals import Arrivals
from feeder_sim.records.counts import Counts
from feeder_sim.records.impacts import Impacts
from feeder_sim.records.removals import Removals

SAME_TIME = 1e-9  # [s]; times this close are the same but for round-off
MOST_SEEDS = 20  # that a notebook shows of a recording
BLOCK_FRAMES = 300  # frames per HDF5 chunk, and about as many are computed between two looks of the guard


class Status(IntEnum):
    """How the recording of one seed ended."""

    UNFINISHED = 0
    DONE = 1
    DIVERGED = 2
    LEFT_PLATE = 3


def endings(status: Sequence[Status]) -> str:
    """How many seeds there are, and how they ended: "4 seeds (3 done, 1 diverged)"."""
    ways = [f"{status.count(way)} {way.name.lower().replace('_', ' ')}" for way in Status if way in status]
    return f"{counted(len(status), 'seed')} ({', '.join(ways) or 'none'})"


class PlateArea(Protocol):
    """What has a length along x and a width along y [m], centred on the origin, and perhaps an outline within."""

    @property
    def length(self) -> float: ...

    @property
    def width(self) -> float: ...

    @property
    def outline(self) -> Outline | None: ...


@dataclass(frozen=True)
class Frames:
    """States of all parts at recorded times, in SI units and world axes.

    Attributes:
        time: [s], shape (n,).
        position: of the centres of mass [m], shape (n, parts, 3).
        quaternion: attitude of the axes that each part was drawn in, w first, shape (n, parts, 4).
        velocity: [m/s], shape (n, parts, 3).
        angular_velocity: [rad/s], shape (n, parts, 3).
        present: False while a part is not in the scene: taken out, or not come yet; shape (n, parts).
    """

    time: NDArray[np.float64]
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    velocity: NDArray[np.float64]
    angular_velocity: NDArray[np.float64]
    present: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        span = f", {self.time[0]:.6g} to {self.time[-1]:.6g} s" if len(self) else ""
        return f"<Frames: {counted(len(self), 'frame')} of {counted(self.present.shape[1], 'part')}{span}>"

    def _repr_html_(self) -> str:
        arrays = [f"{name:<16} {getattr(self, name).shape!s:<14} {unit}" for name, (unit, _, _) in FRAME_FIELDS.items()]
        return block(repr(self)[1:-1], arrays)

    def as_stored(self) -> Frames:
        """Rounded as a trajectory file rounds it, so that measures do not depend on where frames come from."""
        stored = {name: getattr(self, name).astype(kind) for name, (_, kind, _) in FRAME_FIELDS.items()}
        return Frames(**{name: v if v.dtype == bool else v.astype(float) for name, v in stored.items()})

    def __getitem__(self, rows: slice | NDArray[np.int64]) -> Frames:
        return Frames(*(getattr(self, entry.name)[rows] for entry in fields(self)))

    def on_plate(self, plate: PlateArea) -> NDArray[np.bool_]:
        """Which parts are on a plate, shape (n, parts): not taken out, with their centres over it and above it."""
        half = 0.5 * np.array([plate.length, plate.width])
        over = (np.abs(self.position[..., :2]) < half).all(axis=-1)
        if plate.outline is not None:
            over &= plate.outline.holds(np.nan_to_num(self.position[..., :2], nan=np.inf))
        return np.asarray(self.present & over & (self.position[..., 2] > 0.0))

    def row_at(self, time: float) -> int:
        """Index of the first frame at or after a time [s], or of the last one."""
        return min(int(np.searchsorted(self.time, time - SAME_TIME)), len(self) - 1)

    @staticmethod
    def joined(blocks: Sequence[Frames]) -> Frames:
        """Concatenate blocks in time."""
        return Frames(*(np.concatenate([getattr(b, entry.name) for b in blocks]) for entry in fields(Frames)))


# name: (unit, stored type, shape per part); single precision is ample for what no measure differentiates.
FRAME_FIELDS: dict[str, tuple[str, str, tuple[int, ...]]] = {
    "time": ("s", "f8", ()),
    "position": ("m", "f8", (3,)),
    "quaternion": ("1", "f4", (4,)),
    "velocity": ("m/s", "f4", (3,)),
    "angular_velocity": ("rad/s", "f4", (3,)),
    "present": ("1", "?", ()),
}


@dataclass(frozen=True, repr=False)
class Record:
    """What is recorded of one seed, or of a block of it.

    Attributes:
        frames: states of all parts.
        impacts: contacts of a guided part with the plate.
        removals: parts picked or lost.
        stops: when the drives of the stages stopped, in order [s]; those not listed keep to the schedule.
        arrivals: parts of refills.
    """

    frames: Frames
    impacts: Impacts
    removals: Removals
    stops: NDArray[np.float64]
    arrivals: Arrivals = field(default_factory=Arrivals.none, kw_only=True)

    def __repr__(self) -> str:
        held = [counted(len(self.impacts), "impact"), counted(len(self.removals), "removal")]
        return f"<{type(self).__name__}: {', '.join([repr(self.frames)[9:-1], *held])}>"

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Rows of each."""
        return len(self.frames), len(self.impacts), len(self.removals), len(self.stops), len(self.arrivals)

    def begin(self, sizes: Sequence[int]) -> Record:
        """The first rows of each."""
        frames, impacts, removals, stops, arrivals = (slice(size) for size in sizes)
        return Record(
            self.frames[frames],
            self.impacts[impacts],
            self.removals[removals],
            self.stops[stops],
            arrivals=self.arrivals[arrivals],
        )

    @staticmethod
    def joined(blocks: Sequence[Record]) -> Record:
        """Concatenate blocks in time."""
        return Record(
            Frames.joined([block.frames for block in blocks]),
            Impacts.joined([block.impacts for block in blocks]),
            Removals.joined([block.removals for block in blocks]),
            np.concatenate([block.stops for block in blocks]),
            arrivals=Arrivals.joined([block.arrivals for block in blocks]),
        )


@dataclass(frozen=True, repr=False)
class SeedRecord(Record):
    """What is recorded of one seed, and how it ended.

    Attributes:
        status: how it ended.
        readings: what the measures have read of all its frames, by their names, where not all frames were kept.
    """

    status: Status
    readings: Mapping[str, Any] | None = field(default=None, kw_only=True)

    def __repr__(self) -> str:
        return f"{super().__repr__()[:-1]}, {self.status.name.lower()}>"


@dataclass(frozen=True, repr=False)
class PlateRecord:
    """What a recording holds about the plate.

    Attributes:
        length, width, thickness: [m].
        x, y: grid of the shapes [m], shapes (nx,) and (ny,).
        mode_shape: deflection per unit modal coordinate, shape (n_shapes, nx, ny).
        nodal_lines: of the first shape, each (n, 2) [m]; empty where no transport is measured.
        antinode: that the part starts from, shape (2,) [m]; NaN without nodal lines.
        drives: one per excitation of the scenario.
        outline: of a plate that is no whole rectangle.
    """

    length: float
    width: float
    thickness: float
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    mode_shape: NDArray[np.float64]
    nodal_lines: tuple[NDArray[np.float64], ...]
    antinode: NDArray[np.float64]
    drives: tuple[ModalDrive, ...]
    outline: Outline | None = None

    def __repr__(self) -> str:
        size = f"{1e3 * self.length:g} x {1e3 * self.width:g} x {1e3 * self.thickness:g} mm"
        return f"<PlateRecord: {size}, {counted(len(self.drives), 'drive')}>"


@dataclass(frozen=True, repr=False)
class PartRecord:
    """What a recording holds about a part, in the axes it was drawn in.

    Attributes:
        name: of the part.
        vertices, faces: drawn mesh, from the centre of mass, shapes (n, 3) [m] and (m, 3).
        centre: of mass, from the origin of its file, shape (3,) [m].
        principal_axes: their attitude, quaternion (4,), w first.
        poses: its stable poses.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    centre: NDArray[np.float64]
    principal_axes: NDArray[np.float64]
    poses: PoseTable

    def __repr__(self) -> str:
        return f"<PartRecord {self.name}: {counted(len(self.faces), 'triangle')}>"


class WallTime(NamedTuple):
    """What a seed has cost [s], and how long the ensemble had taken when that was noted [s]."""

    seed: float
    ensemble: float


@dataclass(frozen=True, repr=False)
class Recording:
    """A trajectory file in memory.

    Attributes:
        libraries: their versions, and that of the package.
        inputs: SHA-256 of the files the scenario reads, by its keys.
        records, status, counts, wall_times: one entry per seed.
    """

    path: Path
    engine: str
    scenario_text: str
    libraries: dict[str, str]
    inputs: dict[str, str]
    plate: PlateRecord
    parts: tuple[PartRecord, ...]
    records: tuple[Record, ...]
    status: tuple[Status, ...]
    counts: tuple[Counts, ...]
    wall_times: tuple[WallTime, ...]

    def __repr__(self) -> str:
        held = [counted(len(self.parts), "part"), endings(self.status), f"engine {self.engine}"]
        return f"<Recording {self.path}: {', '.join(held)}>"

    def _repr_html_(self) -> str:
        seeds = zip(self.records, self.status, strict=True)
        lines = [f"{n:>3}  {status.name.lower():<11} {record!r}" for n, (record, status) in enumerate(seeds)]
        more = [f"... and {len(lines) - MOST_SEEDS} more"] if len(lines) > MOST_SEEDS else []
        return block(repr(self)[1:-1], [*lines[:MOST_SEEDS], *more])

    @property
    def seeds(self) -> tuple[Frames, ...]:
        """Frames of every seed."""
        return tuple(record.frames for record in self.records)
