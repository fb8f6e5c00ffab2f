"""Means over an ensemble: contact motion is chaotic, so every figure is a mean with its interval."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Statistic:
    """Ensemble mean with standard deviation and standard error; NaN where n is too small for one."""

    mean: float
    sd: float
    se: float
    n: int

    @staticmethod
    def of(values: Iterable[float]) -> Statistic:
        """Statistic of the finite values."""
        finite = [value for value in values if math.isfinite(value)]
        n = len(finite)
        mean = float(np.mean(finite)) if n else math.nan
        sd = float(np.std(finite, ddof=1)) if n > 1 else math.nan
        return Statistic(mean, sd, sd / math.sqrt(n) if n > 1 else math.nan, n)

    def as_dict(self) -> dict[str, float | int | None]:
        """For JSON, where NaN does not exist."""
        values = {"mean": self.mean, "sd": self.sd, "se": self.se}
        return {name: v if math.isfinite(v) else None for name, v in values.items()} | {"n": self.n}
