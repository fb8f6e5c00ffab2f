"""Parts that leave a scene: picked, or lost over the edge of the plate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class Cause(IntEnum):
    """Why a part was taken out."""

    PICKED = 1
    LOST = 2


@dataclass(frozen=True)
class Removals:
    """Parts taken out, in order of time.

    Attributes (one entry per part):
        time: [s].
        part: index of the part.
        cause: see `Cause`.
    """

    time: NDArray[np.float64]
    part: NDArray[np.int64]
    cause: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, rows: slice) -> Removals:
        return Removals(self.time[rows], self.part[rows], self.cause[rows])

    def parts(self, cause: Cause, *, start: float = -np.inf, end: float = np.inf) -> NDArray[np.int64]:
        """Indices of the parts taken out for a cause at start < time <= end [s]."""
        return self.part[(self.cause == cause) & (self.time > start) & (self.time <= end)]

    @staticmethod
    def of(time: float, parts: NDArray[np.int64], cause: Cause) -> Removals:
        """Several parts taken out at once."""
        return Removals(np.full(len(parts), time), np.asarray(parts, np.int64), np.full(len(parts), int(cause)))

    @staticmethod
    def none() -> Removals:
        return Removals.of(0.0, np.empty(0, np.int64), Cause.PICKED)

    @staticmethod
    def joined(blocks: Sequence[Removals]) -> Removals:
        """Concatenate blocks in time."""
        names = ("time", "part", "cause")
        return (
            Removals(*(np.concatenate([getattr(b, name) for b in blocks]) for name in names))
            if blocks
            else Removals.none()
        )
