"""A measure over the uncertain constants, from runs at some of them: a Gaussian process with the seeds' own scatter.

Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), section 2.2. Constants are shares of their
priors, so that every one goes from 0 to 1.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError, MissingExtra

FEWEST = 8  # points with a value
SHORTEST, LONGEST = 0.1, 30.0  # bounds of the length scales [1]
LEAST_NOISE = 1e-8  # of the variance over the points
DRAWN = 4.0  # runs that the median of the variances counts as, at every point
RESTARTS = 2  # of the fit of the length scales


@dataclass(frozen=True)
class Emulator:
    """The mean of a measure over runs, at any constants.

    Attributes:
        regressor: fitted to means over `scale`, after `centre` is taken off.
        centre, scale: in the unit of the measure.
        scatter: standard deviation of a single run, the median over the points.
    """

    regressor: Any
    centre: float
    scale: float
    scatter: float

    @staticmethod
    def of(shares: NDArray[np.float64], values: Sequence[Sequence[float]], name: str) -> Emulator:
        """Fitted to the values of the seeds at points, shares (points, constants); NaN is no value.

        Raises:
            InputError: too few points have a value.
            MissingExtra: scikit-learn is not installed.
        """
        finite = [[v for v in row if math.isfinite(v)] for row in values]
        some = [i for i, row in enumerate(finite) if row]
        if len(some) < FEWEST:
            problem = f"has a value at {len(some)} of {len(values)} points of the prior, must have at {FEWEST} and more"
            raise InputError(problem, key=name)
        means = np.array([np.mean(finite[i]) for i in some])
        counts = np.array([len(finite[i]) for i in some])
        variance = _variances([finite[i] for i in some])
        centre, scale = float(means.mean()), float(means.std()) or 1.0
        noise = np.maximum(variance / counts / scale**2, LEAST_NOISE)
        regressor = _regressor(shares.shape[1], noise)
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore"
            )  # a length at its bound is a straight line, or a measure that hangs on nothing
            regressor.fit(shares[some], (means - centre) / scale)
        return Emulator(regressor, centre, scale, math.sqrt(float(np.median(variance))))

    def at(self, shares: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The mean over runs and its standard deviation, (n,) each, at shares (n, constants)."""
        mean, sd = self.regressor.predict(shares, return_std=True)
        return self.centre + self.scale * mean, self.scale * sd


def _variances(rows: Sequence[Sequence[float]]) -> NDArray[np.float64]:
    """Variance of a single run at every point, (points,), drawn towards the median of all points as by `DRAWN` runs.

    Where parts fly off a plate runs scatter a hundred times as far as elsewhere: what is pooled would be theirs.
    """
    own = np.array([float(np.var(row, ddof=1)) if len(row) > 1 else math.nan for row in rows])
    median = float(np.nanmedian(own)) if np.isfinite(own).any() else 0.0
    degrees = np.array([len(row) - 1 for row in rows])
    return np.asarray((degrees * np.nan_to_num(own, nan=median) + DRAWN * median) / (degrees + DRAWN))


def _regressor(constants: int, noise: NDArray[np.float64]) -> Any:
    try:
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel
    except ImportError as error:
        raise MissingExtra("calibrate") from error
    kernel = ConstantKernel(1.0, (1e-2, 1e2)) * RBF(np.ones(constants), (SHORTEST, LONGEST))
    return GaussianProcessRegressor(kernel, alpha=noise, n_restarts_optimizer=RESTARTS, random_state=0)
