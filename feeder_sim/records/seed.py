"""One seed: a block of it that has just been computed, all of it once it has ended, or as it was read back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feeder_sim.errors import SimulationDiverged
from feeder_sim.notebook import counted
from feeder_sim.records.trajectory import Frames

# What happens to parts beside their motion: impacts, removals and arrivals, a row each, in order of time.
#
# They are NumPy's record arrays: a column is an attribute (`impacts.time`), rows are taken as from any array.
#
# impacts: contacts of a guided part with the plate; a part that sticks is in one long contact.
#
#     time                begin of the contact [s]
#     until               its end [s]: `time` for an impact without duration, infinite while the part still sticks
#     approach_speed      of the part relative to the plate at the begin [m/s]
#     departure_velocity  vertical velocity of the part at the end [m/s]; NaN while the part still sticks
#
# removals: parts taken out, at `time` [s]; `part` is its index, `cause` see `Cause`, `outlet` the index of the one it
# went through, else -1.
#
# arrivals: parts of refills; a part is not in the frame at `time` [s] yet, but in the next one. `part` is its index,
# `cycle` the one at whose end the refill was (there is one at most), without cycles the number of the check, `height`
# that of the centre of mass where it was let go [m].

Events: TypeAlias = Any  # np.recarray, which type checkers lose where rows are taken

# name: (unit, type)
Columns: TypeAlias = Mapping[str, tuple[str, str]]
IMPACTS: Columns = {
    "time": ("s", "f8"),
    "until": ("s", "f8"),
    "approach_speed": ("m/s", "f8"),
    "departure_velocity": ("m/s", "f8"),
}
REMOVALS: Columns = {"time": ("s", "f8"), "part": ("1", "i8"), "cause": ("1", "i8"), "outlet": ("1", "i8")}
ARRIVALS: Columns = {"time": ("s", "f8"), "part": ("1", "i8"), "cycle": ("1", "i8"), "height": ("m", "f8")}


class Cause(IntEnum):
    """Why a part was taken out."""

    PICKED = 1
    LOST = 2
    OUTLET = 3


def events(columns: Columns, **values: ArrayLike) -> Events:
    """Events of one kind, one per entry of the longest column; a number stands for all rows, nothing for none."""
    arrays = np.broadcast_arrays(*(values.get(name, ()) for name in columns))
    rows = np.empty(len(arrays[0]), [(name, kind) for name, (_, kind) in columns.items()])
    for name, array in zip(columns, arrays, strict=True):
        rows[name] = array
    events: Events = rows.view(np.recarray)
    return events


def no_events(columns: Columns) -> Events:
    """None of a kind, the same array each time: one is asked for with every block."""
    return _NONE[id(columns)]


_NONE = {id(columns): events(columns) for columns in (IMPACTS, REMOVALS, ARRIVALS)}


def removed(parts: ArrayLike, time: float, cause: Cause, outlet: ArrayLike = -1) -> Events:
    """Parts, by their indices, that are taken out at once."""
    return events(REMOVALS, time=time, part=parts, cause=cause, outlet=outlet)


def impacts_of(rows: NDArray[np.float64]) -> Events:
    """Impacts whose columns are in the order above, shape (n, 4)."""
    if not len(rows):
        return no_events(IMPACTS)
    return events(IMPACTS, **dict(zip(IMPACTS, rows.T, strict=True)))


def joined(blocks: Sequence[Events]) -> Events:
    """Concatenate events of one kind in time."""
    filled = [block for block in blocks if len(block)] or blocks[:1]
    events: Events = np.concatenate(filled).view(np.recarray) if len(filled) > 1 else filled[0]
    return events


def parts_removed(removals: Events, cause: Cause, *, start: float = -np.inf, end: float = np.inf) -> NDArray[np.int64]:
    """Indices of the parts taken out for a cause at start < time <= end [s]."""
    return np.asarray(removals.part[(removals.cause == cause) & (removals.time > start) & (removals.time <= end)])


def parts_arrived(arrivals: Events, *, start: float, end: float) -> NDArray[np.int64]:
    """Indices of the parts that came at start <= time < end [s]."""
    return np.asarray(arrivals.part[(arrivals.time >= start) & (arrivals.time < end)])


# The last states of a seed that diverged, to look at.

LAST_FRAMES = 100  # kept of a block that failed, at most: half of them before the first one that is not valid


@dataclass(frozen=True)
class LastStates:
    """What is kept of a block in which a seed diverged. The seed runs again from its start, to the same bits.

    Attributes:
        frames: up to LAST_FRAMES of the block.
        valid: number of `frames` before the first one that is not valid.
    """

    frames: Frames
    valid: int

    @staticmethod
    def of(block: Frames, valid: int) -> LastStates:
        """Cut the frames around the failure out of a block of which the first `valid` frames are valid."""
        skipped = max(0, min(valid - LAST_FRAMES // 2, len(block) - LAST_FRAMES))
        frames = block[slice(skipped, skipped + LAST_FRAMES)]
        # Copied, since `present` is still written to.
        return LastStates(Frames(*(getattr(frames, field.name).copy() for field in fields(Frames))), valid - skipped)


class Status(IntEnum):
    """How the recording of one seed ended."""

    UNFINISHED = 0
    DONE = 1
    DIVERGED = 2
    LEFT_PLATE = 3


def endings(status: Sequence[Status]) -> str:
    """How many seeds there are, and how they ended: "4 seeds (3 done, 1 diverged)"."""
    texts = [f"{status.count(ending)} {ending.name.lower().replace('_', ' ')}" for ending in Status if ending in status]
    return f"{counted(len(status), 'seed')} ({', '.join(texts) or 'none'})"


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
        impacts, removals, arrivals: contacts of a guided part with the plate, parts taken out, parts of refills;
            see feeder_sim.records.seed.
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
        facts = [counted(len(self.impacts), "impact"), counted(len(self.removals), "removal")]
        return f"<Seed: {', '.join([repr(self.frames)[9:-1], *facts])}, {self.status.name.lower()}>"

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
