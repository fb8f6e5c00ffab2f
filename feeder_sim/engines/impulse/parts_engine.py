"""What every engine of rigid impulses has: parts as they start, the state at the last frame, and frames from rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.frame_rows import (
    ATTITUDE,
    MOMENTUM,
    POSITION,
    QUATERNION,
    ROW,
    SPIN,
    VELOCITY,
    FrameRows,
)
from feeder_sim.engines.impulse.kinds import read_kinds, rim_walls
from feeder_sim.engines.impulse.state import ABSENT, FIXED, FREE, Kinds, new_parts
from feeder_sim.engines.impulse.surroundings import exactness_of
from feeder_sim.engines.impulse.window import Drive
from feeder_sim.engines.protocol import WHOLE, new_interrupt
from feeder_sim.engines.surface_arrays import surface_arrays
from feeder_sim.machine_code import lasting
from feeder_sim.records.trajectory import BLOCK_FRAMES, Frames
from feeder_sim.scene.scene import Scene, once_per_scene
from feeder_sim.scene.start import start_poses

COLUMNS = {"position": POSITION, "velocity": VELOCITY, "attitude": ATTITUDE, "momentum": MOMENTUM}


@once_per_scene
def kinds_of(scene: Scene) -> Kinds:
    """The kinds of parts of a scene, as compiled code takes them."""
    kinds: Kinds = lasting(read_kinds(scene))
    return kinds


class PartsEngine:
    """Parts, their kinds and the surface behind the engine protocol; how they advance is said by those made of it."""

    name = "impulse"
    frames_per_block = BLOCK_FRAMES

    def __init__(self, scene: Scene, rng: np.random.Generator, *, interrupt: NDArray[np.int64] | None) -> None:
        self._scene = scene
        self._interrupt = new_interrupt() if interrupt is None else interrupt
        self._kinds, self._exact = kinds_of(scene), exactness_of(scene)
        self._n = len(scene.parts)
        self._surface = surface_arrays(scene)
        self._parts = self._start(rng)
        self._frame = 0
        self._row = self._first_row(self._parts[: self._n])  # the state at the last frame
        self._clock = np.zeros(4)  # of a single part: see `advance` of its loop

    def _start(self, rng: np.random.Generator) -> NDArray[np.void]:
        """Parts as they start, then the walls of a rim."""
        from scipy.spatial.transform import Rotation

        poses = start_poses(self._scene, rng)
        fixtures, (centres, attitudes) = self._scene.fixtures, rim_walls(self._scene)
        centres = np.concatenate([np.array([fixture.centre for fixture in fixtures]).reshape(-1, 3), centres])
        attitudes = np.concatenate([np.array([fixture.attitude for fixture in fixtures]).reshape(-1, 3, 3), attitudes])
        standing = len(self._scene.kinds) + np.minimum(np.arange(len(centres)), len(fixtures))
        principal = self._scene.principal_attitudes(np.array([pose.quaternion for pose in poses]))
        turned = Rotation.from_quat(principal, scalar_first=True).as_matrix()
        still = np.zeros_like(centres)
        spin, momentum = np.array([pose.angular_velocity for pose in poses]), np.zeros((len(poses), 3))
        for i in np.flatnonzero(spin.any(axis=1)):
            momentum[i] = turned[i] @ (self._scene.parts[i].inertia * (turned[i].T @ spin[i]))
        parts = new_parts(
            np.concatenate([[pose.position for pose in poses], centres]),
            np.concatenate([turned, attitudes]),
            np.concatenate([self._scene.kind_of, standing]),
            np.concatenate([[pose.velocity for pose in poses], still]),
            np.concatenate([momentum, still]),
        )
        for k, fixture in enumerate(fixtures, len(poses)):
            parts["offset"][k], parts["orientation"][k] = parts["position"][k], parts["attitude"][k]
            parts["phase"][k] = FIXED if fixture.moves else FREE
        parts["there"][: len(poses)][[not pose.present for pose in poses]] = ABSENT
        return parts

    def _drive(self, window: float) -> Drive:
        """The surface as it moves, for windows of a length [s]."""
        scene = self._scene
        return Drive(self._surface, scene.surface.extremes, self._exact, scene.timestep, window)

    def current(self) -> Frames:
        return self._frames(self._row[None], self._frame)

    def _rows_to_fill(self, times: NDArray[np.float64], rows: NDArray[np.float64]) -> FrameRows:
        self._interrupt[WHOLE] = 0
        return FrameRows(times, rows, self._interrupt)

    def _advanced(self, rows: NDArray[np.float64]) -> Frames:
        """The frames that are whole of those that were to be computed."""
        rows = rows[: self._interrupt[WHOLE]]
        if not len(rows):
            return self.current()[slice(0, 0)]
        self._frame += len(rows)
        self._row = rows[-1].copy()
        return self._frames(rows, self._frame - len(rows) + 1)

    def redrive(self, scene: Scene) -> None:
        self._begin_window_now()
        self._scene = scene
        self._surface = surface_arrays(scene)

    def _begin_window_now(self) -> None:
        """What happens at the last frame acts on the parts from then on; here on the only one, as it is in that."""
        now, part = self._frame * self._scene.frame_interval, self._parts[:1]
        self._clock[:] = now, 0.0, now, now
        for name, columns in COLUMNS.items():
            part[name][0] = self._row[0, columns].reshape(part[name][0].shape)
        part["clock"], part["phase"], part["supported"] = now, FREE, 0

    def _first_row(self, parts: NDArray[np.void]) -> NDArray[np.float64]:
        """The state of parts that have not moved yet, shape (parts, ROW)."""
        from scipy.spatial.transform import Rotation

        row = np.zeros((len(parts), ROW))
        for name, columns in COLUMNS.items():
            row[:, columns] = parts[name].reshape(len(parts), -1)
        row[:, QUATERNION] = Rotation.from_matrix(parts["attitude"]).as_quat(scalar_first=True)
        inertia = self._kinds.record["inertia"][parts["kind"]]
        for i in np.flatnonzero(parts["momentum"].any(axis=1)):
            turned = parts["attitude"][i]
            row[i, SPIN] = turned @ (turned.T @ parts["momentum"][i] / inertia[i])
        return row

    def _frames(self, rows: NDArray[np.float64], first: int) -> Frames:
        n = len(rows)
        return Frames(
            time=np.asarray((first + np.arange(n)) * self._scene.frame_interval, float),
            position=rows[..., POSITION],
            quaternion=self._scene.attitudes(rows[..., QUATERNION]),
            velocity=rows[..., VELOCITY],
            angular_velocity=rows[..., SPIN],
            present=np.broadcast_to(self._parts["there"][: self._n] != ABSENT, (n, self._n)).copy(),
        )
