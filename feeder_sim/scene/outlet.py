"""Outlets of a scene in SI units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Scenario

NO_OUTLET = -1


@dataclass(frozen=True, eq=False)
class OutletVolume:
    """An upright prism, its surface included.

    Attributes:
        name: of its table.
        outline: corners, (n, 2) [m].
        low, high: its ends [m].
    """

    name: str
    outline: NDArray[np.float64]
    low: float = -np.inf
    high: float = np.inf

    @cached_property
    def polygon(self) -> Any:
        """The outline, as shapely has it."""
        import shapely

        polygon = shapely.Polygon(self.outline)
        shapely.prepare(polygon)
        return polygon

    def holds(self, place: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of some places (n, 3) [m] are in it."""
        import shapely

        x, y, z = place.T
        return np.asarray(shapely.intersects_xy(self.polygon, x, y) & (z >= self.low) & (z <= self.high))


def build_outlets(scenario: Scenario) -> tuple[OutletVolume, ...]:
    """All outlets of a scenario."""
    volumes = []
    for table in scenario.outlets:
        if table.box_mm is None:
            volumes.append(OutletVolume(table.name, 1e-3 * np.array(table.outline_mm)))
        else:
            (x0, y0, low), (x1, y1, high) = (1e-3 * np.array(corner) for corner in table.box_mm)
            outline = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
            volumes.append(OutletVolume(table.name, outline, float(low), float(high)))
    return tuple(volumes)


def outlet_numbers(outlets: Sequence[OutletVolume], frames: Frames) -> NDArray[np.int64]:
    """Number of the outlet that each part has entered in the last of some frames, (parts,); else NO_OUTLET."""
    number = np.full(frames.present.shape[1], NO_OUTLET)
    if not outlets or not len(frames):
        return number
    there = np.flatnonzero(frames.present[-1])
    for i in reversed(range(len(outlets))):
        number[there[outlets[i].holds(frames.position[-1, there])]] = i
    return number
