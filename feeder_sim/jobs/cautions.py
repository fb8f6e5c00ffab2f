"""Cautions of many scenarios, such as the points of a sweep: each of them once, and at how many of them it holds.

Lines that differ in numbers only are of one kind.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from feeder_sim.jobs.task import SeedValues

_NUMBER = re.compile(r"(?<![\[\w.])[-+]?\d+\.?\d*(?:e[-+]?\d+)?(?![\w\]])")  # of a value, not in a key as drive[0]


@dataclass(frozen=True)
class Caution:
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
        """The caution with where it holds, as far as there is more than one place."""
        if self.of == 1:
            return self.text
        where = f"at all {self.of} {places}" if self.at == self.of else f"at {self.at} of {self.of} {places}"
        return f"{self.text} ({where}{', the numbers are those of the first' if self.numbers_differ else ''})"

    def as_dict(self) -> dict[str, Any]:
        """As JSON takes it."""
        return {"caution": self.text, "at": self.at, "of": self.of, "numbers_differ": self.numbers_differ}

    @staticmethod
    def of_dict(entry: dict[str, Any]) -> Caution:
        """From what `as_dict` has made."""
        return Caution(str(entry["caution"]), int(entry["at"]), int(entry["of"]), bool(entry["numbers_differ"]))


def cautions_over(places: Iterable[Iterable[SeedValues]]) -> list[Caution]:
    """The cautions of all places, from the seeds that each has; a place without any does not count.

    Those that differ in numbers only are one: a sweep over an amplitude would have one for each point.
    """
    texts: dict[str, list[str]] = {}
    of = 0
    for place in places:
        told = {seed.cautions for seed in place}
        of += bool(told)
        here = {_NUMBER.sub("#", text): text for cautions in sorted(told) for text in cautions}
        for kind, text in here.items():
            texts.setdefault(kind, []).append(text)
    return [Caution(found[0], len(found), of, len(set(found)) > 1) for found in texts.values()]


def most_frequent(lines: Sequence[str]) -> str:
    """The first of those lines that most are like, but for numbers in them; "" of none."""
    kinds = [_NUMBER.sub("#", line) for line in lines]
    return lines[kinds.index(Counter(kinds).most_common(1)[0][0])] if lines else ""
