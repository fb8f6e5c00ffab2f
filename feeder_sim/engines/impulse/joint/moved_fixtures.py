"""Fixtures that move by themselves, as the parts that stand for them: a velocity and a spin from window to window."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.state import STEADY
from feeder_sim.scene.fixture_path import path_of
from feeder_sim.scene.scene import Scene


class MovedFixtures:
    """Those fixtures of a scene that have a path; its stages may have got other times since the last one."""

    def __init__(self, scene: Scene) -> None:
        paths = [(fixture, path_of(fixture.table, scene.times.stages)) for fixture in scene.fixtures]
        first = len(scene.parts)
        self._moved = [(first + k, fixture, path) for k, (fixture, path) in enumerate(paths) if path is not None]

    @property
    def any(self) -> bool:
        """Whether there are such."""
        return bool(self._moved)

    def place(self, parts: NDArray[np.void], t: float) -> None:
        """Put them where they are at the begin of a window [s], with the motion that they have in it."""
        for row, fixture, path in self._moved:
            part, (velocity, rate) = parts[row], path.velocity(t)
            part["position"], part["attitude"] = fixture.pose(*path.at(t))
            part["velocity"], part["momentum"] = velocity, rate * fixture.axis
            part["clock"], part["phase"] = t, STEADY

    def next_change(self, t: float) -> float:
        """When one goes on in another way after a time [s]."""
        return min((path.next_change(t) for _, _, path in self._moved), default=math.inf)

    def move_within(self, start: float, end: float) -> bool:
        """Whether any moves between two times [s]."""
        return any(path.moves_within(start, end) for _, _, path in self._moved)
