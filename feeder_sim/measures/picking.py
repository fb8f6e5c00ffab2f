"""Parts that a robot could pick: of the right kind, the right side up, with room around them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from feeder_sim.part.stable_poses import NONE, ROUND
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Pick
from feeder_sim.scene.gripper import Gripper, read_gripper
from feeder_sim.scene.scene import Scene

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
    there = last.on_plate(scene.surface)[0]
    taken = np.zeros(len(scene.parts), bool)
    for pick in picks:
        taken |= _taken(scene, pick, last, there)
    return np.flatnonzero(taken)


def _taken(scene: Scene, pick: Pick, last: Frames, there: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which parts one pick takes in a frame, (parts,)."""
    taken = there.copy()
    if pick.part is not None:
        taken &= scene.kind_of == scene.scenario.kind_names.index(pick.part)
    if pick.up:
        taken &= np.array([name in pick.up for name in scene.pose_names(last.quaternion[0])])
    if pick.clearance_mm is not None:
        taken &= isolated(last.position[0], there, pick.clearance_mm * 1e-3)
    if pick.shape is not None:
        gripper = read_gripper(pick.shape)
        room = _Neighbours(scene, last, there)
        for part in np.flatnonzero(taken):
            taken[part] = room.has_room(int(part), gripper)
    return taken


class _Neighbours:
    """Plan view and height of all parts that are there in a frame."""

    def __init__(self, scene: Scene, last: Frames, there: NDArray[np.bool_]) -> None:
        import shapely
        from scipy.spatial.transform import Rotation

        self._scene, self._last = scene, last
        self._index = np.flatnonzero(there)
        outlines, tops = [], []
        for part in self._index:
            kind, at = scene.kinds[scene.kind_of[part]], last.position[0, part]
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
        own = self._outlines[int(np.flatnonzero(self._index == part)[0])].buffer(-COVERED)
        if len(self._tree.query(own, predicate="intersects")) > 1:  # itself is one
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
