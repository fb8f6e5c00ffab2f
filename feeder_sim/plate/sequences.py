"""Node analysis along a line on a plate: which sequences of modes carry a part from one place to another.

A part that rests on a node of one mode usually lies between node and antinode of the next mode. That mode carries it
to the node in whose cell, between two antinodes, it lies. With the distance d from the old to the new node and the
bending wavelength lambda of the next mode,

    k = d / (lambda / 4).

At k = 1 the part starts from an antinode, where it may drift to either side. For k well below 1 it is carried
reliably (D. Shi, EPFL thesis TH7124, 2016).

The part must also stay near the line. The drift velocity is about proportional to -grad(w^2): along a line of symmetry
dx/dt ~ -w w,x and, at a small offset y from it, dy/dt ~ -w w,yy y. On the way from a to b the offset then grows by the
factor exp(int_a^b w,yy / w,x dx). On a strip, whose modes do not vary across it, the factor is 1.
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

PATH_POINTS = 201  # of the integral over the way from one node to the next
SAMPLES = 2001  # of a mode shape along the line
LARGEST_EXPONENT = 50.0  # of a growth factor: near an antinode the slope vanishes and the integral diverges
NO_DEFLECTION = 1e-6  # [1]; a mode whose deflection stays below this along the line has no nodes on it
NO_SLOPE = 1e-6  # of the largest slope along the line; smaller slopes are round-off
ROUTES_PER_NODE = 20  # that the search continues from each node it has reached


@dataclass(frozen=True)
class LineNodes:
    """Nodes of one mode along the line, in order.

    Attributes:
        mode: 0-based index.
        position: (n,) [m].
        cell: (n, 2) [m], from the antinode (or end of the line) before each node to the one after it.
        quarter_wavelength: of the mode's bending wave [m].
        x: points of the line (m,) [m].
        growth_rate: w,yy / w,x at these points (m,) [1/m]; NaN off the middle of the plate, where the line is not one
            of symmetry.
    """

    mode: int
    position: NDArray[np.float64]
    cell: NDArray[np.float64]
    quarter_wavelength: float
    x: NDArray[np.float64]
    growth_rate: NDArray[np.float64]

    def reached_from(self, start: float) -> int | None:
        """Index of the node in whose cell a position [m] lies; None beyond the outermost cells."""
        inside = np.flatnonzero((self.cell[:, 0] < start) & (start < self.cell[:, 1]))
        return int(inside[0]) if len(inside) else None

    def growth(self, start: float, end: float) -> float:
        """Factor by which an offset from the line grows on the way between two places [m]; NaN if it is not known."""
        path = np.linspace(start, end, PATH_POINTS)
        exponent = float(np.trapezoid(np.interp(path, self.x, self.growth_rate), path))
        return math.exp(min(exponent, LARGEST_EXPONENT)) if math.isfinite(exponent) else math.nan


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
    """A part's way along the line under one mode after the other."""

    steps: tuple[Step, ...]

    @property
    def largest_k(self) -> float:
        """The k of the least reliable step [1]."""
        return max(step.k for step in self.steps)

    @property
    def growth(self) -> float:
        """Factor by which an offset from the line grows over the whole route."""
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
    """Nodes of every mode along the line at y [m] from edge to edge in x; a mode without nodes is left out.

    Where a hole or the outline of the plate interrupts the line, a cell ends.
    """
    x = np.linspace(-0.5, 0.5, SAMPLES) * modes.plate.length
    pieces = _pieces(modes, x, y)
    nodes = []
    for mode, frequency in enumerate(modes.natural_frequency):
        w = modes.evaluate(mode, x, y)[0]
        crossing = (
            np.flatnonzero(np.signbit(w[:-1]) != np.signbit(w[1:]))
            if np.abs(w).max() > NO_DEFLECTION
            else np.empty(0, np.int64)
        )
        if not len(crossing):
            continue
        on_plate = [crossing[(first <= crossing) & (crossing < last)] for first, last in pieces]
        selected = np.concatenate([crossing[:0], *on_plate])
        if not len(selected):
            continue
        fraction = w[selected] / (w[selected] - w[selected + 1])
        position = x[selected] + fraction * (x[1] - x[0])
        cells = []
        for (first, last), crossings in zip(pieces, on_plate, strict=True):
            antinodes = [_antinode(x, w, a, b) for a, b in itertools.pairwise(crossings.tolist())]
            ends = np.array([x[first], *antinodes, x[last]])
            if len(crossings):
                cells.append(np.column_stack([ends[:-1], ends[1:]]))
        quarter = 0.25 * standing_wave(modes.plate, float(frequency)).wavelength
        growth = _growth_rate(modes, mode, x, y, w)
        nodes.append(LineNodes(mode, position, np.concatenate(cells), quarter, x, growth))
    return nodes


def _pieces(modes: PlateModes, x: NDArray[np.float64], y: float) -> list[tuple[int, int]]:
    """First and last sample of every piece of the line x (m,), y [m] that is on the plate."""
    if modes.outline is None:
        return [(0, len(x) - 1)]
    on_plate = modes.outline.holds(np.column_stack([x, np.full_like(x, y)]))
    change = np.flatnonzero(np.diff(np.concatenate([[False], on_plate, [False]]).astype(int)))
    return [(int(a), int(b) - 1) for a, b in change.reshape(-1, 2) if b - a > 1]


def _growth_rate(
    modes: PlateModes, mode: int, x: NDArray[np.float64], y: float, w: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Curvature across the line over the slope along it, w,yy / w,x [1/m], shape (m,); 0 where the slope is 0."""
    if y != 0.0:
        return np.full_like(x, np.nan)
    step = 1e-3 * modes.plate.width
    beside = [modes.evaluate(mode, x, y + side * step)[0] for side in (-1.0, 1.0)]
    slope = np.gradient(w, x)
    across = (beside[0] - 2.0 * w + beside[1]) / step**2
    return np.divide(across, slope, out=np.zeros_like(w), where=np.abs(slope) > NO_SLOPE * np.abs(slope).max())


def _antinode(x: NDArray[np.float64], w: NDArray[np.float64], a: int, b: int) -> float:
    """Position [m] of the largest |w| between the samples a and b, after each of which w changes its sign."""
    return float(x[a + 1 + np.abs(w[a + 1 : b + 1]).argmax()])


def follow(nodes: Iterable[LineNodes], order: Sequence[int], start: float) -> Route:
    """The route of a part from `start` [m] under modes (0-based) in a given order.

    Raises:
        ValueError: a mode has no node on the line, or none that the part would be carried to.
    """
    by_mode, steps = {line_nodes.mode: line_nodes for line_nodes in nodes}, []
    for mode in order:
        step = _step(by_mode[mode], start) if mode in by_mode else None
        if step is None:
            raise ValueError(f"mode {mode + 1} carries a part at {1e3 * start:.1f} mm to no node of this line")
        steps.append(step)
        start = step.end
    return Route(tuple(steps))


def _step(nodes: LineNodes, start: float) -> Step | None:
    """Where one mode carries a part from `start` [m]; None where it has no node for it."""
    node = nodes.reached_from(start)
    if node is None:
        return None
    end = float(nodes.position[node])
    return Step(nodes.mode, start, end, abs(end - start) / nodes.quarter_wavelength, nodes.growth(start, end))


@dataclass(frozen=True)
class Search:
    """Conditions on a sequence of modes.

    Attributes:
        tolerance: allowed distance between the end of the route and the goal [m].
        limit: of k [1]; every k of the route is smaller.
        growth: an offset from the line grows by less than this factor [1] in every mode.
        most_modes: largest number of modes in the route.
    """

    tolerance: float = 2e-3
    limit: float = 1.0
    growth: float = math.inf
    most_modes: int = 6

    def allows(self, step: Step) -> bool:
        """Whether a step meets the conditions; an unknown growth (NaN) does."""
        return step.k < self.limit and not step.growth >= self.growth


def find_routes(nodes: Sequence[LineNodes], start: float, end: float, search: Search) -> list[Route]:
    """Routes from `start` to `end` [m] that meet the conditions of a search: the best of every number of modes.

    "Best" is the smallest largest k. To limit the work, of each number of modes only the `ROUTES_PER_NODE` best routes
    to every node are continued. The result is sorted by largest k, then by number of modes; a route that is longer
    than another one without a smaller largest k is left out.
    """
    first_steps = [step for line_nodes in nodes if (step := _step(line_nodes, start)) is not None]
    routes = [Route((step,)) for step in first_steps if search.allows(step)]
    arrived: list[Route] = []
    for length in range(1, search.most_modes + 1):
        arriving = [route for route in routes if abs(route.end - end) <= search.tolerance]
        best = min(arriving, key=lambda route: route.largest_k, default=None)
        if best is not None and best.largest_k < min((route.largest_k for route in arrived), default=math.inf):
            arrived.append(best)
        if length < search.most_modes:
            routes = _longer(routes, nodes, search)
    return sorted(arrived, key=lambda route: (route.largest_k, len(route.steps)))


def _longer(routes: Iterable[Route], nodes: Sequence[LineNodes], search: Search) -> list[Route]:
    """All routes with one more mode, of those to the same node the `ROUTES_PER_NODE` best."""
    by_node: dict[tuple[int, float], list[Route]] = {}
    for route in routes:
        for line_nodes in nodes:
            step = None if line_nodes.mode == route.steps[-1].mode else _step(line_nodes, route.end)
            if step is not None and search.allows(step):
                by_node.setdefault((step.mode, step.end), []).append(Route((*route.steps, step)))
    return [
        r for to_node in by_node.values() for r in heapq.nsmallest(ROUTES_PER_NODE, to_node, key=lambda r: r.largest_k)
    ]
