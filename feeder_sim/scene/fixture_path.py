"""How a fixture moves by itself: from point to point in straight lines, as stages open it, or turning for ever."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.scenario.fixture import FixtureTable, Opening
from feeder_sim.scene.timetable import TimedStage

SAME_TIME = 1e-12  # [s]


@dataclass(frozen=True)
class FixturePath:
    """Where a fixture is in time, from where it stands.

    Attributes:
        time: of points that it passes, from 0 on, shape (n,) [s].
        shift: of its centre at these (n, 3) [m].
        angle: about its axis at these (n,) [rad].
        rate: at which it turns besides [rad/s].
    """

    time: NDArray[np.float64]
    shift: NDArray[np.float64]
    angle: NDArray[np.float64]
    rate: float

    def at(self, t: float) -> tuple[NDArray[np.float64], float]:
        """Shift (3,) [m] and angle [rad] at a time [s]."""
        shift = np.array([np.interp(t, self.time, column) for column in self.shift.T])
        return shift, float(np.interp(t, self.time, self.angle)) + self.rate * t

    def velocity(self, t: float) -> tuple[NDArray[np.float64], float]:
        """Velocity (3,) [m/s] and rate of turn [rad/s] from a time on [s]."""
        i = int(np.searchsorted(self.time, t + SAME_TIME, side="right"))
        if not 0 < i < len(self.time):
            return np.zeros(3), self.rate
        lasts = self.time[i] - self.time[i - 1]
        turned = float(self.angle[i] - self.angle[i - 1]) / lasts
        return (self.shift[i] - self.shift[i - 1]) / lasts, turned + self.rate

    def next_change(self, t: float) -> float:
        """When it goes on in another way after a time [s]; infinite if it does not."""
        i = int(np.searchsorted(self.time, t + SAME_TIME, side="right"))
        return float(self.time[i]) if i < len(self.time) else math.inf

    def moves_within(self, start: float, end: float) -> bool:
        """Whether it moves at any time between two [s]."""
        inside = self.time[(self.time > start) & (self.time < end)]
        return any(np.any(velocity) or rate != 0.0 for velocity, rate in map(self.velocity, [start, *inside]))

    @property
    def top_speed(self) -> float:
        """The fastest that its centre goes [m/s]."""
        return max((float(np.linalg.norm(self.velocity(t)[0])) for t in self.time), default=0.0)

    @property
    def top_rate(self) -> float:
        """The fastest that it turns [rad/s]."""
        return max(abs(self.velocity(t)[1]) for t in self.time)


def path_of(table: FixtureTable, stages: Sequence[TimedStage]) -> FixturePath | None:
    """The path of a fixture while stages take their times; None for one that has no motion of its own."""
    if not table.moves_itself:
        return None
    rate = 2.0 * math.pi / 60.0 * table.turns_per_minute
    points = [(0.0, np.zeros(3), 0.0)]
    for point in table.path or ():
        if point.at_s > 0.0:
            points.append((point.at_s, 1e-3 * np.array(point.by_mm), math.radians(point.turn_deg)))
    if table.opens is not None:
        points = [(t, share * 1e-3 * np.array(table.opens.by_mm), 0.0) for t, share in _openings(table.opens, stages)]
    time, shift, angle = zip(*points, strict=True)
    return FixturePath(np.array(time, float), np.array(shift, float), np.array(angle, float), rate)


def _openings(opening: Opening, stages: Sequence[TimedStage]) -> list[tuple[float, float]]:
    """Times [s] and shares of the way of a gate, which opens and closes at one speed, also from half-way."""
    points = [(0.0, 0.0)]
    for stage in stages:
        goal = float(stage.name in opening.stages)
        share = float(np.interp(stage.start, [t for t, _ in points], [share for _, share in points]))
        points = [point for point in points if point[0] < stage.start] + [(stage.start, share)]
        if share != goal:
            points.append((stage.start + abs(goal - share) * opening.within_s, goal))
    return points
