"""Torque-free motion against numerical integration and conservation laws."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import from_python
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipkinc

from feeder_sim.engines.impulse import free_flight
from feeder_sim.engines.impulse.free_flight import symmetry_axis

elliptic_f, jacobi = from_python(free_flight.elliptic_f), from_python(free_flight.jacobi)
rotate_freely = from_python(free_flight.rotate_freely)
TOPS = [
    [1.0, 1.0, 1.8],
    [1.5, 1.0, 1.0],
    [1.0, 1.0, 1.0],
    [1.0, 2.0, 3.0],
    [3.0, 1.0, 2.2],
    [2.0, 3.0, 1.0],
    [1.0, 1.001, 1.5],
]


def integrated(attitude: np.ndarray, momentum: np.ndarray, inertia: np.ndarray, duration: float) -> np.ndarray:
    """dR/dt = w x R with w = R I^-1 R^T L, at tight tolerance."""

    def rate(_: float, flat: np.ndarray) -> np.ndarray:
        r = flat.reshape(3, 3)
        return np.cross(r @ ((r.T @ momentum) / inertia), r, axisb=0, axisc=0).ravel()

    solution = solve_ivp(rate, (0.0, duration), attitude.ravel(), rtol=1e-12, atol=1e-13, method="DOP853")
    return np.asarray(solution.y[:, -1].reshape(3, 3))


def flown(attitude: np.ndarray, momentum: np.ndarray, inertia: np.ndarray, duration: float) -> np.ndarray:
    after = np.ascontiguousarray(attitude.copy())
    rotate_freely(after, momentum, inertia, symmetry_axis(inertia), duration)
    return after


@pytest.mark.parametrize("moments", TOPS, ids=str)
def test_attitude_agrees_with_numerical_integration(moments: list[float]) -> None:
    inertia, rng = np.array(moments), np.random.default_rng(0)
    for _ in range(8):
        attitude, momentum = Rotation.random(rng=rng).as_matrix(), 3.0 * rng.normal(size=3)
        expected = integrated(attitude, momentum, inertia, 3.0)
        assert np.abs(flown(attitude, momentum, inertia, 3.0) - expected).max() < 1e-9


@given(
    inertia=st.tuples(*[st.floats(0.1, 10.0)] * 3),
    momentum=st.tuples(*[st.floats(-100.0, 100.0)] * 3),
    seed=st.integers(0, 1000),
)
@settings(max_examples=300, deadline=None)
def test_energy_and_angular_momentum_are_kept_over_ten_seconds(
    inertia: tuple[float, ...], momentum: tuple[float, ...], seed: int
) -> None:
    moments, angular = np.array(inertia), np.array(momentum)
    attitude = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    after = attitude
    for _ in range(20):
        after = flown(after, angular, moments, 0.5)
    assert np.abs(after.T @ after - np.eye(3)).max() < 1e-12  # L is stored in space: it stays if the axes do

    def energy(r: np.ndarray) -> float:
        return float(((r.T @ angular) ** 2 / moments).sum())

    assert energy(after) == pytest.approx(energy(attitude), rel=1e-12)


def test_elliptic_functions_against_scipy() -> None:
    rng = np.random.default_rng(1)
    for u, m, phi in zip(rng.uniform(-20, 20, 300), rng.uniform(0, 0.999, 300), rng.uniform(-3, 3, 300), strict=True):
        assert jacobi(u, m) == pytest.approx(ellipj(u, m)[:3], abs=1e-11)
        assert elliptic_f(phi, m) == pytest.approx(ellipkinc(phi, m), rel=1e-11, abs=1e-12)
