"""The table of drift and diffusion, and what it says of a point of a surface.

A place on the standing wave w = A cos(k x) has the amplitude a = A |cos theta| and the slope s = A k |sin theta|, with
theta from 0 at the antinode to pi/2 at the node. So any pair of an amplitude and a slope is a place on some wave:

    A = hypot(a, s/k),    theta = atan2(s/k, a),    V = A omega

and the table holds, over the frequency, V and theta,

    drift = v / (omega A k h/2),    along, across = D g / V^3

for the diffusion along the slope and across it. Where the antinode would be below 1 g nothing moves. Between the
entries it is linear in theta, log V and log frequency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.errors import InputError
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.rectangle import RectangularPlate

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MapInputs:
    """What a map was made of: it holds for nothing else.

    Attributes:
        part: the part's table of a scenario without its start, as JSON; files by their content.
        contact: constants of its contact with the plate, as JSON.
        method: engine and steps per period.
        thickness: of the plate [m].
    """

    part: str
    contact: str
    method: str
    thickness: float


@dataclass(frozen=True)
class DriftMap:
    """Mean drift and diffusion of a part.

    Attributes:
        made: of what.
        plate: the strip that it was made on; its thickness and its waves count.
        frequency: of the table (f,) [Hz], rising.
        speed: velocity amplitudes V of antinodes (v,) [m/s], rising.
        drift: without units, (f, v, theta), at theta = (j + 1/2) pi / 2 / n.
        drift_se: its standard error.
        along: diffusion along the slope, without units, of the same shape.
        across: diffusion across it.
        simulated_s: of all runs behind it [s].
        processor_s: that they took [s].
    """

    made: MapInputs
    plate: RectangularPlate
    frequency: Floats
    speed: Floats
    drift: Floats
    drift_se: Floats
    along: Floats
    across: Floats
    simulated_s: float
    processor_s: float

    def perturbed(self, rng: np.random.Generator) -> DriftMap:
        """A map whose drifts differ from these as those of other seeds would: what comes of it shows its own error."""
        return replace(self, drift=self.drift + self.drift_se * rng.standard_normal(self.drift.shape))

    def check_covers(self, frequency: float, speed: float) -> None:
        """Refuse a drive that is beyond the table.

        Args:
            frequency: of the drive [Hz].
            speed: largest velocity amplitude of its antinodes [m/s].

        Raises:
            InputError: it is.
        """
        low, high = self.frequency[[0, -1]]
        if not low <= frequency <= high:
            raise InputError(f"is {frequency:g}, must be {low:g} to {high:g} with this drift map", key="frequency_hz")
        if speed > self.speed[-1]:
            raise InputError(
                f"moves an antinode at {speed:.3g} m/s, must be up to {self.speed[-1]:g} m/s with this drift map",
                key="drive",
            )

    def at(self, frequency: float, amplitude: Floats, slope: Floats) -> tuple[Floats, Floats, Floats]:
        """Drift toward falling amplitude [m/s], diffusion along the slope and across it [m^2/s], each (n,).

        Args:
            frequency: of the drive [Hz].
            amplitude: of the surface (n,) [m].
            slope: gradient of the amplitude (n,) [1].
        """
        waves = standing_wave(self.plate, frequency).wavenumber
        return self.at_wave(frequency, amplitude, slope / waves, waves)

    def at_wave(
        self, frequency: float, amplitude: Floats, quadrature: Floats, wavenumber: float
    ) -> tuple[Floats, Floats, Floats]:
        """As `at`, with the slope divided by the wavenumber [m] of this frequency [1/m], which takes long to find."""
        omega = 2.0 * math.pi * frequency
        magnitude = np.hypot(amplitude, quadrature)
        speed = omega * magnitude
        moving = omega * speed > GRAVITY
        theta = np.arctan2(quadrature, amplitude)
        drift, along, across = self._interpolated(frequency, np.maximum(speed, 1e-12), theta)
        surface = 0.5 * self.made.thickness * wavenumber * speed
        spread = np.where(moving, speed**3 / GRAVITY, 0.0)
        return np.where(moving, drift * surface, 0.0), along * spread, across * spread

    def _interpolated(self, frequency: float, speed: Floats, theta: Floats) -> Floats:
        """The three tables (3, n) at a frequency [Hz], at speeds (n,) [m/s] and angles (n,)."""
        table = self._at_frequency(frequency)
        logs = np.log(self.speed)
        i, u = _cell(np.interp(np.log(speed), logs, np.arange(len(logs))), len(logs))
        j, t = _cell(theta * (2.0 / math.pi) * (table.shape[2] - 2) + 0.5, table.shape[2])
        upper, lower = table[:, i, j] * (1.0 - t) + table[:, i, j + 1] * t, table[:, i + 1, j] * (1.0 - t)
        return np.asarray(upper * (1.0 - u) + (lower + table[:, i + 1, j + 1] * t) * u)

    def _at_frequency(self, frequency: float) -> Floats:
        """The tables (3, v, theta + 2) at a frequency, continued beyond antinode and node by their symmetry."""
        cache = self.__dict__.setdefault("_held", {})
        if frequency not in cache:
            logs = np.log(self.frequency)
            (i,), (u,) = _cell(np.interp([math.log(frequency)], logs, np.arange(len(logs))), len(logs))
            table = np.stack([self.drift, self.along, self.across])
            there = table[:, i] * (1.0 - u) + table[:, min(i + 1, len(logs) - 1)] * u
            sign = np.array([-1.0, 1.0, 1.0])[:, None, None]
            cache[frequency] = np.concatenate([sign * there[..., :1], there, sign * there[..., -1:]], axis=2)
        return np.asarray(cache[frequency])


def _cell(place: Floats, n: int) -> tuple[NDArray[np.int64], Floats]:
    """Index of the entry before each place on a row of n entries, and how far it is to the next one."""
    index = np.clip(place.astype(np.int64), 0, max(n - 2, 0))
    return index, place - index
