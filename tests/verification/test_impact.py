"""Impacts of one body: Newton's restitution, Coulomb's cone, no energy from nothing."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import struck
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import HexNut
from feeder_sim.scene.part import build_part

NUT = build_part(HexNut(size="M2.5"))


class State:
    """A nut in some attitude above a plate at rest, with the corners that touch."""

    def __init__(self, part: RigidPart, attitude: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> None:
        self.part, self.velocity = part, velocity.copy()
        self.inverse_inertia = attitude @ np.diag(1 / part.inertia) @ attitude.T
        self.momentum = np.linalg.solve(self.inverse_inertia, spin)
        self.arm = part.corners @ attitude.T

    def hit(self, corners: np.ndarray, e: float, mu: float, slope: float = 0.0) -> np.ndarray:
        """Resolve an impact at some corners; returns their relative velocities before and after, (2, n, 3)."""
        normal = np.tile(np.array([-slope, 0.0, 1.0]) / np.hypot(1, slope), (len(corners), 1))
        before, touch = self.at(corners), (self.arm[corners], normal, np.zeros((len(corners), 3)))
        struck(self.part.mass, self.inverse_inertia, (self.velocity, self.momentum), touch, (e, mu))
        return np.stack([before, self.at(corners)])

    def at(self, corners: np.ndarray) -> np.ndarray:
        return self.velocity + np.cross(self.inverse_inertia @ self.momentum, self.arm[corners])

    def energy(self) -> float:
        return float(
            self.part.mass * self.velocity @ self.velocity + self.momentum @ self.inverse_inertia @ self.momentum
        )


@given(
    seed=st.integers(0, 10**6),
    e=st.floats(0.0, 1.0),
    mu=st.floats(0.0, 1.5),
    touching=st.integers(1, 6),
    slope=st.floats(-0.01, 0.01),
)
@settings(max_examples=400, deadline=None)
def test_energy_never_grows_on_a_plate_at_rest(seed: int, e: float, mu: float, touching: int, slope: float) -> None:
    rng = np.random.default_rng(seed)
    # Nearly flat landings have several corners at once; others one.
    tilt = 0.01 if touching > 1 else 3.0
    attitude = Rotation.from_rotvec(rng.normal(size=3) * tilt).as_matrix()
    state = State(NUT, attitude, rng.normal(size=3) * 0.2, rng.normal(size=3) * 80.0)
    lowest = np.argsort(state.arm[:, 2])[:touching]
    approaching = lowest[state.at(lowest) @ [-slope, 0.0, 1.0] < 0]  # what parts already is no impact
    if not len(approaching):
        return
    before = state.energy()
    state.hit(approaching, e, mu, slope)
    assert state.energy() <= before * (1 + 1e-9)
    assert np.isfinite(state.velocity).all()


@given(seed=st.integers(0, 10**6), mu=st.floats(0.01, 1.0), e=st.floats(0.0, 0.5))
@settings(max_examples=300, deadline=None)
def test_single_corner_obeys_newton_and_coulomb(seed: int, mu: float, e: float) -> None:
    rng = np.random.default_rng(seed)
    state = State(NUT, Rotation.random(rng=rng).as_matrix(), rng.normal(size=3), np.zeros(3))
    state.velocity[2] = -abs(state.velocity[2]) - 0.1
    velocity, corner = state.velocity.copy(), np.array([int(np.argmin(state.arm[:, 2]))])
    before, after = state.hit(corner, e, mu)[:, 0]
    impulse = NUT.mass * (state.velocity - velocity)
    pressed, friction = impulse[2], np.linalg.norm(impulse[:2])
    assert pressed > 0
    assert friction <= mu * pressed * (1 + 1e-6)
    # Newton's law to the letter, unless that would create energy; never more than it.
    assert -1e-9 <= after[2] <= -e * before[2] + 1e-9
    slip = np.linalg.norm(after[:2])
    if slip > 1e-6:  # it slips: on the edge of the cone, friction opposite to the slip
        assert friction == pytest.approx(mu * pressed, rel=1e-6)
        assert impulse[:2] @ after[:2] == pytest.approx(-friction * slip, rel=1e-6)


def test_sliding_impact_gains_no_normal_velocity() -> None:
    """At 2 m/s and mu = 0.3 a convex cone adds 88 % here."""
    flat = State(NUT, np.eye(3), np.array([2.0, 0.0, -0.1]), np.zeros(3))
    lower = np.flatnonzero(flat.arm[:, 2] < 0)
    after = flat.hit(lower, 0.2, 0.3)[1]
    assert after[:, 2].max() <= 0.02 * (1 + 1e-4)
    assert flat.velocity[2] <= 0.02 * (1 + 1e-6)


def test_flat_landing_leaves_no_spin() -> None:
    flat = State(NUT, Rotation.from_rotvec([0, 0, 0.3]).as_matrix(), np.array([0.0, 0.0, -0.14]), np.zeros(3))
    flat.hit(np.flatnonzero(flat.arm[:, 2] < 0), 0.2, 0.3)
    spin = flat.inverse_inertia @ flat.momentum
    assert flat.velocity == pytest.approx([0.0, 0.0, 0.028], abs=1e-9)
    assert np.abs(spin).max() < 1e-5
