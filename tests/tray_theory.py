"""A block on a rigid tray that moves to and fro along a line that rises: the engine's speed, and that of an ODE.

The tray moves by S sin(w t) along a line at an angle beta to it. Its throw number S sin(beta) w^2 / g says whether a
block leaves it (above 1). Of an inclined tray g is what is normal to it, and `pull` is what is along it. The block is a
point that sticks, slips or flies (Boothroyd, Assembly Automation and Product Design, 2005, ch. 3; here with
restitution):

    sticks  while |x_tray'' - pull| <= mu N,     N = g + z_tray'' > 0,
    slips   with  x'' = +-mu N + pull,           until both speeds are the same,
    flies   once  N < 0,                  until it meets the tray; there the normal speed v_n becomes -e v_n, and
            friction takes the tangential one down by mu (1 + e) |v_n| at most.

In each state place and speed are closed forms. Their events are looked for `looks` times a period and bisected, so that
only an event that comes and goes between two looks is missed: twice as many looks show that none is.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from feeder_sim import simulate
from feeder_sim.constants import GRAVITY
from feeder_sim.measures.catalogue import values_of_seed
from feeder_sim.scenario import Box, Contact, Placed, RigidPlate, Run, Scenario, Start, TrayDrive

LENGTH, WIDTH = 8.0, 0.4  # [m]
SETTLED = 1.0  # [s] until the speed is measured


@dataclass(frozen=True)
class Case:
    """Frequency [Hz], throw number, angle to the tray [deg], friction and restitution [1], rise of the tray [deg]."""

    frequency: float
    throw: float
    angle: float
    friction: float
    restitution: float
    tilt: float = 0.0

    def __str__(self) -> str:
        contact = f"mu {self.friction:g}, e {self.restitution:g}{f', rises {self.tilt:g} deg' if self.tilt else ''}"
        return f"{self.frequency:g} Hz, throw {self.throw:g}, {self.angle:g} deg, {contact}"

    @property
    def omega(self) -> float:
        return 2.0 * math.pi * self.frequency

    @property
    def up(self) -> float:
        """Amplitude of the height [m]."""
        return self.throw * GRAVITY * math.cos(math.radians(self.tilt)) / self.omega**2

    @property
    def along(self) -> float:
        """Amplitude along the tray [m]."""
        return self.up / math.tan(math.radians(self.angle))


CASES = (
    Case(50.0, 0.64, 25.0, 0.4, 0.2),
    Case(100.0, 1.7, 25.0, 0.4, 0.0),
    Case(50.0, 1.06, 25.0, 0.4, 0.2),
    Case(40.0, 0.4, 30.0, 0.2, 0.2),
    Case(50.0, 0.8, 20.0, 0.2, 0.0),
    Case(60.0, 0.95, 35.0, 0.4, 0.2),
    Case(50.0, 2.06, 20.0, 0.3, 0.2),
    Case(80.0, 1.3, 25.0, 0.3, 0.0),
    Case(100.0, 1.5, 30.0, 0.2, 0.2),
    Case(120.0, 1.9, 25.0, 0.3, 0.0),
    Case(150.0, 2.2, 25.0, 0.3, 0.2),
    Case(150.0, 2.6, 25.0, 0.2, 0.0),
)
QUICK = CASES[:3]
INCLINED = (
    Case(50.0, 1.06, 25.0, 0.4, 0.2, 3.0),
    Case(60.0, 0.9, 30.0, 0.5, 0.0, 6.0),
    Case(80.0, 1.4, 25.0, 0.3, 0.0, -2.0),
)


# The point block


@njit
def _gap(t: Any, s: Any, up: Any, w: Any, g: Any) -> Any:
    """Height over the tray of a flight that began at s[0] with place and speed s[1], s[2]."""
    age = t - s[0]
    return s[1] + s[2] * age - 0.5 * g * age * age - up * math.sin(w * t)


@njit
def _slip(t: Any, s: Any, up: Any, w: Any, g: Any, mu: Any, pull: Any) -> Any:
    """Way and speed of a block that slips since s[0] with speed s[4], in the direction s[5] of its friction."""
    age = t - s[0]
    speed = s[4] + pull * age + s[5] * mu * (g * age + up * w * (math.cos(w * t) - math.cos(w * s[0])))
    sines = (math.sin(w * t) - math.sin(w * s[0])) / w - age * math.cos(w * s[0])
    return s[4] * age + 0.5 * pull * age * age + s[5] * mu * (0.5 * g * age * age + up * w * sines), speed


@njit
def _event(mode: Any, t: Any, s: Any, up: Any, along: Any, w: Any, g: Any, mu: Any, pull: Any) -> Any:
    """Negative once the state has ended."""
    if mode == 0:  # flight
        return _gap(t, s, up, w, g)
    pressed = g - up * w * w * math.sin(w * t)
    if mode == 1:  # stick
        return min(pressed, mu * pressed - abs(along * w * w * math.sin(w * t) + pull))
    _way, speed = _slip(t, s, up, w, g, mu, pull)
    return min(pressed, s[5] * (along * w * math.cos(w * t) - speed))


@njit
def _walk(motion: Any, law: Any, drop: Any, begin: Any, end: Any, looks: Any) -> Any:
    """Way of the block from `begin` to `end` [m], dropped from rest at t = 0 from a height over the tray."""
    (up, along, w), (mu, e, g, pull) = motion, law
    look, t, mode, x, at_begin, looked = 2.0 * math.pi / w / looks, 0.0, 0, 0.0, 0.0, False
    s = np.array([0.0, drop, 0.0, 0.0, 0.0, 0.0])  # since, height, speed up, place, speed along, direction of friction
    while t < end:
        late = t + look
        if _event(mode, late, s, up, along, w, g, mu, pull) >= 0.0:
            t = late
        else:
            early = t
            for _ in range(60):
                middle = 0.5 * (early + late)
                if _event(mode, middle, s, up, along, w, g, mu, pull) >= 0.0:
                    early = middle
                else:
                    late = middle
            t = late
        # the place now, and the state to go on in
        age = t - s[0]
        way, speed = s[4] * age + 0.5 * pull * age * age, s[4] + pull * age
        if mode == 1:
            way, speed = along * (math.sin(w * t) - math.sin(w * s[0])), along * w * math.cos(w * t)
        elif mode == 2:
            way, speed = _slip(t, s, up, w, g, mu, pull)
        x = s[3] + way
        if not looked and t >= begin:
            looked, at_begin = True, x
        if t != late or _event(mode, t, s, up, along, w, g, mu, pull) >= 0.0:
            continue
        rise = up * w * math.cos(w * t)
        pressed = g - up * w * w * math.sin(w * t)
        tray = along * w * math.cos(w * t)
        if mode == 0:
            approach = max(rise - (s[2] - g * (t - s[0])), 0.0)
            most = mu * (1.0 + e) * approach
            speed += max(-most, min(most, tray - speed))
            if e * approach > 1e-8 or pressed <= 0.0:
                s[:] = t, up * math.sin(w * t), rise + e * approach, x, speed, 0.0
                continue
        elif pressed <= 0.0:
            mode = 0
            s[:] = t, up * math.sin(w * t), rise, x, speed, 0.0
            continue
        wanted = -along * w * w * math.sin(w * t) - pull
        if abs(tray - speed) < 1e-9 and abs(wanted) <= mu * pressed:
            mode, s[5] = 1, 0.0
        else:
            mode, s[5] = 2, np.sign(tray - speed) if abs(tray - speed) >= 1e-9 else np.sign(wanted)
        s[:5] = t, 0.0, 0.0, x, speed
    return x - at_begin


def speed_of_point(case: Case, drop: float = 3e-5, *, end: float = 5.0, looks: int = 1000) -> float:
    """Mean speed along the tray [m/s] from SETTLED to `end` [s]."""
    theta = math.radians(case.tilt)
    law = (case.friction, case.restitution, GRAVITY * math.cos(theta), -GRAVITY * math.sin(theta))
    motion = (case.up, case.along, case.omega)
    return float(_walk(motion, law, drop, SETTLED, end, looks)) / (end - SETTLED)


# The engine


def tray_scenario(case: Case, *, count: int = 1, duration: float, seeds: int, **run: Any) -> Scenario:
    """Flat blocks in a row across a tray that moves along a line at the case's angle to it."""
    drop, flat = (0.02, 0.05), (0.0, 0.0)
    places = tuple((-3000.0, 12.0 * (i + 0.5 - 0.5 * count), 0.0) for i in range(count))
    row = Placed(kind="placed", places_mm_deg=places, drop_height_mm=drop)
    alone = Start(position_mm=(-3000.0, 0.0), drop_height_mm=drop, tilt_deg=flat, yaw_deg=flat)
    stroke = 1e6 * math.hypot(case.up, case.along)
    return Scenario(
        plate=RigidPlate(kind="tray", length_mm=1e3 * LENGTH, width_mm=1e3 * WIDTH, tilt_deg=case.tilt),
        drive=(TrayDrive(frequency_hz=case.frequency, stroke_um=stroke, angle_deg=case.angle + case.tilt),),
        part=(Box(shape="box", size_mm=(8.0, 8.0, 2.0), count=count, start=alone if count == 1 else row),),
        contact=Contact(restitution=case.restitution, friction=case.friction),
        run=Run(duration_s=duration, seeds=seeds, **run),
    )


@dataclass(frozen=True)
class Found:
    """Mean speed of every seed [m/s], shape (seeds,), and cost [s of processor per simulated s]."""

    speed: NDArray[np.float64]
    cost: float


def speed_in_engine(case: Case, *, count: int = 1, duration: float = 5.0, seeds: int = 2, **run: Any) -> Found:
    """Mean speed along the tray from SETTLED to the end."""
    scenario = tray_scenario(case, count=count, duration=duration, seeds=seeds, **run)
    began = time.process_time()
    result = simulate(scenario)
    cost = (time.process_time() - began) / (seeds * duration)
    up_the_tray = math.cos(math.radians(case.tilt))
    speeds = [values_of_seed(result.prepared, seed)["conveying_speed_mm_s"] for seed in result.seeds]
    return Found(1e-3 * np.array(speeds) / up_the_tray, cost)
