"""The groups /plate and /drive of a trajectory file; their layout stands there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.hdf5_text import put_array, put_text
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.plate.outline_group import read_outline, write_outline
from feeder_sim.records.recording import PlateRecord

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
    )


def _read_drives(group: Any) -> tuple[ModalDrive, ...]:
    rows = zip(*(group[name][()].tolist() for name in DRIVE_FIELDS), strict=True)
    drives = [dict(zip(DRIVE_FIELDS, row, strict=True)) for row in rows]
    return tuple(
        ModalDrive(**drive | {"damping_ratio": None if np.isnan(drive["damping_ratio"]) else drive["damping_ratio"]})
        for drive in drives
    )
