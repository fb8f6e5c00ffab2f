"""How errors fall with the step, in motion with a closed form and without chaos: both engines are of first order.

Impulses: a corner enters the surface by up to what it covers in a step, and is put back on it, so that an impact comes
up to a step too late; the flight between impacts is exact. (A fast part takes shorter steps near the surface; drops are
low here, so that it is the step that counts.) MuJoCo: an impact comes up to a step too late, and the flight is an
Euler method of first order. How late an impact is depends on where it falls within a step, so errors are averaged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from conftest import piston_scenario
from scipy.optimize import brentq
from slide_theory import Sine, arc, next_impact, with_throw_number

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.plate_contact import TOUCH
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Ball, Contact, Start

STEPS = (20, 40, 80, 160)  # per period
RADIUS = 1.5e-3
ENGINES = ("impulse", "mujoco")


def run(plate: Sine, engine: str, steps_per_period: int, start: Start, contact: Contact, **run: Any) -> Result:
    """A free ball over a piston that swings from the begin."""
    scenario = piston_scenario(
        part=Ball(shape="ball", diameter_mm=2e3 * RADIUS, start=start),
        contact=contact,
        frequency_hz=plate.frequency,
        engine=engine,
        steps_per_period=steps_per_period,
        **run,
    )
    result = simulate(scenario.model_copy(update={"drive": (plate.drive(),)}))
    assert result.failures == []
    return result


def order(errors: list[float]) -> float:
    """Of convergence: slope of the errors at STEPS, both logarithmic."""
    return -float(np.polyfit(np.log(STEPS), np.log(errors), 1)[0])


def rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def check_first_order(errors: list[float]) -> None:
    """On the whole, and from each step to the next: no error stays behind, and none vanishes by chance."""
    assert 0.9 < order(errors) < 1.1, errors
    assert all(1.6 < coarse / fine < 2.5 for coarse, fine in pairwise(errors)), errors


# A single impact: 40 periods of flight at most, at heights that spread the impacts over all phases of the plate.

SWING = Sine(1000.0, 2e-6)
DROP_MM = (0.1, 0.2)  # it falls at 0.04 to 0.06 m/s for 4.5 to 6.4 periods
ALONG = 60e-3  # [m/s]; so fast along the plate that it slides throughout the impact
E, MU = 0.6, 0.1
AFTER = 0.3e-3  # [s] until it is looked at, still in flight


@dataclass(frozen=True)
class Errors:
    """After a single impact: of the height [m] and of the horizontal velocity [m/s], root mean square."""

    height: float
    along: float


def single_impact(engine: str, steps_per_period: int, contact: Contact) -> Errors:
    start = Start(drop_height_mm=DROP_MM, tilt_deg=(0.0, 0.0), velocity_mm_s=(1e3 * ALONG, 0.0, 0.0))
    more = {"seeds": 48, "duration_s": 9e-3, "frames_per_second": 2000.0}
    result = run(SWING, engine, steps_per_period, start, contact, **more)
    heights, speeds = [], []
    for frames in result.trajectories:
        drop = float(frames.position[0, 0, 2]) - RADIUS
        t = next_impact(SWING, arc(), 0.0, drop, 0.0)
        approach = SWING.velocity(t) + GRAVITY * t
        row = int(np.searchsorted(frames.time, t + AFTER))
        flight = float(frames.time[row]) - t
        leaving = SWING.velocity(t) + contact.coefficient * approach
        if next_impact(SWING, arc(), t, SWING.height(t), leaving) < t + flight:
            continue  # where the plate falls away the ball leaves slowly, and is hit again
        heights.append(frames.position[row, 0, 2] - RADIUS - SWING.height(t) - arc().height(leaving, flight))
        expected = ALONG - contact.friction * (1.0 + contact.coefficient) * approach
        speeds.append(frames.velocity[row, 0, 0] - expected)
    assert len(heights) > 36
    return Errors(rms(heights), rms(speeds))


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("e", [0.2, 0.9])
def test_single_impact_on_a_moving_plate_converges_with_first_order(engine: str, e: float) -> None:
    """Without friction, of which MuJoCo's convex cone makes something else."""
    contact = Contact(restitution=e, friction=0.0)
    errors = [single_impact(engine, steps, contact).height for steps in STEPS]
    check_first_order(errors)
    # By anything up to a step too late, and then too low by what the ball covers in that time before and after it.
    step = SWING.period / STEPS[0]
    assert 0.4 < errors[0] / (step * (1.0 + e) * 0.05) < 1.0


def test_sliding_impact_on_a_moving_plate_converges_with_first_order() -> None:
    """Friction follows the approach, which is off by gravity and the plate's acceleration over the time it is late."""
    errors = [single_impact("impulse", steps, Contact(restitution=E, friction=MU)) for steps in STEPS]
    check_first_order([error.height for error in errors])
    check_first_order([error.along for error in errors])


# Period one: the ball meets the plate once in every period, at the same phase.

ELASTICITIES = (0.2, 0.6)
PERIODS, COUNTED = 60, 30


def plates(e: float, n: int) -> list[Sine]:
    """From a quarter to three quarters of the way between the begin of period one and that of period two.

    At 437 Hz the ball is slow, and the period is no multiple of any time that an engine works by.
    """
    first = math.pi * (1.0 - e) / (1.0 + e)
    second = math.hypot(2.0 * (1.0 + e * e) / (1.0 + e) ** 2, first)
    return [with_throw_number(437.0, first + (second - first) * share) for share in np.linspace(0.25, 0.75, n)]


@dataclass(frozen=True)
class PeriodOne:
    """The ball leaves at this phase [rad] and velocity [m/s], and does so again a period later."""

    plate: Sine
    phase: float
    leaving: float

    @property
    def rise(self) -> float:
        """Of the tops, over the resting plate [m]."""
        return self.plate.amplitude * math.sin(self.phase) + self.leaving**2 / (2.0 * GRAVITY)


def period_one(plate: Sine, e: float, late: float = 0.0) -> PeriodOne:
    """The motion in which every impact comes a certain time [s] after the ball has met the plate.

    Until then it falls on, and the plate moves on; at the impact it is put on the plate.
    """
    fall, omega = GRAVITY * plate.period, plate.omega

    def at(phase: float) -> PeriodOne:
        # It comes back with `leaving - fall`, and leaves with the plate's velocity and e times the approach.
        return PeriodOne(plate, phase, float(plate.velocity(phase / omega)) + e * fall / (1.0 + e))

    def gap(phase: float) -> float:
        """Over the plate at the moment at which it should meet it."""
        ball, flight = at(phase), plate.period - late
        met = plate.height(phase / omega) + arc().height(ball.leaving, flight)
        return float(met - plate.height(phase / omega - late))

    # The stable one of two such motions: on the plate's way up, with the plate's velocity falling over the phase.
    exact = math.acos(0.5 * fall * (1.0 - e) / (1.0 + e) / (plate.amplitude * omega))
    return at(brentq(gap, exact - 0.4, exact + 0.4, xtol=1e-14))


def risen(engine: str, steps_per_period: int, plate: Sine, e: float) -> float:
    """Mean height of the last tops [m]; it starts in the middle of a flight of period one."""
    orbit = period_one(plate, e)
    age = plate.period - orbit.phase / plate.omega
    height = plate.height(orbit.phase / plate.omega) + arc().height(orbit.leaving, age)
    start = Start(
        drop_height_mm=(1e3 * height, 1e3 * height),
        tilt_deg=(0.0, 0.0),
        velocity_mm_s=(0.0, 0.0, 1e3 * arc().velocity(orbit.leaving, age)),
    )
    times = {"duration_s": PERIODS * plate.period, "frames_per_second": 20.0 * plate.frequency}
    frames = run(plate, engine, steps_per_period, start, Contact(restitution=e), **times).trajectories[0]
    height = frames.position[:, 0, 2] - RADIUS
    # Flight is a parabola: the highest frame of each period says where its top is.
    top = height + frames.velocity[:, 0, 2] ** 2 / (2.0 * GRAVITY)
    per_period = np.reshape(top[1:], (PERIODS, 20))[-COUNTED:]
    highest = np.reshape(height[1:], (PERIODS, 20))[-COUNTED:].argmax(axis=1)
    return float(np.mean(per_period[np.arange(COUNTED), highest]))


@pytest.mark.parametrize("e", ELASTICITIES)
def test_closed_form_of_period_one_is_that_of_holmes(e: float) -> None:
    """Without delay: the plate moves at g T/2 (1 - e)/(1 + e) when it is hit, and the ball leaves with g T/2."""
    for plate in plates(e, 3):
        orbit = period_one(plate, e)
        assert orbit.leaving == pytest.approx(0.5 * GRAVITY * plate.period, rel=1e-9)
        hit = 0.5 * GRAVITY * plate.period * (1.0 - e) / (1.0 + e)
        assert plate.velocity(orbit.phase / plate.omega) == pytest.approx(hit, rel=1e-9)


@pytest.mark.parametrize("e", ELASTICITIES)
def test_period_one_in_mujoco_converges_with_first_order(e: float) -> None:
    errors = [
        rms([risen("mujoco", steps, plate, e) / period_one(plate, e).rise - 1.0 for plate in plates(e, 8)])
        for steps in STEPS
    ]
    check_first_order(errors)


@pytest.mark.parametrize("e", ELASTICITIES)
def test_in_period_one_no_impulse_comes_more_than_a_step_late(e: float) -> None:
    """Impacts keep their place between steps, so nothing is averaged: errors at one step are anything up to a bound.

    The bound is a closed form too, and of first order. Corners within TOUCH count as touching, so it may be that early.
    """
    for plate in plates(e, 6):
        exact = period_one(plate, e).rise
        for steps in STEPS:
            found = risen("impulse", steps, plate, e)
            latest = period_one(plate, e, plate.period / steps).rise
            assert latest < exact
            assert latest - TOUCH < found < exact + TOUCH
