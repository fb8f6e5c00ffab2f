"""Sobol indices of a function whose indices are known, with seeds that scatter."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import strip_scenario

from feeder_sim.scenario import Uncertain
from feeder_sim.studies.uncertainty.indices import saltelli_draws, sobol_indices
from feeder_sim.studies.uncertainty.spread import draws_of

KEYS = ("drive[0].amplitude_um", "contact.friction", "contact.part_friction")
SCATTER = 1.0  # standard deviation of seeds


def ishigami(x: np.ndarray) -> float:
    """sin x1 + 7 sin^2 x2 + 0.1 x3^4 sin x1 (Ishigami and Homma, 1990)."""
    return float(np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]))


@pytest.mark.filterwarnings("default")
def test_ishigami_function_with_noise() -> None:
    """x from -pi to pi; V = 7^2/8 + 0.1 pi^4/5 + 0.1^2 pi^8/18 + 1/2, S = 0.314, 0.442, 0, T = 0.558, 0.442, 0.244."""
    span = Uncertain(uniform=(0.0, 2.0 * np.pi))  # friction and amplitude are not negative: shifted by pi
    scenario = strip_scenario().changed({"uncertain": {key: span.model_dump() for key in KEYS}})
    random = np.random.default_rng(0)
    draws = saltelli_draws(scenario, 1024)
    assert len(draws) == 1024 * 5
    exact = [ishigami(np.array([draw[key] for key in KEYS]) - np.pi) for draw in draws]
    values = [(value + random.normal(0.0, SCATTER, 2)).tolist() for value in exact]
    found = sobol_indices(scenario, values)
    assert [index.key for index in found] == list(KEYS)
    for index, first, total in zip(found, (0.314, 0.442, 0.0), (0.558, 0.442, 0.244), strict=True):
        assert index.first == pytest.approx(first, abs=max(0.05, index.first_interval))
        assert index.total == pytest.approx(total, abs=max(0.05, index.total_interval))
        assert index.first_interval < 0.15 and index.total_interval < 0.15


def test_indices_are_shares_of_the_variance_of_the_independent_draws() -> None:
    """By hand, from the first, the middle and the last of every three draws: A, AB and B of one input."""
    scenario = strip_scenario().changed({"uncertain": {KEYS[0]: {"uniform": [1.0, 2.0]}}})
    random = np.random.default_rng(3)
    draws = saltelli_draws(scenario, 8)
    values = [(draw[KEYS[0]] + random.normal(0.0, 0.2, 2)).tolist() for draw in draws]
    a, ab, b = np.mean(values, axis=1).reshape(-1, 3).T
    scatter = np.mean([np.var(seeds, ddof=1) / 2.0 for seeds in values])
    inputs = np.var(np.concatenate([a, b])) - scatter
    (index,) = sobol_indices(scenario, values)
    assert index.total == pytest.approx((0.5 * np.mean((a - ab) ** 2) - scatter) / inputs)
    assert scenario.run.seed == 0 and sobol_indices(scenario, values) == [index]  # the interval, too
    alone = [seeds[:1] for seeds in values]
    assert np.isnan(sobol_indices(scenario, alone)[0].total)  # nobody knows how far seeds scatter


def test_inputs_that_change_nothing_have_no_indices() -> None:
    scenario = strip_scenario().changed({"uncertain": {KEYS[0]: {"uniform": [1.0, 2.0]}}})
    constant = [[1.0, 1.0] for _ in saltelli_draws(scenario, 8)]
    assert all(np.isnan(index.total) for index in sobol_indices(scenario, constant))
    missing = [[1.0, 1.0], [], *constant[2:]]
    assert all(np.isnan(index.total) for index in sobol_indices(scenario, missing))


def test_draws_fill_the_ranges_evenly() -> None:
    held = {KEYS[0]: {"uniform": [1.0, 2.0], "also": [KEYS[1]]}, KEYS[2]: {"choice": [0.1, 0.2]}}
    scenario = strip_scenario().changed({"uncertain": held})
    draws = draws_of(scenario, 16)
    assert draws == draws_of(scenario, 16)
    values = np.sort([draw[KEYS[0]] for draw in draws])
    assert (np.floor(16 * (values - 1.0)) == np.arange(16)).all()
    assert all(draw[KEYS[0]] == draw[KEYS[1]] for draw in draws)
    assert sum(draw[KEYS[2]] == 0.1 for draw in draws) == 8
