"""Where a stage will carry parts: along the gradient of the plate's local speed, to its nodes.

How fast is said by one of two laws. A drift map (studies/drift_map) says it of the part, its contact and the local
motion of the surface: *MapDrift*. Without a map there is a rule of thumb, *GradientDrift*: with the velocity amplitude
v(x, y) of the surface, the top of a plate of the thickness h moves sideways with the amplitude h/2 |grad v|, and parts
drift toward the node at a share of that:

    dx/dt = -share * h/2 * grad v        where the surface throws parts, omega v > g

SHARE is what short pulses gave of an M2.5 nut on the 180 mm plate (letter.py --fit). By either law a part comes no
further than to the node. Modes of one frequency add up as phasors; of several frequencies each adds its own way.
"""

from __future__ import annotations

import argparse
import cmath
import itertools
import math
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

import feeder_sim
from feeder_sim.constants import GRAVITY
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.scene.scene import Scene
from feeder_sim.studies.drift_map.drift_map import DriftMap
from feeder_sim.studies.drift_map.files import check_made, load_map, save_map
from feeder_sim.studies.drift_map.making import SPEEDS_M_S, make_map, strip_of

SHARE = 0.66
STEP_S = 0.1  # [s] of one step of the way
BESIDE = 2e-4  # [m] from a point to those that its gradient is made of
AROUND = BESIDE * np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
TINY = 1e-12
FASTEST_M_S = 1.2  # antinodes that the pulses of the separation move


class Prediction(Protocol):
    """Where parts will be."""

    def predict(self, stage: int, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Places (n, 2) [m] after a stage, by its number, of parts at places (n, 2) [m]."""
        ...


class AlongGradient(ABC):
    """A prediction along the gradient of the speed, at a rate that the subclass says."""

    def __init__(self, scene: Scene) -> None:
        """`scene` has the plate and the stages, all of them in its schedule."""
        self._surface = scene.surface
        schedule = scene.scenario.schedule
        assert schedule is not None
        drives = iter(scene.drives[sum(len(stage.drive) for stage in schedule.prepare) :])
        self._stages = [
            (stage.duration_s, list(itertools.islice(drives, len(stage.drive)))) for stage in schedule.stage
        ]
        self._places, self._shapes = b"", np.empty((0, 0, 0))

    def predict(self, stage: int, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        duration, drives = self._stages[stage]
        n_steps = max(1, math.ceil(duration / STEP_S))
        places = np.array(positions, float)
        for _ in range(n_steps):
            way = np.zeros_like(places)
            for frequency in dict.fromkeys(drive.drive_frequency for drive in drives):
                rate = 2.0 * math.pi * frequency
                amplitude = np.zeros(self._surface.n_shapes, complex)
                for drive in drives:
                    if drive.drive_frequency == frequency:
                        amplitude[drive.shape] += rate * drive.steady_amplitude * cmath.exp(1j * drive.phase)
                speed, gradient = self._speed(amplitude, places)
                steepness = np.linalg.norm(gradient, axis=1)
                length = self._drift(frequency, speed, steepness) * duration / n_steps
                length = np.minimum(length, speed / np.maximum(steepness, TINY))
                way -= gradient * (length / np.maximum(steepness, TINY))[:, None]
            places += way
        return places

    @abstractmethod
    def _drift(
        self, frequency: float, speed: NDArray[np.float64], steepness: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Drift toward the node (n,) [m/s] where the surface moves at a speed (n,) [m/s] with a gradient (n,) [1/s]."""

    def _speed(
        self, amplitude: NDArray[np.complex128], places: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Modulus of the velocity (n,) [m/s] at places (n, 2), and its gradient (n, 2) [1/s].

        `amplitude` are those of all mode shapes [m/s].
        """
        v = np.tensordot(amplitude, self._shapes_around(places), axes=1)
        slope = np.stack([v[:, 1] - v[:, 2], v[:, 3] - v[:, 4]], axis=1) / (2.0 * BESIDE)
        modulus = np.abs(v[:, 0])
        return modulus, (v[:, :1].conj() * slope).real / np.maximum(modulus, TINY)[:, None]

    def _shapes_around(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """All mode shapes at places and beside them, (n_shapes, n, 5); kept, as all stages begin at the same ones."""
        key = places.tobytes()
        if key != self._places:
            points = (places[:, None] + AROUND).reshape(-1, 2)
            self._places, self._shapes = key, self._surface.deflections(points).reshape(-1, len(places), len(AROUND))
        return self._shapes


class GradientDrift(AlongGradient):
    """The rule of thumb: a share of the in-plane speed of the surface."""

    def __init__(self, scene: Scene, *, share: float = SHARE) -> None:
        super().__init__(scene)
        self._share = share

    def _drift(
        self, frequency: float, speed: NDArray[np.float64], steepness: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        thrown = 2.0 * math.pi * frequency * speed > GRAVITY
        return np.where(thrown, self._share * 0.5 * self._surface.thickness * steepness, 0.0)


class MapDrift(AlongGradient):
    """What a drift map says.

    Raises:
        InputError: the map is of another part, contact or thickness, or does not cover a drive.
    """

    def __init__(self, scene: Scene, drift_map: DriftMap) -> None:
        super().__init__(scene)
        check_made(drift_map, scene.scenario, scene.surface.thickness)
        for _, drives in self._stages:
            for drive in drives:
                fastest = 2.0 * math.pi * drive.drive_frequency * drive.steady_amplitude
                drift_map.check_covers(drive.drive_frequency, fastest * float(scene.surface.extremes[0, drive.shape]))
        frequencies = {drive.drive_frequency for _, drives in self._stages for drive in drives}
        self._map = drift_map
        self._wavenumber = {f: standing_wave(drift_map.plate, f).wavenumber for f in frequencies}

    def _drift(
        self, frequency: float, speed: NDArray[np.float64], steepness: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        rate, wavenumber = 2.0 * math.pi * frequency, self._wavenumber[frequency]
        drift, _, _ = self._map.at_wave(frequency, speed / rate, steepness / (rate * wavenumber), wavenumber)
        return drift


def add_map_options(parser: argparse.ArgumentParser) -> None:
    """Options that `prediction_of` takes."""
    parser.add_argument("--map", type=Path, help="predict by this drift map of the nut; it is made if it is not there")
    parser.add_argument("--map-seeds", type=int, default=300, help="of each entry of the map")


def prediction_of(scene: Scene, options: argparse.Namespace) -> Prediction:
    """By a drift map, or by the gradient where there is none."""
    return MapDrift(scene, drift_map_of(options)) if options.map else GradientDrift(scene)


def drift_map_of(options: argparse.Namespace) -> DriftMap:
    """The map of the options, made if it is not there."""
    if not options.map.exists():
        nut = feeder_sim.load_scenario("separation_100")
        speeds = (*SPEEDS_M_S, FASTEST_M_S)
        save_map(make_map(nut, strip_of(nut), speeds_m_s=speeds, seeds=options.map_seeds), options.map)
    return load_map(options.map)
