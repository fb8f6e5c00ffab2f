"""How many seeds the mean of a measure takes: a number, or as many as bring its standard error below a share of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from feeder_sim.measures.statistic import Statistic

FIRST_CHECK = 4  # seeds after which it is known whether anything happens at all
FEWEST = 8  # values of which a standard error is believed: of two it is less than half the true one in 38 % of cases
MOST_SEEDS = 1000  # where nobody says how many
GROWTH = 2.0  # of the number of seeds from one look to the next, at most


@dataclass(frozen=True)
class Effort:
    """How many seeds are worth their time.

    Attributes:
        seeds: with `until_se` at first, and then no fewer than `FEWEST`.
        until_se: more seeds are run until the standard error of the measure is below this share of its mean [1].
        most_seeds: with `until_se`, whatever the standard error is then.
        measure: that `until_se` looks at.
    """

    seeds: int
    until_se: float | None = None
    most_seeds: int = MOST_SEEDS
    measure: str = ""

    def seeds_required(self, values: Sequence[float]) -> int:
        """How many seeds there should be, by what the first of them have of the measure; NaN for none.

        Where nothing happens, as no part arrives or every seed has the same value, the first few are enough.
        """
        if self.until_se is None:
            return self.seeds
        required = FIRST_CHECK
        while len(values) >= required:
            more = self._next_check(Statistic.of(values[:required]), required)
            if more <= required:
                break
            required = more
        return required

    def falls_short(self, values: Sequence[float]) -> bool:
        """Whether these are all seeds that there may be, and the standard error is still larger than it should be."""
        statistic = Statistic.of(values)
        return (
            self.until_se is not None and not _nothing_happens(statistic, len(values)) and not self._is_sure(statistic)
        )

    def _next_check(self, statistic: Statistic, now: int) -> int:
        """How many seeds should be there when so many are."""
        assert self.until_se is not None
        if _nothing_happens(statistic, now):
            return now
        if now < max(self.seeds, FEWEST):
            return max(self.seeds, FEWEST)
        if self._is_sure(statistic):
            return now
        most = int(min(GROWTH * now, self.most_seeds))
        aim = self.until_se * abs(statistic.mean)
        if statistic.n < FEWEST or aim == 0.0:
            return most
        return min(max(now + 1, math.ceil(now * min((statistic.se / aim) ** 2, GROWTH))), most)

    def _is_sure(self, statistic: Statistic) -> bool:
        """Whether the standard error is as small as it should be, and of enough values to be believed."""
        return statistic.n >= FEWEST and statistic.se <= (self.until_se or 0.0) * abs(statistic.mean)


def _nothing_happens(statistic: Statistic, seeds: int) -> bool:
    """Whether none of so many seeds has a value, or all have the same one."""
    return not statistic.n or (statistic.n == seeds and statistic.sd == 0.0)
