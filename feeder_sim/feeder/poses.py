"""What a camera over the plate sees: where the parts on it are, and how they lie."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.notebook import counted, line, table
from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.scene import Scene


@dataclass(frozen=True, repr=False)
class Poses:
    """The parts on the plate at one time, in the order of their numbers.

    Attributes:
        time: [s].
        part: number of each part, shape (n,); what `Feeder.pick` takes.
        position: of the centres of mass [m], shape (n, 3); the top of the resting plate is z = 0.
        quaternion: attitude of the axes that each part was drawn in, w first, shape (n, 4).
        kind: name of the kind of each part.
        pose: name of the stable pose that it lies in; None in none of them, and for kinds that have none.
    """

    time: float
    part: NDArray[np.int64]
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    kind: tuple[str, ...]
    pose: tuple[str | None, ...]

    def __len__(self) -> int:
        return len(self.part)

    def __repr__(self) -> str:
        kinds = Counter(self.kind)
        of = f" ({', '.join(f'{number} {kind}' for kind, number in kinds.items())})" if len(kinds) > 1 else ""
        return line(f"Poses at {self.time:.6g} s: {counted(len(self), 'part')} on the plate{of}")

    def _repr_html_(self) -> str:
        return table(repr(self)[1:-1], list(self._rows()))

    def _rows(self) -> Iterator[dict[str, Any]]:
        """A row per part."""
        for part, place, kind, pose in zip(self.part, self.position, self.kind, self.pose, strict=True):
            x, y, z = (float(1e3 * value) for value in place)
            yield {"part": int(part), "kind": kind, "pose": pose, "x_mm": x, "y_mm": y, "z_mm": z}


def poses_of(scene: Scene, now: Frames) -> Poses:
    """The parts on the plate in the last of some frames."""
    last = now[slice(-1, None)]
    part = np.flatnonzero(scene.on_plate(last)[0])
    lying, names = scene.pose_names(last.quaternion[0]), scene.scenario.kind_names
    return Poses(
        time=float(last.time[0]),
        part=part,
        position=last.position[0, part].copy(),
        quaternion=last.quaternion[0, part].copy(),
        kind=tuple(names[scene.kind_of[i]] for i in part),
        pose=tuple(lying[i] for i in part),
    )
