"""Node analysis along a line on a plate: which orders of modes carry a part from one place to another.

A part that rests on a node of one mode lies on a slope of the next; that mode carries it to the node in whose cell it
lies, between two antinodes. With the distance d between both nodes and the quarter of the next mode's bending
wavelength,

    k = d / (lambda / 4),

a part is sure to be carried for k well below 1, at which it starts from an antinode (D. Shi, EPFL thesis TH7124, 2016).

The line has to hold the part, too. Parts drift down the slope of w^2, about as fast as it is steep: along a line of
symmetry dx/dt ~ -w w,x and, a little beside it, dy/dt ~ -w w,yy y. On the way from a to b an offset y from the line
then grows by the factor exp(int_a^b w,yy / w,x dx); on a strip, whose modes do not vary across it, by 1.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.modes import PlateModes

PATH_POINTS = 201  # of the way from one node to the next
SAMPLES = 2001  # of a mode shape along the line
MOST_GROWTH = 50.0  # as an exponent: near an antinode the slope vanishes
FLAT = 1e-6  # a mode whose deflection stays below this along the line has no nodes on it
KEPT = 20  # routes to every node that are followed on


@dataclass(frozen=True)
class LineNodes:
    """Nodes of one mode along the line, in order.

    Attributes:
        mode: 0-based index.
        position: (n,) [m].
        cell: (n, 2) [m], from the antinode or end of the line before each node to the one after it.
        quarter_wavelength: of the mode's bending wave [m].
        place, leaving: (m,) [m], (m,) [1/m]: points of the line, and w,yy / w,x there; NaN off the middle of the plate,
            which is no line of symmetry.
    """

    mode: int
    position: NDArray[np.float64]
    cell: NDArray[np.float64]
    quarter_wavelength: float
    place: NDArray[np.float64]
    leaving: NDArray[np.float64]

    def reached_from(self, x: float) -> int | None:
        """Index of the node in whose cell a position [m] lies; None beyond the outermost cells."""
        inside = np.flatnonzero((self.cell[:, 0] < x) & (x < self.cell[:, 1]))
        return int(inside[0]) if len(inside) else None

    def growth(self, start: float, end: float) -> float:
        """Factor by which an offset from the line grows on the way between two places [m]."""
        x = np.linspace(start, end, PATH_POINTS)
        exponent = float(np.trapezoid(np.interp(x, self.place, self.leaving), x))
        return math.exp(min(exponent, MOST_GROWTH)) if math.isfinite(exponent) else math.nan


@dataclass(frozen=True)
class Step:
    """One mode of a route: it carries the part from `start` to a node at `end` [m]; an offset grows by `growth`."""

    mode: int
    start: float
    end: float
    k: float
    growth: float = 1.0


@dataclass(frozen=True)
class Route:
    """Modes one after the other."""

    steps: tuple[Step, ...]

    @property
    def largest_k(self) -> float:
        return max(step.k for step in self.steps)

    @property
    def growth(self) -> float:
        """Factor by which an offset from the line grows in all."""
        return math.prod(step.growth for step in self.steps)

    @property
    def end(self) -> float:
        """Where the part ends [m]."""
        return self.steps[-1].end

    @property
    def modes(self) -> tuple[int, ...]:
        """0-based indices."""
        return tuple(step.mode for step in self.steps)


def nodes_on_line(modes: PlateModes, *, y: float = 0.0) -> list[LineNodes]:
    """Nodes of every mode along the line at y [m] from edge to edge in x; modes without any are left out."""
    x = np.linspace(-0.5, 0.5, SAMPLES) * modes.plate.length
    found = []
    for mode, frequency in enumerate(modes.natural_frequency):
        w = modes.evaluate(mode, x, y)[0]
        crossing = (
            np.flatnonzero(np.signbit(w[:-1]) != np.signbit(w[1:])) if np.abs(w).max() > FLAT else np.empty(0, np.int64)
        )
        if not len(crossing):
            continue
        share = w[crossing] / (w[crossing] - w[crossing + 1])
        position = x[crossing] + share * (x[1] - x[0])
        between = [_antinode(x, w, a, b) for a, b in itertools.pairwise(crossing.tolist())]
        ends = np.array([x[0], *between, x[-1]])
        quarter = 0.25 * standing_wave(modes.plate, float(frequency)).wavelength
        cells = np.column_stack([ends[:-1], ends[1:]])
        found.append(LineNodes(mode, position, cells, quarter, x, _leaving(modes, mode, x, y, w)))
    return found


def _leaving(
    modes: PlateModes, mode: int, x: NDArray[np.float64], y: float, w: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Curvature across the line over the slope along it, w,yy / w,x [1/m]; 0 where the slope is."""
    if y != 0.0:
        return np.full_like(x, np.nan)
    step = 1e-3 * modes.plate.width
    beside = [modes.evaluate(mode, x, y + side * step)[0] for side in (-1.0, 1.0)]
    slope = np.gradient(w, x)
    across = (beside[0] - 2.0 * w + beside[1]) / step**2
    return np.divide(across, slope, out=np.zeros_like(w), where=np.abs(slope) > FLAT * np.abs(slope).max())


def _antinode(x: NDArray[np.float64], w: NDArray[np.float64], a: int, b: int) -> float:
    return float(x[a + 1 + np.abs(w[a + 1 : b + 1]).argmax()])


def follow(nodes: Iterable[LineNodes], order: Sequence[int], start: float) -> Route:
    """The route that an order of modes (0-based) makes of a start [m].

    Raises:
        ValueError: a mode has no node on the line, or none that the part would be carried to.
    """
    by_mode, steps = {of.mode: of for of in nodes}, []
    for mode in order:
        step = _step(by_mode[mode], start) if mode in by_mode else None
        if step is None:
            raise ValueError(f"mode {mode + 1} carries a part at {1e3 * start:.1f} mm to no node of this line")
        steps.append(step)
        start = step.end
    return Route(tuple(steps))


def _step(nodes: LineNodes, x: float) -> Step | None:
    node = nodes.reached_from(x)
    if node is None:
        return None
    end = float(nodes.position[node])
    return Step(nodes.mode, x, end, abs(end - x) / nodes.quarter_wavelength, nodes.growth(x, end))


@dataclass(frozen=True)
class Search:
    """What a sequence has to keep to.

    Attributes:
        tolerance: of the place it ends at [m].
        limit: every k is smaller.
        growth: an offset from the line grows by less than this factor in every mode.
        most_modes: in a sequence.
    """

    tolerance: float = 2e-3
    limit: float = 1.0
    growth: float = math.inf
    most_modes: int = 6

    def allows(self, step: Step) -> bool:
        """Whether a step keeps to it."""
        return step.k < self.limit and not step.growth >= self.growth


def find_routes(nodes: Sequence[LineNodes], start: float, end: float, search: Search) -> list[Route]:
    """Routes from `start` to `end` [m] that keep to a search: the best of every length.

    Of each number of modes the `KEPT` routes to every node with the smallest largest k are followed on. Sorted by
    largest k, then by the number of modes; longer routes with no smaller k than a shorter one are left out.
    """
    first = [step for of in nodes if (step := _step(of, start)) is not None]
    routes = [Route((step,)) for step in first if search.allows(step)]
    arrived: list[Route] = []
    for length in range(1, search.most_modes + 1):
        there = [route for route in routes if abs(route.end - end) <= search.tolerance]
        best = min(there, key=lambda route: route.largest_k, default=None)
        if best is not None and best.largest_k < min((route.largest_k for route in arrived), default=math.inf):
            arrived.append(best)
        if length < search.most_modes:
            routes = _longer(routes, nodes, search)
    return sorted(arrived, key=lambda route: (route.largest_k, len(route.steps)))


def _longer(routes: Iterable[Route], nodes: Sequence[LineNodes], search: Search) -> list[Route]:
    """All routes with one more mode, the best ones to every node."""
    by_node: dict[tuple[int, float], list[Route]] = {}
    for route in routes:
        for of in nodes:
            step = None if of.mode == route.steps[-1].mode else _step(of, route.end)
            if step is not None and search.allows(step):
                by_node.setdefault((step.mode, step.end), []).append(Route((*route.steps, step)))
    return [r for to_node in by_node.values() for r in heapq.nsmallest(KEPT, to_node, key=lambda r: r.largest_k)]
