"""Pictures of uncertain inputs: what a measure may be, and which inputs it hangs on."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.plots.figure import empty_figure
from feeder_sim.studies.uncertainty.indices import Index
from feeder_sim.studies.uncertainty.propagate import Propagation

BLUE, PALE, RED = "#3a60be", "#b8c6ea", "#be3434"
ROOM = 1.45  # of the height of a histogram, with the legend above it


def draw_uncertainty(found: Propagation, measure: str, path: Path, measured: float | None = None) -> None:
    """Draw a measure over all draws, with its intervals and a measured value, beside its Sobol indices."""
    indices = [index for index in found.indices(measure) if math.isfinite(index.total)]
    figure = empty_figure(10.0 if indices else 6.0, 4.2)
    axes = figure.subplots(1, 2 if indices else 1, squeeze=False)[0]
    draw_values(axes[0], found, measure, measured)
    if indices:
        draw_indices(axes[1], indices)
    figure.savefig(path, dpi=150)


def draw_values(axes: Any, found: Propagation, measure: str, measured: float | None) -> None:
    """Histogram of all runs, the intervals, and a measured value."""
    spread = found.spread(measure)
    values = np.array([value for row in found.values(measure) for value in row])
    axes.hist(values, bins=min(30, max(5, round(math.sqrt(len(values))))), color=PALE)
    top = axes.get_ylim()[1]
    for height, low, high, label, color in (
        (0.06, spread.low, spread.high, "90 % of runs, inputs and seeds", BLUE),
        (0.13, spread.inputs_low, spread.inputs_high, "90 % of means, inputs alone", "#3a8a5a"),
    ):
        if math.isfinite(low):
            axes.plot([low, high], [height * top] * 2, "|-", color=color, linewidth=2.5, markersize=9, label=label)
    if spread.not_told:
        axes.plot([], [], " ", label=f"means, inputs alone:\n{spread.not_told}")
    below = 1.0 / ROOM  # the legend
    axes.axvline(spread.median, ymax=below, color=BLUE, linestyle="--", label=f"median {spread.median:.4g}")
    if measured is not None:
        axes.axvline(measured, ymax=below, color=RED, linewidth=1.8, label=f"measured {measured:g}")
    axes.set(xlabel=measure, ylabel="runs", ylim=(0.0, ROOM * top))
    axes.legend(fontsize=8, loc="upper center", ncols=2)


def draw_indices(axes: Any, indices: list[Index]) -> None:
    """Bars of the first and the total order of every input, with their 95 % intervals."""
    place = np.arange(len(indices))
    for shift, color, label, value, interval in (
        (-0.18, BLUE, "first order", [i.first for i in indices], [i.first_interval for i in indices]),
        (0.18, PALE, "total order", [i.total for i in indices], [i.total_interval for i in indices]),
    ):
        axes.barh(place + shift, value, 0.34, xerr=interval, color=color, label=label, capsize=3)
    axes.set_yticks(place, [index.key for index in indices])
    axes.invert_yaxis()
    axes.axvline(0.0, color="0.4", linewidth=0.8)
    axes.set(xlabel="share of the variance over the inputs")
    axes.legend(fontsize=8)
