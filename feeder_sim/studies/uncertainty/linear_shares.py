"""Linear shares: how much of the variance over the inputs a straight line in each of them explains. Any draws will do.

The means of the draws are fitted by least squares, y = a + sum of b_i x_i. Of inputs that are independent of each other

    share of input i = b_i^2 var(x_i) / V

is the square of its standardised regression coefficient (Saltelli et al., Global Sensitivity Analysis: The Primer,
2008, section 1.2.5). V is the variance over the inputs, without the scatter of the seeds. What the fit takes from
chance, the variance of b_i times var(x_i), is subtracted. Where the result is such a sum of straight lines, these are
the Sobol indices, of first and of total order, and they take far fewer draws; *explained* says whether it is.

Intervals are a bootstrap over those draws that are independent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.scenario import Scenario, Uncertain
from feeder_sim.scenario.changes import labels
from feeder_sim.studies.uncertainty.spread import Draw

RESAMPLES = 400  # of the bootstrap: the ends of a 95 % interval lie between its 10th and 11th values
ENDS = (0.025, 0.975)  # of the intervals
LEAST_FREEDOM = 4  # draws more than the fit has numbers; with fewer neither shares nor intervals mean much


@dataclass(frozen=True)
class Share:
    """Of the variance over the inputs, what one input explains by a straight line, with half its 95 % interval."""

    key: str
    share: float
    interval: float


@dataclass(frozen=True)
class LinearShares:
    """What all inputs explain.

    Attributes:
        inputs: the share of each.
        explained: the share of all together; 1 for a sum of straight lines, but for chance.
        explained_interval: half of its 95 % interval.
    """

    inputs: tuple[Share, ...]
    explained: float
    explained_interval: float


def linear_shares(
    scenario: Scenario, draws: Sequence[Draw], values: Sequence[Sequence[float]], group: int = 1
) -> LinearShares | None:
    """Shares of every uncertain input; None where the inputs are not told apart from the seeds, or draws are too few.

    Args:
        scenario: with the uncertain inputs.
        draws: the values of the inputs.
        values: of the seeds at each draw; draws without any do not count.
        group: so many draws after each other share values of inputs, as in Saltelli's sample.
    """
    scatters = [np.var(row, ddof=1) / len(row) for row in values if len(row) > 1]
    if not scatters:
        return None  # nobody knows how far seeds scatter
    uncertain = scenario.uncertain or {}
    has_values = np.array([len(row) > 0 for row in values])
    columns = [_columns(u, [draw.get(key) for draw in draws])[has_values] for key, u in uncertain.items()]
    means, scatter = np.array([np.mean(row) for row in values if len(row)]), float(np.mean(scatters))
    (shares,) = _fits(columns, means, scatter, np.ones((1, len(means))))
    if np.isnan(shares).any():
        return None
    rng, groups = np.random.default_rng(scenario.run.seed), len(draws) // group
    times = rng.multinomial(groups, np.full(groups, 1.0 / groups), RESAMPLES)
    resampled = _fits(columns, means, scatter, np.repeat(times, group, axis=1)[:, has_values].astype(float))
    valid = resampled[np.isfinite(resampled).all(axis=1)]
    missing = np.full(len(shares), math.nan)
    half = 0.5 * np.ptp(np.quantile(valid, ENDS, axis=0), axis=0) if len(valid) > RESAMPLES // 2 else missing
    inputs = tuple(Share(key, float(shares[i]), float(half[i])) for i, key in enumerate(uncertain))
    return LinearShares(inputs, float(shares[-1]), float(half[-1]))


def _fits(
    columns: Sequence[NDArray[np.float64]], means: NDArray[np.float64], scatter: float, times: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The share of each input, then that of all, for every resample; NaN where they cannot be told.

    Args:
        columns: of each input (draws, its columns).
        means: of the draws (draws,).
        scatter: variance of such a mean by its seeds.
        times: how often a resample has each draw (resamples, draws).
    """
    matrix = np.hstack(columns)
    count = times.sum(axis=1)
    freedom = count - 1.0 - matrix.shape[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        table = np.hstack([matrix, means[:, None]])
        middle = times @ table / count[:, None]
        products = np.einsum("rn,ni,nj->rij", times, table, table, optimize=True) / count[:, None, None]
        spread = (products - middle[:, :, None] * middle[:, None, :]) * (count / (count - 1.0))[:, None, None]
        of_inputs = spread[:, -1, -1] - scatter
        of_inputs[(freedom < LEAST_FREEDOM) | (of_inputs <= 0.0)] = math.nan
        input_spread, shared = spread[:, :-1, :-1], spread[:, :-1, -1]
        inverse = np.linalg.pinv(np.nan_to_num(input_spread), hermitian=True)
        slopes = np.einsum("rij,rj->ri", inverse, shared)
        residual = (spread[:, -1, -1] - np.einsum("ri,ri->r", slopes, shared)) * (count - 1.0) / freedom
        covariance = inverse * (residual / (count - 1.0))[:, None, None]
        shares, first = [], 0
        for column in columns:
            part = slice(first, first := first + column.shape[1])
            explained = np.einsum("ri,rij,rj->r", slopes[:, part], input_spread[:, part, part], slopes[:, part])
            by_chance = np.einsum("rij,rji->r", covariance[:, part, part], input_spread[:, part, part])
            shares.append((explained - by_chance) / of_inputs)
        return np.array([*shares, 1.0 - (residual - scatter) / of_inputs]).T


def _columns(uncertain: Uncertain, values: Sequence[object]) -> NDArray[np.float64]:
    """An input as columns of the fit: its values, their logarithms, or a column for each choice but the first."""
    if uncertain.choice is not None:
        names, choices = [_name(value) for value in values], [_name(choice) for choice in uncertain.choice[1:]]
        return np.array([[name == choice for choice in choices] for name in names], float)
    numbers = np.array(values, float)[:, None]
    return np.log(numbers) if uncertain.log_uniform else numbers


def _name(choice: object) -> str:
    """A choice as a table of draws has it, from which 1 comes back as 1.0."""
    label = labels({"": choice})[""]
    return str(float(label) if isinstance(label, int) and not isinstance(label, bool) else label)
