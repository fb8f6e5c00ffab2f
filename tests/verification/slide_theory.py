"""A part on a slide over a sinusoidal plate, by other means than the package's, for the tests."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from feeder_sim.constants import GRAVITY
from feeder_sim.records.seed import Events, Seed
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Ball, Contact, Drive, RigidPlate, Run, Scenario, Slide, Start

RADIUS = 1.5e-3
TILT, FRICTION = 30.0, 0.3  # of the tilted guides


@dataclass(frozen=True)
class Sine:
    """The plate's motion A sin(2 pi f t)."""

    frequency: float
    amplitude: float

    @property
    def period(self) -> float:
        return 1.0 / self.frequency

    @property
    def omega(self) -> float:
        return 2.0 * math.pi * self.frequency

    def height(self, t: Any) -> Any:
        return self.amplitude * np.sin(self.omega * t)

    def velocity(self, t: Any) -> Any:
        return self.amplitude * self.omega * np.cos(self.omega * t)

    def acceleration(self, t: Any) -> Any:
        return -self.amplitude * self.omega**2 * np.sin(self.omega * t)

    def drive(self, **options: Any) -> Drive:
        return Drive(frequency_hz=self.frequency, amplitude_um=1e6 * self.amplitude, ring_up=False, **options)


AT_REST = Sine(50.0, 0.0)


@dataclass(frozen=True)
class Arc:
    """Heights of a part that decelerates by `up` while it rises and by `down` while it falls."""

    up: float
    down: float

    def height(self, velocity: float, age: Any) -> Any:
        """Above the point of departure, `age` after it."""
        apex = max(velocity, 0.0) / self.up
        early, late = np.minimum(age, apex), np.maximum(age - apex, 0.0)
        return (velocity - 0.5 * self.up * early) * early + (min(velocity, 0.0) - 0.5 * self.down * late) * late

    def velocity(self, velocity: float, age: Any) -> Any:
        apex = max(velocity, 0.0) / self.up
        return velocity - self.up * np.minimum(age, apex) - self.down * np.maximum(age - apex, 0.0)


def arc(tilt_deg: float = 0.0, friction: float = 0.0) -> Arc:
    theta = math.radians(tilt_deg)
    along = GRAVITY * math.cos(theta)
    return Arc(
        along * (math.cos(theta) + friction * math.sin(theta)), along * (math.cos(theta) - friction * math.sin(theta))
    )


def with_throw_number(frequency: float, throw_number: float, deceleration: float = GRAVITY) -> Sine:
    return Sine(frequency, throw_number * deceleration / (2.0 * math.pi * frequency) ** 2)


def slide_scenario(
    *drives: Drive | Sine,
    drop_mm: float | tuple[float, float] = 1.0,
    e: float = 0.2,
    tilt_deg: float = 0.0,
    friction: float = 0.0,
    noise_m_s: float = 0.0,
    **run: Any,
) -> Scenario:
    """A ball on a slide without noise; with 1000 steps per period frames can lie close."""
    exact = {} if run.get("engine") == "mujoco" else {"tolerance_nm": 1e-4}
    guide = Slide(kind="slide", tilt_deg=tilt_deg, friction=friction)
    start = Start(drop_height_mm=drop_mm if isinstance(drop_mm, tuple) else (drop_mm, drop_mm))
    return Scenario(
        plate=RigidPlate(kind="piston"),
        drive=tuple(drive.drive() if isinstance(drive, Sine) else drive for drive in drives),
        part=(Ball(shape="ball", diameter_mm=2e3 * RADIUS, guide=guide, start=start),),
        contact=Contact(restitution=e, noise_m_s=noise_m_s),
        run=Run(**({"duration_s": 0.5, "seeds": 1, "steps_per_period": 1000} | exact | run)),
    )


def ran(*drives: Drive | Sine, **options: Any) -> Seed:
    return simulate(slide_scenario(*drives, **options)).seeds[0]


def lowest_point(seed: Seed) -> NDArray[np.float64]:
    return seed.frames.position[:, 0, 2] - RADIUS


def lasting(impacts: Events) -> Events:
    """Contacts in which the part rode on the plate and lifted off again."""
    return impacts[(impacts.until > impacts.time) & np.isfinite(impacts.until)]


def next_impact(plate: Sine, flight: Arc, t: float, height: float, velocity: float) -> float:
    """When a part that flies from there at t meets the plate: dense samples of the gap, then bisection.

    A flight shorter than the first sample, 1e-4 of a period, is not seen.
    """

    def gap(age: Any) -> Any:
        return height + flight.height(velocity, age) - plate.height(t + age)

    step = plate.period / 1000.0
    ages: NDArray[np.float64] = np.geomspace(0.1 * step, step, 30)
    for _ in range(1000):
        below = np.flatnonzero(gap(ages) <= 0.0)
        if len(below):
            i = int(below[0])
            return t + float(brentq(gap, ages[max(i - 1, 0)], ages[i], xtol=1e-17, rtol=1e-15))
        ages = ages[-1] + step * np.arange(20_001.0)
    raise AssertionError("it never comes down")


def impacts_by_brute_force(plate: Sine, e: float, drop: float, n: int) -> NDArray[np.float64]:
    times, t, height, velocity = [], 0.0, drop, 0.0
    for _ in range(n):
        landing = next_impact(plate, arc(), t, height, velocity)
        approach = plate.velocity(landing) - arc().velocity(velocity, landing - t)
        t, height, velocity = landing, plate.height(landing), plate.velocity(landing) + e * approach
        times.append(t)
    return np.array(times)
