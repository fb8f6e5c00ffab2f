"""Pictures of uncertain inputs: what a measure may be, and which inputs it hangs on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from feeder_sim.document.figure import Figure
from feeder_sim.document.words import between, key_words, measure_label, number
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plots.sweep import Mean, sample_figure

if TYPE_CHECKING:
    from feeder_sim.studies.uncertainty.indices import Index
    from feeder_sim.studies.uncertainty.linear_shares import LinearShares
    from feeder_sim.studies.uncertainty.uncertainty import Uncertainty

BLUE, PALE, RED, GREEN = "#3a60be", "#b8c6ea", "#be3434", "#3a8a5a"
MOST_PANELS = 9  # of inputs; more would make the picture too high
ROOM = 1.45  # of the height of a histogram, with the legend above it


def uncertainty_figures(study: Uncertainty, measure: str) -> list[Figure]:
    """How a measure spreads, what it depends on where that can be told, and its draws over each input."""
    linear, indices = study.linear_shares(measure), study.indices(measure)
    shares = [_shares_figure(linear, indices, measure)] if linear or indices else []
    return [_spread_figure(study, measure, study.question.measured), *shares, _inputs_figure(study, measure)]


def _spread_figure(study: Uncertainty, measure: str, measured: float | None) -> Figure:
    """All runs as a histogram, with the intervals and a measured value."""
    label, spread = measure_label(measure), study.spread(measure)
    runs = sum(len(row) for row in study.values(measure))
    alt = f"Histogram of {label} in {runs} runs: median {number(spread.median)}, {spread.of_runs} "
    alt += f"{between(spread.low, spread.high)}{f', measured {number(measured)}' if measured is not None else ''}."
    caption = f"{label}: {runs} runs, every seed of every draw. Bars: {spread.of_runs}"
    caption += f", and {spread.of_means} over many seeds." if math.isfinite(spread.inputs_low) else "."
    return Figure(lambda figure: draw_values(figure.add_subplot(), study, measure, measured), 3.4, alt, caption)


def _inputs_figure(study: Uncertainty, measure: str) -> Figure:
    """The mean of every draw over each uncertain input."""
    keys, label = list(study.scenario.uncertain or {})[:MOST_PANELS], measure_label(measure)
    pairs = zip(study.draws, study.values(measure), strict=True)
    rows = [Mean(draw, Statistic.of([float(np.mean(values))])) for draw, values in pairs if values]
    alt = f"{label} over {' and '.join(keys)}, {len(rows)} draws."
    return sample_figure(rows, keys, label, alt=alt, caption=f"{label}: means over the seeds of each draw.")


def _shares_figure(linear: LinearShares | None, indices: Sequence[Index], measure: str) -> Figure:
    """The linear shares and the Sobol indices of a measure as bars."""
    label, keys = measure_label(measure), [i.key for i in (linear.inputs if linear else indices)]
    kinds = [("by straight lines", [i.share for i in linear.inputs])] if linear else []
    kinds += [("Sobol, first order", [i.first for i in indices])] if indices else []
    texts = [f"{kind}: {', '.join(f'{k} {s:.2f}' for k, s in zip(keys, s_, strict=True))}" for kind, s_ in kinds]
    return Figure(
        lambda figure: draw_shares(figure.add_subplot(), linear, indices),
        height=1.2 + (0.4 + 0.2 * len(kinds)) * len(keys),
        alt=f"Shares of the variance of {label}; {'; '.join(texts)}.",
        caption=f"{label}: share of its variance over the inputs that depends on each. Lines are 95 % intervals.",
    )


def draw_values(axes: Any, study: Uncertainty, measure: str, measured: float | None) -> None:
    """Histogram of all runs, the intervals, and a measured value."""
    spread = study.spread(measure)
    values = np.array([value for row in study.values(measure) for value in row])
    axes.hist(values, bins=min(30, max(5, round(math.sqrt(len(values))))), color=PALE)
    top = axes.get_ylim()[1]
    for height, low, high, label, color in (
        (0.06, spread.low, spread.high, f"{spread.of_runs}, inputs and seeds", BLUE),
        (0.13, spread.inputs_low, spread.inputs_high, f"{spread.of_means}, inputs alone", GREEN),
    ):
        if math.isfinite(low):
            axes.plot([low, high], [height * top] * 2, "|-", color=color, linewidth=2.5, markersize=9, label=label)
    if spread.separation_reason:
        axes.plot([], [], " ", label=f"means, inputs alone:\n{spread.separation_reason}")
    below = 1.0 / ROOM  # the legend
    axes.axvline(spread.median, ymax=below, color=BLUE, linestyle="--", label=f"median {spread.median:.4g}")
    if measured is not None:
        axes.axvline(measured, ymax=below, color=RED, linewidth=1.8, label=f"measured {measured:g}")
    axes.set(xlabel=measure_label(measure), ylabel="runs", ylim=(0.0, ROOM * top))
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
    for place_of, (color, label, rows) in enumerate(bars):
        place = np.arange(len(rows)) + (place_of - 0.5 * (len(bars) - 1)) * height
        halves = [0.0 if math.isnan(half) else half for _, _, half in rows]
        axes.barh(
            place, [share for _, share, _ in rows], 0.9 * height, xerr=halves, color=color, label=label, capsize=3
        )
    axes.set_yticks(range(len(bars[0][2])), [key_words(key) for key, _, _ in bars[0][2]])
    axes.invert_yaxis()
    axes.axvline(0.0, color="0.4", linewidth=0.8)
    axes.set(xlabel="share of the variance over the inputs")
    axes.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)  # over the bars, not on them
