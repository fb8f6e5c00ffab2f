"""Impacts know no frame of reference: what moves along with a surface sees the same impact as over one at rest.

A single point is solved to round-off. Several at once are solved to 1e-11 m/s, which steps in different frames reach in
different places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from conftest import from_python, moving_part, rows, struck, symmetric
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from feeder_sim.engines.impulse import single_impact
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import Ball, Cylinder, HexNut
from feeder_sim.scene.part import build_part

resolve_single = from_python(single_impact.resolve_single)
NUT, LARGE_NUT = build_part(HexNut(size="M2.5")), build_part(HexNut(size="M5"))
BALL = build_part(Ball(shape="ball", diameter_mm=3.0))
ROD = build_part(Cylinder(shape="cylinder", diameter_mm=4.0, height_mm=9.0))
PARTS = (NUT, LARGE_NUT, BALL, ROD)
ROUND_OFF = 1e-12  # of the velocities; most impacts of the kind here stay below 1e-15, the worst came to 1e-13
SOLVED = 1e-10  # of the velocities, where several points are solved at once
# [m/s]. An impact without any loss does no work. `impact` finds that but for the round-off of all velocities,
# and compares it with 1e-12 of the work of the approach: over a surface at 1 m/s an approach below 1e-4 m/s may fail
# that, and loses restitution for it.
SLOWEST = 1e-3

chance = st.integers(0, 10**6)
share = st.floats(0.0, 1.0)
frame = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)  # [m/s]; no plate is faster


@dataclass
class Body:
    """A part in some attitude and motion."""

    part: RigidPart
    attitude: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray

    def __post_init__(self) -> None:
        self.inverse_inertia = self.attitude @ np.diag(1 / self.part.inertia) @ self.attitude.T
        self.momentum = np.linalg.solve(self.inverse_inertia, self.spin)

    def corners(self) -> np.ndarray:
        """Of the hull, from the centre of mass."""
        return np.asarray(self.part.corners @ self.attitude.T)

    def at(self, arm: np.ndarray) -> np.ndarray:
        """Velocity of points of the body."""
        return np.asarray(self.velocity + np.cross(self.inverse_inertia @ self.momentum, arm))

    def seen_from(self, moving: np.ndarray) -> Body:
        """The same body in a frame that moves backwards: everything gets that velocity on top."""
        return Body(self.part, self.attitude, self.velocity + moving, self.spin)

    def energy(self, moving: np.ndarray) -> float:
        """Twice the kinetic energy, seen from a frame that moves."""
        along = self.velocity - moving
        return float(self.part.mass * along @ along + self.momentum @ self.inverse_inertia @ self.momentum)


def random_body(rng: np.random.Generator, part: RigidPart, tilt: float) -> Body:
    attitude = Rotation.from_rotvec(tilt * rng.normal(size=3)).as_matrix()
    return Body(part, attitude, 0.2 * rng.normal(size=3), 80.0 * rng.normal(size=3))


@dataclass(frozen=True)
class Touch:
    """Points of a body on a surface: arms, normals and velocities of the surface there, (n, 3) each."""

    arm: np.ndarray
    normal: np.ndarray
    surface: np.ndarray

    def approach(self, body: Body) -> np.ndarray:
        """How fast each point comes down on the surface."""
        return np.asarray(-((body.at(self.arm) - self.surface) * self.normal).sum(axis=1))

    def only(self, which: np.ndarray) -> Touch:
        return Touch(*(np.ascontiguousarray(a[which]) for a in (self.arm, self.normal, self.surface)))

    def seen_from(self, moving: np.ndarray) -> Touch:
        return Touch(self.arm, self.normal, self.surface + moving)

    def hit(self, body: Body, e: float, mu: float) -> None:
        motion = body.velocity, body.momentum
        struck(body.part.mass, body.inverse_inertia, motion, (self.arm, self.normal, self.surface), (e, mu))


def landing(seed: int, touching: int, *, uneven: float) -> tuple[Body, Touch]:
    """A body whose lowest points come down on a moving, sloping surface; `uneven` [m/s]: its velocity varies by that.

    One corner lands in any attitude; several at once do so in nearly flat landings.
    """
    rng = np.random.default_rng(seed)
    part = PARTS[rng.integers(len(PARTS))]
    body = random_body(rng, part, 3.0 if touching == 1 else 0.01)
    tilt = np.array([*rng.uniform(-0.01, 0.01, 2), 1.0])
    normal = tilt / np.linalg.norm(tilt)
    corners = body.corners()
    lowest = np.argsort(corners @ normal)[:touching]
    arm = corners[lowest] - part.corner_radius * normal
    surface = 0.2 * rng.normal(size=3) + uneven * rng.normal(size=(len(arm), 3))
    touch = Touch(arm, np.tile(normal, (len(arm), 1)), surface)
    touch = touch.only(touch.approach(body) > 0.0)
    assume(len(touch.arm) > 0 and touch.approach(body).min() > SLOWEST)
    return body, touch


def check_same(one: Body, other: Body, moving: np.ndarray, off: float = ROUND_OFF) -> None:
    """The second body is the first one with a velocity on top, and nothing else."""
    speed = max(float(np.abs(one.velocity).max()), float(np.abs(other.velocity).max()), 1.0)
    assert np.abs(other.velocity - moving - one.velocity).max() < off * speed
    turned = one.part.size * one.inverse_inertia @ (other.momentum - one.momentum)  # as speed of its rim
    assert np.abs(turned).max() < off * speed


@pytest.mark.slow
@given(seed=chance, touching=st.integers(1, 12), e=share, mu=share, moving=frame)
@example(seed=5133, touching=6, e=1.0, mu=0.0, moving=np.array([0.0, 1.0, 1.0]))
@settings(max_examples=300, deadline=None)
def test_velocity_added_to_part_and_surface_is_added_to_the_result(
    seed: int, touching: int, e: float, mu: float, moving: np.ndarray
) -> None:
    """Also where the surface turns: its velocity differs from corner to corner."""
    body, touch = landing(seed, touching, uneven=0.05)
    other = body.seen_from(moving)
    before = body.velocity.copy()
    touch.hit(body, e, mu)
    touch.seen_from(moving).hit(other, e, mu)
    assert np.abs(body.velocity - before).max() > 0.0  # it was an impact
    check_same(body, other, moving, SOLVED)


@given(seed=chance, touching=st.integers(1, 12), e=share, mu=share)
@settings(max_examples=300, deadline=None)
def test_a_surface_in_uniform_motion_creates_no_energy(seed: int, touching: int, e: float, mu: float) -> None:
    """Seen from the surface; seen from the ground it may well do work."""
    body, touch = landing(seed, touching, uneven=0.0)
    surface = touch.surface[0]
    before = body.energy(surface)
    touch.hit(body, e, mu)
    assert body.energy(surface) <= before * (1 + ROUND_OFF)


def meeting(seed: int) -> tuple[Body, Body, np.ndarray, np.ndarray]:
    """Two bodies of any kind that touch in one point, the arms to it, and the normal from the first to the second."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    bodies = [random_body(rng, PARTS[rng.integers(len(PARTS))], 3.0) for _ in range(2)]
    arms = np.empty((2, 3))
    for i, (body, outward) in enumerate(zip(bodies, (normal, -normal), strict=True)):
        corners = body.corners()
        arms[i] = corners[np.argmax(corners @ outward)] + body.part.corner_radius * outward
    one, other = bodies
    closing = float((one.at(arms[0]) - other.at(arms[1])) @ normal)
    if closing < 0.0:  # they part: the other way round they meet
        for body in bodies:
            body.velocity, body.momentum, body.spin = -body.velocity, -body.momentum, -body.spin
    assume(abs(closing) > SLOWEST)
    return one, other, arms, normal


def collide(a: Body, b: Body, arms: np.ndarray, normal: np.ndarray, e: float, mu: float) -> None:
    inverse_mass = 1 / a.part.mass, 1 / b.part.mass
    inverse_inertia = symmetric(a.inverse_inertia), symmetric(b.inverse_inertia)
    with moving_part(a.velocity, a.momentum) as one, moving_part(b.velocity, b.momentum) as other:
        assert resolve_single(one, other, inverse_mass, inverse_inertia, rows(arms), tuple(normal), e, mu)


@given(seed=chance, e=share, mu=share, moving=frame)
@settings(max_examples=300, deadline=None)
def test_two_bodies_meet_in_the_same_way_in_every_frame(seed: int, e: float, mu: float, moving: np.ndarray) -> None:
    a, b, arms, normal = meeting(seed)
    seen = a.seen_from(moving), b.seen_from(moving)
    frames = np.zeros(3), moving
    before = [a.energy(one) + b.energy(one) for one in frames]
    collide(a, b, arms, normal, e, mu)
    collide(*seen, arms, normal, e, mu)
    check_same(a, seen[0], moving)
    check_same(b, seen[1], moving)
    # As no momentum is made, the loss is the same in every frame; so none is a gain.
    lost = [energy - a.energy(one) - b.energy(one) for energy, one in zip(before, frames, strict=True)]
    assert min(lost) >= -ROUND_OFF * max(before)
    assert abs(lost[0] - lost[1]) < ROUND_OFF * max(before)


@given(seed=chance, e=share, mu=share, moving=frame)
@example(seed=118749, e=0.734375, mu=0.88671875, moving=np.array([0.88671875, 0.75, 0.890625]))
@settings(max_examples=300, deadline=None)
def test_a_wall_of_infinite_mass_is_a_surface(seed: int, e: float, mu: float, moving: np.ndarray) -> None:
    """Two ways to the same impact: a body against one that nothing moves, and against a moving surface."""
    body, touch = landing(seed, 1, uneven=0.0)
    surface, normal, arm = touch.surface[0] + moving, touch.normal[0], touch.arm[0]
    assume(float((surface - body.at(arm)) @ normal) > SLOWEST)
    on_wall = body.seen_from(np.zeros(3))
    wall, still = surface.copy(), np.zeros(3)
    arms = np.stack([arm, np.zeros(3)])
    inverse_mass = 1 / on_wall.part.mass, 0.0
    inverse_inertia = symmetric(on_wall.inverse_inertia), symmetric(np.zeros((3, 3)))
    with moving_part(on_wall.velocity, on_wall.momentum) as one, moving_part(wall, still) as other:
        assert resolve_single(one, other, inverse_mass, inverse_inertia, rows(arms), tuple(-normal), e, mu)
    assert np.array_equal(wall, surface) and not still.any()
    Touch(arm[None], normal[None], surface[None]).hit(body, e, mu)
    # The direction of the slip is found to 1e-10 of a turn, along other tangents for either.
    assert np.abs(on_wall.velocity - body.velocity).max() < 1e-8
    turned = body.part.size * body.inverse_inertia @ (on_wall.momentum - body.momentum)
    assert np.abs(turned).max() < 1e-8
