"""A trajectory file in memory: the plate, the parts and the seeds of a run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.notebook import block, counted
from feeder_sim.part.stable_poses import PoseTable
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.plate.outline import Outline
from feeder_sim.records.seed import Seed, Status, endings
from feeder_sim.records.trajectory import Frames

MOST_SEEDS = 20  # that a notebook shows


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


@dataclass(frozen=True, repr=False)
class Recording:
    """A trajectory file in memory.

    Attributes:
        libraries: their versions, and that of the package.
        inputs: SHA-256 of the files the scenario reads, by its keys.
        records: one entry per seed.
        wall_s: elapsed wall time of the ensemble [s].
    """

    path: Path
    engine: str
    scenario_text: str
    libraries: dict[str, str]
    inputs: dict[str, str]
    plate: PlateRecord
    parts: tuple[PartRecord, ...]
    records: tuple[Seed, ...]
    wall_s: float

    def __repr__(self) -> str:
        held = [counted(len(self.parts), "part"), endings(self.status), f"engine {self.engine}"]
        return f"<Recording {self.path}: {', '.join(held)}>"

    def _repr_html_(self) -> str:
        lines = [f"{n:>3}  {record!r}" for n, record in enumerate(self.records)]
        more = [f"... and {len(lines) - MOST_SEEDS} more"] if len(lines) > MOST_SEEDS else []
        return block(repr(self)[1:-1], [*lines[:MOST_SEEDS], *more])

    @property
    def status(self) -> tuple[Status, ...]:
        """How every seed ended."""
        return tuple(record.status for record in self.records)

    @property
    def begun(self) -> tuple[Seed, ...]:
        """The seeds that had begun; the first stands for all where none had."""
        return tuple(seed for index, seed in enumerate(self.records) if index == 0 or len(seed.frames))

    @property
    def seeds(self) -> tuple[Frames, ...]:
        """Frames of every seed."""
        return tuple(record.frames for record in self.records)
