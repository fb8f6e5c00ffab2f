"""Pictures of a sweep: a measure over one key, a map over two, points over each key of a sample."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from feeder_sim.measures.statistic import half_interval
from feeder_sim.plots.figure import make_logarithmic
from feeder_sim.plots.intervals import COLOURS
from feeder_sim.plots.sweep import DECADES, draw_line, draw_map
from feeder_sim.report.page import Picture
from feeder_sim.report.pictures import picture_of
from feeder_sim.report.words import key_label, measure_label, number, value_text
from feeder_sim.studies.sweep.table import Row
from feeder_sim.studies.uncertainty.spread import NOT_TOLD

MOST_CURVES = 6  # of the key with fewer values; with more of them there is a map
TOO_FEW = 2  # values of a mean whose interval says next to nothing
BESIDE = 3  # panels of a sample in a row


def measure_picture(rows: Sequence[Row], keys: tuple[str, ...], measure: str) -> Picture:
    """A measure of a sweep over its keys, from the rows that have a mean."""
    label, alt = measure_label(measure), f"{measure_label(measure)} over {' and '.join(keys)}, {len(rows)} points."
    bars = f"{label}: means over the seeds; bars are 95 % intervals of the mean."
    if rows[0].spread is not None:
        bars = f"{label}: means over seeds and uncertain inputs; bars are 95 % intervals of the mean."
    bars += _beyond(rows)
    grid = math.prod(len(values_of(rows, key)) for key in keys) <= 1.5 * len(rows)
    if len(keys) == 1:
        caption = bars + _on_band(rows)
        return picture_of(lambda figure: _draw_one(figure, rows, keys[0], label), height=3.0, alt=alt, caption=caption)
    few, many = sorted(keys, key=lambda key: len(values_of(rows, key)))[:2]
    if len(keys) == 2 and grid and len(values_of(rows, few)) <= MOST_CURVES:
        return picture_of(
            lambda figure: _draw_family(figure, rows, many, few, label), height=3.2, alt=alt, caption=bars
        )
    if len(keys) == 2 and grid:
        halves = sorted(half_width(row) for row in rows if count_of(row) > 1)
        sure = ""
        if halves:
            middle, widest = number(halves[len(halves) // 2], 2), number(halves[-1], 2)
            sure = f" Half the 95 % intervals are within ± {middle}, all within ± {widest}; the tables have them."
        caption = f"{label}: means over the seeds.{sure} White: no value."
        return picture_of(lambda figure: _draw_map(figure, rows, keys, label), height=4.2, alt=alt, caption=caption)
    return sample_picture(rows, keys, label, alt=alt, caption=bars)


def sample_picture(rows: Sequence[Row], keys: Sequence[str], label: str, *, alt: str, caption: str) -> Picture:
    """Points over each key in a panel of its own, the other keys as they happen to be."""
    caption += " Every panel has all points, over another key." if len(keys) > 1 else ""
    height = 2.6 * math.ceil(len(keys) / BESIDE)
    return picture_of(lambda figure: _draw_sample(figure, rows, keys, label), height=height, alt=alt, caption=caption)


def _on_band(rows: Sequence[Row]) -> str:
    """What is to be said of the band over uncertain inputs, and of where there is none."""
    spreads = [row.spread for row in rows if row.spread is not None]
    band = " The band is the 90 % interval over the inputs." if any(spread.is_told for spread in spreads) else ""
    gaps = sum(bool(spread.not_told) for spread in spreads)
    return f"{band} At {gaps} of {len(rows)} points the inputs are {NOT_TOLD}: no band." if gaps else band


def count_of(row: Row) -> int:
    """Number of independent values behind a mean: seeds, or draws of uncertain inputs."""
    return row.spread.draws if row.spread else row.found.n


def half_width(row: Row) -> float:
    """Half the width of the 95 % interval of a mean; NaN where it has none."""
    return half_interval(row.found.se, count_of(row))


def values_of(rows: Sequence[Row], key: str) -> list[Any]:
    """The different values of a key, in order of appearance."""
    return list(dict.fromkeys(row.point[key] for row in rows))


def _draw_one(figure: Any, rows: Sequence[Row], key: str, label: str) -> None:
    axes = figure.add_subplot()
    draw_line(axes, rows, key, joined=True, colour=COLOURS[0])
    axes.set(xlabel=key_label(key), ylabel=label)
    _fit(axes, rows)


def _draw_family(figure: Any, rows: Sequence[Row], over: str, each: str, label: str) -> None:
    """A curve over one key for each value of the other."""
    axes = figure.add_subplot()
    for i, value in enumerate(values_of(rows, each)):
        chosen = [row for row in rows if row.point[each] == value]
        draw_line(axes, chosen, over, joined=True, colour=COLOURS[i % len(COLOURS)], label=value_text(value))
    axes.set(xlabel=key_label(over), ylabel=label)
    _fit(axes, rows)
    axes.legend(title=key_label(each), loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_map(figure: Any, rows: Sequence[Row], keys: tuple[str, ...], label: str) -> None:
    draw_map(figure, rows, keys, label)
    figure.axes[0].set(xlabel=key_label(keys[0]), ylabel=key_label(keys[1]))


def _draw_sample(figure: Any, rows: Sequence[Row], keys: Sequence[str], label: str) -> None:
    columns = min(len(keys), BESIDE)
    grid = figure.subplots(math.ceil(len(keys) / columns), columns, squeeze=False, sharey=True)
    for axes in grid.ravel()[len(keys) :]:
        axes.set_axis_off()
    for i, (axes, key) in enumerate(zip(grid.ravel(), keys, strict=False)):
        draw_line(axes, rows, key, joined=False, colour=COLOURS[0])
        axes.set(xlabel=key_label(key), ylabel=label if i % columns == 0 else "")
        _fit(axes, rows)


def _fit(axes: Any, rows: Sequence[Row]) -> None:
    """Set the limits to the means and the bars of three values or more: those of two would leave no room for others."""
    means = [row.found.mean for row in rows]
    if min(means) > 0.0 and max(means) > DECADES * min(means):
        make_logarithmic(axes.yaxis)
        axes.set_ylim(0.5 * min(means), 2.0 * max(means))
        return
    halves = [half_width(row) if count_of(row) > TOO_FEW else 0.0 for row in rows]
    low = min(mean - half for mean, half in zip(means, halves, strict=True))
    high = max(mean + half for mean, half in zip(means, halves, strict=True))
    room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    axes.set_ylim(low - room, high + room)


def _beyond(rows: Sequence[Row]) -> str:
    """A remark on bars that are not seen in full."""
    few = any(count_of(row) == TOO_FEW for row in rows)
    return " Bars of two values, as wide as 25 standard errors, may run out of the picture." if few else ""
