"""Torque-free motion against numerical integration and conservation laws."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import from_python
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from feeder_sim.engines.impulse import free_flight
from feeder_sim.engines.impulse.free_flight import symmetry_axis

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


def integrated(
    attitude: np.ndarray, momentum: np.ndarray, inertia: np.ndarray, duration: float, tolerance: float = 1e-12
) -> np.ndarray:
    """dR/dt = w x R with w = R I^-1 R^T L, at tight tolerance."""

    def rate(_: float, flat: np.ndarray) -> np.ndarray:
        r = flat.reshape(3, 3)
        return np.cross(r @ ((r.T @ momentum) / inertia), r, axisb=0, axisc=0).ravel()

    solution = solve_ivp(rate, (0.0, duration), attitude.ravel(), rtol=tolerance, atol=0.1 * tolerance, method="DOP853")
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


# Moments of brackets, rods and plates, and momenta about nearly each of their axes, or across two of them.
GENERAL = [[1.0, 2.0, 2.8], [2.2, 1.0, 3.0], [0.05, 1.0, 1.02], [1.0, 1.001, 1.5], [0.5, 0.5001, 0.99]]
MOMENTA = [
    *(3.0 * np.eye(3)[k] + away * np.eye(3)[(k + 1) % 3] for k in range(3) for away in (0.0, 1e-9, 1e-5)),
    np.array([3.0, 2.0, 1.0]),
    np.array([1e-6, 3.0, 1e-6]),
]


@pytest.mark.parametrize("moments", GENERAL, ids=str)
def test_short_flights_are_exact_to_round_off(moments: list[float]) -> None:
    inertia, attitude = np.array(moments), Rotation.random(rng=np.random.default_rng(3)).as_matrix()
    for body_momentum in MOMENTA:
        momentum = attitude @ body_momentum
        for angle in (1e-7, 3e-3, 0.019, 0.021, 0.2, 1.3):  # either side of where the method changes
            duration = angle * inertia.min() / 3.0
            expected = integrated(attitude, momentum, inertia, duration, tolerance=3e-14)
            assert np.abs(flown(attitude, momentum, inertia, duration) - expected).max() < 1e-12


@pytest.mark.parametrize("moments", GENERAL, ids=str)
def test_a_flight_in_pieces_is_the_whole_flight(moments: list[float]) -> None:
    inertia, rng = np.array(moments), np.random.default_rng(4)
    for _ in range(10):
        attitude, momentum = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
        duration, after = 2.0 * inertia.min(), attitude
        for _ in range(50):
            after = flown(after, momentum, inertia, duration / 50)
        assert np.abs(flown(attitude, momentum, inertia, duration) - after).max() < 1e-12


@example(inertia=(1.0, 2.0, 3.0), momentum=(0.0, 0.0, 6.084748875671207e-161), seed=0)  # its square underflows
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
