"""Notices states that no part over a vibrating plate can be in, and parts that have fallen off it."""

from __future__ import annotations

import numpy as np

from feeder_sim.errors import SimulationDiverged
from feeder_sim.scene import GRAVITY, Scene
from feeder_sim.trajectory import Frames


class Guard:
    """Watches one seed, block after block; looks at parts that are there only.

    A part that has fallen past the edge may swing or drift under the plate; it is remembered (`remember`).
    """

    # A part gains at most a few plate velocities per impact, and impacts take energy out; 20 is far above any hop seen.
    SPEED_FACTOR = 20.0

    def __init__(self, scene: Scene, first: Frames) -> None:
        self._scene = scene
        drives = scene.drives
        plate_speed = sum(2 * np.pi * max(d.drive_frequency, d.natural_frequency) * d.amplitude for d in drives)
        height = float(np.abs(first.position[..., 2]).max())
        self._speed = self.SPEED_FACTOR * plate_speed + 2.0 * np.sqrt(2.0 * GRAVITY * height) + 0.1
        self._crest = sum(drive.amplitude for drive in drives)
        self._floor = 1e-3 * scene.scenario.run.floor_mm
        self._size = max(kind.size for kind in scene.kinds)
        self._fallen = np.zeros(first.position.shape[1], bool)

    def check(self, frames: Frames, seed_index: int) -> tuple[int, SimulationDiverged | None]:
        """Return how many leading frames are valid, and what is wrong with the next one."""
        found = [
            (int(np.argmax(bad.any(axis=1))), cause, int(np.argmax(bad.any(axis=0))))
            for cause, bad in self._violations(frames).items()
            if bad.any()
        ]
        if not found:
            return len(frames), None
        row, cause, part = min(found)
        name = self._scene.parts[part].name
        return row, SimulationDiverged(cause=cause, time_s=float(frames.time[row]), part=name, seed=seed_index)

    def lost(self, frames: Frames) -> np.ndarray:
        """Frames and parts (n, parts) that are off the plate and below the floor level."""
        position = frames.position
        off = ~self.over(position) | self.fallen(frames)
        return np.asarray(frames.present & off & (position[..., 2] < self._floor))

    def fallen(self, frames: Frames) -> np.ndarray:
        """Frames and parts (n, parts) that have come down beside the plate and not come up again since.

        The sides of the plate stop nothing: a part that tips over the edge may swing under the plate by twice its size
        until the next frame, and fly on from there.
        """
        position = frames.position
        sides = 0.5 * np.array([self._scene.surface.length, self._scene.surface.width])
        if self._scene.rim:
            return np.zeros(position.shape[:2], bool)
        swung = 2.0 * self._size + np.abs(frames.velocity[..., :2]) * self._scene.frame_interval
        inside = (np.abs(position[..., :2]) < sides - swung).all(axis=-1)
        beside = (position[..., 2] < -self._crest) & ~inside
        found = np.empty(beside.shape, bool)
        last = self._fallen
        for row in range(len(found)):
            found[row] = last = (last & (position[row, :, 2] < 0.0)) | beside[row]
        return found

    def remember(self, frames: Frames) -> None:
        """Go on to the next block of frames."""
        if len(frames):
            self._fallen = self.fallen(frames)[-1]

    def over(self, position: np.ndarray) -> np.ndarray:
        """Whether positions (..., 3) [m] are over the plate, or under it."""
        half = 0.5 * np.array([self._scene.surface.length, self._scene.surface.width])
        return np.asarray((np.abs(position[..., :2]) < half).all(axis=-1))

    def _violations(self, frames: Frames) -> dict[str, np.ndarray]:
        position, present = frames.position, frames.present
        speed = np.linalg.norm(frames.velocity, axis=-1)
        finite = np.isfinite(position).all(axis=-1) & np.isfinite(speed)
        on = present & finite & self.over(position) & ~self.fallen(frames)
        return {
            "its state is not finite": present & ~finite,
            f"its speed exceeds {self._speed:.3g} m/s, more than this plate can give": on & (speed > self._speed),
            "its centre lies below the plate's surface": on & (position[..., 2] < -self._crest),
        }
