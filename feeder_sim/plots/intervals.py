"""Means with their 95 % intervals, and the bundles of curves they come from.

The interval is that of the mean for independent seeds, by Student's t: mean ± t(0.975, n - 1) SE. That of two values is
as wide as 25 standard errors, far beyond what most measures can be, and would hide all others: it is not drawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.statistic import Statistic, half_interval
from feeder_sim.records.trajectory import Frames

COLOURS = ("#1f5fa8", "#c2571a", "#2a8a5f", "#8a4fa3", "#b3261e", "#5b6875")  # of curves, in this order
SEED = "#aab4bf"  # of the thin curve of a single seed
FEWEST = 3  # values of a mean whose interval is drawn
POINTS = 400  # of a curve at most; a picture has no room for more
DODGE = 0.06  # of the distance of two points; curves side by side, so that their bars do not hide each other


def thinned(n: int) -> NDArray[np.int64]:
    """Indices of at most `POINTS` of n points, the last one included."""
    return np.unique(np.linspace(0, n - 1, min(n, POINTS)).round().astype(np.int64))


def draw_band(axes: Any, x: NDArray[np.float64], curves: NDArray[np.float64], *, label: str, colour: str) -> None:
    """Draw the mean of curves (seeds, n) over x (n,) with a band for its interval."""
    mean = curves.mean(axis=0)
    axes.plot(x, mean, color=colour, linewidth=1.8, label=label)
    if len(curves) >= FEWEST:
        se = curves.std(axis=0, ddof=1) / math.sqrt(len(curves))
        half = half_interval(1.0, len(curves)) * se
        axes.fill_between(x, mean - half, mean + half, color=colour, alpha=0.25, linewidth=0.0)


def draw_over_time(
    axes: Any, seeds: Sequence[Frames], value: Callable[[Frames], NDArray[np.float64]], *, counted: Sequence[bool]
) -> None:
    """Draw a value of every seed over time as a thin curve, and the mean with its interval while all counted seeds run.

    A mean over the seeds that are left would be one of the slow ones.

    Args:
        axes: time in s.
        seeds: with the same times, as far as they go.
        value: of the frames of a seed, (n,).
        counted: whether a seed is part of the mean; the others are dashed.
    """
    common = min((len(frames) for frames, counts in zip(seeds, counted, strict=True) if counts), default=0)
    curves = []
    for frames, counts in zip(seeds, counted, strict=True):
        values, rows = value(frames), thinned(len(frames))
        axes.plot(frames.time[rows], values[rows], color=SEED, linewidth=0.7, linestyle="-" if counts else "--")
        if counts and common:
            curves.append(values[thinned(common)])
    axes.plot([], [], color=SEED, linewidth=0.7, label="single seeds")
    if not curves:
        return
    time = next(frames.time for frames, counts in zip(seeds, counted, strict=True) if counts)[thinned(common)]
    draw_band(axes, time, np.stack(curves), label=f"mean of {len(curves)} seeds", colour=COLOURS[0])


def drawn_half(statistic: Statistic) -> float:
    """Half the interval of a mean; 0 of a mean of too few values."""
    return half_interval(statistic.se, statistic.n) if statistic.n >= FEWEST else 0.0


def draw_bars(
    axes: Any, x: Sequence[float], statistics: Sequence[Statistic], *, label: str, colour: str, shift: float = 0.0
) -> None:
    """Draw means over x, joined by a line, with their intervals; those without a value are left out."""
    points = [(at + shift, s) for at, s in zip(x, statistics, strict=True) if s.n]
    half = [drawn_half(s) for _, s in points]
    axes.errorbar(
        [at for at, _ in points],
        [s.mean for _, s in points],
        yerr=half,
        color=colour,
        marker="o",
        markersize=3.5,
        linewidth=1.2,
        elinewidth=1.0,
        capsize=2.0,
        label=label,
    )
