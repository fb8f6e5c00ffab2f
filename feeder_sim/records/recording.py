"""What is recorded of a run, in memory: the plate, the parts and the seeds of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.hdf5 import put_array, put_text
from feeder_sim.notebook import block, counted
from feeder_sim.part.stable_poses import PoseTable, StablePose, pose_names
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.plate.mode_file import read_outline, write_outline
from feeder_sim.plate.outline import Outline
from feeder_sim.records.seed import Seed, Status, endings
from feeder_sim.records.trajectory import Frames

# The groups /plate and /drive of a recording; the layout stands in trajectory_file.py.

DRIVE_FIELDS = {
    "shape": "1",
    "drive_frequency": "Hz",
    "natural_frequency": "Hz",
    "amplitude": "m",
    "phase": "rad",
    "damping_ratio": "1",
}


def write_plate(file: Any, plate: PlateRecord) -> None:
    """Write what is kept of a plate and its drives."""
    group = file.create_group("plate")
    group.attrs.update(length=plate.length, width=plate.width, thickness=plate.thickness)
    put_text(group.attrs, {"unit": "m"})
    lines = plate.nodal_lines
    points = np.concatenate(lines) if lines else np.zeros((0, 2))
    numbers = np.concatenate([np.full(len(line), i) for i, line in enumerate(lines)]) if lines else np.zeros(0)
    put_array(file, "plate/x", plate.x, "m")
    put_array(file, "plate/y", plate.y, "m")
    put_array(file, "plate/mode_shape", plate.mode_shape, "1")
    put_array(file, "plate/nodal_point", points, "m")
    put_array(file, "plate/nodal_line", numbers.astype(np.int64), "1")
    put_array(file, "plate/antinode", plate.antinode, "m")
    if plate.outline is not None:
        write_outline(file, "plate/outline", plate.outline)
    for fixture in plate.fixtures:
        put_array(file, f"fixtures/{fixture.name}/vertices", fixture.vertices, "m")
        put_array(file, f"fixtures/{fixture.name}/faces", fixture.faces, "1")
        put_array(file, f"fixtures/{fixture.name}/centre", fixture.centre, "m")
        put_array(file, f"fixtures/{fixture.name}/axis", fixture.axis, "1")
    for name, corners in plate.outlets.items():
        put_array(file, f"outlets/{name}", corners, "m")
    for name, unit in DRIVE_FIELDS.items():
        values = [getattr(drive, name) for drive in plate.drives]
        put_array(file, f"drive/{name}", np.array([np.nan if value is None else value for value in values]), unit)


def read_plate(file: Any) -> PlateRecord:
    """Read it back.

    Raises:
        InputError: its outline is damaged.
    """
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
        outline=read_outline(
            group,
            "outline",
            (float(group.attrs["length"]), float(group.attrs["width"])),
            Path(str(file.filename)) if hasattr(file, "filename") else Path("trajectory.h5"),
        ),
        fixtures=tuple(
            FixtureRecord(name, *(each[key][()] for key in ("vertices", "faces", "centre", "axis")))
            for name, each in (file["fixtures"].items() if "fixtures" in file else ())
        ),
        outlets={name: each[()] for name, each in (file["outlets"].items() if "outlets" in file else ())},
    )


def _read_drives(group: Any) -> tuple[ModalDrive, ...]:
    rows = zip(*(group[name][()].tolist() for name in DRIVE_FIELDS), strict=True)
    drives = [dict(zip(DRIVE_FIELDS, row, strict=True)) for row in rows]
    return tuple(
        ModalDrive(**drive | {"damping_ratio": None if np.isnan(drive["damping_ratio"]) else drive["damping_ratio"]})
        for drive in drives
    )


# The groups /parts/NAME of a recording; the layout stands in trajectory_file.py.


def write_part(file: Any, part: PartRecord) -> None:
    """Write what is kept of a part."""
    group = f"parts/{part.name}"
    for name, unit in (("vertices", "m"), ("faces", "1"), ("centre", "m"), ("principal_axes", "1")):
        put_array(file, f"{group}/{name}", getattr(part, name), unit)
    poses = part.poses.poses
    pose = np.repeat(np.arange(len(poses)), [len(p.down) for p in poses])
    put_array(file, f"{group}/poses/height", np.array([p.height for p in poses], float), "m")
    put_array(file, f"{group}/poses/chance", np.array([p.chance for p in poses], float), "1")
    put_array(file, f"{group}/poses/yaws", np.array([p.yaws for p in poses], np.int64), "1")
    put_array(file, f"{group}/poses/pose", pose.astype(np.int64), "1")
    put_array(file, f"{group}/poses/down", np.concatenate([np.empty((0, 3)), *(p.down for p in poses)]), "1")
    put_array(file, f"{group}/poses/attitude", np.concatenate([np.empty((0, 4)), *(p.attitude for p in poses)]), "1")


def read_part(name: str, group: Any) -> PartRecord:
    """Read it back."""
    poses = {key: values[()] for key, values in group["poses"].items()}
    of = [poses["pose"] == n for n in range(len(poses["height"]))]
    table = PoseTable(
        tuple(
            StablePose(letter, float(height), float(chance), poses["down"][rows], poses["attitude"][rows], int(yaws))
            for letter, height, chance, yaws, rows in zip(
                pose_names(), poses["height"], poses["chance"], poses["yaws"], of, strict=False
            )
        )
    )
    vertices, faces, centre, axes = (group[key][()] for key in ("vertices", "faces", "centre", "principal_axes"))
    return PartRecord(name, vertices, faces, centre, axes, table)


MOST_SEEDS = 20  # that a notebook shows
DISPLAY_POINTS = 121  # per axis of the plate: enough for the shortest wave of the catalogue, small enough to scrub


@dataclass(frozen=True)
class FixtureRecord:
    """What stands on the plate, where it is at rest: its name, vertices (n, 3) [m], and triangles (m, 3) of them.

    What turns does so about an axis (3,) through a centre (3,) [m].
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    centre: NDArray[np.float64]
    axis: NDArray[np.float64]


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
        fixtures: what stands on it.
        outlets: corners (n, 2) [m] of each outlet seen from above, by its name.
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
    fixtures: tuple[FixtureRecord, ...] = ()
    outlets: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    @property
    def trough(self) -> float:
        """How far below z = 0 the surface may be, at most, while one drive acts [m]."""
        return max((d.largest * float(np.abs(self.mode_shape[d.shape]).max()) for d in self.drives), default=0.0)

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
    """What is recorded of a run.

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
        facts = [counted(len(self.parts), "part"), endings(self.status), f"engine {self.engine}"]
        return f"<Recording {self.path}: {', '.join(facts)}>"

    def _repr_html_(self) -> str:
        lines = [f"{n:>3}  {record!r}" for n, record in enumerate(self.records)]
        more = [f"... and {len(lines) - MOST_SEEDS} more"] if len(lines) > MOST_SEEDS else []
        return block(repr(self)[1:-1], [*lines[:MOST_SEEDS], *more])

    @property
    def status(self) -> tuple[Status, ...]:
        """How every seed ended."""
        return tuple(record.status for record in self.records)

    @property
    def started_seeds(self) -> tuple[Seed, ...]:
        """The seeds that had begun; the first stands for all where none had."""
        return tuple(seed for index, seed in enumerate(self.records) if index == 0 or len(seed.frames))

    @property
    def seeds(self) -> tuple[Frames, ...]:
        """Frames of every seed."""
        return tuple(record.frames for record in self.records)
