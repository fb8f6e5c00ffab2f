"""Recorded motion in memory: frames of all parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from feeder_sim.notebook import block, counted
from feeder_sim.plate.outline import Outline

SAME_TIME = 1e-9  # [s]; times this close are the same but for round-off
BLOCK_FRAMES = 300  # frames per HDF5 chunk, and about as many are computed between two looks of the guard


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
        """Rounded as the file of a seed rounds it, so that measures do not depend on where frames come from."""
        stored = {name: getattr(self, name).astype(kind) for name, (_, kind, _) in FRAME_FIELDS.items()}
        return Frames(**{name: v if v.dtype == bool else v.astype(float) for name, v in stored.items()})

    def __getitem__(self, rows: slice | NDArray[np.int64]) -> Frames:
        return Frames(*(getattr(self, name)[rows] for name in FRAME_FIELDS))

    def on_plate(self, plate: PlateArea, height: NDArray[np.float64] | float) -> NDArray[np.bool_]:
        """Which parts are on a plate, shape (n, parts): not taken out, with their centres over it and above it.

        height: of the surface under each centre (n, parts), or the least that it may be [m].
        """
        half = 0.5 * np.array([plate.length, plate.width])
        over = (np.abs(self.position[..., :2]) < half).all(axis=-1)
        if plate.outline is not None:
            over &= plate.outline.holds(np.nan_to_num(self.position[..., :2], nan=np.inf))
        return np.asarray(self.present & over & (self.position[..., 2] > height))

    def row_at(self, time: float) -> int:
        """Index of the first frame at or after a time [s], or of the last one."""
        return min(int(np.searchsorted(self.time, time - SAME_TIME)), len(self) - 1)

    @staticmethod
    def joined(blocks: Sequence[Frames]) -> Frames:
        """Concatenate blocks in time."""
        return Frames(*(np.concatenate([getattr(block, name) for block in blocks]) for name in FRAME_FIELDS))


# name: (unit, stored type, shape per part); single precision is ample for what no measure differentiates.
FRAME_FIELDS: dict[str, tuple[str, str, tuple[int, ...]]] = {
    "time": ("s", "f8", ()),
    "position": ("m", "f8", (3,)),
    "quaternion": ("1", "f4", (4,)),
    "velocity": ("m/s", "f4", (3,)),
    "angular_velocity": ("rad/s", "f4", (3,)),
    "present": ("1", "?", ()),
}
