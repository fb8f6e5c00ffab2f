"""A ball with all six degrees of freedom on a swinging piston bounces as high as in one dimension without a step."""

from __future__ import annotations

import pytest
from ball_on_piston import Case, compared
from small_noise_slide import mean_height

# With little restitution heights follow the amplitude in leaps. These depend on neither the noise nor the start.
CASES = (
    Case(2797.0, 0.5e-6, 0.2),
    Case(4750.0, 0.5e-6, 0.5),
    Case(8775.0, 0.5e-6, 0.5),
    Case(4750.0, 0.5e-6, 0.8),
)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_reference_depends_neither_on_the_noise_nor_on_the_tolerance(case: Case) -> None:
    arguments = (case.frequency, case.amplitude, case.restitution)
    reference = mean_height(*arguments)
    for other in (mean_height(*arguments, noise=1e-9), mean_height(*arguments, noise=1e-7, tolerance=1e-11)):
        assert other.mean == pytest.approx(reference.mean, rel=0.03)


def test_without_noise_the_reference_locks_onto_a_period_that_noise_leaves() -> None:
    arguments = (4750.0, 0.5e-6, 0.5)
    assert mean_height(*arguments, noise=0.0).mean == pytest.approx(14.87e-6, rel=0.01)
    assert mean_height(*arguments).mean == pytest.approx(25.9e-6, rel=0.03)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_free_ball_bounces_as_high_as_the_reference(case: Case) -> None:
    found = compared(case)
    assert abs(found.deviation) < 0.10
    assert abs(found.in_errors) < 4.0
