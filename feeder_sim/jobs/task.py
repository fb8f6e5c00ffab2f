"""What is sent to a process: some seeds of one scenario. What comes back: the measures of each as numbers."""

from __future__ import annotations

import math
import re
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from feeder_sim.errors import InputError
from feeder_sim.scenario import Scenario
from feeder_sim.single_thread import single_threaded

if TYPE_CHECKING:
    from feeder_sim.measures.protocol import Measure


# Warnings of many scenarios, such as the points of a sweep: each of them once, and at how many of them it holds.
#
# Lines that differ in numbers only are of one kind.

_NUMBER = re.compile(r"(?<![\[\w.])[-+]?\d+\.?\d*(?:e[-+]?\d+)?(?![\w\]])")  # of a value, not in a key as drive[0]


@dataclass(frozen=True)
class RepeatedWarning:
    """A setting that is known to mislead.

    Attributes:
        text: what it is, and does; where numbers in it differ from place to place, that of the first.
        at: number of places, such as points of a sweep, where it holds.
        of: number of all places that have been run.
        numbers_differ: as said.
    """

    text: str
    at: int
    of: int
    numbers_differ: bool = False

    def in_words(self, places: str = "points") -> str:
        """The warning with where it holds, as far as there is more than one place."""
        if self.of == 1:
            return self.text
        where = f"at all {self.of} {places}" if self.at == self.of else f"at {self.at} of {self.of} {places}"
        return f"{self.text} ({where}{', the numbers are those of the first' if self.numbers_differ else ''})"

    def as_dict(self) -> dict[str, Any]:
        """As JSON takes it."""
        return {"warning": self.text, "at": self.at, "of": self.of, "numbers_differ": self.numbers_differ}


def warnings_over(places: Iterable[Iterable[SeedValues]]) -> list[RepeatedWarning]:
    """The warnings of all places, from the seeds that each has; a place without any does not count.

    Those that differ in numbers only are one: a sweep over an amplitude would have one for each point.
    """
    texts: dict[str, list[str]] = {}
    of = 0
    for place in places:
        distinct = {seed.warnings for seed in place}
        of += bool(distinct)
        here = {_NUMBER.sub("#", text): text for warnings in sorted(distinct) for text in warnings}
        for kind, text in here.items():
            texts.setdefault(kind, []).append(text)
    return [RepeatedWarning(variants[0], len(variants), of, len(set(variants)) > 1) for variants in texts.values()]


def most_frequent(lines: Sequence[str]) -> str:
    """The first of those lines that most are like, but for numbers in them; "" of none."""
    kinds = [_NUMBER.sub("#", line) for line in lines]
    return lines[kinds.index(Counter(kinds).most_common(1)[0][0])] if lines else ""


@dataclass(frozen=True)
class Task:
    """Some seeds, by their indices, of one scenario, whose identity is that of who asks."""

    scenario: Scenario
    identity: str
    seeds: tuple[int, ...]


@dataclass(frozen=True)
class SeedValues:
    """What one seed has come to.

    Attributes:
        seed: its index.
        values: measures by dotted name, see `values_of_seed`; NaN where it has none.
        wall_s: what it took [s].
        failure: why it has no values, a line; "" otherwise.
        warnings: settings of its scenario that are known to mislead, a line each; see `feeder_sim.jobs.task`.
        left: whether all its parts have left the plate.
    """

    seed: int
    values: dict[str, float]
    wall_s: float
    failure: str = ""
    warnings: tuple[str, ...] = ()
    left: bool = False

    def as_entry(self) -> dict[str, Any]:
        """As JSON takes it, which has no NaN."""
        values = {name: None if math.isnan(value) else value for name, value in self.values.items()}
        entry = {"seed": self.seed, "values": values, "wall_s": self.wall_s, "failure": self.failure}
        entry |= {"warnings": list(self.warnings)} if self.warnings else {}
        return entry | ({"left": True} if self.left else {})

    @staticmethod
    def of_entry(entry: dict[str, Any]) -> SeedValues:
        """From what `as_entry` has made."""
        values = {name: math.nan if value is None else float(value) for name, value in entry["values"].items()}
        warnings = tuple(str(line) for line in entry.get("warnings", ()))
        numbers = int(entry["seed"]), values, float(entry["wall_s"])
        return SeedValues(*numbers, str(entry["failure"]), warnings, bool(entry.get("left")))


@single_threaded
def run_task(task: Task, measures: tuple[Measure[Any, Any], ...] = ()) -> tuple[SeedValues, ...]:
    """Run the seeds of a task, one after the other on one thread; the bits do not depend on where that is.

    Args:
        task: what to run.
        measures: that are taken besides those of the package.

    Raises:
        FeederSimError: this process has another version of the package, or other files than who asks.
    """
    from feeder_sim.measures.catalogue import values_of_seed
    from feeder_sim.records.seed import Status
    from feeder_sim.run.one_seed import prepared_once, run_one_seed

    prepared = prepared_once(task.scenario, task.identity)
    if isinstance(prepared, InputError):
        return tuple(SeedValues(seed, {}, 0.0, str(prepared)) for seed in task.seeds)
    prepared = replace(prepared, measures=measures)
    completed, warnings = [], prepared.warnings
    for seed in task.seeds:
        started = time.perf_counter()
        try:
            result = run_one_seed(prepared, seed)
        except InputError as error:  # no room for its parts
            completed.append(SeedValues(seed, {}, time.perf_counter() - started, str(error), warnings))
            continue
        failure = str(result.failure) if result.failure else ""
        values = {} if failure else values_of_seed(prepared, result)
        left = result.status == Status.LEFT_PLATE
        completed.append(SeedValues(seed, values, time.perf_counter() - started, failure, warnings, left))
    return tuple(completed)
