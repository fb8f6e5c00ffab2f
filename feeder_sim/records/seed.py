"""One seed: a block of it that has just been computed, all of it once it has ended, or as it was read back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import SimulationDiverged
from feeder_sim.notebook import counted
from feeder_sim.records.events import ARRIVALS, IMPACTS, REMOVALS, Events, joined, no_events
from feeder_sim.records.last_states import LastStates
from feeder_sim.records.trajectory import Frames


class Status(IntEnum):
    """How the recording of one seed ended."""

    UNFINISHED = 0
    DONE = 1
    DIVERGED = 2
    LEFT_PLATE = 3


def endings(status: Sequence[Status]) -> str:
    """How many seeds there are, and how they ended: "4 seeds (3 done, 1 diverged)"."""
    ways = [f"{status.count(way)} {way.name.lower().replace('_', ' ')}" for way in Status if way in status]
    return f"{counted(len(status), 'seed')} ({', '.join(ways) or 'none'})"


class Counts(NamedTuple):
    """What an engine counts where it had to give way: nothing of it means that all went as its methods say.

    unresolved_impacts: impacts and forces of many contacts whose iteration was given up; late_contacts: contacts that
    a leap in time had passed, and that were found by going back; budgets_spent: times in which a part was looked at so
    often that nothing was allowed to bounce any more.
    """

    unresolved_impacts: int = 0
    late_contacts: int = 0
    budgets_spent: int = 0

    @staticmethod
    def total(seeds: Sequence[Seed]) -> Counts:
        """Of several seeds together."""
        return Counts(*(sum(column) for column in zip(Counts(), *(seed.counts for seed in seeds), strict=True)))


@dataclass(frozen=True, repr=False)
class Seed:
    """What is recorded of one seed, or of a block of it.

    Attributes:
        frames: states of all parts.
        impacts, removals, arrivals: contacts of a guided part with the plate, parts picked or lost, parts of refills;
            see feeder_sim.records.events.
        stops: when the drives of the stages stopped, in order [s]; those not listed keep to the schedule.
        status: how it ended.
        wall_s: wall time spent in its loop [s].
        failure: why it diverged, None otherwise.
        last: its last states if it diverged and they were kept, None otherwise.
        counts: what the engine counted.
        readings: what the measures have read of all its frames, by their names, where not all frames were kept.
        reached_s: time of its last frame [s], where that was not kept.
    """

    frames: Frames
    impacts: Events = field(default_factory=lambda: no_events(IMPACTS))
    removals: Events = field(default_factory=lambda: no_events(REMOVALS))
    arrivals: Events = field(default_factory=lambda: no_events(ARRIVALS), kw_only=True)
    stops: NDArray[np.float64] = field(default_factory=lambda: np.empty(0), kw_only=True)
    status: Status = field(default=Status.UNFINISHED, kw_only=True)
    wall_s: float = field(default=0.0, kw_only=True)
    failure: SimulationDiverged | None = field(default=None, kw_only=True)
    last: LastStates | None = field(default=None, kw_only=True)
    counts: Counts = field(default=Counts(), kw_only=True)
    readings: Mapping[str, Any] | None = field(default=None, kw_only=True)
    reached_s: float | None = field(default=None, kw_only=True)

    def __repr__(self) -> str:
        held = [counted(len(self.impacts), "impact"), counted(len(self.removals), "removal")]
        return f"<Seed: {', '.join([repr(self.frames)[9:-1], *held])}, {self.status.name.lower()}>"

    @property
    def reached(self) -> float | None:
        """Time of its last frame [s], whether that was kept or not; None without any."""
        return float(self.frames.time[-1]) if self.reached_s is None and len(self.frames) else self.reached_s

    @staticmethod
    def joined(blocks: Sequence[Seed]) -> Seed:
        """Concatenate blocks in time; how the last one stands is how all of it stands."""
        return replace(
            blocks[-1],
            frames=Frames.joined([block.frames for block in blocks]),
            impacts=joined([block.impacts for block in blocks]),
            removals=joined([block.removals for block in blocks]),
            arrivals=joined([block.arrivals for block in blocks]),
            stops=np.concatenate([block.stops for block in blocks]),
        )
