"""How strongly the plate moves where parts start, under each drive by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.scenario import GivenState, Heap, PartSpec, Placed, Start
from feeder_sim.scene.scene import Scene

POINTS = 41  # per axis of the area in which parts start


@dataclass(frozen=True)
class UnderPart:
    """Amplitude of the surface under one part table, under one drive, when the plate has rung up.

    Attributes:
        excitation: index into `Scenario.excitations`.
        part: index of the part table.
        frequency: of the drive [Hz].
        least, median, largest: amplitude over the area in which its parts start [m]; equal for a start at a point.
    """

    excitation: int
    part: int
    frequency: float
    least: float
    median: float
    largest: float

    @property
    def velocity(self) -> float:
        """Of the median [m/s]."""
        return 2.0 * math.pi * self.frequency * self.median

    @property
    def acceleration(self) -> float:
        """Peak of the median over gravity [1]."""
        return 2.0 * math.pi * self.frequency * self.velocity / GRAVITY


def motion_under_parts(scene: Scene) -> Iterator[UnderPart]:
    """The motion under every part table, drive by drive."""
    for i, spec in enumerate(scene.scenario.part):
        shapes = scene.surface.deflections(_starting_points(spec, scene))
        for excitation, drives in enumerate(scene.all_drives):
            field = np.zeros(shapes.shape[1], complex)
            for drive in drives:
                field += drive.steady * shapes[drive.shape]
            least, median, largest = np.quantile(np.abs(field), [0.0, 0.5, 1.0])
            frequency = drives[0].drive_frequency
            yield UnderPart(excitation, i, frequency, float(least), float(median), float(largest))


def _starting_points(spec: PartSpec, scene: Scene) -> NDArray[np.float64]:
    """Points (n, 2) [m] of the area in which the parts of a table start."""
    start = spec.start
    if isinstance(start, Start | GivenState):
        return 1e-3 * np.array([start.position_mm[:2]])
    if isinstance(start, Placed):
        return 1e-3 * np.array(start.places_mm_deg)[:, :2]
    size = np.array([scene.surface.length, scene.surface.width])
    if isinstance(start, Heap):
        size = np.full(2, 1e-3 * start.diameter_mm)
    elif start.size_mm is not None:
        size = 1e-3 * np.array(start.size_mm)
    steps = np.linspace(-0.5, 0.5, POINTS)
    x, y = (values.ravel() for values in np.meshgrid(steps, steps, indexing="ij"))
    inside = np.hypot(x, y) <= 0.5 if isinstance(start, Heap) else np.full(len(x), True)
    points = 1e-3 * np.array(start.centre_mm) + np.stack([x, y], axis=1)[inside] * size
    return points if scene.surface.outline is None else points[scene.surface.outline.holds(points)]
