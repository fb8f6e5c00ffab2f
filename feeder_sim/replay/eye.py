"""The eye of a 3D view, placed so that what is to be seen fills the pane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FIELD_OF_VIEW = np.radians(55.0)  # of rerun's viewer, from the lower to the upper edge of a pane
MARGIN = 0.04  # of the half pane, left free on each side
OBLIQUE = (0.0, -0.62, 0.95)  # from what is seen to the eye
UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Eye:
    """Where the eye is and where it looks [mm]."""

    position: NDArray[np.float64]
    target: NDArray[np.float64]

    def seen(self, points: ArrayLike, aspect: float) -> NDArray[np.float64]:
        """Places (n, 2) of points (n, 3) [mm] in a pane, from -1 to 1 in each axis; aspect is width over height."""
        right, up, forward = _axes(self.position - self.target)
        relative = np.asarray(points, float) - self.position
        depth = (relative @ forward) * np.tan(0.5 * FIELD_OF_VIEW)
        return np.column_stack([relative @ right / (aspect * depth), relative @ up / depth])


def framing(points: ArrayLike, aspect: float, *, direction: ArrayLike = OBLIQUE) -> Eye:
    """The eye nearest to points that sees all of them.

    In the axes of the eye a point (x, y) at a depth of D + z is in the pane if |x - a| and |y - b| are at most
    k (D + z), with a k for either axis. The smallest D follows from the pairs of points that are farthest apart in this
    sense, and a and b, by which the eye is moved sideways, lie midway.

    Args:
        points: to be seen (n, 3) [mm].
        aspect: width of the pane over its height.
        direction: from what is seen to the eye.
    """
    points = np.asarray(points, float)
    right, up, forward = _axes(np.asarray(direction, float))
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    relative = points - centre
    z = relative @ forward
    slope = (1.0 - MARGIN) * np.tan(0.5 * FIELD_OF_VIEW)
    sides = [(relative @ right, slope * aspect), (relative @ up, slope)]
    distance = max((np.max(s - k * z) - np.min(s + k * z)) / (2.0 * k) for s, k in sides)
    distance = max(distance, 1e-3 - z.min())
    shift = [_middle(s, distance + z) for s, _ in sides]
    target = centre + shift[0] * right + shift[1] * up
    return Eye(target - distance * forward, target)


def _middle(side: NDArray[np.float64], depth: NDArray[np.float64]) -> float:
    """The place of the eye from which the outermost points, seen under side / depth (n,), lie at equal angles."""
    slope = (side[:, None] - side) / (depth[:, None] + depth)  # to either side, as seen from midway between two points
    highest = int(slope.max(axis=1).argmax())
    return float(side[highest] - slope.max() * depth[highest])


def _axes(towards_eye: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors to the right, up and forward in a pane."""
    forward = -towards_eye / np.linalg.norm(towards_eye)
    right = np.cross(forward, UP)
    right /= np.linalg.norm(right)
    return right, np.cross(right, forward), forward
