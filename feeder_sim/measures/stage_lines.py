"""Nodal lines of every stage's modes: who is near them, and when all parts have settled there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.nodal_lines import NodalLines, nodal_lines
from feeder_sim.records.trajectory import SAME_TIME, Frames
from feeder_sim.scene.scene import Scene


@dataclass(frozen=True)
class StageLines:
    """Nodal lines of every stage's modes."""

    of_stage: tuple[tuple[NodalLines, ...], ...]

    def near(self, stage: int, points: NDArray[np.float64], distance: float) -> NDArray[np.bool_]:
        """Points (n, 2) within a distance [m] of a nodal line of each of the stage's modes; none where nothing acts."""
        lines = self.of_stage[stage]
        close = np.full(len(points), bool(lines))
        for line in lines:
            close &= line.distance(points) < distance
        return close


def stage_lines(scene: Scene) -> StageLines:
    """Trace the nodal lines of the modes of every stage."""
    traced = {drive.shape: nodal_lines(scene.surface, drive.shape) for drive in scene.drives}
    shapes = [[scene.drives[i].shape for i in stage.excitations] for stage in scene.times.stages]
    return StageLines(tuple(tuple(traced[shape] for shape in dict.fromkeys(of_stage)) for of_stage in shapes))


def settled(scene: Scene, lines: StageLines, number: int, frames: Frames) -> bool:
    """Whether the parts have settled in a stage by the last of these frames, which reach back far enough to tell.

    Parts that are not there, or on their way down beside the plate, do not count; without any others nothing settles.
    """
    stage = scene.times.stages[number]
    if stage.until is None or not len(frames):
        return False
    since = frames.time[-1] - stage.until.for_s
    if since < max(stage.start, frames.time[0]) - SAME_TIME:
        return False
    last = frames[slice(int(np.searchsorted(frames.time, since - SAME_TIME)), None)]
    points = last.position[last.on_plate(scene.surface)][:, :2]
    return len(points) > 0 and bool(lines.near(number, points, 1e-3 * stage.until.within_mm).all())
