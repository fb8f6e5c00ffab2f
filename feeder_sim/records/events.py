"""What happens to parts beside their motion: impacts, removals and arrivals, a row each, in order of time.

They are NumPy's record arrays: a column is an attribute (`impacts.time`), rows are taken as from any array.

impacts: contacts of a guided part with the plate; a part that sticks is in one long contact.

    time                begin of the contact [s]
    until               its end [s]: `time` for an impact without duration, infinite while the part still sticks
    approach_speed      of the part relative to the plate at the begin [m/s]
    departure_velocity  vertical velocity of the part at the end [m/s]; NaN while the part still sticks

removals: parts taken out, at `time` [s]; `part` is its index, `cause` see `Cause`.

arrivals: parts of refills; a part is not in the frame at `time` [s] yet, but in the next one. `part` is its index,
`cycle` the one at whose end the refill was (there is one at most), `height` that of the centre of mass where it was let
go [m].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Events: TypeAlias = Any  # np.recarray, which type checkers lose where rows are taken

# name: (unit, type)
Columns: TypeAlias = Mapping[str, tuple[str, str]]
IMPACTS: Columns = {
    "time": ("s", "f8"),
    "until": ("s", "f8"),
    "approach_speed": ("m/s", "f8"),
    "departure_velocity": ("m/s", "f8"),
}
REMOVALS: Columns = {"time": ("s", "f8"), "part": ("1", "i8"), "cause": ("1", "i8")}
ARRIVALS: Columns = {"time": ("s", "f8"), "part": ("1", "i8"), "cycle": ("1", "i8"), "height": ("m", "f8")}


class Cause(IntEnum):
    """Why a part was taken out."""

    PICKED = 1
    LOST = 2


def events(columns: Columns, **values: ArrayLike) -> Events:
    """Events of one kind, one per entry of the longest column; a number stands for all rows, nothing for none."""
    arrays = np.broadcast_arrays(*(values.get(name, ()) for name in columns))
    found = np.empty(len(arrays[0]), [(name, kind) for name, (_, kind) in columns.items()])
    for name, array in zip(columns, arrays, strict=True):
        found[name] = array
    events: Events = found.view(np.recarray)
    return events


def no_events(columns: Columns) -> Events:
    """None of a kind, the same array each time: one is asked for with every block."""
    return _NONE[id(columns)]


_NONE = {id(columns): events(columns) for columns in (IMPACTS, REMOVALS, ARRIVALS)}


def removed(parts: ArrayLike, time: float, cause: Cause) -> Events:
    """Parts, by their indices, that are taken out at once."""
    return events(REMOVALS, time=time, part=parts, cause=cause)


def impacts_of(rows: NDArray[np.float64]) -> Events:
    """Impacts whose columns are in the order above, shape (n, 4)."""
    if not len(rows):
        return no_events(IMPACTS)
    return events(IMPACTS, **dict(zip(IMPACTS, rows.T, strict=True)))


def joined(blocks: Sequence[Events]) -> Events:
    """Concatenate events of one kind in time."""
    held = [block for block in blocks if len(block)] or blocks[:1]
    events: Events = np.concatenate(held).view(np.recarray) if len(held) > 1 else held[0]
    return events


def parts_removed(removals: Events, cause: Cause, *, start: float = -np.inf, end: float = np.inf) -> NDArray[np.int64]:
    """Indices of the parts taken out for a cause at start < time <= end [s]."""
    return np.asarray(removals.part[(removals.cause == cause) & (removals.time > start) & (removals.time <= end)])


def parts_arrived(arrivals: Events, *, start: float, end: float) -> NDArray[np.int64]:
    """Indices of the parts that came at start <= time < end [s]."""
    return np.asarray(arrivals.part[(arrivals.time >= start) & (arrivals.time < end)])
