"""Simulation-based calibration: of constants drawn from the priors, posteriors hold as many as they say."""

from __future__ import annotations

import pytest
from calibration_ranks import ranks

from feeder_sim.pool.work import Work


@pytest.mark.slow
def test_ranks_of_the_truth_are_uniform() -> None:
    """Of 24 sets a 90 % interval misses eight or more with a chance below 0.2 %."""
    pytest.importorskip("sklearn")
    result = ranks(24, 32, Work())
    assert (result.coverage >= 17 / 24).all()
    assert min(result.p_values) > 0.005
