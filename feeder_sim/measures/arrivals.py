"""Transport by a schedule: duration of every stage, place of the parts at its end, and parts that reach the goal.

A part has *arrived* if it is on the plate and within `goal.within_mm` of the goal at the end of the schedule.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.protocol import FindingsBase, Measure, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.notebook import counted
from feeder_sim.records.seed import Seed, Status
from feeder_sim.records.trajectory import SAME_TIME, Frames
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene


@dataclass(frozen=True, repr=False)
class TransportStage(FindingsBase):
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


@dataclass(frozen=True, repr=False)
class ArrivalFindings(FindingsBase):
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


@dataclass(frozen=True)
class StageEnd:
    """How one seed comes to the end of one stage: drive time [s], whether its parts settled, mean place (2,) [mm]."""

    drive: float
    settled: bool
    place: NDArray[np.float64]


@dataclass(frozen=True)
class SeedArrivals:
    """What is read of a seed.

    Attributes:
        arrived: which parts are at the goal, shape (parts,).
        end: of the schedule [s].
        travelled: distance between the mean places of the parts at the start and at the end [mm].
        stages: one entry per stage; None for those that it did not reach the end of.
    """

    arrived: NDArray[np.bool_]
    end: float
    travelled: float
    stages: tuple[StageEnd | None, ...]


class Arrivals(Measure[ArrivalFindings, SeedArrivals]):
    """How many parts a schedule brings to its goal."""

    headline = ("arrival_time_s", "travelled_mm")

    counts = (Status.DONE, Status.LEFT_PLATE)

    def applies(self, prepared: Prepared) -> bool:
        return prepared.scenario.goal is not None

    missing: ClassVar[Mapping[str, str]] = {
        "arrival_time_s": "in no seed did all parts reach the goal",
        "travelled_mm": "in no seed was a part on the plate at the end",
    }

    def reader(self, prepared: Prepared) -> Callable[[Seed], SeedArrivals]:
        scene = prepared.scene

        def read(seed: Seed) -> SeedArrivals:
            displacement = 1e3 * (_mean_place(scene, seed.frames, -1) - _mean_place(scene, seed.frames, 0))
            return SeedArrivals(
                arrived=arrived(scene, seed.frames),
                end=scene.stages(seed.stops.tolist())[-1].end,
                travelled=float(np.hypot(*displacement)),
                stages=_stage_ends(scene, seed),
            )

        return read

    def findings(self, prepared: Prepared, readings: Sequence[SeedArrivals]) -> ArrivalFindings:
        stages = prepared.scene.times.stages
        return ArrivalFindings(
            at_goal=sum(int(seed.arrived.sum()) for seed in readings),
            at_goal_of=sum(len(seed.arrived) for seed in readings),
            arrival_time_s=Statistic.of(seed.end for seed in readings if seed.arrived.all()),
            travelled_mm=Statistic.of(seed.travelled for seed in readings),
            transport_stages=tuple(
                _stage(stage.name, [seed.stages[number] for seed in readings]) for number, stage in enumerate(stages)
            ),
        )

    def lines(self, prepared: Prepared, findings: ArrivalFindings) -> list[str]:
        lines = [labelled("arrived", f"{findings.at_goal} of {findings.at_goal_of}")]
        for label, statistic, unit in (
            ("travelled", findings.travelled_mm, "mm"),
            ("time", findings.arrival_time_s, "s"),
        ):
            if statistic.n:
                spread = f", SD {statistic.sd:.2f}" if statistic.n > 1 else ""
                lines.append(
                    labelled(label, f"{statistic.mean:.2f} {unit}{spread}, n = {counted(statistic.n, 'seed')}")
                )
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
    return np.asarray(scene.on_plate(frames[slice(-1, None)])[0] & (distance <= goal.within_mm))


def arrival_time(scene: Scene, seed: Seed) -> float:
    """End of the schedule [s] in a seed whose parts all arrived; NaN in others.

    Raises:
        ValueError: the scenario has no goal.
    """
    return scene.stages(seed.stops.tolist())[-1].end if arrived(scene, seed.frames).all() else math.nan


def _mean_place(scene: Scene, frames: Frames, row: int) -> NDArray[np.float64]:
    """Mean (x, y) [m] of the parts on the plate in one frame, shape (2,); NaN without parts."""
    on_plate = scene.on_plate(frames[slice(row, row + 1 or None)])[0]
    return frames.position[row, on_plate, :2].mean(axis=0) if on_plate.any() else np.full(2, np.nan)


def _stage_ends(scene: Scene, seed: Seed) -> tuple[StageEnd | None, ...]:
    """The ends of all stages in one seed; None where the seed ended before, since all parts had left the plate."""
    ends: list[StageEnd | None] = []
    for planned, stage in zip(scene.times.stages, scene.stages(seed.stops.tolist()), strict=True):
        if seed.frames.time[-1] < stage.end - scene.frame_interval:
            ends.append(None)
            continue
        drive = stage.stop - stage.start
        place = 1e3 * _mean_place(scene, seed.frames, seed.frames.row_at(stage.end))
        ends.append(StageEnd(drive, drive < planned.stop - planned.start - SAME_TIME, place))
    return tuple(ends)


def _stage(name: str, ends: Sequence[StageEnd | None]) -> TransportStage:
    """Findings of a stage of a name, over the seeds that reached its end."""
    reached = [end for end in ends if end is not None]
    x, y = (Statistic.of(end.place[axis] for end in reached) for axis in (0, 1))
    return TransportStage(name, Statistic.of(end.drive for end in reached), sum(end.settled for end in reached), x, y)
