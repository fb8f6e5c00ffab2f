"""The cases of a sweep: the work they make, and what comes out.

Every point has the same seeds, that is the same starts (common random numbers), so that differences between points are
surer than the points themselves. With uncertain inputs every point is run with the same draws of them. Each draw has
seeds of its own, the same at every point.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from feeder_sim.errors import InputError, Unknown
from feeder_sim.jobs.cautions import Caution, cautions_over
from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import Bench
from feeder_sim.jobs.task import SeedValues, Task
from feeder_sim.run.provenance import identity_of
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.changes import labels
from feeder_sim.studies.study import Study
from feeder_sim.studies.sweep.case import Case, Effort
from feeder_sim.studies.sweep.design import Point, overlap, with_frequencies
from feeder_sim.studies.sweep.table import Row, rows_of
from feeder_sim.studies.uncertainty.spread import Draw


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
        """The scenario changed to every point and draw, all of them checked.

        Raises:
            InputError: a key or a value that is not allowed.
        """
        for key in with_frequencies(scenario, points[0], file=file):
            if any(overlap(key, other) for other in draws[0]):
                raise InputError("is varied, but also [uncertain]; allowed is one of them", file=file, key=key)
        if effort.until_se is not None and len(draws) > 1:
            problem = "is given, allowed is none with [uncertain] inputs: more draws narrow their interval"
            raise InputError(problem, argument="until_se")
        rows = []
        for point in points:
            changes = with_frequencies(scenario, point, file=file)
            changed = [scenario.changed({"uncertain": None, **draw, **changes}, file=file) for draw in draws]
            rows.append(
                tuple(Case(varied, identity_of(varied), number, len(draws)) for number, varied in enumerate(changed))
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

    def take(self, ledger: Ledger) -> None:
        """Let what is done count.

        Raises:
            InputError: it has no such measure as the effort looks at.
        """
        for case in self:
            case.take(tuple(ledger.seeds_of(case.identity).values()))
            case.keep_done()
            for seed in case.done.values():
                check_measure(self.effort.measure, seed.values)

    def run(self, bench: Bench) -> bool:
        """Run what is not done; returns whether it came to the end.

        Raises:
            InputError: there is no such measure as the effort looks at.
        """
        return bench.run(SweepWork(self, bench.ledger.add))

    @property
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
        return sum(case.wanted(self.effort) - len(case.seeds(self.effort)) for case in self)

    @property
    def short(self) -> int:
        """Points that have all seeds they may have, and not the standard error that was asked for."""
        return sum(any(case.falls_short(self.effort) for case in row) for row in self.cases)

    @property
    def kept(self) -> int:
        """Points that keep more seeds than were asked for, since they had been run before."""
        return sum(any(case.kept > case.asked(self.effort) for case in row) for row in self.cases)

    @property
    def failures(self) -> list[str]:
        """Why seeds have failed, each reason once, with the first point where it is so."""
        found: dict[str, str] = {}
        for point, row in zip(self.points, self.cases, strict=True):
            values = labels(point).items()
            at = ", ".join(f"{key} = {v:.6g}" if isinstance(v, float) else f"{key} = {v}" for key, v in values)
            for failure in dict.fromkeys(s.failure for case in row for s in case.seeds(self.effort) if s.failure):
                found.setdefault(failure, f"at {at}: {failure}" if at else failure)
        return list(found.values())

    @property
    def cautions(self) -> list[Caution]:
        """Settings that are known to mislead, each once, with the number of points where it holds."""
        return cautions_over([seed for case in row for seed in case.seeds(self.effort)] for row in self.cases)


class SweepWork:
    """The seeds of all cases that are still to be run, handed out in order, or in turn."""

    def __init__(self, cases: Cases, keep: Callable[[str, SeedValues], None]) -> None:
        self._effort, self._keep, self._in_turn = cases.effort, keep, cases.in_turn
        self._open = deque(cases)  # those that may have something to hand out
        self._wanted = sum(case.wanted(self._effort) for case in cases)
        self._done = sum(len(case.seeds(self._effort)) for case in cases)

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
        before = place.wanted(self._effort), len(place.seeds(self._effort))
        place.take(done)
        self._wanted += place.wanted(self._effort) - before[0]
        self._done += len(place.seeds(self._effort)) - before[1]
        if place.wanted(self._effort) > before[0]:
            self._open.appendleft(place)
        for seed in done:
            check_measure(self._effort.measure, seed.values)
            self._keep(place.identity, seed)

    @property
    def share_done(self) -> float:
        return self._done / max(1, self._wanted)


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

    def take(self, ledger: Ledger) -> None:
        self.cases.take(ledger)

    def part(self, number: int, of: int) -> CasesPlan:
        return replace(self, cases=self.cases.part(number, of))

    def run(self, bench: Bench) -> bool:
        return self.cases.run(bench)

    def study(self, complete: bool, others: int) -> Study:
        return self.answer(self.cases, complete, others)
