"""Pictures of uncertain inputs: how a measure spreads, and which inputs it hangs on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from feeder_sim.measures.statistic import Statistic
from feeder_sim.plots.uncertainty import draw_shares, draw_values
from feeder_sim.report.page import Picture
from feeder_sim.report.pictures import picture_of
from feeder_sim.report.sweep_pictures import sample_picture
from feeder_sim.report.words import between, key_label, measure_label, number
from feeder_sim.studies.sweep.table import Row
from feeder_sim.studies.uncertainty.indices import Index
from feeder_sim.studies.uncertainty.linear_shares import LinearShares
from feeder_sim.studies.uncertainty.uncertainty import Uncertainty

MOST_PANELS = 9  # of inputs; more would make the picture too high


def spread_picture(found: Uncertainty, measure: str, measured: float | None) -> Picture:
    """All runs as a histogram, with the intervals and a measured value."""
    label, spread = measure_label(measure), found.spread(measure)
    runs = sum(len(row) for row in found.values(measure))

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        draw_values(axes, found, measure, measured)
        axes.set(xlabel=label)

    alt = f"Histogram of {label} in {runs} runs: median {number(spread.median)}"
    alt += f", {spread.of_runs} {between(spread.low, spread.high)}" + (
        f", measured {number(measured)}." if measured is not None else "."
    )
    caption = f"{label}: {runs} runs, every seed of every draw. Bars: {spread.of_runs}"
    caption += f", and {spread.of_means} over many seeds." if math.isfinite(spread.inputs_low) else "."
    return picture_of(draw, height=3.4, alt=alt, caption=caption)


def inputs_picture(found: Uncertainty, measure: str) -> Picture:
    """The mean of every draw over each uncertain input."""
    keys, label = list(found.scenario.uncertain or {})[:MOST_PANELS], measure_label(measure)
    pairs = zip(found.draws, found.values(measure), strict=True)
    rows = [Row(draw, measure, Statistic.of([float(np.mean(values))]), 1, 0) for draw, values in pairs if values]
    alt = f"{label} over {' and '.join(keys)}, {len(rows)} draws."
    caption = f"{label}: means over the seeds of each draw."
    return sample_picture(rows, keys, label, alt=alt, caption=caption)


def shares_picture(linear: LinearShares | None, indices: Sequence[Index], measure: str) -> Picture:
    """The linear shares and the Sobol indices of a measure as bars."""
    label = measure_label(measure)
    keys = [i.key for i in linear.inputs] if linear else [i.key for i in indices]

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        draw_shares(axes, linear, indices)
        axes.set_yticks(range(len(keys)), [key_label(key) for key in keys])

    kinds = [("by straight lines", [i.share for i in linear.inputs])] if linear else []
    kinds += [("Sobol, first order", [i.first for i in indices])] if indices else []
    told = [f"{kind}: {', '.join(f'{k} {s:.2f}' for k, s in zip(keys, s_, strict=True))}" for kind, s_ in kinds]
    return picture_of(
        draw,
        height=1.2 + (0.4 + 0.2 * len(kinds)) * len(keys),
        alt=f"Shares of the variance of {label}; {'; '.join(told)}.",
        caption=f"{label}: what share of its variance over the inputs hangs on each of them. Lines are 95 % intervals.",
    )
