"""Means over an ensemble. Contact motion is chaotic, so that every result is a mean with its standard error."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

# What is to be said wherever the best of many points is named.
LARGEST_OF_MANY = (
    "The largest of many means is too large on average, the smallest too small: check a winner with fresh seeds "
    "(another --seed) before relying on its value."
)


def half_interval(se: float, n: float, confidence: float = 0.95) -> float:
    """Half the width of Student's interval of a mean: t(n - 1) times its standard error; NaN below two values.

    Args:
        se: standard error of the mean.
        n: number of independent values; with Satterthwaite's degrees of freedom it is not a whole one.
        confidence: of the interval, to both sides [1].
    """
    from scipy.special import stdtrit

    return float(stdtrit(n - 1, 0.5 + 0.5 * confidence)) * se if n > 1 else math.nan


def finite_or_none(value: float) -> float | None:
    """A number as JSON and tables take it; None where it is not finite."""
    return value if math.isfinite(value) else None


@dataclass(frozen=True, eq=False)
class Statistic:
    """Mean, standard deviation and standard error of n values; NaN where n is too small for them."""

    mean: float
    sd: float
    se: float
    n: int

    def __eq__(self, other: object) -> bool:
        """Of the same values; a missing number equals another one."""
        return isinstance(other, Statistic) and self.as_dict() == other.as_dict()

    def __hash__(self) -> int:
        return hash(tuple(self.as_dict().values()))

    @staticmethod
    def of(values: Iterable[float]) -> Statistic:
        """Statistic of the finite values."""
        finite = [value for value in values if math.isfinite(value)]
        n = len(finite)
        mean = float(np.mean(finite)) if n else math.nan
        sd = float(np.std(finite, ddof=1)) if n > 1 else math.nan
        return Statistic(mean, sd, sd / math.sqrt(n) if n > 1 else math.nan, n)

    @property
    def interval(self) -> tuple[float, float]:
        """Student's 95 % interval of the mean; NaN below two values."""
        half = half_interval(self.se, self.n)
        return self.mean - half, self.mean + half

    def as_dict(self) -> dict[str, float | int | None]:
        """As JSON takes it."""
        return {name: finite_or_none(getattr(self, name)) for name in ("mean", "sd", "se")} | {"n": self.n}
