"""Paths of parts on a standing wave -> mean drift and diffusion over the angle from antinode to node.

What counts is where a part is at the begin of an increment and where after a *lag*. The lag has to be longer than a
part remembers a hop, so that the increments make a chain without memory, and short against the way to the node.
Increments of one path follow on each other and do not overlap. Standard errors are those between seeds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
LEAST = 8  # increments of a bin that a mean is made of


@dataclass(frozen=True)
class Bins:
    """Of every bin (n,): drift [m/s] toward the node, its standard error, diffusion [m^2/s] along and across, count."""

    drift: Floats
    drift_se: Floats
    along: Floats
    across: Floats
    count: NDArray[np.int64]


def binned(paths: Iterable[Floats], steps: int, lag: float, wavenumber: float, bins: int) -> Bins:
    """Put the increments of many paths into bins of the angle.

    Args:
        paths: places (frames, 2) [m] of one part each, without the time that it takes to forget its start.
        steps: frames of an increment.
        lag: their duration [s].
        wavenumber: of the wave, whose antinode is at x = 0 [1/m].
        bins: of the angle from 0 to pi/2.
    """
    seeds, places, moves = [], [], []
    for number, path in enumerate(paths):
        ends = path[:: max(steps, 1)]
        seeds.append(np.full(max(len(ends) - 1, 0), number))
        places.append(ends[:-1, 0])
        moves.append(np.diff(ends, axis=0))
    seed, (angle, sign) = np.concatenate(seeds), folded(wavenumber * np.concatenate(places))
    move = np.concatenate(moves)
    move[:, 0] *= sign
    index = np.minimum((angle * (2.0 / math.pi) * bins).astype(int), bins - 1)
    values = [_of_bin(move[index == j], seed[index == j], lag) for j in range(bins)]
    drift, drift_se, along, across = np.array(values).T
    return Bins(drift, drift_se, along, across, np.bincount(index, minlength=bins))


def folded(phase: Floats) -> tuple[Floats, Floats]:
    """Angle (n,) from the next antinode, 0 to pi/2, of phases k x (n,); and the sign of x toward the node there."""
    turned = np.mod(phase, math.pi)
    far = turned > 0.5 * math.pi
    return np.where(far, math.pi - turned, turned), np.where(far, -1.0, 1.0)


def _of_bin(move: Floats, seed: NDArray[np.int64], lag: float) -> tuple[float, float, float, float]:
    """Drift, its standard error, and both diffusions of the increments (m, 2) of one bin; NaN of too few."""
    if len(move) < LEAST:
        return math.nan, math.nan, math.nan, math.nan
    drift = float(move[:, 0].mean())
    _, own = np.unique(seed, return_inverse=True)
    excess = np.bincount(own, move[:, 0] - drift)  # of every seed over the mean: a ratio of sums over seeds
    m = len(excess)
    error = math.sqrt(float((excess**2).sum()) * m / max(m - 1, 1)) / len(move)
    spread = ((move - [drift, 0.0]) ** 2).mean(axis=0) / (2.0 * lag)
    return drift / lag, error / lag, float(spread[0]), float(spread[1])
