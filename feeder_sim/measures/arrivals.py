"""Transport by a schedule: duration of every stage, place of the parts at its end, and parts that reach the goal.

A part has *arrived* if it is on the plate and within `goal.within_mm` of the goal at the end of the schedule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.protocol import ended, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.trajectory import SAME_TIME, Frames, SeedRecord
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene


@dataclass(frozen=True)
class TransportStage:
    """One stage, over the seeds that reached its end.

    Attributes:
        stage: its name.
        drive_s: how long the drives acted.
        settled: number of seeds in which the parts settled before the time limit of the stage.
        x_mm, y_mm: mean place of the parts at the end of the stage.
    """

    stage: str
    drive_s: Statistic
    settled: int
    x_mm: Statistic
    y_mm: Statistic


@dataclass(frozen=True)
class ArrivalFindings:
    """Findings over the seeds that ran to their end.

    Attributes:
        at_goal, at_goal_of: parts that arrived, and all parts, of all seeds together.
        arrival_time_s: end of the schedule, over the seeds in which all parts arrived.
        travelled_mm: distance between the mean places of the parts at the start and at the end.
        transport_stages: one entry per stage.
    """

    at_goal: int
    at_goal_of: int
    arrival_time_s: Statistic
    travelled_mm: Statistic
    transport_stages: tuple[TransportStage, ...]


class Arrivals:
    """How many parts a schedule brings to its goal."""

    def applies(self, prepared: Prepared) -> bool:
        return prepared.scenario.goal is not None

    def compute(self, prepared: Prepared, seeds: Sequence[SeedRecord]) -> ArrivalFindings:
        scene, counted = prepared.scene, ended(seeds, left_plate=True)
        arrivals = [arrived(scene, seed.frames) for seed in counted]
        ends = [scene.stages(seed.stops.tolist())[-1].end for seed in counted]
        ways = [1e3 * (_mean_place(scene, seed.frames, -1) - _mean_place(scene, seed.frames, 0)) for seed in counted]
        return ArrivalFindings(
            at_goal=sum(int(parts.sum()) for parts in arrivals),
            at_goal_of=sum(len(parts) for parts in arrivals),
            arrival_time_s=Statistic.of(end for end, parts in zip(ends, arrivals, strict=True) if parts.all()),
            travelled_mm=Statistic.of(float(np.hypot(*way)) for way in ways),
            transport_stages=tuple(_stage(scene, number, counted) for number in range(len(scene.times.stages))),
        )

    def lines(self, prepared: Prepared, findings: ArrivalFindings) -> list[str]:
        lines = [labelled("arrived", f"{findings.at_goal} of {findings.at_goal_of}")]
        for label, statistic, unit in (
            ("travelled", findings.travelled_mm, "mm"),
            ("time", findings.arrival_time_s, "s"),
        ):
            if statistic.n:
                spread = f", SD {statistic.sd:.2f}" if statistic.n > 1 else ""
                lines.append(labelled(label, f"{statistic.mean:.2f} {unit}{spread}, n = {statistic.n} seeds"))
        return lines


def arrived(scene: Scene, frames: Frames) -> NDArray[np.bool_]:
    """Which parts are at the goal in the last frame, shape (parts,).

    Raises:
        ValueError: the scenario has no goal.
    """
    goal = scene.scenario.goal
    if goal is None:
        raise ValueError("the scenario has no goal")
    x, y = frames.position[-1, :, :2].T * 1e3
    distance = np.hypot(x - goal.x_mm, 0.0 if goal.y_mm is None else y - goal.y_mm)
    return np.asarray(frames[slice(-1, None)].on_plate(scene.surface)[0] & (distance <= goal.within_mm))


def _mean_place(scene: Scene, frames: Frames, row: int) -> NDArray[np.float64]:
    """Mean (x, y) [m] of the parts on the plate in one frame, shape (2,); NaN without parts."""
    on_plate = frames[slice(row, row + 1 or None)].on_plate(scene.surface)[0]
    return frames.position[row, on_plate, :2].mean(axis=0) if on_plate.any() else np.full(2, np.nan)


def _stage(scene: Scene, number: int, seeds: Sequence[SeedRecord]) -> TransportStage:
    """Findings of the stage of a number, over the seeds that reached its end."""
    planned = scene.times.stages[number]
    durations, settled, places = [], 0, []
    for seed in seeds:
        stage = scene.stages(seed.stops.tolist())[number]
        if seed.frames.time[-1] < stage.end - scene.frame_interval:
            continue  # the seed ended before the stage, since all parts had left the plate
        durations.append(stage.stop - stage.start)
        settled += durations[-1] < planned.stop - planned.start - SAME_TIME
        places.append(1e3 * _mean_place(scene, seed.frames, seed.frames.row_at(stage.end)))
    x, y = (Statistic.of(place[axis] for place in places) for axis in (0, 1))
    return TransportStage(planned.name, Statistic.of(durations), settled, x, y)
