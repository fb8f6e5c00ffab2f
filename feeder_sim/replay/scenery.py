"""What a replay shows, as plain data: what is at which path, and at which times; without physics, rerun or viser.

Lengths are in millimetres, colours are red, green, blue (and opacity) from 0 to 255, quaternions have w first. What is
None in an item stays as it is at that path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

TIMELINE, SLOW = "sim_time", "slow_motion"
MM = 1e3
RGB = tuple[int, ...]
Times = Mapping[str, Any]  # of timelines: a time [s], or a number on "cycle" and "stage"; or arrays (n,) of them
FAR, NEAR = 0.15, 0.045  # of the size of a box: from its edges to the text behind it and to the bar before it
BELOW = 0.055  # of the size: what the text below the bar takes


@dataclass(frozen=True, eq=False)
class Cuboid:
    """A cuboid along the axes, by its centre (3,) and its sides (3,)."""

    centre: ArrayLike
    sides: NDArray[np.float64]
    colour: RGB


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, of one colour, of a colour at every vertex (n, 4), or of pixels (height, width, 3) at their `uv`.

    Attributes:
        vertices, normals: shape (n, 3).
        triangles: indices of vertices, shape (m, 3).
        uv: shape (n, 2).
    """

    vertices: Any = None
    triangles: Any = None
    colour: RGB | None = None
    normals: Any = None
    vertex_colours: Any = None
    uv: Any = None
    pixels: Any = None


@dataclass(frozen=True, eq=False)
class Lines:
    """Polylines, each (n, 3), with a text; their radius, one or one each, is in points of the screen below zero."""

    strips: Sequence[NDArray[np.float64]]
    colour: RGB
    radius: ArrayLike
    text: str | None = None


@dataclass(frozen=True, eq=False)
class Texts:
    """Texts at places (n, 3), with dots of their colours and a radius in points of the screen, if not 0."""

    texts: Sequence[str] | None = None
    places: Any = None
    colours: Sequence[RGB] | None = None
    radius: float | None = None


@dataclass(frozen=True, eq=False)
class Parts:
    """Parts of one kind in all frames.

    Attributes:
        mesh: of each of them, around its origin; a part that is alone and stays has the colour of its mesh.
        position, quaternion: shapes (frames, parts, 3), (frames, parts, 4).
        present: whether a part is there, shape (frames, parts).
        on_plate: whether it is over the plate and above it, shape (frames, parts).
        colour: index into `palette`, shape (frames, parts).
        used: indices of the colours that any part has in any frame of the replay.
    """

    mesh: Mesh
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    present: NDArray[np.bool_]
    on_plate: NDArray[np.bool_]
    colour: NDArray[np.int64]
    palette: Sequence[RGB]
    used: Sequence[int]


Item = Cuboid | Mesh | Lines | Texts | Parts | str | None  # a line in a list of what happens; the end of what was there
Entry = tuple[str, Item, Times]  # path, what is there, and from when on; always, without times


@dataclass(frozen=True, eq=False)
class Curve:
    """Values over time in a plot; `every` value must be seen (True), or at least the largest (False).

    A path that begins with "others/" is that of a curve which is there to be compared with.
    """

    path: str
    name: str
    colour: RGB
    width: float
    values: NDArray[np.float64]
    times: Times
    every: bool | None = None


@dataclass(frozen=True, eq=False)
class Plot:
    """Curves, up to a `largest` value (from 0, or from its negative if `signed`) and in a `window` [s] around now.

    `legend`: whether it has one even beside its title.
    """

    path: str
    title: str
    curves: Sequence[Curve]
    largest: float | None = None
    signed: bool = False
    window: float | None = None
    legend: bool = False


@dataclass(frozen=True, eq=False)
class Box:
    """What a view is to show: its lowest and its highest corner, each (3,)."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @property
    def size(self) -> float:
        """The side of a square as large as it is."""
        return float(np.sqrt(np.prod((self.high - self.low)[:2])))

    @property
    def corners(self) -> NDArray[np.float64]:
        """Its corners (8, 3)."""
        return np.stack(np.meshgrid(*zip(self.low, self.high, strict=True)), axis=-1).reshape(-1, 3)

    @property
    def stage_place(self) -> NDArray[np.float64]:
        """Where the text about the stage hangs: behind the box."""
        top = (1.0 + FAR) * max(float(self.high[2]), 0.0)
        return np.array([0.5 * (self.low[0] + self.high[0]), self.high[1] + FAR * self.size, top])

    @property
    def bar_place(self) -> NDArray[np.float64]:
        """Left end of the scale bar: before the box."""
        return np.array([self.low[0] + 0.03 * self.size, self.low[1] - NEAR * self.size, 0.0])

    def framed(self, legend_lines: int = 1) -> NDArray[np.float64]:
        """Points (n, 3) that a view has to show: the box and what is written around it."""
        below = self.bar_place - [0.0, max(legend_lines, 1) * BELOW * self.size, 0.0]
        return np.vstack([self.corners, self.stage_place, below])


@dataclass(frozen=True, eq=False)
class Scenery:
    """All that a replay shows.

    Attributes:
        entries: in the order in which they are drawn.
        box, direction, title: of the scene; the direction is that from it to the eye.
        legend: number of entries in its legend.
        plots: beside the scene.
        wave: whether the surface is shown by itself, below `wave`, and its stages are listed at `stage`.
    """

    entries: Sequence[Entry]
    box: Box
    direction: ArrayLike
    title: str
    legend: int
    plots: Sequence[Plot]
    wave: bool
