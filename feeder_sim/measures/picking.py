"""Parts that a robot could pick: of the right kind, the right side up, with room around them."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.part.stable_poses import NONE, ROUND, axis_up
from feeder_sim.records.seed import Cause, Seed
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Outlet, Pick, Robot
from feeder_sim.scene.gripper import Gripper, read_gripper
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.timetable import TimedStage

# The picks of a seed one by one: when, which kind, in which stable pose, and where; picks.csv of a run folder.

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
    stage_index = np.abs(time[:, None] - ends).argmin(axis=1) if len(time) else np.empty(0, np.int64)
    row = [frames.row_at(t) for t in time]
    pose, yaw = _lying(scene, part, frames.quaternion[row, part])
    return Picks(
        time=time,
        clock=time + robot.camera_s * (stage_index + 1) + robot.pick_s * np.arange(1, len(time) + 1),
        cycle=np.array([stage.cycle for stage in stages], np.int64)[stage_index],
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


COVERED = 1e-4  # [m]; parts that overlap by less in plan view only touch
MOST_YAWS = 12  # of a part that is round, at which its gripper is tried


def nearest_neighbours(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance [m] of every point (n, 2) to the nearest other one, shape (n,); infinite for a single point."""
    from scipy.spatial import cKDTree

    if len(points) < 2:
        return np.full(len(points), np.inf)
    return np.asarray(cKDTree(points).query(points, k=2)[0][:, 1])


def isolated(position: NDArray[np.float64], candidates: NDArray[np.bool_], clearance: float) -> NDArray[np.bool_]:
    """Which parts are farther than a clearance [m] from all others in plan view, shape (n,).

    Args:
        position: centres of all parts, shape (n, 3) [m].
        candidates: which parts count, shape (n,); the others are neither picked nor neighbours.
        clearance: smallest distance to the next candidate.
    """
    free = np.zeros(len(position), bool)
    index = np.flatnonzero(candidates)
    free[index] = nearest_neighbours(position[index, :2]) > clearance
    return free


def pickable(scene: Scene, picks: Sequence[Pick], frames: Frames) -> NDArray[np.int64]:
    """Indices (m,) of the parts that at least one of several picks may take, in the last of some frames."""
    last = frames[slice(-1, None)]
    there = scene.on_plate(last)[0]
    selected = np.zeros(len(scene.parts), bool)
    for pick in picks:
        selected |= _selected(scene, pick, last, there)
    return np.flatnonzero(selected)


def _selected(scene: Scene, pick: Pick, last: Frames, there: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which parts one pick takes in a frame, (parts,)."""
    selected = there & is_right(scene, pick, last.quaternion[0])
    if pick.clearance_mm is not None:
        selected &= isolated(last.position[0], there, pick.clearance_mm * 1e-3)
    if pick.shape is not None:
        gripper = read_gripper(pick.shape)
        room = _Neighbours(scene, last, there)
        for part in np.flatnonzero(selected):
            selected[part] = room.has_room(int(part), gripper)
    return selected


def is_right(scene: Scene, rule: Pick | Outlet, quaternion: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which parts (parts,) have the kind and the side up that a pick or an outlet wants, at attitudes (parts, 4)."""
    right = np.ones(len(scene.parts), bool)
    if rule.part is not None:
        right &= scene.kind_of == scene.scenario.kind_names.index(rule.part)
    if rule.up:
        in_pose = np.array([name in rule.up for name in scene.pose_names(quaternion)])
        right &= in_pose | axis_up(quaternion, rule.up)
    return right


class _Neighbours:
    """Plan view and height of all parts that are there in a frame."""

    def __init__(self, scene: Scene, last: Frames, there: NDArray[np.bool_]) -> None:
        import shapely
        from scipy.spatial.transform import Rotation

        self._scene, self._last = scene, last
        self._index = np.flatnonzero(there)
        outlines, tops = [], []
        place = last.position[0, self._index]
        height = scene.surface.heights(place[:, :2], np.repeat(last.time, len(place)))  # a tray may be anywhere
        for part, at in zip(self._index, place - height[:, None] * [0.0, 0.0, 1.0], strict=True):
            kind = scene.kinds[scene.kind_of[part]]
            turn = Rotation.from_quat(last.quaternion[0, part], scalar_first=True)
            bodies = [turn.apply(corners) + at for corners in kind.pieces or (kind.corners,)]
            flat = [shapely.convex_hull(shapely.MultiPoint(body[:, :2])).buffer(kind.corner_radius) for body in bodies]
            outlines.append(shapely.union_all(flat))
            tops.append(max(float(body[:, 2].max()) for body in bodies) + kind.corner_radius)
        self._outlines, self._tops = outlines, tops
        self._tree = shapely.STRtree(outlines)

    def has_room(self, part: int, gripper: Gripper) -> bool:
        """Whether the fingers meet no other part, at one of the yaws at which the part looks the same.

        A part that lies over or under another one, as seen from above, would take it along.
        """
        outline = self._outlines[int(np.flatnonzero(self._index == part)[0])].buffer(-COVERED)
        if len(self._tree.query(outline, predicate="intersects")) > 1:  # itself is one
            return False
        table, attitude = self._scene.poses[self._scene.kind_of[part]], self._last.quaternion[0, part : part + 1]
        yaw, pose = float(table.yaw(attitude)[0]), int(table.number(attitude)[0])
        yaws = table.poses[pose].yaws if pose != NONE else 1
        if yaws >= ROUND or not table.poses:  # round there, or a ball
            yaws = MOST_YAWS
        place = self._last.position[0, part]
        return any(not self._is_met(gripper.placed(place, yaw + 2.0 * np.pi * n / yaws), part) for n in range(yaws))

    def _is_met(self, gripper: Gripper, part: int) -> bool:
        """Whether a finger stands in another part than the one it picks."""
        for finger in gripper.outlines(max(self._tops)):
            for k in self._tree.query(finger, predicate="intersects"):
                if self._index[k] != part and any(
                    lower.intersects(self._outlines[k]) for lower in gripper.outlines(self._tops[k])
                ):
                    return True
        return False
