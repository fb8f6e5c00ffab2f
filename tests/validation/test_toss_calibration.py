"""Calibration on tosses whose constants and scatter are known: posterior and predictions hold what they should."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cube_tosses import read_tosses
from numpy.typing import NDArray
from toss_calibration import EVEN, ODD, Design, Prediction, calibrated, designed, ends_of, scattered

Floats = NDArray[np.float64]

DATA = Path(__file__).parents[2] / "benchmarks" / "validation" / "cube_tosses.csv"
TRUTH = np.array([0.184, 0.12])  # friction, restitution
WIDTH, FREEDOM = 0.015, 4.0  # [m], [1] of the scatter
SETS, FEWEST = 20, 14  # data sets; 90 % intervals hold the truth in fewer with a chance of 0.2 %


def with_scatter(ends: Floats, rng: np.random.Generator) -> Floats:
    return ends + scattered(np.array([WIDTH]), np.array([FREEDOM]), (1, *ends.shape), rng)[0]


def sliding_ends(velocity: Floats, constants: Floats) -> Floats:
    """Last places of points that slide to rest, from the origin, after an impact that leaves a share of their speed."""
    speed = np.linalg.norm(velocity, axis=1)
    distance = speed**2 / (2.0 * 9.81 * constants[:, :1]) * (1.0 + constants[:, 1:] * np.cos(7.0 * speed)) ** 2
    return np.asarray((velocity / speed[:, None]) * distance[:, :, None])


def check_coverage(design: Design, truth: Floats, rng: np.random.Generator) -> None:
    """Over sets that differ by their scatter: intervals of the constants and the width, and of places not used."""
    covered, within = np.zeros((SETS, 3), bool), []
    for i in range(SETS):
        measured = with_scatter(truth, rng)
        posterior = calibrated(design, measured, EVEN, i)
        low, high = np.quantile(np.column_stack([posterior.constants, posterior.width]), (0.05, 0.95), axis=0)
        covered[i] = (low <= [*TRUTH, WIDTH]) & ([*TRUTH, WIDTH] <= high)
        within.append(Prediction(posterior.ends(design, ODD, rng), measured[ODD]).within.mean(axis=0))
    assert (covered.sum(axis=0) >= FEWEST).all(), covered.sum(axis=0)
    assert np.abs(np.mean(within, axis=0) - 0.9).max() < 0.03, np.mean(within, axis=0)


def test_what_slides_to_rest() -> None:
    rng = np.random.default_rng(1)
    velocity = rng.uniform(0.5, 1.5, (60, 1)) * np.array([[1.0, 0.5]]) * rng.choice([-1.0, 1.0], (60, 2))
    ends = partial(sliding_ends, velocity)
    truth = ends(TRUTH[None])[0]
    check_coverage(designed(ends), truth, rng)


@pytest.mark.slow
def test_computed_tosses() -> None:
    tosses, rng = read_tosses(DATA)[::12], np.random.default_rng(1)

    def ends(constants: Floats) -> Floats:
        return np.array([ends_of(tosses, each) for each in constants])

    truth = ends(TRUTH[None])[0]
    check_coverage(designed(ends), truth, rng)


def test_width_and_tails_of_the_scatter() -> None:
    """Half of the draws of a Student's t of two dimensions lie within width sqrt(nu (2^(2 / nu) - 1))."""
    draws = scattered(np.full(4000, WIDTH), np.full(4000, FREEDOM), (4000, 10, 2), np.random.default_rng(1))
    half = WIDTH * np.sqrt(FREEDOM * (2.0 ** (2.0 / FREEDOM) - 1.0))
    assert np.mean(np.linalg.norm(draws, axis=2) < half) == pytest.approx(0.5, abs=0.01)
