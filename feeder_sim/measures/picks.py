"""The picks of a seed one by one: when, which kind, in which stable pose, and where; picks.csv of a run folder."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.part.stable_poses import NONE
from feeder_sim.records.events import Cause
from feeder_sim.records.seed import Seed
from feeder_sim.scenario import Robot
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.timetable import TimedStage

COLUMNS = ("seed", "time_s", "clock_s", "cycle", "kind", "pose", "x_mm", "y_mm", "yaw_deg")
IN_NO_POSE = "none"


@dataclass(frozen=True)
class Picks:
    """Parts picked in one seed, in order of time; arrays with one entry per part.

    Attributes:
        time: simulated [s].
        clock: when the robot has the part [s]: the simulated time, and that of robot and camera up to then.
        cycle: 0 for a stage that prepares the parts.
        kind: index of the part table.
        pose: name of the stable pose; "none" in none of those of the kind, "" for a kind that has none.
        place: of the centre of mass, shape (n, 2) [m].
        yaw: see `PoseTable.yaw` [rad].
    """

    time: NDArray[np.float64]
    clock: NDArray[np.float64]
    cycle: NDArray[np.int64]
    kind: NDArray[np.int64]
    pose: NDArray[np.str_]
    place: NDArray[np.float64]
    yaw: NDArray[np.float64]


def pick_stages(scene: Scene, record: Seed) -> list[TimedStage]:
    """The stages of a seed with a pick at their end; a program that picks by hand looks at the end of every stage."""
    stages = scene.stages(record.stops.tolist())
    return [stage for stage in stages if stage.picks or (picks_by_hand(scene) and stage.cycle)]


def picks_by_hand(scene: Scene) -> bool:
    """Whether a program picks parts, besides what the stages say."""
    schedule = scene.scenario.schedule
    return schedule is not None and schedule.by_hand


def robot_of(scene: Scene) -> Robot:
    """The times of the robot and the camera; without a table they take none."""
    return scene.scenario.robot or Robot()


def has_picks(scene: Scene) -> bool:
    """Whether anything is picked in a scene, by its stages or by a program."""
    return picks_by_hand(scene) or any(stage.picks for stage in scene.times.stages)


def picks_of(scene: Scene, seed: Seed) -> Picks:
    """The picks of one seed."""
    if seed.readings is not None:  # its frames were dropped
        picks: Picks = seed.readings[picks_of.__name__]
        return picks
    record = seed
    frames, removals, robot = record.frames, record.removals, robot_of(scene)
    picked = removals.cause == Cause.PICKED
    time, part = removals.time[picked], removals.part[picked]
    stages = pick_stages(scene, record)
    ends = np.array([stage.end for stage in stages])
    look = np.abs(time[:, None] - ends).argmin(axis=1) if len(time) else np.empty(0, np.int64)
    row = [frames.row_at(t) for t in time]
    pose, yaw = _lying(scene, part, frames.quaternion[row, part])
    return Picks(
        time=time,
        clock=time + robot.look_s * (look + 1) + robot.pick_s * np.arange(1, len(time) + 1),
        cycle=np.array([stage.cycle for stage in stages], np.int64)[look],
        kind=scene.kind_of[part],
        pose=pose,
        place=frames.position[row, part, :2],
        yaw=yaw,
    )


def _lying(
    scene: Scene, part: NDArray[np.int64], quaternion: NDArray[np.float64]
) -> tuple[NDArray[np.str_], NDArray[np.float64]]:
    """Names of the poses (n,) and yaws (n,) [rad] of parts (n,) at attitudes (n, 4)."""
    pose, yaw = np.full(len(part), "", "U8"), np.zeros(len(part))
    for kind in np.unique(scene.kind_of[part]):
        table, of_kind = scene.poses[kind], scene.kind_of[part] == kind
        yaw[of_kind] = table.yaw(quaternion[of_kind])
        if table.poses:
            number = table.number(quaternion[of_kind])
            pose[of_kind] = np.where(number == NONE, IN_NO_POSE, np.array(table.names)[number])
    return pose, yaw


def picks_csv(scene: Scene, seeds: Sequence[Seed]) -> str:
    """All picks of all seeds as the text of a CSV file, a line each."""
    written = io.StringIO()
    writer = csv.writer(written, lineterminator="\n")
    writer.writerow(COLUMNS)
    names = scene.scenario.kind_names
    for index, seed in enumerate(seeds):
        picks = picks_of(scene, seed)
        for k, (x, y) in enumerate(1e3 * picks.place):
            times = f"{picks.time[k]:.4f}", f"{picks.clock[k]:.4f}"
            lying = f"{x:.3f}", f"{y:.3f}", f"{np.degrees(picks.yaw[k]):.1f}"
            writer.writerow([index, *times, picks.cycle[k], names[picks.kind[k]], picks.pose[k], *lying])
    return written.getvalue()
