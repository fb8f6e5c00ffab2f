"""The cases of a sweep: the work they make, and what comes out.

Every point has the same seeds, that is the same starts (common random numbers), so that differences between points are
surer than the points themselves. With uncertain inputs every point is run with the same draws of them. Each draw has
seeds of its own, the same at every point.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from feeder_sim.errors import InputError, Unknown
from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import Runner
from feeder_sim.jobs.task import RepeatedWarning, SeedValues, Task, warnings_over
from feeder_sim.measures.effort import Effort
from feeder_sim.run.provenance import identity_of
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.changes import labels
from feeder_sim.studies.study import Study
from feeder_sim.studies.sweep.design import Point, overlap, with_frequencies
from feeder_sim.studies.sweep.table import Row, rows_of
from feeder_sim.studies.uncertainty.spread import Draw

# One scenario of a sweep: what its seeds have come to, and how many more the answer takes.


@dataclass
class Case:
    """A scenario with the seeds that it has been run with.

    Attributes:
        make: makes and checks what is run; a study that is only read does not need it.
        point: of the study, with the draw of uncertain inputs.
        first, stride: its seeds are `first`, `first + stride`, and so on: draws of uncertain inputs have seeds of their
            own, so that their scatter is independent.
        done: what has come back, by seed.
        times: as many seeds as other cases have, where none are run until a standard error is reached.
        retained: how many of its seeds were there before, and count whatever is asked for now.
    """

    make: Callable[[], Scenario]
    point: Point = field(default_factory=dict)
    first: int = 0
    stride: int = 1
    done: dict[int, SeedValues] = field(default_factory=dict)
    times: int = 1
    retained: int = 0
    _handed: set[int] = field(default_factory=set)

    @cached_property
    def scenario(self) -> Scenario:
        """What is run.

        Raises:
            InputError: a key or a value that is not allowed.
        """
        return self.make()

    @cached_property
    def identity(self) -> str:
        """See `feeder_sim.run.provenance`."""
        return identity_of(self.scenario)

    def seed_numbers(self, count: int) -> range:
        """The first so many seeds of the case."""
        return range(self.first, self.first + self.stride * count, self.stride)

    def target(self, effort: Effort) -> int:
        """How many seeds the case should have, by those of them that are done; the order they came in does not matter.

        Those that were there before are not given up.
        """
        return max(self.requested_seeds(effort), self.retained)

    def requested_seeds(self, effort: Effort) -> int:
        """How many seeds the effort asks for."""
        if effort.until_se is None:
            return effort.seeds * self.times
        return effort.seeds_required(self._first_values(effort.measure))

    def falls_short(self, effort: Effort) -> bool:
        """Whether it has all seeds that it may have, and still a larger standard error than it should."""
        return self.is_done(effort) and effort.falls_short(self.values(effort.measure, self.target(effort)))

    def hand_out(self, effort: Effort, most: int) -> tuple[int, ...]:
        """Up to so many seeds that are to be run next."""
        requested = self.seed_numbers(self.target(effort))
        missing = [seed for seed in requested if seed not in self.done and seed not in self._handed][:most]
        self._handed.update(missing)
        return tuple(missing)

    def is_done(self, effort: Effort) -> bool:
        """Whether all seeds that are wanted have come back."""
        return all(seed in self.done for seed in self.seed_numbers(self.target(effort)))

    def take(self, seeds: tuple[SeedValues, ...]) -> None:
        for seed in seeds:
            self.done[seed.seed] = seed
            self._handed.discard(seed.seed)

    def keep_done(self) -> None:
        """Let those of its first seeds that are done count, however many are asked for."""
        self.retained = len(self._first_values(""))

    def seeds(self, effort: Effort) -> list[SeedValues]:
        """The seeds that count, in order: those wanted, whatever else has been run before."""
        return [self.done[seed] for seed in self.seed_numbers(self.target(effort)) if seed in self.done]

    def _first_values(self, measure: str) -> list[float]:
        """What its first seeds have of a measure, up to the first one that is not done."""
        numbers = itertools.takewhile(self.done.__contains__, itertools.count(self.first, self.stride))
        return [self.done[seed].values.get(measure, math.nan) for seed in numbers]

    def values(self, measure: str, count: int) -> list[float]:
        """What the first so many seeds have of a measure; NaN where there is none."""
        return [self.done[s].values.get(measure, math.nan) for s in self.seed_numbers(count) if s in self.done]


def _varied(scenario: Scenario, point: Point, draw: Draw, file: Path) -> Scenario:
    changes = with_frequencies(scenario, point, file=file)
    return scenario.changed({"uncertain": None, **draw, **changes}, file=file)


@dataclass(frozen=True)
class Cases:
    """The points of a sweep with their cases, one per draw of the uncertain inputs.

    in_turn: whether all points go on side by side, so that their wall times are taken under the same load.
    """

    points: tuple[Point, ...]
    cases: tuple[tuple[Case, ...], ...]
    effort: Effort
    in_turn: bool = False

    @staticmethod
    def at(scenario: Scenario, points: Sequence[Point], draws: Sequence[Draw], effort: Effort, *, file: Path) -> Cases:
        """The scenario changed to every point and draw; each is checked when its identity is asked for.

        Raises:
            InputError: a key that is varied twice, or more seeds that are asked for with uncertain inputs.
        """
        for key in with_frequencies(scenario, points[0], file=file):
            if any(overlap(key, other) for other in draws[0]):
                raise InputError("is varied, but also [uncertain]; must be one of them", file=file, key=key)
        if effort.until_se is not None and len(draws) > 1:
            problem = "is given, must be none with [uncertain] inputs: more draws narrow their interval"
            raise InputError(problem, argument="until_se")
        rows = []
        for point in points:
            rows.append(
                tuple(
                    Case(functools.partial(_varied, scenario, point, draw, file), {**draw, **point}, n, len(draws))
                    for n, draw in enumerate(draws)
                )
            )
        return Cases(tuple(points), tuple(rows), effort)

    def part(self, number: int, of: int) -> Cases:
        """Every n-th point from a number on, which counts from 1; of a single point every n-th draw."""
        share = slice(number - 1, None, of)
        if len(self.points) == 1:
            return replace(self, cases=(self.cases[0][share],))
        return replace(self, points=self.points[share], cases=self.cases[share])

    @property
    def all_done(self) -> bool:
        """Whether there is nothing to run."""
        return all(case.is_done(self.effort) for case in self)

    def __iter__(self) -> Iterator[Case]:
        return (case for row in self.cases for case in row)

    def take(self, ledger: Ledger, *, recorded: bool = False) -> None:
        """Let what is done count; recorded: whatever version has run it.

        Raises:
            InputError: it has no such measure as the effort looks at.
        """
        for case in self:
            seeds = ledger.recorded_at(labels(case.point)) if recorded else ledger.seeds_of(case.identity)
            case.take(tuple(seeds.values()))
            case.keep_done()
            for seed in case.done.values():
                check_measure(self.effort.measure, seed.values)

    def run(self, runner: Runner) -> bool:
        """Run what is not done; returns whether it came to the end.

        Raises:
            InputError: there is no such measure as the effort looks at.
        """
        return runner.run(self.tasks(runner.ledger))

    def tasks(self, ledger: Ledger) -> SweepTasks:
        """What is not done; the ledger keeps what comes."""
        return SweepTasks(self, ledger.add)

    @cached_property
    def uncertain(self) -> bool:
        """Whether inputs are uncertain."""
        return any(len(row) > 1 for row in self.cases)

    @cached_property
    def rows(self) -> list[list[Row]]:
        """The rows of the table of each point; none where nothing is done yet."""
        points = zip(self.points, self.cases, strict=True)
        return [rows_of(p, [case.seeds(self.effort) for case in row], uncertain=self.uncertain) for p, row in points]

    @property
    def missing(self) -> int:
        """Seeds that are still to be run, as far as is known by now."""
        return sum(case.target(self.effort) - len(case.seeds(self.effort)) for case in self)

    @property
    def short(self) -> int:
        """Points that have all seeds they may have, and not the standard error that was asked for."""
        return sum(any(case.falls_short(self.effort) for case in row) for row in self.cases)

    @property
    def retained(self) -> int:
        """Points that keep more seeds than were asked for, since they had been run before."""
        return sum(any(case.retained > case.requested_seeds(self.effort) for case in row) for row in self.cases)

    @property
    def failures(self) -> list[str]:
        """Why seeds have failed, each reason once, with the first point where it is so."""
        reasons: dict[str, str] = {}
        for point, row in zip(self.points, self.cases, strict=True):
            values = labels(point).items()
            at = ", ".join(f"{key} = {v:.6g}" if isinstance(v, float) else f"{key} = {v}" for key, v in values)
            for failure in dict.fromkeys(s.failure for case in row for s in case.seeds(self.effort) if s.failure):
                reasons.setdefault(failure, f"at {at}: {failure}" if at else failure)
        return list(reasons.values())

    @property
    def warnings(self) -> list[RepeatedWarning]:
        """Settings that are known to mislead, each once, with the number of points where it holds."""
        return warnings_over([seed for case in row for seed in case.seeds(self.effort)] for row in self.cases)


class SweepTasks:
    """The seeds of all cases that are still to be run, handed out in order, or in turn."""

    def __init__(self, cases: Cases, record: Callable[[str, Point, SeedValues], None]) -> None:
        self._effort, self._record, self._in_turn = cases.effort, record, cases.in_turn
        self._open = deque(cases)  # those that may have something to hand out
        self._requested = sum(case.target(self._effort) for case in cases)
        self._completed = sum(len(case.seeds(self._effort)) for case in cases)

    def next(self, seeds: int) -> tuple[Case, Task] | None:
        while self._open:
            case = self._open[0]
            handed = case.hand_out(self._effort, seeds)
            if handed:
                self._open.rotate(-1 if self._in_turn else 0)
                return case, Task(case.scenario, case.identity, handed)
            self._open.popleft()
        return None

    def take(self, place: Case, done: tuple[SeedValues, ...]) -> None:
        before = place.target(self._effort), len(place.seeds(self._effort))
        place.take(done)
        self._requested += place.target(self._effort) - before[0]
        self._completed += len(place.seeds(self._effort)) - before[1]
        if place.target(self._effort) > before[0]:
            self._open.appendleft(place)
        for seed in done:
            check_measure(self._effort.measure, seed.values)
            self._record(place.identity, labels(place.point), seed)

    @property
    def share_done(self) -> float:
        return self._completed / max(1, self._requested)


def check_measure(name: str, values: Mapping[str, float], argument: str = "measure") -> None:
    """Refuse a measure that a seed does not have; as soon as one is done, which is when it is known.

    Raises:
        InputError: as said.
    """
    if name and values and name not in values:
        raise Unknown(name, values, argument=argument)


@dataclass(frozen=True)
class CasesPlan:
    """The cases of a question as what there is to run, and what makes the answer of them."""

    cases: Cases
    answer: Callable[[Cases, bool, int], Study]

    @property
    def all_done(self) -> bool:
        return self.cases.all_done

    @property
    def identities(self) -> set[str]:
        return {case.identity for case in self.cases}

    def take(self, ledger: Ledger, *, recorded: bool = False) -> None:
        self.cases.take(ledger, recorded=recorded)

    def part(self, number: int, of: int) -> CasesPlan:
        return replace(self, cases=self.cases.part(number, of))

    def run(self, runner: Runner) -> bool:
        return self.cases.run(runner)

    def study(self, complete: bool, foreign_seeds: int) -> Study:
        return self.answer(self.cases, complete, foreign_seeds)
