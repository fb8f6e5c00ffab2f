"""When a part on a level plate has too little energy left to roll out of the pose that it is in.

Its centre of mass is never lower than h(d) = max v.d over its corners v, d the direction down in its axes. Contacts
only take energy, so that d stays where m g h(d) is below the energy. To get from one face to the next it has to pass
the lowest of the ways between them, which goes along edges of the hull: from everywhere else h falls towards them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from feeder_sim.part.stable_poses import BARRIER, NONE, PoseTable

LOOKS = 33  # at a great circle
ROUND_OFF = 1e-9  # of a height


@dataclass(frozen=True)
class Barriers:
    """The ways out of the poses of a part.

    Attributes:
        corners: with which it touches a plate, about its centre of mass, (n, 3) [m].
        table: its stable poses.
    """

    corners: NDArray[np.float64]
    table: PoseTable

    @cached_property
    def heights(self) -> NDArray[np.float64]:
        """Of the centre of mass, without which a part cannot leave a pose, (poses,) [m]; infinite without another one.

        Faces that a rotation of the part takes to each other are one pose, but leaving one for the other counts, unless
        the way is all but level.
        """
        nodes, heights, edges = _edges(self.corners)
        escape = np.full(len(self.table.poses), np.inf)
        parent = np.arange(len(nodes))
        lowest = heights.copy()  # of each tree
        poses = [{int(k)} for k in self._nearest(nodes)]

        def root(i: int) -> int:
            while parent[i] != i:
                parent[i] = i = parent[parent[i]]
            return i

        for height, i, j in edges:
            a, b = sorted((root(i), root(j)), key=lambda k: lowest[k])
            if a == b:
                continue
            another = poses[a] != poses[b] and height > (1.0 + ROUND_OFF) * lowest[b]
            if another or height > (1.0 + BARRIER) * lowest[b]:
                for k in poses[a] | poses[b]:
                    escape[k] = min(escape[k], height)
                poses[a] |= poses[b]
            parent[b] = a
        return escape

    def _nearest(self, down: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.stack([(down @ pose.down.T).max(axis=1) for pose in self.table.poses], axis=1).argmax(axis=1)

    def decided(self, down: NDArray[np.float64], height: NDArray[np.float64]) -> NDArray[np.int64]:
        """The pose that a part can no longer leave, or `NONE`, (n,).

        Args:
            down: in its axes (n, 3).
            height: to which all its energy would lift its centre of mass over the plate, (n,) [m].
        """
        pose = np.full(len(down), NONE)
        some = np.flatnonzero(height < self.heights.max(initial=0.0))
        along = [down[some] @ each.down.T for each in self.table.poses]
        nearest = np.stack([each.max(axis=1) for each in along], axis=1).argmax(axis=1)
        goal = np.array([self.table.poses[k].down[along[k][i].argmax()] for i, k in enumerate(nearest)]).reshape(-1, 3)
        fraction = np.linspace(0.0, 1.0, LOOKS)[:, None, None]
        path = (1.0 - fraction) * down[some] + fraction * goal
        path /= np.linalg.norm(path, axis=2, keepdims=True)
        steps = np.arccos(np.clip((path[1:] * path[:-1]).sum(axis=2), -1.0, 1.0))
        # Between two looks a corner is lower than at the nearer one over the cosine of half the angle.
        top = (path @ self.corners.T).max(axis=2).max(axis=0) / np.cos(0.5 * steps.max(axis=0, initial=0.0))
        below = np.maximum(height[some], top) < self.heights[nearest]
        pose[some[below]] = nearest[below]
        return pose


def _edges(
    corners: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[tuple[float, int, int]]]:
    """Faces of a hull and the ways between them.

    Outward normals (faces, 3) and distances from the centre of mass (faces,) [m]; of every edge the largest height on
    the way over it [m] and the two faces, the lowest first.
    """
    from scipy.spatial import ConvexHull

    size = float(np.abs(corners).max())
    hull = ConvexHull(corners / size)
    normals, heights = hull.equations[:, :3], -size * hull.equations[:, 3]
    face, beside = np.repeat(np.arange(len(normals)), 3), hull.neighbors.ravel()
    ends = hull.simplices[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)  # of the edge towards each neighbour
    face, beside, ends = face[once := face < beside], beside[once], ends[once]
    start, along = corners[ends[:, 0]], corners[ends[:, 1]] - corners[ends[:, 0]]
    foot = start - ((start * along).sum(axis=1) / (along**2).sum(axis=1))[:, None] * along
    middle = normals[face] + normals[beside]
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    distance = np.linalg.norm(foot, axis=1)
    saddle = (foot * middle).sum(axis=1) > distance * (normals[face] * middle).sum(axis=1)
    top = np.where(saddle, distance, np.maximum(heights[face], heights[beside]))
    order = top.argsort()
    edges = list(zip(top[order].tolist(), face[order].tolist(), beside[order].tolist(), strict=True))
    return normals, heights, edges
