"""Pictures of sweeps: a measure over one key, a map over two, points over each key of a sample."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from feeder_sim.document.figure import Figure, make_logarithmic
from feeder_sim.document.words import key_words, measure_label, number, value_text
from feeder_sim.measures.statistic import Statistic, half_interval
from feeder_sim.plots.intervals import COLOURS, FEWEST
from feeder_sim.scenario.changes import labels

if TYPE_CHECKING:
    from feeder_sim.studies.sweep.table import Row

MOST_TICKS = 8  # on a logarithmic axis
PALE = "#b8c6ea"
DECADES = 30.0  # largest over smallest value from which on colours of a map, or an axis, are logarithmic
OUTLYING = 1.5  # distances of the quartiles, beyond them, from which on a value is far from the others (Tukey)
EVEN = 1e-6  # relative difference of steps, or of ratios, that counts as none
MOST_CURVES = 6  # of the key with fewer values; with more of them there is a map
BESIDE = 3  # panels of a sample in a row


@dataclass(frozen=True)
class Mean:
    """A mean at a point that is no row of a table."""

    point: Mapping[str, Any]
    statistic: Statistic
    spread: None = None


def sweep_figure(rows: Sequence[Row], keys: tuple[str, ...], measure: str) -> Figure:
    """A measure of a sweep over its keys, from the rows that have a mean, of which there is one at least."""
    label, alt = measure_label(measure), f"{measure_label(measure)} over {' and '.join(keys)}, {len(rows)} points."
    over = "seeds and uncertain inputs" if rows[0].spread is not None else "the seeds"
    bars = f"{label}: means over {over}; bars are 95 % intervals of the mean.{_without_bars(rows)}"
    grid = math.prod(len(values_of(rows, key)) for key in keys) <= 1.5 * len(rows)
    if len(keys) == 1:
        draw = partial(_draw_curves, rows=rows, over=keys[0], label=label)
        return Figure(draw, 3.0, alt, bars + _on_band(rows))
    few, many = sorted(keys, key=lambda key: len(values_of(rows, key)))[:2]
    if len(keys) == 2 and grid and len(values_of(rows, few)) <= MOST_CURVES:
        return Figure(partial(_draw_curves, rows=rows, over=many, label=label, each=few), 3.2, alt, bars)
    if len(keys) == 2 and grid:
        halves = sorted(half_width(row) for row in rows if count_of(row) > 1)
        sure = ""
        if halves:
            middle, widest = number(halves[len(halves) // 2], 2), number(halves[-1], 2)
            sure = f" Half the 95 % intervals are within ± {middle}, all within ± {widest}; the tables have them."
        ends = " Values beyond an arrow of the scale have the colour at its end." if colour_limits(rows)[2] else ""
        caption = f"{label}: means over the seeds.{sure} White: no value.{ends}"
        return Figure(partial(_draw_map, rows=rows, keys=keys, label=label), 4.2, alt, caption)
    return sample_figure(rows, keys, label, alt=alt, caption=bars)


def sample_figure(rows: Sequence[Row | Mean], keys: Sequence[str], label: str, *, alt: str, caption: str) -> Figure:
    """Points over each key in a panel of its own, the other keys as they happen to be."""
    caption += " Every panel has all points, over another key." if len(keys) > 1 else ""
    draw = partial(_draw_sample, rows=rows, keys=keys, label=label)
    return Figure(draw, 2.6 * math.ceil(len(keys) / BESIDE), alt, caption)


def count_of(row: Row | Mean) -> int:
    """Number of independent values behind a mean: seeds, or draws of uncertain inputs."""
    return row.spread.draws if row.spread else row.statistic.n


def half_width(row: Row | Mean) -> float:
    """Half the width of the 95 % interval of a mean; NaN where it has none."""
    return half_interval(row.statistic.se, count_of(row))


def _drawn_half(row: Row | Mean) -> float:
    """The same for a bar; 0 of a mean of too few values."""
    return half_width(row) if count_of(row) >= FEWEST else 0.0


def values_of(rows: Sequence[Row | Mean], key: str) -> list[Any]:
    """The different values of a key, in order of appearance."""
    return list(dict.fromkeys(row.point[key] for row in rows))


def draw_line(
    axes: Any, rows: Sequence[Row | Mean], key: str, *, joined: bool, colour: str = COLOURS[0], label: str | None = None
) -> None:
    """Draw means with 95 % intervals over one key; where inputs are uncertain, a band of 90 % over them, if told."""
    values = [row.point[key] for row in rows]
    numbers = all(_is_number(value) for value in values)
    names = list(dict.fromkeys(str(value) for value in values))
    x = np.array(values, float) if numbers else np.array([names.index(str(value)) for value in values], float)
    order = np.argsort(x, kind="stable")
    mean = np.array([row.statistic.mean for row in rows])
    reach = np.array([_drawn_half(row) for row in rows])
    if joined and all(row.spread for row in rows):
        low, high = (np.array([getattr(row.spread, name) for row in rows]) for name in ("inputs_low", "inputs_high"))
        is_finite = np.isfinite(low)
        if is_finite.any():
            axes.fill_between(x[order], low[order], high[order], color=PALE, label="90 % over the inputs")
            # Seen where points beside have none.
            axes.vlines(x[is_finite], low[is_finite], high[is_finite], color=PALE, linewidth=3.0)
            axes.legend()
    line = "o-" if joined and numbers else "o"
    bars = {"fmt": line, "color": colour, "markersize": 4, "capsize": 2, "linewidth": 1.2, "label": label}
    axes.errorbar(x[order], mean[order], reach[order], **bars)
    if numbers and _is_log(x):
        make_logarithmic(axes.xaxis)
    if not numbers:
        axes.set_xticks(range(len(names)), names)
    axes.set(xlabel=key_words(key))
    axes.grid(True, alpha=0.3)


def _draw_curves(figure: Any, *, rows: Sequence[Row], over: str, label: str, each: str = "") -> None:
    """A curve over one key, for each value of another if there is one."""
    axes = figure.add_subplot()
    for i, value in enumerate(values_of(rows, each) if each else [None]):
        chosen = [row for row in rows if not each or row.point[each] == value]
        named = value_text(value) if each else None
        draw_line(axes, chosen, over, joined=True, colour=COLOURS[i % len(COLOURS)], label=named)
    axes.set(ylabel=label)
    _fit(axes, rows)
    if each:
        axes.legend(title=key_words(each), loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_map(figure: Any, *, rows: Sequence[Row], keys: tuple[str, ...], label: str) -> None:
    """A heat map over two keys; points without a value stay white."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import NullLocator

    axes = figure.subplots()
    points = [labels(row.point) for row in rows]
    ticks = [list(dict.fromkeys(point[key] for point in points)) for key in keys]
    ticks = [sorted(values) if all(_is_number(v) for v in values) else values for values in ticks]
    grid = np.full((len(ticks[1]), len(ticks[0])), math.nan)
    for point, row in zip(points, rows, strict=True):
        grid[ticks[1].index(point[keys[1]]), ticks[0].index(point[keys[0]])] = row.statistic.mean
    norm, limits, extend = colour_limits(rows)
    how: dict[str, Any] = {"cmap": "viridis", "norm": norm(*limits)}
    image = axes.pcolormesh(*(_edges(values) for values in ticks), grid, **how)
    axes.set(xlabel=key_words(keys[0]), ylabel=key_words(keys[1]))
    for values, axis, name in zip(ticks, (axes.xaxis, axes.yaxis), "xy", strict=True):
        if not all(_is_number(value) for value in values):
            axis.set_ticks(range(len(values)), [str(value) for value in values])
        elif _is_log(np.array(values, float)):
            axes.set(**{f"{name}scale": "log"})
            axis.set_minor_locator(NullLocator())
            axis.set_ticks(values[:: math.ceil(len(values) / MOST_TICKS)])
            axis.set_major_formatter("{x:.3g}")
    colours = figure.colorbar(image, label=label, extend=extend or "neither")
    if norm is LogNorm:
        make_logarithmic(colours.ax.yaxis)


def colour_limits(rows: Sequence[Row | Mean]) -> tuple[Any, tuple[float, float], str]:
    """Scale and limits of colours, and which ends lie beyond them: a few far values must not hide all others."""
    from matplotlib.colors import LogNorm, Normalize

    means = np.array([row.statistic.mean for row in rows])
    low, high = float(means.min()), float(means.max())
    if low > 0.0 and high > DECADES * low:
        return LogNorm, (low, high), ""
    first, third = np.quantile(means, [0.25, 0.75])
    room = OUTLYING * (third - first) if third > first else math.inf
    near = means[(means >= first - room) & (means <= third + room)]
    least, most = float(near.min()), float(near.max())
    extend = "both" if least > low and most < high else "min" if least > low else "max" if most < high else ""
    return Normalize, (least, most), extend


def _draw_sample(figure: Any, *, rows: Sequence[Row | Mean], keys: Sequence[str], label: str) -> None:
    columns = min(len(keys), BESIDE)
    grid = figure.subplots(math.ceil(len(keys) / columns), columns, squeeze=False, sharey=True)
    for axes in grid.ravel()[len(keys) :]:
        axes.set_axis_off()
    for i, (axes, key) in enumerate(zip(grid.ravel(), keys, strict=False)):
        draw_line(axes, rows, key, joined=False)
        axes.set(ylabel=label if i % columns == 0 else "")
        _fit(axes, rows)


def _on_band(rows: Sequence[Row]) -> str:
    """What is to be said of the band over uncertain inputs, and of where there is none."""
    spreads = [row.spread for row in rows if row.spread is not None]
    band = " The band is the 90 % interval over the inputs." if any(spread.is_separated for spread in spreads) else ""
    gaps = [spread.separation_reason for spread in spreads if spread.separation_reason]
    return f"{band} At {len(gaps)} of {len(rows)} points the inputs are {gaps[0]}: no band." if gaps else band


def _without_bars(rows: Sequence[Row]) -> str:
    """A remark on means without bars."""
    few = any(count_of(row) < FEWEST for row in rows)
    return f" Means of fewer than {FEWEST} values have none." if few else ""


def _fit(axes: Any, rows: Sequence[Row | Mean]) -> None:
    """Set the limits to the means and their bars."""
    means = [row.statistic.mean for row in rows]
    if min(means) > 0.0 and max(means) > DECADES * min(means):
        make_logarithmic(axes.yaxis)
        axes.set_ylim(0.5 * min(means), 2.0 * max(means))
        return
    halves = [_drawn_half(row) for row in rows]
    low = min(mean - half for mean, half in zip(means, halves, strict=True))
    high = max(mean + half for mean, half in zip(means, halves, strict=True))
    room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    axes.set_ylim(low - room, high + room)


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


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_log(x: np.ndarray) -> bool:
    """Whether numbers have a constant ratio, and no constant step."""
    x = np.unique(x)
    if len(x) < 3 or x[0] <= 0.0:
        return False
    steps, ratios = np.diff(x), np.diff(np.log(x))
    return bool(np.ptp(ratios) <= EVEN * abs(ratios[0]) and np.ptp(steps) > EVEN * abs(steps[0]))
