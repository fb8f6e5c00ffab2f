"""Nodal lines of every stage's modes: which parts are near them, and whether all parts have settled there."""

from __future__ import annotations

import functools
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.nodal_lines import NodalLines, nodal_lines
from feeder_sim.records.trajectory import SAME_TIME, Frames
from feeder_sim.scene.scene import Scene

# What is made of a scene once, and asked for by every seed of it.

T = TypeVar("T")


def once_for_scene(function: Callable[[Scene], T]) -> Callable[[Scene], T]:
    """The function, which remembers what it gave for the last scene as long as that scene lives.

    Threads may call it; at worst they all compute the same.
    """
    last: list[tuple[weakref.ref[Scene], T]] = []

    @functools.wraps(function)
    def remembered(scene: Scene) -> T:
        for scene_ref, value in tuple(last):
            if scene_ref() is scene:
                return value
        value = function(scene)
        last[:] = [(weakref.ref(scene, lambda _: last.clear()), value)]
        return value

    return remembered


@dataclass(frozen=True)
class StageLines:
    """Nodal lines of every stage's modes.

    Attributes:
        of_stage: for every stage the lines of each of its modes.
    """

    of_stage: tuple[tuple[NodalLines, ...], ...]

    def near(self, stage: int, points: NDArray[np.float64], distance: float) -> NDArray[np.bool_]:
        """Whether points (n, 2) [m] are within a distance [m] of a nodal line of each mode of a stage, shape (n,).

        In a stage without drives no point is.
        """
        modes = self.of_stage[stage]
        near = np.full(len(points), bool(modes))
        for lines in modes:
            near &= lines.distance(points) < distance
        return near


@once_for_scene
def stage_lines(scene: Scene) -> StageLines:
    """Nodal lines of the modes of every stage of a scene."""
    lines = {drive.shape: nodal_lines(scene.surface, drive.shape) for drive in scene.drives}
    stages = [dict.fromkeys(scene.drives[i].shape for i in stage.excitations) for stage in scene.times.stages]
    return StageLines(tuple(tuple(lines[shape] for shape in shapes) for shapes in stages))


def settled(scene: Scene, lines: StageLines, number: int, frames: Frames) -> bool:
    """Whether the parts meet the condition `until` of a stage at the last of some frames.

    Parts that have been taken out or are not over the plate do not count; without any other part nothing has settled.

    Args:
        scene: has the stages.
        lines: their nodal lines.
        number: of the stage, over the whole timetable.
        frames: the latest frames. They have to reach back by `until.for_s`, or the parts count as not settled.
    """
    stage = scene.times.stages[number]
    if stage.until is None or not len(frames):
        return False
    since = frames.time[-1] - stage.until.for_s
    if since < max(stage.start, frames.time[0]) - SAME_TIME:
        return False
    last = frames[slice(int(np.searchsorted(frames.time, since - SAME_TIME)), None)]
    points = last.position[scene.on_plate(last)][:, :2]
    return len(points) > 0 and bool(lines.near(number, points, 1e-3 * stage.until.within_mm).all())
