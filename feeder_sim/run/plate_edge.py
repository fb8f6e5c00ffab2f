"""Where parts are relative to the edge of the plate: over it, clear of the edge, fallen beside it, or lost.

The sides of the plate stop nothing. A part that tips over the edge may swing under the plate by twice its size until
the next frame, and go on falling below the plate. So a part that has once come down beside the plate counts as *fallen*
until it rises above the resting surface again. It is *lost* once it is off the plate and below the floor level.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.scene import Scene


class PlateEdge:
    """Follows the parts of one seed, block after block of frames.

    Args:
        scene: has the plate and the parts.
        first: frames with the state at the start.
        crest: largest height of the surface over the resting plate [m].
    """

    def __init__(self, scene: Scene, first: Frames, crest: float) -> None:
        self._rim, self._crest = scene.rim, crest
        self._floor = 1e-3 * scene.scenario.run.floor_mm
        self._half_sides = 0.5 * np.array([scene.surface.length, scene.surface.width])
        self._frame_interval = scene.frame_interval
        self._sizes = np.array([kind.size for kind in scene.kinds])[scene.kind_of]
        self._enclosed = scene.rim or any(scene.guides)  # no part can get over the edge
        self.last_fallen = np.zeros(first.position.shape[1], bool)  # at the last frame of the block before

    def over(self, position: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether positions (..., 3) [m] are above or below the area of the plate, shape (...)."""
        return np.asarray((np.abs(position[..., :2]) < self._half_sides).all(axis=-1))

    def clear_of(self, frames: Frames) -> NDArray[np.bool_]:
        """Frames and parts (n, parts) so far from the edge that they cannot have been over it since the last frame."""
        margin = self._sizes[:, None] * np.ones(2)
        if not self._enclosed:
            margin = 2.0 * self._sizes.max() + np.abs(frames.velocity[..., :2]) * self._frame_interval
        return np.asarray((np.abs(frames.position[..., :2]) < self._half_sides - margin).all(axis=-1))

    def fallen(self, frames: Frames) -> NDArray[np.bool_]:
        """Frames and parts (n, parts) that have come down beside the plate and have not risen above it since."""
        height = frames.position[..., 2]
        below = height < -self._crest
        if self._rim or not (below.any() or self.last_fallen.any()):
            return np.zeros(below.shape, bool)
        beside = below & ~self.clear_of(frames)
        fallen = np.empty(beside.shape, bool)
        before = self.last_fallen
        for row in range(len(fallen)):
            fallen[row] = before = (before & (height[row] < 0.0)) | beside[row]
        return fallen

    def lost(self, frames: Frames) -> NDArray[np.bool_]:
        """Frames and parts (n, parts) that are off the plate and below the floor level."""
        off = ~self.over(frames.position) | self.fallen(frames)
        return np.asarray(frames.present & off & (frames.position[..., 2] < self._floor))

    def remember(self, frames: Frames) -> None:
        """Go on to the next block of frames; this one has at least one frame."""
        self.last_fallen = self.fallen(frames)[-1]
