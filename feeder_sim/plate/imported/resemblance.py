"""Which mode of the plain rectangle a given mode is most alike, by the modal assurance criterion.

    MAC = (a . b)^2 / (a . a)(b . b)

(Allemang and Brown, Proc. 1st IMAC (1982) 110.) Degenerate modes come in any mixture, so that for those within
`SAME_FREQUENCY` of each other it is the share of a in the space that they span.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.rectangle import RectangularPlate

SAME_FREQUENCY = 1e-3  # relative
FARTHER = (
    1.6,
    1.2,
    1.0,
    0.7,
    0.4,
)  # of the highest frequency; how far the rectangle's modes are computed, if they can be


@dataclass(frozen=True)
class Resemblance:
    """The likeness of a mode to one of the plain rectangle of the same bounding box.

    Attributes:
        mac: 1 for the same shape, 0 for nothing in common.
        modes: 0-based index of the rectangle's mode; of all that are degenerate with it.
        frequency: of that mode [Hz].
    """

    mac: float
    modes: tuple[int, ...]
    frequency: float


def resemblances(
    plate: RectangularPlate, frequency: NDArray[np.float64], points: NDArray[np.float64], values: NDArray[np.float64]
) -> list[Resemblance | None]:
    """For modes with values (modes, n) at points (n, 2) [m] of a plate; None where the rectangle has no modes there."""
    modes = _of_rectangle(plate, float(frequency.max()))
    if modes is None:
        return [None] * len(values)
    groups: list[list[int]] = []
    for i, f in enumerate(modes.natural_frequency.tolist()):
        if groups and f < (1.0 + SAME_FREQUENCY) * modes.natural_frequency[groups[-1][-1]]:
            groups[-1].append(i)
        else:
            groups.append([i])
    best: list[Resemblance | None] = [None] * len(values)
    for group in groups:
        span = np.linalg.qr(np.stack([modes.evaluate(i, *points.T)[0] for i in group], axis=1))[0]
        for k, value in enumerate(values):
            mac = float(((span.T @ value) ** 2).sum() / (value**2).sum())
            held = best[k]
            if held is None or mac > held.mac:
                best[k] = Resemblance(mac, tuple(group), float(modes.natural_frequency[group[0]]))
    return best


def _of_rectangle(plate: RectangularPlate, highest: float) -> PlateModes | None:
    for factor in FARTHER:
        try:
            modes = plate_modes(plate, highest_frequency=factor * highest)
        except ValueError:  # not resolved so far
            continue
        if len(modes):
            return modes
    return None
