"""Means with their 95 % intervals, and the bundles of curves they come from.

The interval is that of the mean for independent seeds, by Student's t: mean +- t(0.975, n - 1) SE.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.statistic import Statistic, half_interval

COLOURS = ("#1f5fa8", "#c2571a", "#2a8a5f", "#8a4fa3", "#b3261e", "#5b6875")  # of curves, in this order
SEED = "#aab4bf"  # of the thin curve of a single seed
POINTS = 400  # of a curve at most; a picture has no room for more
DODGE = 0.06  # of the distance of two points; curves side by side, so that their bars do not hide each other


def thinned(n: int) -> NDArray[np.int64]:
    """Indices of at most `POINTS` of n points, the last one included."""
    return np.unique(np.linspace(0, n - 1, min(n, POINTS)).round().astype(np.int64))


def draw_band(axes: Any, x: NDArray[np.float64], curves: NDArray[np.float64], *, label: str, colour: str) -> None:
    """Draw the mean of curves (seeds, n) over x (n,) with a band for its interval."""
    mean = curves.mean(axis=0)
    axes.plot(x, mean, color=colour, linewidth=1.8, label=label)
    if len(curves) > 1:
        se = curves.std(axis=0, ddof=1) / math.sqrt(len(curves))
        half = half_interval(1.0, len(curves)) * se
        axes.fill_between(x, mean - half, mean + half, color=colour, alpha=0.25, linewidth=0.0)


def draw_bars(
    axes: Any, x: Sequence[float], statistics: Sequence[Statistic], *, label: str, colour: str, shift: float = 0.0
) -> None:
    """Draw means over x, joined by a line, with their intervals; those without a value are left out."""
    held = [(at + shift, s) for at, s in zip(x, statistics, strict=True) if s.n]
    half = [half_interval(s.se, s.n) if s.n > 1 else 0.0 for _, s in held]
    axes.errorbar(
        [at for at, _ in held],
        [s.mean for _, s in held],
        yerr=half,
        color=colour,
        marker="o",
        markersize=3.5,
        linewidth=1.2,
        elinewidth=1.0,
        capsize=2.0,
        label=label,
    )
