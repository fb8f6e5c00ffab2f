"""Pictures of uncertain inputs: what a measure may be, and which inputs it hangs on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from feeder_sim.plots.figure import empty_figure

if TYPE_CHECKING:
    from feeder_sim.studies.uncertainty.indices import Index
    from feeder_sim.studies.uncertainty.linear_shares import LinearShares
    from feeder_sim.studies.uncertainty.uncertainty import Uncertainty

BLUE, PALE, RED, GREEN = "#3a60be", "#b8c6ea", "#be3434", "#3a8a5a"
ROOM = 1.45  # of the height of a histogram, with the legend above it


def draw_uncertainty(found: Uncertainty, measure: str, path: Path, measured: float | None = None) -> None:
    """Draw a measure over all draws, with its intervals and a measured value, beside the inputs that it hangs on."""
    linear, indices = found.linear_shares(measure), found.indices(measure)
    beside = bool(linear or indices)
    figure = empty_figure(10.0 if beside else 6.0, 4.2)
    axes = figure.subplots(1, 2 if beside else 1, squeeze=False)[0]
    draw_values(axes[0], found, measure, measured)
    if beside:
        draw_shares(axes[1], linear, indices)
    figure.savefig(path, dpi=150)


def draw_values(axes: Any, found: Uncertainty, measure: str, measured: float | None) -> None:
    """Histogram of all runs, the intervals, and a measured value."""
    spread = found.spread(measure)
    values = np.array([value for row in found.values(measure) for value in row])
    axes.hist(values, bins=min(30, max(5, round(math.sqrt(len(values))))), color=PALE)
    top = axes.get_ylim()[1]
    for height, low, high, label, color in (
        (0.06, spread.low, spread.high, f"{spread.of_runs}, inputs and seeds", BLUE),
        (0.13, spread.inputs_low, spread.inputs_high, f"{spread.of_means}, inputs alone", GREEN),
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


def draw_shares(axes: Any, linear: LinearShares | None, indices: Sequence[Index]) -> None:
    """Bars of the linear share, the first and the total order of every input, with their 95 % intervals."""
    bars: list[tuple[str, str, list[tuple[str, float, float]]]] = []
    if linear:
        label = f"straight line (all: {linear.explained:.2f} ± {linear.explained_interval:.2f})"
        bars.append((GREEN, label, [(i.key, i.share, i.interval) for i in linear.inputs]))
    if indices:
        bars.append((BLUE, "Sobol, first order", [(i.key, i.first, i.first_interval) for i in indices]))
        bars.append((PALE, "Sobol, total order", [(i.key, i.total, i.total_interval) for i in indices]))
    height = 0.8 / len(bars)
    for number, (color, label, rows) in enumerate(bars):
        place = np.arange(len(rows)) + (number - 0.5 * (len(bars) - 1)) * height
        halves = [0.0 if math.isnan(half) else half for _, _, half in rows]
        axes.barh(
            place, [share for _, share, _ in rows], 0.9 * height, xerr=halves, color=color, label=label, capsize=3
        )
    axes.set_yticks(range(len(bars[0][2])), [key for key, _, _ in bars[0][2]])
    axes.invert_yaxis()
    axes.axvline(0.0, color="0.4", linewidth=0.8)
    axes.set(xlabel="share of the variance over the inputs")
    axes.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)  # over the bars, not on them
