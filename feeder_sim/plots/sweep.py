"""Pictures of sweeps: a measure over one key, a heat map over two, or points over each key of a sample."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from feeder_sim.measures.statistic import half_interval
from feeder_sim.plots.figure import empty_figure, make_logarithmic
from feeder_sim.scenario.changes import labels

if TYPE_CHECKING:
    from feeder_sim.studies.sweep.sweep import Sweep
    from feeder_sim.studies.sweep.table import Row

MOST_TICKS = 8  # on a logarithmic axis
BLUE, PALE = "#3a60be", "#b8c6ea"
DECADES = 30.0  # largest over smallest value from which on colours of a map, or an axis, are logarithmic
EVEN = 1e-6  # relative difference of steps, or of ratios, that counts as none


def draw_sweep(sweep: Sweep, measure: str, path: Path) -> None:
    """Draw one measure of a sweep to a file; nothing where it has no value anywhere."""
    figure = empty_figure(6.4, 4.2)
    if draw_measure(figure, sweep, measure):
        figure.savefig(path, dpi=150)


def draw_measure(figure: Any, sweep: Sweep, measure: str) -> bool:
    """Draw one measure into an empty figure, which gets the size it needs; returns whether it has a value anywhere."""
    rows = sweep.valued(measure)
    if not rows:
        return False
    keys = sweep.keys
    if len(keys) == 2 and _is_grid(sweep, rows):
        figure.set_size_inches(6.4, 4.8)
        draw_map(figure, rows, keys, measure)
    else:
        figure.set_size_inches(6.4 if len(keys) == 1 else 4.2 * len(keys), 4.2)
        beside = figure.subplots(1, len(keys), sharey=True, squeeze=False)[0]
        for axes, key in zip(beside, keys, strict=True):
            draw_line(axes, rows, key, joined=len(keys) == 1)
        beside[0].set_ylabel(measure)
    return True


def draw_line(
    axes: Any, rows: Sequence[Row], key: str, *, joined: bool, colour: str = BLUE, label: str | None = None
) -> None:
    """Draw means with 95 % intervals over one key; where inputs are uncertain, a band of 90 % over them, if told."""
    values = [row.point[key] for row in rows]
    numbers = all(_is_number(value) for value in values)
    names = list(dict.fromkeys(str(value) for value in values))
    x = np.array(values, float) if numbers else np.array([names.index(str(value)) for value in values], float)
    order = np.argsort(x, kind="stable")
    mean = np.array([row.found.mean for row in rows])
    # Of uncertain inputs the draws count.
    counts = [row.spread.draws if row.spread else row.found.n for row in rows]
    reach = np.nan_to_num([half_interval(row.found.se, n) for row, n in zip(rows, counts, strict=True)])
    if joined and all(row.spread for row in rows):
        low, high = (np.array([getattr(row.spread, name) for row in rows]) for name in ("inputs_low", "inputs_high"))
        told = np.isfinite(low)
        if told.any():
            axes.fill_between(x[order], low[order], high[order], color=PALE, label="90 % over the inputs")
            axes.vlines(x[told], low[told], high[told], color=PALE, linewidth=3.0)  # seen where points beside have none
            axes.legend()
    line = "o-" if joined and numbers else "o"
    bars = {"fmt": line, "color": colour, "markersize": 4, "capsize": 2, "linewidth": 1.2, "label": label}
    axes.errorbar(x[order], mean[order], reach[order], **bars)
    if numbers and _is_log(x):
        make_logarithmic(axes.xaxis)
    if not numbers:
        axes.set_xticks(range(len(names)), names)
    axes.set(xlabel=key)
    axes.grid(True, alpha=0.3)


def draw_map(figure: Any, rows: Sequence[Row], keys: tuple[str, ...], measure: str) -> None:
    """Draw a heat map over two keys; points without a value stay white."""
    from matplotlib.ticker import NullLocator

    axes = figure.subplots()
    points = [labels(row.point) for row in rows]
    ticks = [list(dict.fromkeys(point[key] for point in points)) for key in keys]
    ticks = [sorted(values) if all(_is_number(v) for v in values) else values for values in ticks]
    grid = np.full((len(ticks[1]), len(ticks[0])), math.nan)
    for point, row in zip(points, rows, strict=True):
        grid[ticks[1].index(point[keys[1]]), ticks[0].index(point[keys[0]])] = row.found.mean
    edges = [_edges(values) for values in ticks]
    low, high = float(np.nanmin(grid)), float(np.nanmax(grid))
    norm = "log" if low > 0.0 and high > DECADES * low else "linear"
    image = axes.pcolormesh(*edges, grid, cmap="viridis", norm=norm)
    axes.set(xlabel=keys[0], ylabel=keys[1])
    for values, axis, name in zip(ticks, (axes.xaxis, axes.yaxis), "xy", strict=True):
        if not all(_is_number(value) for value in values):
            axis.set_ticks(range(len(values)), [str(value) for value in values])
        elif _is_log(np.array(values, float)):
            axes.set(**{f"{name}scale": "log"})
            axis.set_minor_locator(NullLocator())
            axis.set_ticks(values[:: math.ceil(len(values) / MOST_TICKS)])
            axis.set_major_formatter("{x:.3g}")
    figure.colorbar(image, label=measure)


def _edges(values: list[Any]) -> np.ndarray:
    """Borders of the cells around values."""
    if not all(_is_number(value) for value in values) or len(values) < 2:
        middle = np.arange(len(values)) if not all(_is_number(v) for v in values) else np.array(values, float)
        return np.append(middle - 0.5, middle[-1] + 0.5)
    x = np.array(values, float)
    log = _is_log(x)
    x = np.log(x) if log else x
    middle = 0.5 * (x[1:] + x[:-1])
    edges = np.concatenate([[2 * x[0] - middle[0]], middle, [2 * x[-1] - middle[-1]]])
    return np.exp(edges) if log else edges


def _is_grid(sweep: Sweep, rows: list[Row]) -> bool:
    """Whether the points are those of a grid of at least two values each."""
    counts = [len({repr(point[key]) for point in sweep.points}) for key in sweep.keys]
    return min(counts) > 1 and math.prod(counts) == len(sweep.points)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_log(x: np.ndarray) -> bool:
    """Whether numbers have a constant ratio, and no constant step."""
    x = np.unique(x)
    if len(x) < 3 or x[0] <= 0.0:
        return False
    steps, ratios = np.diff(x), np.diff(np.log(x))
    return bool(np.ptp(ratios) <= EVEN * abs(ratios[0]) and np.ptp(steps) > EVEN * abs(steps[0]))
