"""How far a result spreads over uncertain inputs, and how far over seeds, apart.

With S seeds at each of N draws of the inputs, the mean of a draw varies by

    var(mean of a draw) = var(inputs) + var(seeds) / S

(one-way analysis of variance, Searle, Casella and McCulloch, Variance Components, section 3.5). The variance of the
seeds is known from within the draws, that of the inputs is the rest. For an interval over the inputs the means are
drawn together towards their own mean until only that rest is left. Where nothing is left, because the means scatter no
more than the seeds let them, the inputs are not told apart from the seeds: how far they reach is not known, and there
is no interval over them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.statistic import finite_or_none
from feeder_sim.scenario import Scenario

# Draws of the uncertain inputs of a scenario: a scrambled Sobol sequence, or Saltelli's sample for Sobol indices.

Draw = dict[str, Any]  # a value for each uncertain key, and for those tied to it


def draws_of(scenario: Scenario, count: int) -> list[Draw]:
    """So many draws of all uncertain inputs; a single one without values where there are none."""
    if not scenario.uncertain:
        return [{}]
    from scipy.stats import qmc

    exponent = int(np.ceil(np.log2(max(2, count))))
    joint = [uncertain.joint is not None for uncertain in scenario.uncertain.values()]
    independent = joint.count(False)
    shares = qmc.Sobol(independent + any(joint), rng=scenario.run.seed).random_base2(exponent)[:count]
    columns = np.where(joint, independent, np.cumsum(np.logical_not(joint)) - 1)  # joint inputs have one share together
    return [draw_at(scenario, row[columns]) for row in shares]


def draw_at(scenario: Scenario, shares: Sequence[float] | NDArray[np.float64]) -> Draw:
    """The values below which these shares of all lie (inputs,) [1]."""
    draw: Draw = {}
    for (key, uncertain), share in zip((scenario.uncertain or {}).items(), shares, strict=True):
        draw |= dict.fromkeys((key, *uncertain.also), uncertain.at(float(share)))
    return draw


INTERVAL = (0.05, 0.95)  # quantiles of the intervals: 90 %
NOT_SEPARATED = "not told apart from the seeds"


@dataclass(frozen=True)
class Spread:
    """NaN where there are too few draws, or too few seeds, to tell.

    Attributes:
        median: over all draws and seeds.
        low, high: 90 % interval of a single run: inputs and seeds together.
        inputs_low, inputs_high: 90 % interval of the mean over the seeds; NaN also where `sd_inputs` is 0 because the
            inputs are not told apart from the seeds.
        sd_inputs, sd_seeds: standard deviations, apart.
        se: standard error of the mean over all.
        draws: with a value.
        runs: with a value.
    """

    median: float
    low: float
    high: float
    inputs_low: float
    inputs_high: float
    sd_inputs: float
    sd_seeds: float
    se: float
    draws: int
    runs: int

    @property
    def of_runs(self) -> str:
        """What `low` and `high` hold, in words."""
        return f"{_percent(self.runs)} of runs"

    @property
    def of_means(self) -> str:
        """What `inputs_low` and `inputs_high` hold, in words."""
        return f"{_percent(self.draws)} of means"

    @property
    def is_separated(self) -> bool:
        """Whether there is an interval over the inputs."""
        return math.isfinite(self.inputs_low)

    @property
    def separation_reason(self) -> str:
        """Why there is no interval over the inputs, in words; "" where there is one, or too little to tell."""
        return NOT_SEPARATED if self.sd_inputs == 0.0 and not self.is_separated else ""

    def as_dict(self) -> dict[str, float | None]:
        """The columns of a table; None where there is no value."""
        values = {"low": self.inputs_low, "high": self.inputs_high, "sd_inputs": self.sd_inputs}
        values["sd_seeds"] = self.sd_seeds
        return {name: finite_or_none(value) for name, value in values.items()}


def spread_of(values: Sequence[Sequence[float]]) -> Spread:
    """From the values of the seeds at each draw of the inputs; those that are not finite do not count."""
    draws = [[value for value in draw if math.isfinite(value)] for draw in values]
    draws = [draw for draw in draws if draw]
    if not draws:
        return Spread(*(math.nan,) * 8, 0, 0)
    everything = np.concatenate([np.array(draw) for draw in draws])
    means, sizes = np.array([np.mean(draw) for draw in draws]), np.array([len(draw) for draw in draws])
    within = sum(float(np.var(draw, ddof=1)) * (len(draw) - 1) for draw in draws if len(draw) > 1)
    freedom = int((sizes - 1).sum())
    of_seeds = within / freedom if freedom else math.nan
    of_means = float(np.var(means, ddof=1)) if len(means) > 1 else math.nan
    remaining = of_means - of_seeds * float(np.mean(1.0 / sizes))
    of_inputs = max(remaining, 0.0) if math.isfinite(remaining) else math.nan
    low, high = interval_of(everything)
    inputs_low = inputs_high = math.nan
    constant = math.isfinite(remaining) and everything.min() == everything.max()
    if remaining > 0.0 or constant:
        share = math.sqrt(of_inputs / of_means) if of_means > 0.0 else 0.0
        drawn = means.mean() + share * (means - means.mean())
        inputs_low, inputs_high = interval_of(drawn)
    return Spread(
        median=float(np.median(everything)),
        low=low,
        high=high,
        inputs_low=inputs_low,
        inputs_high=inputs_high,
        sd_inputs=math.sqrt(of_inputs),
        sd_seeds=math.sqrt(of_seeds),
        se=math.sqrt(of_means / len(means)) if len(means) > 1 else math.nan,
        draws=len(means),
        runs=len(everything),
    )


def interval_of(values: Sequence[float] | NDArray[np.float64]) -> tuple[float, float]:
    """The interval that holds another value, drawn as these were, with a chance of 90 %.

    The chance that another value lies below the k-th of n is k / (n + 1), whatever they are drawn from. NumPy's usual
    quantiles lie further inward: of 16 values they would hold 84 %. Of fewer than 19 values the least and the largest
    are the interval, which hold (n - 1) / (n + 1).
    """
    low, high = np.quantile(values, INTERVAL, method="weibull")
    return float(low), float(high)


def _percent(n: int) -> str:
    """What share such an interval of n values holds: that between the least and the largest, if they are few."""
    share = INTERVAL[1] - INTERVAL[0]
    return f"{100.0 * min(share, (n - 1) / (n + 1)):.0f} %"
