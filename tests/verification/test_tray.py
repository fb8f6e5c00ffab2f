"""Flat blocks on a tray that moves as a linear feeder's does, against an ODE of stick, slip and flight."""

from __future__ import annotations

import pytest
from tray_theory import CASES, INCLINED, QUICK, Case, speed_in_engine, speed_of_point

WITHIN = 0.002
IN_STEPS = 0.05


def deviation(case: Case, **how: int) -> float:
    """Relative, of the engine's mean speed from that of the point."""
    return float(speed_in_engine(case, **how).speed.mean()) / speed_of_point(case) - 1.0


@pytest.mark.parametrize("case", [*CASES, *INCLINED], ids=str)
def test_the_reference_has_converged(case: Case) -> None:
    """Neither looking twice as often for events, nor another start, nor more time changes it by 0.2 %."""
    reference = speed_of_point(case)
    others = [speed_of_point(case, looks=2000), speed_of_point(case, 2e-5), speed_of_point(case, 5e-5, end=9.0)]
    assert others == pytest.approx([reference] * 3, rel=2e-3)


@pytest.mark.parametrize("case", [*QUICK, INCLINED[0]], ids=str)
def test_a_block_on_a_tray_travels_as_a_point_does(case: Case) -> None:
    assert abs(deviation(case)) < WITHIN


@pytest.mark.slow
def test_blocks_travel_as_points_do_in_every_gait() -> None:
    off = {str(case): deviation(case) for case in (*CASES, *INCLINED)}
    assert max(map(abs, off.values())) < WITHIN, off


@pytest.mark.slow
def test_blocks_side_by_side_travel_as_points_do_within_their_step() -> None:
    off = {str(case): deviation(case, count=2, duration=3, seeds=1) for case in CASES[:6]}
    assert max(map(abs, off.values())) < IN_STEPS, off
