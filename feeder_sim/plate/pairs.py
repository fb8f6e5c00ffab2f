"""Pairs of modes for a purpose: one that gathers parts on its nodal lines, one that throws them off these lines again.

Both are driven at resonance by the actuator that moves each most. What counts is how high a part hops (see
feeder_sim.plate.response). A mode *moves* the share of the plate where parts hop by `MOVES`, and a second one *throws*
the share of the first one's nodal lines where they hop by `THROWS`; the rest are dead places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.mode_file import ModeFile
from feeder_sim.plate.response import RankedMode, hop_height, rank_modes

POINTS = 81  # per axis of the plate, which are looked at
ON_LINE = 0.1  # of the antinode; what moves less belongs to a nodal line
LEAST_MOVED = 0.3  # of the plate; a mode that moves less gathers nothing
MOVES, THROWS = 5e-5, 1e-3  # [m]
APART = 0.01  # relative; modes nearer in frequency move together


@dataclass(frozen=True)
class ModePair:
    """A gathering mode and a throwing one.

    Attributes:
        gather, throw: the modes, at the voltage.
        moved: share of the plate where parts hop under `gather` [1].
        thrown: share of its nodal lines from where `throw` throws them [1].
        hop: median height on these lines under `throw` [m].
        dead: middle of the largest dead place on these lines (x, y) [m]; None where there is none.
    """

    gather: RankedMode
    throw: RankedMode
    moved: float
    thrown: float
    hop: float
    dead: tuple[float, float] | None

    @property
    def score(self) -> float:
        """Share of the plate that is moved, times the share of the lines that is thrown [1]."""
        return self.moved * self.thrown


def mode_pairs(mode_file: ModeFile, voltage: float) -> list[ModePair]:
    """All pairs of modes that a voltage [V, amplitude] can use, the best first."""
    ranked = rank_modes(mode_file, voltage, None)
    modes = mode_file.modes
    x, y = (((np.arange(POINTS) + 0.5) / POINTS - 0.5) * side for side in (modes.plate.length, modes.plate.width))
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    on_plate = np.full((POINTS, POINTS), True) if modes.outline is None else modes.outline.holds(places)
    fields = {mode.mode: np.abs(modes.evaluate_grid(mode.mode, x, y)[0]) for mode in ranked}
    hops = {mode.mode: hop_height(mode.antinode * fields[mode.mode], mode.frequency) for mode in ranked}
    moved = {j: float((hops[j] > MOVES)[on_plate].mean()) for j in hops}
    pairs = [
        _pair(gather, throw, moved[gather.mode], (fields[gather.mode] < ON_LINE) & on_plate, hops[throw.mode], places)
        for gather in ranked
        for throw in ranked
        if moved[gather.mode] >= LEAST_MOVED and abs(throw.frequency / gather.frequency - 1.0) > APART
    ]
    return sorted(pairs, key=lambda pair: (-round(pair.score, 3), -pair.hop))


def _pair(
    gather: RankedMode,
    throw: RankedMode,
    moved: float,
    lines: NDArray[np.bool_],
    hop: NDArray[np.float64],
    places: NDArray[np.float64],
) -> ModePair:
    still = lines & (hop <= THROWS)
    return ModePair(
        gather=gather,
        throw=throw,
        moved=moved,
        thrown=float((hop > THROWS)[lines].mean()) if lines.any() else 0.0,
        hop=float(np.median(hop[lines])) if lines.any() else 0.0,
        dead=_largest(still, places) if still.any() else None,
    )


def _largest(marked: NDArray[np.bool_], places: NDArray[np.float64]) -> tuple[float, float]:
    """The middle of the largest connected patch of marked points [m]."""
    from scipy.ndimage import label

    numbers = label(marked, np.ones((3, 3)))[0]
    largest = int(np.bincount(numbers[numbers > 0]).argmax())
    x, y = places[numbers == largest].mean(axis=0).tolist()
    return x, y


def best_of_each(pairs: Sequence[ModePair], most: int) -> list[ModePair]:
    """The best pairs, no gathering mode more than once."""
    best: dict[int, ModePair] = {}
    for pair in pairs:
        best.setdefault(pair.gather.mode, pair)
    return list(best.values())[:most]
