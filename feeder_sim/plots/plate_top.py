"""The plate from above, drawn on axes in mm: mode shapes with nodal lines, parts as they lie, and paths of a part."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from feeder_sim.document.figure import MM
from feeder_sim.plate.outline import Outline
from feeder_sim.plots.intervals import COLOURS, thinned
from feeder_sim.records.recording import PartRecord, PlateRecord
from feeder_sim.records.trajectory import Frames

# The outline of a plate in pictures: drawn, and what lies beside it cut off.


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


PICKED = "#009e50"  # of the ring around a part that is picked
OUTLET = "#b35900"
STRETCHED = 8.0  # length over width of a plate, or the other way round, from which on its picture is stretched


def has_shape(plate: PlateRecord, shape: int) -> bool:
    """Whether a shape bends the plate at all; a piston moves it as a whole."""
    return bool(np.ptp(plate.mode_shape[shape]) > 0.0)


def draw_shape(axes: Any, plate: PlateRecord, shape: int, *, pale: float = 0.85) -> Any:
    """Draw a mode shape with its nodal lines, antinode 1; `pale` is the share of the full colours."""
    w = plate.mode_shape[shape] / np.abs(plate.mode_shape[shape]).max()
    limit = 1.0 / pale
    levels = np.linspace(-1.0, 1.0, 33)
    colours = {"cmap": "RdBu_r", "vmin": -limit, "vmax": limit}
    filled = axes.contourf(plate.x * MM, plate.y * MM, w.T, levels=levels, extend="both", **colours)
    drawn = [filled]
    if w.min() < 0.0 < w.max():
        line = {"colors": "black", "linewidths": 0.9}
        drawn.append(axes.contour(plate.x * MM, plate.y * MM, w.T, levels=[0.0], **line))
    cut_to_plate(axes, plate.outline, *drawn)
    frame_plate(axes, plate)
    return filled


def frame_plate(axes: Any, plate: PlateRecord) -> None:
    """Set the limits of axes to the whole plate, in true proportion unless it is very long; draw what is on it."""
    for fixture in plate.fixtures:
        rings = shapely.MultiPoint(fixture.vertices[:, :2]).convex_hull.exterior.xy
        axes.fill(*(MM * np.asarray(ring) for ring in rings), facecolor="0.6", edgecolor="0.3", linewidth=0.8)
    half = 0.5 * MM * np.array([plate.length, plate.width])
    for name, corners in plate.outlets.items():
        axes.fill(*(MM * corners.T), facecolor="none", edgecolor=OUTLET, linestyle="--", linewidth=1.2)
        axes.annotate(name, MM * corners.mean(axis=0), color=OUTLET, ha="center", va="center", fontsize="small")
        half = np.maximum(half, MM * np.abs(corners).max(axis=0))  # one may be beside the plate
    axes.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]))
    longest = max(half) / min(half)
    axes.set_aspect("auto" if longest > STRETCHED else "equal")
    for side in ("top", "right"):
        axes.spines[side].set_visible(True)


def draw_parts(
    axes: Any,
    parts: Sequence[PartRecord],
    frames: Frames,
    row: int,
    *,
    colours: Sequence[str],
    picked: Sequence[int] = (),
) -> None:
    """Draw the outlines of the parts that are there in a row of frames, with rings around those that are picked.

    Args:
        axes: in mm.
        parts: as recorded.
        frames: of a seed.
        row: of the frames.
        colours: of every part.
        picked: indices of parts.
    """
    from matplotlib.collections import PolyCollection
    from scipy.spatial import ConvexHull
    from scipy.spatial.transform import Rotation

    visible = np.flatnonzero(frames.present[row] & np.isfinite(frames.position[row]).all(axis=1)).tolist()
    corners = _all_corners(parts)
    outlines, across = [], np.zeros(len(parts))
    for i in visible:
        turned = Rotation.from_quat(frames.quaternion[row, i], scalar_first=True).apply(corners[i])
        flat = (turned + frames.position[row, i])[:, :2] * MM
        outlines.append(flat[ConvexHull(flat).vertices])
        across[i] = np.linalg.norm(flat - frames.position[row, i, :2] * MM, axis=1).max()
    face: dict[str, Any] = {"facecolors": [colours[i] for i in visible], "edgecolors": "#222222", "linewidths": 0.4}
    axes.add_collection(PolyCollection(outlines, zorder=3, **face), autolim=False)
    rings = [frames.position[row, i, :2] * MM for i in picked]
    angle = np.linspace(0.0, 2.0 * np.pi, 41)
    for i, centre in zip(picked, rings, strict=True):
        ring = centre + (1.3 * across[i] + 1.0) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        axes.plot(*ring.T, color=PICKED, linewidth=1.4, zorder=4)


def _all_corners(parts: Sequence[PartRecord]) -> list[NDArray[np.float64]]:
    """Corners of the convex hull of every part (n, 3) [m], computed once for parts with the same mesh."""
    from scipy.spatial import ConvexHull

    @cache
    def hull(mesh: bytes) -> NDArray[np.float64]:
        vertices = np.frombuffer(mesh).reshape(-1, 3)
        return vertices[ConvexHull(vertices).vertices]

    return [hull(np.ascontiguousarray(part.vertices, np.float64).tobytes()) for part in parts]


def draw_paths(axes: Any, seeds: Sequence[Frames], part: int = 0) -> None:
    """Draw the path of a part in every seed, with its ends: ring at the start, dot at the end."""
    for i, frames in enumerate(seeds):
        path = frames.position[thinned(len(frames)), part, :2] * MM
        colour = COLOURS[i % len(COLOURS)]
        axes.plot(*path.T, color=colour, linewidth=0.9, alpha=0.8, zorder=3)
        axes.plot(*path[0], "o", color=colour, markersize=5, fillstyle="none", zorder=4)
        axes.plot(*path[-1], "o", color=colour, markersize=4, zorder=4)


def close_up(axes: Any, plate: PlateRecord, points: NDArray[np.float64], around: float) -> None:
    """Set the limits of axes to points (n, 2) [m] with some room around [m], within the plate."""
    half = 0.5 * np.array([plate.length, plate.width])
    low = np.maximum(np.nanmin(points, axis=0) - around, -half) * MM
    high = np.minimum(np.nanmax(points, axis=0) + around, half) * MM
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
