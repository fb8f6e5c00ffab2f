"""Stable poses: the ways a part can lie on a level plate, named A, B, ... from the lowest centre of mass on.

Two of the faces that the hull rests on, each of a quasi-static chance (`quasi_static`), are one pose where

    the part can roll from one to the other all but level (a rod on its side), or
    a rotation of the part into itself takes one to the other (the six sides of a nut).

Mirror images are different poses, for a gripper has to treat them differently.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.part.quasi_static import resting_faces
from feeder_sim.part.rigid_part import RigidPart

NONE = -1  # the pose of a part that lies in none
WITHIN_DEG = 10.0  # largest angle between the downward direction of a part and that of its pose
LEAST_CHANCE = 2e-3  # quasi-static; a pose of less is left out
BARRIER = 0.02  # of the height: what is in the way of rolling from one pose to the next, where both count as one
NEAREST_DEG = 30.0  # poses that a part can roll between at once
ALIKE = 5e-3  # of the size: how far a turned part may stick out of itself
ALIKE_INERTIA = 0.02  # of the largest moment of inertia
MOST_POINTS = 600  # of a hull; of a finer one those farthest along as many directions
NEIGHBOURS = 12  # directions next to one
# Directions of a part as drawn that may be asked to point up: faces that look alike are one pose, but have axes.
AXES = {f"{sign}{axis}": float(f"{sign}1") * np.eye(3)[i] for i, axis in enumerate("xyz") for sign in "+-"}
TURN_TOLERANCE = 0.01  # [rad]; turns this close are one
ROUND = 24  # a part that looks the same at so many yaws is round


@dataclass(frozen=True)
class StablePose:
    """One way of lying.

    Attributes:
        name: "A" is the one with the lowest centre of mass.
        height: of the centre of mass over the plate [m].
        chance: of a part that is put down slowly from a random attitude [1].
        down: directions that point down in this pose, in the part's axes, shape (n, 3).
        attitude: in which `down` points down and the yaw is 0, quaternions (n, 4), w first.
        yaws: number of yaws at which the part looks the same.
    """

    name: str
    height: float
    chance: float
    down: NDArray[np.float64]
    attitude: NDArray[np.float64]
    yaws: int


@dataclass(frozen=True)
class PoseTable:
    """The stable poses of one part; none for a ball, which lies on any side, and for a part that stays in a plane."""

    poses: tuple[StablePose, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(pose.name for pose in self.poses)

    def number(self, quaternion: NDArray[np.float64]) -> NDArray[np.int64]:
        """Index of the pose that a part lies in at each attitude (..., 4), w first, or `NONE`; shape (...)."""
        down = downward(quaternion)
        if not self.poses:
            return np.full(down.shape[:-1], NONE)
        along = np.stack([(down @ pose.down.T).max(axis=-1) for pose in self.poses], axis=-1)
        number = along.argmax(axis=-1)
        return np.where(along.max(axis=-1) >= np.cos(np.radians(WITHIN_DEG)), number, NONE)

    def yaw(self, quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
        """Turn about the vertical [rad] against the attitude of yaw 0 of its pose, (n,), for attitudes (n, 4).

        From 0 up to the first yaw at which the part looks the same; of a part in no pose, its turn as drawn; of one
        that is round in its pose, 0.
        """
        from scipy.spatial.transform import Rotation

        number, down = self.number(quaternion), downward(quaternion)
        yaws = np.zeros(len(quaternion))
        for i, (attitude, n) in enumerate(zip(quaternion, number, strict=True)):
            level, period = np.array([1.0, 0.0, 0.0, 0.0]), 2.0 * np.pi
            if n != NONE:
                pose = self.poses[n]
                if pose.yaws >= ROUND:
                    continue
                level, period = pose.attitude[(pose.down @ down[i]).argmax()], period / pose.yaws
            turn = Rotation.from_quat(attitude, scalar_first=True) * Rotation.from_quat(level, scalar_first=True).inv()
            w, z = turn.as_quat(scalar_first=True)[[0, 3]]
            yaws[i] = (2.0 * np.arctan2(z, w)) % period  # the twist of the turn about the vertical
        return yaws


def downward(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """The direction of gravity in the part's axes, (..., 3), at attitudes (..., 4), w first."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, float), -1, 0)
    return -np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=-1)


def axis_up(quaternion: NDArray[np.float64], names: Iterable[str]) -> NDArray[np.bool_]:
    """Whether one of these `AXES` points up at attitudes (..., 4), w first; others of the names say nothing."""
    up = -downward(quaternion)
    axes = np.array([AXES[name] for name in names if name in AXES]).reshape(-1, 3)
    return np.asarray((up @ axes.T >= np.cos(np.radians(WITHIN_DEG))).any(axis=-1))


def stable_poses(part: RigidPart) -> PoseTable:
    """The stable poses of a part."""
    if len(part.corners) < 4 or (np.ptp(part.corners, axis=0) == 0.0).any():
        return PoseTable(())
    corners = _hull_points(part.vertices)
    axes = part.in_principal_axes(np.eye(3))
    inertia = axes @ np.diag(part.inertia) @ axes.T
    return _of_hull(corners.tobytes(), inertia.tobytes())


@functools.lru_cache(maxsize=64)  # the same parts for every seed and every measure
def _of_hull(corners: bytes, tensor: bytes) -> PoseTable:
    points, inertia = np.frombuffer(corners).reshape(-1, 3), np.frombuffer(tensor).reshape(3, 3)
    hull = _Hull(points, inertia)
    down, chance = resting_faces(points)
    groups = _grouped(len(down), _neighbours(down), lambda i, j: hull.rolls(down[i], down[j]))
    first = [max(group, key=lambda i: round(float(chance[i]), 6)) for group in groups]  # what stands for a group
    pairs = itertools.combinations(range(len(first)), 2)
    alike = _grouped(len(first), pairs, lambda i, j: bool(hull.rotations(down[first[i]], down[first[j]])))
    poses = []
    for family in alike:
        root = first[family[0]]
        level = _level(down[root])
        directions, attitudes = [], []
        for k in family:
            turns = hull.rotations(down[root], down[first[k]])
            turn = turns[0] if turns else np.eye(3)
            for i in groups[k]:
                directions.append(down[i])
                attitudes.append(level @ turn.T @ _rolled(down[i], down[first[k]], down[groups[k]]))
        together = float(sum(chance[i] for k in family for i in groups[k]))
        if together >= LEAST_CHANCE:
            yaws = len(hull.rotations(down[root], down[root]))
            lowest = min(hull.height(down[i]) for k in family for i in groups[k])
            poses.append(StablePose("", lowest, together, np.array(directions), _quaternions(attitudes), yaws))
    # Mirror images are equally high but for round-off.
    poses.sort(key=lambda pose: (round(pose.height / hull.size, 4), pose.down[0].round(6).tolist()))
    named = zip(pose_names(), poses, strict=False)
    return PoseTable(tuple(StablePose(name, p.height, p.chance, p.down, p.attitude, p.yaws) for name, p in named))


def pose_names() -> itertools.chain[str]:
    """A to Z, then AA, AB, ..."""
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
    return itertools.chain(letters, ("".join(pair) for pair in itertools.product(letters, repeat=2)))


class _Hull:
    """A convex hull about its centre of mass, from corners (n, 3) [m], with its inertia (3, 3) in the same axes."""

    def __init__(self, corners: NDArray[np.float64], inertia: NDArray[np.float64]) -> None:
        from scipy.spatial import ConvexHull

        self._corners, self._inertia = corners, inertia
        self.size = float(np.linalg.norm(corners, axis=1).max())
        equations = ConvexHull(corners / self.size).equations
        self._normals, self._offsets = equations[:, :3], equations[:, 3] * self.size

    def height(self, down: NDArray[np.float64]) -> float:
        """Of the centre over a plate that lies in a direction (3,) [m]."""
        return float((self._corners @ down).max())

    def rolls(self, a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
        """Whether it rolls all but level from the pose with a direction (3,) down to that with another."""
        angle = np.arccos(np.clip(a @ b, -1.0, 1.0))
        if angle > np.radians(NEAREST_DEG):
            return False
        low = min(self.height(a), self.height(b))
        path = (1.0 - np.linspace(0.0, 1.0, 33)[:, None]) * a + np.linspace(0.0, 1.0, 33)[:, None] * b
        path /= np.linalg.norm(path, axis=1, keepdims=True)
        return bool((self._corners @ path.T).max() <= (1.0 + BARRIER) * low)

    def rotations(self, a: NDArray[np.float64], b: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Rotations (3, 3) of the part into itself that take one direction (3,) to another."""
        if abs(self.height(a) - self.height(b)) > ALIKE * self.size:
            return []
        first, second = _level(a), _level(b)
        at_a, at_b = self._corners @ first.T, self._corners @ second.T
        radius = np.hypot(at_a[:, 0], at_a[:, 1])
        reference = at_a[radius.argmax()]  # goes to a corner equally high and equally far from the vertical
        near = np.abs(np.hypot(at_b[:, 0], at_b[:, 1]) - radius.max()) < ALIKE * self.size
        near &= np.abs(at_b[:, 2] - reference[2]) < ALIKE * self.size
        angles = np.arctan2(at_b[near, 1], at_b[near, 0]) - np.arctan2(reference[1], reference[0])
        matches: list[tuple[float, float, NDArray[np.float64]]] = []  # angle, how far it sticks out, turn
        for angle in np.unique((angles % (2.0 * np.pi)).round(6)):
            c, s = np.cos(angle), np.sin(angle)
            turn = second.T @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ first
            out = self._sticks_out(turn)
            if out > ALIKE * self.size:
                continue
            if matches and angle - matches[-1][0] < TURN_TOLERANCE:
                if out < matches[-1][1]:
                    matches[-1] = angle, out, turn
            else:
                matches.append((angle, out, turn))
        if len(matches) > 1 and matches[0][0] + 2.0 * np.pi - matches[-1][0] < TURN_TOLERANCE:
            del matches[0 if matches[0][1] > matches[-1][1] else -1]
        return [turn for _, _, turn in matches]

    def _sticks_out(self, turn: NDArray[np.float64]) -> float:
        """How far the turned part sticks out of itself [m]; infinite where its inertia is another."""
        changed = np.abs(turn @ self._inertia @ turn.T - self._inertia).max()
        if changed > ALIKE_INERTIA * np.abs(self._inertia).max():
            return np.inf
        return float(((self._corners @ turn.T) @ self._normals.T + self._offsets).max())


def _level(down: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rotation (3, 3) that takes a direction (3,) down by the shortest way."""
    from scipy.spatial.transform import Rotation

    axis = np.cross(down, [0.0, 0.0, -1.0])
    sine, cosine = np.linalg.norm(axis), -down[2]
    axis = axis / sine if sine > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.asarray(Rotation.from_rotvec(np.arctan2(sine, cosine) * axis).as_matrix())


def _rolled(a: NDArray[np.float64], b: NDArray[np.float64], group: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rotation (3, 3) that takes a direction (3,) of a group (n, 3) to another one, about the axis of the group."""
    from scipy.spatial.transform import Rotation

    if len(group) < 3:
        return _level(b).T @ _level(a)
    axis = np.linalg.eigh(np.cov(group.T))[1][:, 0]
    p, q = a - (a @ axis) * axis, b - (b @ axis) * axis
    about = Rotation.from_rotvec(np.arctan2(np.cross(p, q) @ axis, p @ q) * axis).as_matrix()
    correction = _level(b).T @ _level(about @ a)  # a group is not quite on a cone
    return np.asarray(correction @ about)


def _quaternions(attitudes: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(np.array(attitudes)).as_quat(scalar_first=True))


def _hull_points(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vertices of the convex hull of points (n, 3) [m], or enough of them to stand for it.

    Not the contact corners: what is left of a fine mesh there need not be as symmetric as the part.
    """
    from scipy.spatial import ConvexHull

    points = vertices[ConvexHull(vertices / np.abs(vertices).max()).vertices]
    if len(points) > MOST_POINTS:
        i = np.arange(MOST_POINTS)  # directions spread evenly, a Fibonacci lattice
        z, turn = 1.0 - (2.0 * i + 1.0) / MOST_POINTS, np.pi * (3.0 - np.sqrt(5.0)) * i
        flat = np.sqrt(1.0 - z * z)
        directions = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
        points = points[np.unique((points @ directions.T).argmax(axis=0))]
    return np.ascontiguousarray(points, float)


def _neighbours(down: NDArray[np.float64]) -> set[tuple[int, int]]:
    """Pairs of directions (n, 3) next to each other; a part that rolls farther rolls through those between."""
    from scipy.spatial import cKDTree

    nearest = cKDTree(down).query(down, k=min(len(down), NEIGHBOURS + 1))[1].reshape(len(down), -1)
    return {(min(i, j), max(i, j)) for i, row in enumerate(nearest.tolist()) for j in row if i != j}


def _grouped(n: int, pairs: Iterable[tuple[int, int]], together: Callable[[int, int], bool]) -> list[list[int]]:
    """Numbers 0 to n - 1 in groups of those that a relation links, of the pairs that are looked at."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    linked = [(i, j) for i, j in pairs if together(i, j)]
    rows, columns = np.array(linked, np.int64).reshape(-1, 2).T
    _, label = connected_components(coo_array((np.ones(len(rows)), (rows, columns)), shape=(n, n)), directed=False)
    return [np.flatnonzero(label == k).tolist() for k in range(label.max() + 1)]
