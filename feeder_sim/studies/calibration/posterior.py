"""Where constants may be once something has been measured: draws from the priors, weighted by how well they fit.

Means over n measured runs with the standard deviations s between them are a Student's t with n - 1 degrees of freedom
about the true ones, of widths s / sqrt(n); several measures of the same runs hang together as they do in runs of one
point (Wood, Nature 466 (2010) 1102). The emulators' own uncertainty adds to that. Weighted draws become equally likely
ones by systematic resampling (importance resampling, Rubin 1988).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.statistic import Statistic
from feeder_sim.studies.calibration.emulator import Emulator

FIRST_EXPONENT, LAST_EXPONENT = 14, 18  # powers of two: draws from the priors
ENOUGH = 1000  # effective draws
FEW = 100  # effective draws below which the posterior is not known
DRAWS = 1000  # of the posterior
UNIFORM_VARIANCE = 1.0 / 12.0  # of a share of a prior
DECIDED = 0.5  # of the standard deviation of the prior: a direction that is left less is decided
GOES_WITH = 0.5  # correlation from which two constants are told to trade off
RIDGE = 1e-6  # by which a correlation is kept apart from 1
FAR = 3.0  # standard errors: no constants of the prior explain such a measurement


@dataclass(frozen=True)
class Observed:
    """One experiment.

    Attributes:
        measured: over its runs, by measure.
        emulators: of the same measures.
        correlation: between them in runs of one point, (measures, measures).
        constants: places of the constants that the emulators take.
    """

    measured: Mapping[str, Statistic]
    emulators: tuple[Emulator, ...]
    correlation: NDArray[np.float64]
    constants: tuple[int, ...]

    @cached_property
    def mean(self) -> NDArray[np.float64]:
        """Measured, (measures,)."""
        return np.array([each.mean for each in self.measured.values()])

    @cached_property
    def standard_error(self) -> NDArray[np.float64]:
        """Of these means, (measures,); a single run scatters as those that are computed."""
        pairs = zip(self.measured.values(), self.emulators, strict=True)
        return np.array([each.se if math.isfinite(each.se) else of.scatter / math.sqrt(each.n) for each, of in pairs])

    def prediction(self, shares: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Means over runs and their standard deviations at shares of all priors (n, all constants); (n, measures)."""
        of_each = [emulator.at(shares[:, self.constants]) for emulator in self.emulators]
        mean, sd = (np.stack(columns, axis=1) for columns in zip(*of_each, strict=True))
        return mean, sd

    def apart(self, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Measured less predicted, over the standard error of both, (n, measures)."""
        mean, sd = self.prediction(shares)
        return np.asarray((self.mean - mean) / np.hypot(sd, self.standard_error))

    def log_likelihood(self, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of the measured means, (n,), but for a constant."""
        mean, sd = self.prediction(shares)
        error, n = self.standard_error, min(each.n for each in self.measured.values())
        size = len(error)
        covariance = np.outer(error, error) * self.correlation + np.eye(size) * sd[:, None, :] ** 2
        away = self.mean - mean
        square = np.einsum("ni,ni->n", away, np.linalg.solve(covariance, away[..., None])[..., 0])
        tail = 0.5 * (n - 1 + size) * np.log1p(square / (n - 1)) if n > 1 else 0.5 * square
        return np.asarray(-tail - 0.5 * np.linalg.slogdet(covariance)[1])


@dataclass(frozen=True)
class Posterior:
    """Equally likely draws.

    Attributes:
        shares: of the priors, (draws, constants).
        effective: how many independent draws the weights amount to.
        nearest: of each experiment the smallest distance between measurement and prediction over the whole prior, in
            standard errors; of several measures that of the one which is furthest away.
    """

    shares: NDArray[np.float64]
    effective: float
    nearest: tuple[float, ...]

    @staticmethod
    def of(observed: Sequence[Observed], constants: int, seed: int, draws: int = DRAWS) -> Posterior:
        """The posterior of all experiments together; without any it is the prior."""
        from scipy.stats import qmc

        for exponent in range(FIRST_EXPONENT, LAST_EXPONENT + 1, 2):
            shares = qmc.Sobol(constants, rng=seed).random_base2(exponent)
            logs = sum((each.log_likelihood(shares) for each in observed), np.zeros(len(shares)))
            weights = np.exp(logs - logs.max())
            weights /= weights.sum()
            effective = 1.0 / float((weights**2).sum())
            if effective >= ENOUGH:
                break
        nearest = tuple(float(np.abs(each.apart(shares)).max(axis=1).min()) for each in observed)
        return Posterior(shares[resampled(weights, draws, np.random.default_rng(seed))], effective, nearest)

    @cached_property
    def covariance(self) -> NDArray[np.float64]:
        """Over that of one share of a prior: 1 on the diagonal where nothing is learnt, (constants, constants)."""
        return np.atleast_2d(np.cov(self.shares.T)) / UNIFORM_VARIANCE

    @property
    def left(self) -> NDArray[np.float64]:
        """Of the standard deviation of each constant's prior, (constants,) [1]."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def directions(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What is left of the prior's standard deviation along each principal direction, the least first, and these.

        Shapes (constants,) and (constants, constants), a direction per row.
        """
        variance, vectors = np.linalg.eigh(self.covariance)
        return np.sqrt(np.maximum(variance, 0.0)), vectors.T

    def words(self, names: Sequence[str]) -> list[str]:
        """What the data decide, and what they do not, a line each."""
        lines = []
        left, directions = self.directions
        for k in np.flatnonzero(left < DECIDED):
            lines.append(f"decided to {100.0 * left[k]:.0f} % of the prior: {_combination(directions[k], names)}")
        for k in np.flatnonzero(left >= DECIDED):
            lines.append(
                f"not decided ({100.0 * left[k]:.0f} % of the prior left): {_combination(directions[k], names)}"
            )
        correlation = self.covariance / np.outer(self.left, self.left)
        for i in range(len(names)):
            for j in range(i):
                r = float(correlation[i, j])
                if abs(r) >= GOES_WITH:
                    other = "smaller" if r < 0.0 else "larger"
                    trade = f"a larger {names[j]} goes with a {other} {names[i]} (correlation {r:+.2f})"
                    lines.append(f"{trade}: the data hold them together, not each by itself")
        return lines

    def narrowed_by(self, candidate: Observed, values: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """What one more experiment would leave of the standard deviation of values (draws, n), (n,).

        By default of the constants. By the straight lines between values and the mean of the experiment (Bayes linear;
        Goldstein and Wooff 2007).
        """
        mean, sd = (column[:, 0] for column in candidate.prediction(self.shares))
        noise = float((sd**2).mean() + candidate.standard_error[0] ** 2)
        deviation = mean - mean.mean()
        values = self.shares if values is None else values
        away = values - values.mean(axis=0)
        covariance = (away * deviation[:, None]).mean(axis=0)
        gained = covariance**2 / (float((deviation**2).mean()) + noise)
        variance = np.maximum((away**2).mean(axis=0), 1e-30)
        return np.asarray(np.sqrt(np.maximum(1.0 - gained / variance, 0.0)))


def resampled(weights: NDArray[np.float64], draws: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Rows of weighted draws as equally likely ones, shuffled, shape (draws,); weights add up to 1."""
    places = (np.arange(draws) + rng.random()) / draws
    return rng.permutation(np.minimum(np.searchsorted(np.cumsum(weights), places), len(weights) - 1))


def within_correlation(values: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Correlation of measures in runs of one point, over points of runs (runs, measures), each over its own scatter."""
    size, whole = values[0].shape[1], [rows for rows in values if np.isfinite(rows).all() and len(rows) > 1]
    if sum(len(rows) for rows in whole) <= size + len(whole):
        return np.eye(size)
    residuals = np.concatenate([_standardised(rows) for rows in whole])
    covariance = residuals.T @ residuals
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return np.asarray(covariance / np.outer(sd, sd) * (1.0 - RIDGE) + RIDGE * np.eye(size))


def _standardised(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    sd = rows.std(axis=0)
    return np.asarray((rows - rows.mean(axis=0)) / np.where(sd > 0.0, sd, 1.0))


def _combination(direction: NDArray[np.float64], names: Sequence[str]) -> str:
    """A direction in words, the constants that matter in it, the largest share first."""
    direction = direction * np.sign(direction[np.abs(direction).argmax()])
    order = [k for k in np.argsort(-np.abs(direction)) if abs(direction[k]) > 0.2]
    if len(order) == 1:
        return names[order[0]]
    return " ".join(f"{'-+'[int(direction[k] > 0.0)]} {abs(direction[k]):.2f} {names[k]}" for k in order).removeprefix(
        "+ "
    )


def interval(values: NDArray[np.float64]) -> Mapping[str, float]:
    """Median and 90 % interval."""
    low, median, high = np.quantile(values, (0.05, 0.5, 0.95)).tolist()
    return {"median": median, "low": low, "high": high}
