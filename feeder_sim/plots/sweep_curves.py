"""Measures over the keys that a sweep has varied, drawn on axes: curves with intervals, maps, clouds of points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.statistic import Statistic
from feeder_sim.plots.intervals import COLOURS, half_interval

Value = float | str
WIDE = 20.0  # largest over smallest value from which on evenly growing ones get a logarithmic axis
MOST_CURVES = 6  # of the second key; with more values there is a map


def places_of(values: Sequence[Value]) -> tuple[NDArray[np.float64], list[str] | None]:
    """Where values lie on an axis, and the names of its ticks where they are no numbers."""
    if all(isinstance(value, float) for value in values):
        return np.array(values, float), None
    names = list(dict.fromkeys(str(value) for value in values))
    return np.array([names.index(str(value)) for value in values], float), names


def draw_sweep_curve(
    axes: Any, values: Sequence[Value], statistics: Sequence[Statistic], *, colour: str = COLOURS[0], label: str = ""
) -> None:
    """Draw the mean of a measure over a key, with 95 % intervals; joined by a line where the key is a number."""
    places, names = places_of(values)
    order = np.argsort(places, kind="stable")
    half = [half_interval(statistics[i].se, statistics[i].n) if statistics[i].n > 1 else 0.0 for i in order]
    axes.errorbar(
        places[order],
        [statistics[i].mean for i in order],
        yerr=np.nan_to_num(half),
        color=colour,
        marker="o",
        markersize=3.5,
        linewidth=1.2 if names is None else 0.0,
        elinewidth=1.0,
        capsize=2.0,
        label=label or None,
    )
    scale_axis(axes.xaxis, places, names)


def draw_sweep_map(
    axes: Any, first: Sequence[Value], second: Sequence[Value], statistics: Sequence[Statistic], *, label: str
) -> None:
    """Draw the mean of a measure over two keys: cells of a full grid, else dots; cells without a value are grey."""
    (x, x_names), (y, y_names) = places_of(first), places_of(second)
    means = np.array([s.mean for s in statistics])
    columns, rows = np.unique(x), np.unique(y)
    if len(columns) * len(rows) <= 1.5 * len(means):
        field = np.full((len(rows), len(columns)), np.nan)
        field[np.searchsorted(rows, y), np.searchsorted(columns, x)] = means
        axes.set_facecolor("#d5dae0")
        drawn = axes.pcolormesh(edges(columns), edges(rows), np.ma.masked_invalid(field), cmap="viridis")
    else:
        drawn = axes.scatter(x, y, c=means, cmap="viridis", s=28, edgecolors="black", linewidths=0.3)
    axes.figure.colorbar(drawn, ax=axes, label=label)
    scale_axis(axes.xaxis, x, x_names)
    scale_axis(axes.yaxis, y, y_names)


def edges(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Edges (n + 1,) of cells around ascending places (n,): half way between them, by ratio where they grow so."""
    if len(places) == 1:
        width = 0.5 * abs(places[0]) or 0.5
        return np.array([places[0] - width, places[0] + width])
    at = np.log(places) if grows_evenly(places) else places
    middle = 0.5 * (at[1:] + at[:-1])
    ends = np.concatenate([[2.0 * at[0] - middle[0]], middle, [2.0 * at[-1] - middle[-1]]])
    return np.exp(ends) if grows_evenly(places) else ends


def grows_evenly(places: NDArray[np.float64]) -> bool:
    """Whether values go over more than a decade and lie more evenly by ratio than by difference."""
    distinct = np.unique(places)
    if len(distinct) < 3 or distinct[0] <= 0.0 or distinct[-1] / distinct[0] < WIDE:
        return False
    differences, ratios = np.diff(distinct), np.diff(np.log(distinct))
    return bool(ratios.std() / ratios.mean() < differences.std() / differences.mean())


def scale_axis(axis: Any, places: NDArray[np.float64], names: Sequence[str] | None) -> None:
    """Name the ticks of an axis whose values are no numbers; make one logarithmic whose values grow evenly."""
    if names is not None:
        axis.set_ticks(range(len(names)), names)
        return
    if grows_evenly(places):
        from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

        set_scale = axis.axes.set_xscale if axis.axis_name == "x" else axis.axes.set_yscale
        set_scale("log")
        decades = math.log10(places.max() / places.min())
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
