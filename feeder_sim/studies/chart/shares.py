"""How far a work is, whose pieces come one after the other and take about known times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import accumulate

Show = Callable[[float], None]  # takes the fraction done

SEED_S = 0.003  # processor time of a part under the impulses, per simulated second [s/s]
CROWDED_S = 0.0135  # the same of a part that meets others
MUJOCO = 60.0  # times as long in MuJoCo at 40 steps per period, and in proportion to the steps
MUJOCO_STEPS = 40


def no_progress(fraction: float) -> None:
    """For those who do not want to know."""


def shares(progress: Show, costs: Sequence[float]) -> list[Show]:
    """What each piece of a work calls with the fraction of itself that is done.

    Args:
        progress: called with the fraction of the whole work that is done.
        costs: of the pieces, in their order; only their ratios count.
    """
    total = sum(costs) or 1.0
    begins = accumulate(costs, initial=0.0)
    return [partial(_show, progress, begin / total, cost / total) for begin, cost in zip(begins, costs, strict=False)]


def _show(progress: Show, begin: float, share: float, fraction: float) -> None:
    progress(begin + share * fraction)
