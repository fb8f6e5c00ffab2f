"""What a seed is begun with, what it hands on while it runs, and what comes out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import SimulationDiverged
from feeder_sim.records.counts import NOTHING_COUNTED, Counts
from feeder_sim.records.last_states import LastStates
from feeder_sim.records.trajectory import Record, SeedRecord, Status


class Recorder(Protocol):
    """Where blocks go while a run is under way; called from several threads."""

    def append(self, seed_index: int, block: Record) -> None: ...

    def checkpoint(self, seed_index: int, state: dict[str, NDArray[np.float64]], wall_s: float) -> None:
        """Keep what the run can go on from after everything appended so far, and the wall time spent on it."""
        ...

    def keep_last(self, failure: SimulationDiverged, last: LastStates) -> str:
        """Keep the last states of the seed that diverged; returns the name of the file."""
        ...

    def finish(self, seed_index: int, status: Status, wall_s: float, counts: Counts) -> None: ...

    def recorded(self, seed_index: int) -> Record:
        """Everything appended so far."""
        ...


@dataclass(frozen=True, repr=False)
class Begun(SeedRecord):
    """What there is of a seed that is to be continued.

    Attributes:
        state: of the engine at the end of the record; empty where the seed has ended.
        wall_s: wall time spent so far [s].
        counts: of a seed that has ended; of others the engine's state knows.
    """

    state: dict[str, NDArray[np.float64]]
    wall_s: float
    counts: Counts = NOTHING_COUNTED


@dataclass(frozen=True)
class Left:
    """What there is of an ensemble that is to be continued.

    Attributes:
        begun: seeds, by their index, that go on from what there is of them.
        wall_s: wall time [s] of the ensemble before it was interrupted.
    """

    begun: Mapping[int, Begun]
    wall_s: float


@dataclass(frozen=True, repr=False)
class SeedResult(SeedRecord):
    """One seed of an ensemble.

    Attributes:
        wall_s: wall time spent in its loop [s], that before a break included.
        failure: why it diverged, None otherwise.
        last: its last states if it diverged, None otherwise.
        counts: what the engine counted.
        reached_s: time of its last frame [s], where that was not kept.
    """

    wall_s: float
    failure: SimulationDiverged | None = None
    last: LastStates | None = None
    counts: Counts = NOTHING_COUNTED
    reached_s: float | None = None

    @property
    def reached(self) -> float | None:
        """Time of its last frame [s], whether that was kept or not; None without any."""
        return float(self.frames.time[-1]) if self.reached_s is None and len(self.frames) else self.reached_s
