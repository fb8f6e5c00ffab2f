"""Impacts of a part on the plate: what a bounce is, before anything is measured on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Impacts:
    """Contacts of a guided part with the plate in order of time; a part that sticks is in one long contact.

    Attributes:
        time: begin of the contact [s], shape (n,).
        until: its end [s], equal to `time` for an impact without duration; infinite while the part still sticks.
        approach_speed: of the part relative to the plate at the begin [m/s], shape (n,).
        departure_velocity: vertical velocity of the part at the end [m/s], shape (n,); NaN while the part still sticks.
    """

    time: NDArray[np.float64]
    until: NDArray[np.float64]
    approach_speed: NDArray[np.float64]
    departure_velocity: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, rows: slice | NDArray[np.bool_]) -> Impacts:
        return Impacts(*(getattr(self, field.name)[rows] for field in fields(self)))

    @staticmethod
    def of_rows(rows: NDArray[np.float64]) -> Impacts:
        """From columns in the order of the attributes, shape (n, 4)."""
        return Impacts(*rows.T.copy())

    @staticmethod
    def none() -> Impacts:
        return Impacts.of_rows(np.empty((0, len(fields(Impacts)))))

    @staticmethod
    def joined(blocks: Sequence[Impacts]) -> Impacts:
        """Concatenate in time."""
        return Impacts(*(np.concatenate([getattr(b, field.name) for b in blocks]) for field in fields(Impacts)))
