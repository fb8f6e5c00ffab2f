"""Parts that come into a scene while it runs, as removals.py has those that leave it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Arrivals:
    """Parts of refills, in order of time; a part is not in the frame at this time yet, but in the next one.

    Attributes (one entry per part):
        time: [s].
        part: index of the part.
        cycle: at whose end the refill was; there is one at most.
        height: of the centre of mass where the part was let go [m].
    """

    time: NDArray[np.float64]
    part: NDArray[np.int64]
    cycle: NDArray[np.int64]
    height: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, rows: slice) -> Arrivals:
        return Arrivals(*(getattr(self, field.name)[rows] for field in fields(self)))

    def parts(self, *, start: float, end: float) -> NDArray[np.int64]:
        """Indices of the parts that came at start <= time < end [s]."""
        return self.part[(self.time >= start) & (self.time < end)]

    @staticmethod
    def of(time: float, parts: NDArray[np.int64], cycle: int, height: NDArray[np.float64]) -> Arrivals:
        """The parts of one refill."""
        n = len(parts)
        return Arrivals(np.full(n, time), np.asarray(parts, np.int64), np.full(n, cycle), np.asarray(height, float))

    @staticmethod
    def none() -> Arrivals:
        return Arrivals.of(0.0, np.empty(0, np.int64), 0, np.empty(0))

    @staticmethod
    def joined(blocks: Sequence[Arrivals]) -> Arrivals:
        """Concatenate blocks in time."""
        if not blocks:
            return Arrivals.none()
        return Arrivals(*(np.concatenate([getattr(b, field.name) for b in blocks]) for field in fields(Arrivals)))
