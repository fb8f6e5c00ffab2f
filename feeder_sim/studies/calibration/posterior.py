"""Where constants may be once something has been measured: draws from the priors, weighted by how well they fit.

A mean over n measured runs with the standard deviation s between them is a Student's t with n - 1 degrees of freedom
about the true one, of width s / sqrt(n); the emulator's own uncertainty adds to that. Weighted draws become equally
likely ones by systematic resampling (importance resampling, Rubin 1988).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from feeder_sim.studies.calibration.emulator import Emulator

FIRST_EXPONENT, LAST_EXPONENT = 14, 18  # powers of two: draws from the priors
ENOUGH = 1000  # effective draws
FEW = 100  # effective draws below which the posterior is not known
DRAWS = 1000  # of the posterior
UNIFORM_VARIANCE = 1.0 / 12.0  # of a share of a prior
DECIDED = 0.5  # of the standard deviation of the prior: a direction that is left less is decided
GOES_WITH = 0.5  # correlation from which two constants are told to trade off
FAR = 3.0  # standard errors: no constants of the prior explain such a measurement


@dataclass(frozen=True)
class Observed:
    """One experiment: its mean over n runs, their standard deviation, and which constants its emulator takes."""

    mean: float
    sd: float
    n: int
    emulator: Emulator
    constants: tuple[int, ...]

    def prediction(self, shares: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The mean over runs and its standard deviation at shares of all priors (n, all constants)."""
        return self.emulator.at(shares[:, self.constants])

    def apart(self, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Measured less predicted, over the standard error of both, (n,)."""
        mean, sd = self.prediction(shares)
        return np.asarray((self.mean - mean) / np.hypot(sd, self.sd / math.sqrt(self.n)))

    def log_likelihood(self, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        from scipy.stats import norm, t

        mean, sd = self.prediction(shares)
        width = np.hypot(sd, self.sd / math.sqrt(self.n))
        law = t(self.n - 1) if self.n > 1 else norm
        return np.asarray(law.logpdf((self.mean - mean) / width) - np.log(width))


@dataclass(frozen=True)
class Posterior:
    """Equally likely draws.

    Attributes:
        shares: of the priors, (draws, constants).
        effective: how many independent draws the weights amount to.
        nearest: of each experiment the smallest distance between measurement and prediction over the whole prior, in
            standard errors.
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
        nearest = tuple(float(np.abs(each.apart(shares)).min()) for each in observed)
        rng = np.random.default_rng(seed)
        places = (np.arange(draws) + rng.random()) / draws
        rows = np.minimum(np.searchsorted(np.cumsum(weights), places), len(weights) - 1)
        return Posterior(shares[rng.permutation(rows)], effective, nearest)

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

    def narrowed_by(self, candidate: Observed) -> NDArray[np.float64]:
        """What one more experiment would leave of each constant's standard deviation in the posterior, (constants,).

        By the straight lines between constants and its mean (Bayes linear; Goldstein and Wooff 2007).
        """
        mean, sd = candidate.prediction(self.shares)
        noise = float((sd**2).mean()) + candidate.sd**2 / candidate.n
        deviation = mean - mean.mean()
        away = self.shares - self.shares.mean(axis=0)
        covariance = (away * deviation[:, None]).mean(axis=0)
        gained = covariance**2 / (float((deviation**2).mean()) + noise)
        variance = np.maximum((away**2).mean(axis=0), 1e-30)
        return np.asarray(np.sqrt(np.maximum(1.0 - gained / variance, 0.0)))


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
