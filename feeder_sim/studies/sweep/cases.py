"""The cases of a sweep: the work they make, and what comes out.

Every point has the same seeds, that is the same starts (common random numbers), so that differences between points are
surer than the points themselves. With uncertain inputs every point is run with the same draws of them. Each draw has
seeds of its own, the same at every point.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from feeder_sim.errors import InputError, nearest
from feeder_sim.jobs.cautions import Caution, cautions_over
from feeder_sim.jobs.identity import identity_of
from feeder_sim.jobs.journal import Journal, read_journal
from feeder_sim.jobs.runner import run_work
from feeder_sim.jobs.task import SeedValues, Task
from feeder_sim.jobs.workers import Workers
from feeder_sim.scenario import Scenario
from feeder_sim.studies.sweep.case import Case, Effort
from feeder_sim.studies.sweep.design import Point, labels, overlap
from feeder_sim.studies.sweep.modes import with_frequencies
from feeder_sim.studies.sweep.question import Question
from feeder_sim.studies.sweep.table import Row, empty_row, main_measure, rows_of
from feeder_sim.studies.uncertainty.draws import Draw, draws_of


@dataclass(frozen=True)
class Cases:
    """The points of a sweep with their cases, one per draw of the uncertain inputs."""

    points: tuple[Point, ...]
    cases: tuple[tuple[Case, ...], ...]
    effort: Effort

    @staticmethod
    def of(scenario: Scenario, question: Question, *, file: Path) -> Cases:
        """The points of a question, each with all draws; `file` names the scenario in messages.

        Raises:
            InputError: a key or a value that is not allowed.
        """
        draws = draws_of(scenario, question.inputs)
        return Cases.at(scenario, question.points(scenario), draws, question.effort(scenario), file=file)

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
        """Every n-th point from a number on, which counts from 1."""
        share = slice(number - 1, None, of)
        return Cases(self.points[share], self.cases[share], self.effort)

    @property
    def all_done(self) -> bool:
        """Whether there is nothing to run."""
        return all(case.is_done(self.effort) for case in self)

    def __iter__(self) -> Iterator[Case]:
        return (case for row in self.cases for case in row)


class SweepWork:
    """The seeds of all cases that are still to be run, handed out in order."""

    def __init__(self, cases: Cases, keep: Callable[[Case, SeedValues], None]) -> None:
        self._effort, self._keep = cases.effort, keep
        self._open = deque(cases)  # those that may have something to hand out
        self._wanted = sum(case.wanted(self._effort) for case in cases)
        self._done = sum(len(case.seeds(self._effort)) for case in cases)

    def next(self, seeds: int) -> tuple[Case, Task] | None:
        while self._open:
            case = self._open[0]
            handed = case.hand_out(self._effort, seeds)
            if handed:
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
            self._keep(place, seed)

    @property
    def share_done(self) -> float:
        return self._done / max(1, self._wanted)


def check_measure(name: str, values: Mapping[str, float], argument: str = "measure") -> None:
    """Refuse a measure that a seed does not have; as soon as one is done, which is when it is known.

    Raises:
        InputError: as said.
    """
    if name and values and name not in values:
        raise InputError(f"is {name}{nearest(name, values)}, allowed are {', '.join(values)}", argument=argument)


@dataclass(frozen=True)
class Sweep:
    """What a sweep has come to.

    Attributes:
        cases: the points, and what their seeds have come to.
        complete: whether all of it is done.
        others: seeds in the journal that do not count: of other points, of another version, of files that have changed.
    """

    cases: Cases
    complete: bool
    others: int = 0

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied keys."""
        return tuple(dict.fromkeys(key for point in self.cases.points for key in point))

    @property
    def uncertain(self) -> bool:
        """Whether inputs were uncertain."""
        return any(len(row) > 1 for row in self.cases.cases)

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """The table: every measure at every point."""
        return tuple(row for rows in self._by_point for row in rows)

    @cached_property
    def _by_point(self) -> list[list[Row]]:
        """The rows of each point; none where nothing is done yet."""
        effort, uncertain = self.cases.effort, self.uncertain
        points = zip(self.cases.points, self.cases.cases, strict=True)
        return [rows_of(point, [case.seeds(effort) for case in row], uncertain=uncertain) for point, row in points]

    @property
    def measures(self) -> tuple[str, ...]:
        """Names of all measures."""
        return tuple(dict.fromkeys(row.measure for row in self.rows if row.measure))

    def measure(self, name: str | None = None) -> str:
        """The measure asked for, or the one to show.

        Raises:
            InputError: there is no such measure.
        """
        name = name or self.cases.effort.measure
        check_measure(name, dict.fromkeys(self.measures, 0.0))
        return name or main_measure(self.measures, self.rows)

    def of(self, measure: str) -> list[Row]:
        """The rows of one measure, one per point that has it."""
        return [row for row in self.rows if row.measure == measure]

    def at_every_point(self, measure: str) -> list[Row]:
        """A row for each point, also where it has no value of the measure, or has not begun."""
        found = []
        for point, rows in zip(self.cases.points, self._by_point, strict=True):
            seeds, failed = (rows[0].seeds, rows[0].failed) if rows else (0, 0)
            held = (row for row in rows if row.measure == measure)
            found.append(next(held, empty_row(point, seeds, failed)))
        return found

    @property
    def missing(self) -> int:
        """Seeds that are still to be run, as far as is known by now."""
        effort = self.cases.effort
        return sum(case.wanted(effort) - len(case.seeds(effort)) for case in self.cases)

    @property
    def short(self) -> int:
        """Points that have all seeds they may have, and not the standard error that was asked for."""
        effort = self.cases.effort
        return sum(any(case.falls_short(effort) for case in row) for row in self.cases.cases)

    @property
    def kept(self) -> int:
        """Points that keep more seeds than were asked for, since they had been run before."""
        effort = self.cases.effort
        return sum(any(case.kept > case.asked(effort) for case in row) for row in self.cases.cases)

    @property
    def failures(self) -> list[str]:
        """Why seeds have failed, each reason once, with the first point where it is so."""
        effort, found = self.cases.effort, dict[str, str]()
        for point, row in zip(self.cases.points, self.cases.cases, strict=True):
            values = labels(point).items()
            at = ", ".join(f"{key} = {v:.6g}" if isinstance(v, float) else f"{key} = {v}" for key, v in values)
            for failure in dict.fromkeys(s.failure for case in row for s in case.seeds(effort) if s.failure):
                found.setdefault(failure, f"at {at}: {failure}" if at else failure)
        return list(found.values())

    @cached_property
    def cautions(self) -> list[Caution]:
        """Settings that are known to mislead, each once, with the number of points where it holds."""
        effort = self.cases.effort
        return cautions_over([seed for case in row for seed in case.seeds(effort)] for row in self.cases.cases)


def run_cases(
    cases: Cases,
    workers: Workers,
    journal: Path | None = None,
    *,
    others: int | None = None,
    stop: threading.Event | None = None,
    progress: Callable[[float], None] | None = None,
) -> Sweep:
    """Run what is not done yet; with a journal, what comes is added to it.

    What is in the journal counts as done, unless `take_checked` has been called for it: then `others` is what it said.

    Raises:
        InputError: there is no such measure as the effort looks at.
    """
    if journal is None:
        return Sweep(cases, run_work(SweepWork(cases, _keep_nowhere), workers, stop=stop, progress=progress))
    if others is None:
        others = take_checked(cases, [journal])
    with Journal(journal) as written:

        def keep(case: Case, seed: SeedValues) -> None:
            written.add({"case": case.identity, **seed.as_entry()})

        return Sweep(cases, run_work(SweepWork(cases, keep), workers, stop=stop, progress=progress), others)


def _keep_nowhere(case: Case, seed: SeedValues) -> None:
    pass


def take_done(cases: Cases, journals: Sequence[Path]) -> int:
    """Take what is done out of journals; returns how many seeds in them are of other cases, and do not count."""
    others = 0
    by_identity: dict[str, list[Case]] = {}
    for case in cases:
        by_identity.setdefault(case.identity, []).append(case)
    for journal in journals:
        for entry in read_journal(journal):
            try:
                seed, of = SeedValues.of_entry(entry), by_identity.get(str(entry["case"]), ())
            except (KeyError, TypeError, ValueError, AttributeError):
                continue  # not written by this program
            others += not of
            for case in of:
                case.take((seed,))
    for case in cases:
        case.keep_done()
    return others


def take_checked(cases: Cases, journals: Sequence[Path]) -> int:
    """`take_done`, for a sweep that is to go on; to be called before its folder says what is asked.

    Raises:
        InputError: what is done has no such measure as the effort looks at.
    """
    others = take_done(cases, journals)
    for case in cases:
        for seed in case.done.values():
            check_measure(cases.effort.measure, seed.values)
    return others
