"""What stability maps have in common: two axes, and cells with a state.

tunnelling  the guard stopped the run because a centre or a corner lay too deep below the surface
exploding   the guard stopped the run for its energy, or the nut rose many times as high as in the reference
biased      the number differs by more than `BIAS` and by more than two standard errors from the reference
unclear     none of these, but the standard error is larger than `BIAS`
stable      none of these
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum

from feeder_sim.measures.statistic import Statistic

BIAS = 0.15  # relative deviation from the reference


class State(StrEnum):
    """State of a cell; the worst comes last."""

    STABLE = "stable"
    UNCLEAR = "unclear"
    BIASED = "biased"
    EXPLODING = "exploding"
    TUNNELLING = "tunnelling"


# The state of a cell; the relative deviation of its number from the reference, NaN where none is defined; and the
# reason for the state, empty for a stable cell.
Verdict = tuple[State, Statistic, str]


@dataclass(frozen=True)
class Axis:
    """One setting of a map: its values, and those of the quick variant."""

    label: str
    values: tuple[float, ...]
    quick: tuple[float, ...]


@dataclass(frozen=True)
class StabilityMap(ABC):
    """A map over two settings, which knows how to fill its cells.

    Attributes:
        name, title: in files and in the picture.
        x, y: the axes.
    """

    name: str
    title: str
    x: Axis
    y: Axis

    @abstractmethod
    def judge(self, x: float, y: float, *, quick: bool) -> Verdict:
        """Compute the cell of two settings; `quick` with few seeds."""

    @abstractmethod
    def cost(self, x: float, y: float, *, quick: bool) -> float:
        """How long that takes, about [s]."""

    def settings(self, *, quick: bool) -> list[tuple[float, float]]:
        """The x and y of all cells, row by row."""
        xs, ys = (axis.quick if quick else axis.values for axis in (self.x, self.y))
        return [(x, y) for y in ys for x in xs]


@dataclass(frozen=True)
class MapCell:
    """One cell of a map.

    Attributes:
        map: name of the map.
        x, y: values of the settings.
        state: of the cell.
        deviation, se: relative deviation of its number from the reference, and its standard error; NaN without one.
        why: reason for the state; empty for a stable cell.
    """

    map: str
    x: float
    y: float
    state: State
    deviation: float
    se: float
    why: str


def by_deviation(deviation: Statistic, what: str) -> Verdict:
    """The verdict on a cell that has a number.

    Args:
        deviation: relative, from the reference; NaN where it is not known.
        what: names the number.
    """
    relative, se = deviation.mean, deviation.se
    if abs(relative) > BIAS and abs(relative) > 2.0 * se:
        return State.BIASED, deviation, f"{what} off by {100.0 * relative:+.0f} %"
    if se <= BIAS:
        return State.STABLE, deviation, ""
    known = f"known to {100.0 * se:.0f} % only" if se > BIAS else "not known"
    return State.UNCLEAR, deviation, f"{what} {known}"
