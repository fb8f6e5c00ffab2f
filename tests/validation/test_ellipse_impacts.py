"""The impact law against measured impacts of an ellipse, and Routh's method against what it has to give."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import REPOSITORY
from ellipse_impacts import (
    FRICTION,
    INVERSE_INERTIA,
    RESTITUTION,
    error_shares,
    mobility,
    newton,
    newton_with_tangential,
    poisson,
    read_impacts,
    torque_slopes,
)

IMPACTS = read_impacts(REPOSITORY / "benchmarks/validation/ellipse_impacts.csv")


def median(change: np.ndarray) -> float:
    return float(np.median(error_shares(IMPACTS, change)))


def test_one_restitution_and_one_friction_predict_859_impacts() -> None:
    assert len(IMPACTS.theta) == 859
    assert median(newton(IMPACTS, RESTITUTION, FRICTION)) <= 0.06
    assert median(newton(IMPACTS, RESTITUTION, 0.0)) > 0.12  # without friction
    assert median(newton(IMPACTS, 0.2, FRICTION)) > 0.15


def test_spins_say_what_the_moment_of_inertia_is() -> None:
    """Both impulses bracket the value in use; with x not mirrored the tangential one would have the wrong sign."""
    normal, tangential = torque_slopes(IMPACTS)
    assert tangential < INVERSE_INERTIA < normal
    assert normal / tangential == pytest.approx(1.0, abs=0.06)


def test_planar_laws_are_the_engines_where_they_have_to_be() -> None:
    engine = newton(IMPACTS, RESTITUTION, FRICTION)
    assert newton_with_tangential(IMPACTS, RESTITUTION, FRICTION, 0.0) == pytest.approx(engine, abs=1e-9)
    # Without friction Poisson's law is Newton's, and without restitution where a slip that ends does not turn round.
    assert poisson(IMPACTS, RESTITUTION, 0.0) == pytest.approx(newton(IMPACTS, RESTITUTION, 0.0), abs=1e-9)
    tt, tn, _ = mobility(IMPACTS)
    holds = np.abs(tn) <= FRICTION * tt
    assert 0.5 < holds.mean() < 1.0
    assert poisson(IMPACTS, 0.0, FRICTION)[holds] == pytest.approx(newton(IMPACTS, 0.0, FRICTION)[holds], abs=1e-9)
