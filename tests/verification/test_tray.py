"""Flat blocks on a tray that moves as a linear feeder's does, against an ODE of stick, slip and flight."""

from __future__ import annotations

import itertools

import pytest
from tray_theory import CASES, INCLINED, QUICK, Case, speed_in_engine, speed_of_point

from feeder_sim import simulate
from feeder_sim.scenario import Scenario

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


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2])
def test_parts_of_any_thickness_on_any_stroke_have_a_speed_or_a_reason(count: int) -> None:
    for thickness, stroke, frequency in itertools.product((0.05, 0.2, 1.0, 10.0), (10, 100, 500, 2000), (20, 60, 200)):
        start: dict[str, object] = {"position_mm": [-150.0, 0.0], "drop_height_mm": [0.01, 0.02]}
        if count > 1:
            start = {"kind": "scattered", "centre_mm": [-100.0, 0.0], "size_mm": [60.0, 60.0], "tilt_deg": [0.0, 0.0]}
            start["drop_height_mm"] = [0.01, 0.02]
        part = {"shape": "box", "size_mm": [8.0, 8.0, thickness], "count": count, "start": start}
        raw = {
            "plate": {"kind": "tray", "length_mm": 400.0, "width_mm": 100.0},
            "drive": [{"frequency_hz": float(frequency), "stroke_um": float(stroke), "angle_deg": 25.0}],
            "part": [part],
            "run": {"duration_s": 1.2, "seeds": 1},
        }
        result = simulate(Scenario.model_validate(raw))
        case = (thickness, stroke, frequency)
        assert not result.failures, (case, result.failures)
        missing = result.without_value().get("conveying_speed_mm_s")
        assert (result.conveying.conveying_speed_mm_s.n == 1) == (missing is None), case
