"""The drift of a ball on a standing wave does not depend on how finely it is computed."""

from __future__ import annotations

import math

import pytest
from conftest import REPOSITORY

from feeder_sim import measure_drift
from feeder_sim.scenario import Ball, Scenario, load_scenario, with_run

DEFAULT_NM = 0.1


def ball_drifts(name: str, tolerance_nm: float) -> Scenario:
    """A drift scenario with a ball of 3 mm instead of its nut."""
    scenario = load_scenario(REPOSITORY / f"scenarios/{name}.toml")
    ball = Ball(shape="ball", diameter_mm=3.0, start=scenario.part[0].start)
    return with_run(scenario.model_copy(update={"part": (ball,)}), tolerance_nm=tolerance_nm, seeds=48)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["drift_4750hz", "drift_8775hz"])
def test_a_ball_drifts_alike_at_a_tenth_of_the_tolerance(name: str) -> None:
    """Within 2 % or two standard errors, which are those of 48 seeds."""
    found = measure_drift([ball_drifts(name, tolerance) for tolerance in (DEFAULT_NM, 0.1 * DEFAULT_NM)])
    usual, fine = (ensemble.findings.drift_velocity_x_mm_s for ensemble in found)
    assert abs(usual.mean - fine.mean) < max(0.02 * abs(fine.mean), 2.0 * math.hypot(usual.se, fine.se))
    assert usual.se < 0.05
