"""Draws of the uncertain inputs of a scenario: a scrambled Sobol sequence, or Saltelli's sample for Sobol indices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.scenario import Scenario

Draw = dict[str, Any]  # a value for each uncertain key, and for those tied to it


def draws_of(scenario: Scenario, count: int) -> list[Draw]:
    """So many draws of all uncertain inputs; a single one without values where there are none."""
    if not scenario.uncertain:
        return [{}]
    from scipy.stats import qmc

    exponent = int(np.ceil(np.log2(max(2, count))))
    shares = qmc.Sobol(len(scenario.uncertain), rng=scenario.run.seed).random_base2(exponent)[:count]
    return [draw_at(scenario, row) for row in shares]


def draw_at(scenario: Scenario, shares: Sequence[float] | NDArray[np.float64]) -> Draw:
    """The values below which these shares of all lie (inputs,) [1]."""
    draw: Draw = {}
    for (key, uncertain), share in zip((scenario.uncertain or {}).items(), shares, strict=True):
        draw |= dict.fromkeys((key, *uncertain.also), uncertain.at(float(share)))
    return draw
