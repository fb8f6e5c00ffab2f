"""Sobol indices: which uncertain input a result hangs on. Sample and estimators are those of SALib.

*First order* S: the share of the variance over the inputs that would go if this input were known. *Total order* T: the
share that would stay if all others were known (Saltelli et al., Computer Physics Communications 181, 259, 2010).

SALib's indices S' and T' are shares of the variance of two independent samples of all inputs, A and B: var(Y). Seeds
scatter too. With the scatter of a mean, s2, known from the seeds, the variance over the inputs is V = var(Y) - s2.
Estimators of S compare draws that share an input, whose scatter is independent: V S = var(Y) S'. Those of T compare
draws that differ in one input, which the scatter makes differ by 2 s2 on the mean square: V T = var(Y) T' - s2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import MissingExtra
from feeder_sim.scenario import Scenario
from feeder_sim.studies.uncertainty.spread import Draw, draw_at

RESAMPLES = 200  # of the bootstrap that SALib makes the intervals with


@dataclass(frozen=True)
class Index:
    """Indices of one input, with the half widths of their 95 % intervals; NaN where the inputs change nothing."""

    key: str
    first: float
    first_interval: float
    total: float
    total_interval: float


def saltelli_draws(scenario: Scenario, base: int) -> list[Draw]:
    """Saltelli's sample: `base` times (inputs + 2) draws; `base` is a power of two.

    Raises:
        InputError: SALib is not installed.
    """
    sample = _salib("SALib.sample.sobol").sample
    shares = sample(_problem(scenario), base, calc_second_order=False, seed=scenario.run.seed)
    return [draw_at(scenario, row) for row in shares]


def sobol_indices(scenario: Scenario, values: Sequence[Sequence[float]]) -> list[Index]:
    """Indices of every uncertain input from the values of the seeds at each draw of `saltelli_draws`.

    A draw without a value makes all of them NaN, and so do draws of one seed each, whose scatter is not known.
    """
    keys = list(scenario.uncertain or {})
    means = np.array([np.mean(draw) if len(draw) else math.nan for draw in values])
    scatter = _scatter(values)
    # Of A and B, the first and the last of every (inputs + 2) draws. Those between differ from A in one input alone.
    apart = np.concatenate([means[:: len(keys) + 2], means[len(keys) + 1 :: len(keys) + 2]])
    variance = float(np.var(apart)) if np.isfinite(means).all() else math.nan
    inputs = variance - scatter
    if not inputs > 0.0:
        return [Index(key, *(math.nan,) * 4) for key in keys]
    analyze = _salib("SALib.analyze.sobol").analyze
    estimates = analyze(
        _problem(scenario),
        means,
        calc_second_order=False,
        num_resamples=RESAMPLES,
        seed=scenario.run.seed + 1,  # SALib takes 0 for no seed, and its intervals would be others each time
    )
    scale, shift = variance / inputs, scatter / inputs
    return [
        Index(
            key,
            float(scale * estimates["S1"][i]),
            float(scale * estimates["S1_conf"][i]),
            float(scale * estimates["ST"][i] - shift),
            float(scale * estimates["ST_conf"][i]),
        )
        for i, key in enumerate(keys)
    ]


def _scatter(values: Sequence[Sequence[float]]) -> float:
    """Variance of the mean of a draw by its seeds, the mean over all draws; NaN where each has but one."""
    variances: NDArray[np.float64] = np.array([np.var(draw, ddof=1) / len(draw) for draw in values if len(draw) > 1])
    return float(variances.mean()) if len(variances) else math.nan


def _problem(scenario: Scenario) -> dict[str, Any]:
    keys = list(scenario.uncertain or {})
    return {"num_vars": len(keys), "names": keys, "bounds": [[0.0, 1.0]] * len(keys)}


def _salib(module: str) -> Any:
    try:
        import importlib

        return importlib.import_module(module)
    except ImportError:
        raise MissingExtra("uncertainty", argument="indices") from None
