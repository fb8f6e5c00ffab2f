"""What a schedule does to the one part it carries: where every stage leaves it, how long that takes, who arrives.

A part has *arrived* that is within `goal.within_mm` of the goal at the end of the schedule, and on the plate.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures import Statistic
from feeder_sim.scene import Scene
from feeder_sim.timetable import timetable
from feeder_sim.trajectory import Frames, Record


def arrived(scene: Scene, frames: Frames) -> NDArray[np.bool_]:
    """Which parts are at the goal in the last frame, shape (parts,).

    Raises:
        ValueError: the scenario has no goal.
    """
    goal = scene.scenario.goal
    if goal is None:
        raise ValueError("the scenario has no goal")
    x, y, z = frames.position[-1].T * 1e3
    off = np.hypot(x - goal.x_mm, 0.0 if goal.y_mm is None else y - goal.y_mm)
    return np.asarray(frames.present[-1] & (z > 0.0) & (off <= goal.within_mm))


def _middle(frames: Frames, row: int) -> NDArray[np.float64]:
    """Mean place [m] of the parts on the plate in a frame, shape (2,); NaN without any."""
    there = frames.present[row] & (frames.position[row, :, 2] > 0.0)
    return frames.position[row, there, :2].mean(axis=0) if there.any() else np.full(2, np.nan)


def transport_measures(scene: Scene, seeds: Sequence[Record]) -> dict[str, Any]:
    """Share of parts that arrived, the time it took, and the mean place [mm] at the end of every stage.

    The times are those of seeds whose parts have all arrived; a stage is *settled* when its parts, not its time limit,
    ended it.
    """
    seeds = [seed for seed in seeds if len(seed.frames)]
    there = [arrived(scene, seed.frames) for seed in seeds]
    times = [timetable(scene.scenario, seed.stops.tolist()).stages for seed in seeds]
    whole = [i for i, at in enumerate(there) if at.all()]
    stages = []
    for number, planned in enumerate(scene.times.stages):
        took, settled, places = [], [], []
        for seed, actual in zip(seeds, times, strict=True):
            if seed.frames.time[-1] < actual[number].end - scene.frame_interval:
                continue  # it had left the plate
            row = min(int(np.searchsorted(seed.frames.time, actual[number].end - 1e-9)), len(seed.frames) - 1)
            took.append(actual[number].stop - actual[number].start)
            settled.append(took[-1] < planned.stop - planned.start - 1e-9)
            places.append(1e3 * _middle(seed.frames, row))
        x, y = (Statistic.of(place[axis] for place in places).as_dict() for axis in (0, 1))
        duration = Statistic.of(took).as_dict()
        stages.append({"stage": planned.name, "drive_s": duration, "settled": sum(settled), "x_mm": x, "y_mm": y})
    way = [1e3 * (_middle(seed.frames, -1) - _middle(seed.frames, 0)) for seed in seeds]
    return {
        "at_goal": sum(int(at.sum()) for at in there),
        "at_goal_of": sum(len(at) for at in there),
        "arrival_time_s": Statistic.of(times[i][-1].end for i in whole).as_dict(),
        "travelled_mm": Statistic.of(float(np.hypot(*w)) for w in way).as_dict(),
        "transport_stages": stages,
    }
