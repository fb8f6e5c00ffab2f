"""One scenario of a sweep: what its seeds have come to, and how many more the answer takes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from feeder_sim.jobs.task import SeedValues
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario import Scenario

FIRST_LOOK = 4  # seeds after which it is known whether anything happens at all
FEWEST = 8  # values of which a standard error is believed: of two it is less than half the true one in 38 % of cases
MOST_SEEDS = 1000  # of a case, where nobody says how many
GROWTH = 2.0  # of the number of seeds from one look to the next, at most


@dataclass(frozen=True)
class Effort:
    """How many seeds are worth their time.

    Attributes:
        seeds: of every case; with `until_se` at first, and then no fewer than `FEWEST`.
        until_se: more seeds are run until the standard error of the measure is below this share of its mean [1].
        most_seeds: of a case with `until_se`, whatever the standard error is then.
        measure: that `until_se` looks at.
    """

    seeds: int
    until_se: float | None = None
    most_seeds: int = MOST_SEEDS
    measure: str = ""


@dataclass
class Case:
    """A scenario with the seeds that it has been run with.

    Attributes:
        scenario: what is run.
        identity: see `feeder_sim.run.provenance`.
        first, stride: its seeds are `first`, `first + stride`, and so on: draws of uncertain inputs have seeds of their
            own, so that their scatter is independent.
        done: what has come back, by seed.
        times: as many seeds as other cases have, where none are run until a standard error is reached.
        kept: how many of its seeds were there before, and count whatever is asked for now.
    """

    scenario: Scenario
    identity: str
    first: int = 0
    stride: int = 1
    done: dict[int, SeedValues] = field(default_factory=dict)
    times: int = 1
    kept: int = 0
    _handed: set[int] = field(default_factory=set)

    def seed_numbers(self, count: int) -> range:
        """The first so many seeds of the case."""
        return range(self.first, self.first + self.stride * count, self.stride)

    def wanted(self, effort: Effort) -> int:
        """How many seeds the case should have, by those of them that are done; the order they came in does not matter.

        Those that were there before are not given up.
        """
        return max(self.asked(effort), self.kept)

    def asked(self, effort: Effort) -> int:
        """How many seeds the effort asks for.

        Where nothing happens, as no part arrives or every seed has the same value, the first few are enough.
        """
        if effort.until_se is None:
            return effort.seeds * self.times
        wanted = FIRST_LOOK
        while all(seed in self.done for seed in self.seed_numbers(wanted)):
            more = self._next_look(wanted, effort)
            if more <= wanted:
                break
            wanted = more
        return wanted

    def _next_look(self, now: int, effort: Effort) -> int:
        """How many seeds should be there when so many are."""
        assert effort.until_se is not None
        found = Statistic.of(self.values(effort.measure, now))
        if _nothing_happens(found, now):
            return now
        if now < max(effort.seeds, FEWEST):
            return max(effort.seeds, FEWEST)
        if self._is_sure(found, effort):
            return now
        most = int(min(GROWTH * now, effort.most_seeds))
        aim = effort.until_se * abs(found.mean)
        if found.n < FEWEST or aim == 0.0:
            return most
        return min(max(now + 1, math.ceil(now * min((found.se / aim) ** 2, GROWTH))), most)

    def _is_sure(self, found: Statistic, effort: Effort) -> bool:
        """Whether the standard error is as small as it should be, and of enough values to be believed."""
        return found.n >= FEWEST and found.se <= (effort.until_se or 0.0) * abs(found.mean)

    def falls_short(self, effort: Effort) -> bool:
        """Whether it has all seeds that it may have, and still a larger standard error than it should."""
        if effort.until_se is None or not self.is_done(effort):
            return False
        count = self.wanted(effort)
        found = Statistic.of(self.values(effort.measure, count))
        return not _nothing_happens(found, count) and not self._is_sure(found, effort)

    def hand_out(self, effort: Effort, most: int) -> tuple[int, ...]:
        """Up to so many seeds that are to be run next."""
        wanted = self.seed_numbers(self.wanted(effort))
        missing = [seed for seed in wanted if seed not in self.done and seed not in self._handed][:most]
        self._handed.update(missing)
        return tuple(missing)

    def is_done(self, effort: Effort) -> bool:
        """Whether all seeds that are wanted have come back."""
        return all(seed in self.done for seed in self.seed_numbers(self.wanted(effort)))

    def take(self, seeds: tuple[SeedValues, ...]) -> None:
        for seed in seeds:
            self.done[seed.seed] = seed
            self._handed.discard(seed.seed)

    def keep_done(self) -> None:
        """Let those of its first seeds that are done count, however many are asked for."""
        count = 0
        while self.first + self.stride * count in self.done:
            count += 1
        self.kept = count

    def seeds(self, effort: Effort) -> list[SeedValues]:
        """The seeds that count, in order: those wanted, whatever else has been run before."""
        return [self.done[seed] for seed in self.seed_numbers(self.wanted(effort)) if seed in self.done]

    def values(self, measure: str, count: int) -> list[float]:
        """What the first so many seeds have of a measure; NaN where there is none."""
        return [self.done[s].values.get(measure, math.nan) for s in self.seed_numbers(count) if s in self.done]


def _nothing_happens(found: Statistic, seeds: int) -> bool:
    """Whether none of so many seeds has a value, or all have the same one."""
    return not found.n or (found.n == seeds and found.sd == 0.0)
