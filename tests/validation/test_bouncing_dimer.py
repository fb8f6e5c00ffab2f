"""A dimer on a plate that moves up and down drifts, and in which direction depends on its length."""

from __future__ import annotations

import pytest
from bouncing_dimer import dimer_drift, speed_by_steps, turning_point

FRICTION, SHORT, LONG = 0.2, 5.0, 9.0  # aspect ratios


@pytest.mark.slow
@pytest.mark.parametrize("planar", [True, False])
def test_the_drift_turns_round_with_the_aspect_ratio(planar: bool) -> None:
    """One ball is on the plate, the other bounces once a period; many starts end in the same motion."""
    assert SHORT < turning_point(FRICTION) < LONG
    short, long = (dimer_drift(ratio, FRICTION, planar=planar) for ratio in (SHORT, LONG))
    for drift in (short, long):
        ended = [bounce for bounce in drift.bounces if bounce.drifts]
        assert len(ended) >= 3
        assert all(bounce.on_plate > 0.95 for bounce in ended)
        assert drift.speed_mm_s.sd < 0.05
    assert short.speed_mm_s.mean < -3.0  # toward the ball on the plate
    assert 0.1 < long.speed_mm_s.mean < 0.4  # toward the one that bounces


@pytest.mark.slow
@pytest.mark.parametrize(("ratio", "friction"), [(SHORT, 0.1), (SHORT, FRICTION), (LONG, FRICTION), (SHORT, 0.3)])
def test_a_program_of_its_own_finds_the_same_speed(ratio: float, friction: float) -> None:
    found = dimer_drift(ratio, friction).speed_mm_s.mean
    assert found == pytest.approx(speed_by_steps(ratio, friction, poisson=False), rel=0.02, abs=0.05)


@pytest.mark.slow
def test_the_direction_is_the_same_by_poissons_law() -> None:
    assert speed_by_steps(SHORT, FRICTION, poisson=True) < -2.0
    assert speed_by_steps(LONG, FRICTION, poisson=True) > 0.1
