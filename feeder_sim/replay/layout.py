"""Layout of the viewer: the scene, and beside it, or below it where the plate is long, plots and other views.

Pictures and films have a style of their own: content only, without the titles and panels by which people work the
viewer, and in slow motion without the plots, which know no such time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feeder_sim.replay.labels import legend_lines
from feeder_sim.replay.scenery import Box

# The eye of a 3D view, placed so that what is to be seen fills the pane.

FIELD_OF_VIEW = np.radians(55.0)  # of rerun's viewer, from the lower to the upper edge of a pane
MARGIN = 0.04  # of the half pane, left free on each side
OBLIQUE = (0.0, -0.62, 0.95)  # from what is seen to the eye
UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Eye:
    """Where the eye is and where it looks [mm]."""

    position: NDArray[np.float64]
    target: NDArray[np.float64]


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
    right, up, forward = axes_of(np.asarray(direction, float))
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


def axes_of(towards_eye: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors to the right, up and forward in a pane."""
    forward = -towards_eye / np.linalg.norm(towards_eye)
    right = np.cross(forward, UP)
    right /= np.linalg.norm(right)
    return right, np.cross(right, forward), forward


Style = Literal["viewer", "picture", "slow_motion"]
BACKGROUND = (24, 27, 31)
LONG = 2.2  # length over depth of a box, from which on the scene has the whole width
SHARES = {"viewer": (3, 2), "picture": (3, 2), "slow_motion": (2, 3)}  # of the scene, and of what is beside or below it
WINDOW = 16.0 / 9.0  # width over height of a picture, and about that of the viewer's window


def scene_eye(box: Box, entries: int, style: Style, direction: ArrayLike = OBLIQUE) -> Eye:
    """The eye of the scene, for a box with so many entries in its legend."""
    return framing(box.framed(legend_lines(entries)), scene_aspect(box, style), direction=direction)


def scene_aspect(box: Box, style: Style) -> float:
    """Width over height of the pane of the scene."""
    share = SHARES[style][0] / sum(SHARES[style])
    return WINDOW / share if is_long(box) else WINDOW * share


def wave_aspect(box: Box, style: Style) -> float:
    """Width over height of the pane of the surface, which is one of two panes except in slow motion."""
    share, alone = SHARES[style][1] / sum(SHARES[style]), style == "slow_motion"
    if is_long(box):
        return WINDOW / share * (1.0 if alone else 0.5)
    return WINDOW * share * (1.0 if alone else 2.0)


def is_long(box: Box) -> bool:
    """Whether a box is so long that its pane should be so, too."""
    length, depth = (box.high - box.low)[:2]
    return bool(length > LONG * depth)
