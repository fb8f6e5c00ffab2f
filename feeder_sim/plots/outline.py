"""The outline of a plate in pictures: drawn, and what lies beside it cut off."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.outline import Outline

MM = 1e3


def cut_to_plate(axes: Any, outline: Outline | None, *drawn: Any) -> None:
    """Draw an outline on axes in mm, and cut what was drawn there to it; nothing happens without one."""
    if outline is None:
        return
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    rings = [_turned(ring * MM, outer=i == 0) for i, ring in enumerate(outline.rings)]
    closed = [np.vstack([ring, ring[:1]]) for ring in rings]
    plate = PathPatch(
        Path.make_compound_path(*(Path(ring, closed=True) for ring in closed)),
        facecolor="none",
        edgecolor="none",
        transform=axes.transData,
    )
    for artist in drawn:
        artist.set_clip_path(plate)
    for ring in closed:
        axes.plot(*ring.T, color="0.25", linewidth=0.9)


def _turned(ring: NDArray[np.float64], *, outer: bool) -> NDArray[np.float64]:
    """A polygon (n, 2) in the sense in which it is filled: an outer edge counter-clockwise, a hole clockwise."""
    (x, y), (u, v) = ring.T, np.roll(ring, -1, axis=0).T
    counter_clockwise = float((x * v - u * y).sum()) > 0.0
    return ring if counter_clockwise == outer else ring[::-1]
