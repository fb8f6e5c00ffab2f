"""What a measure is: which scenes it applies to, what it reads from a seed, its findings in an ensemble, its lines.

A measure first reads from every seed what it needs of it, and then makes its findings of these readings. So the frames
of a seed can be dropped once all measures have read it, and the findings stay what they are, to the last bit.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar, Generic, TypeVar

from feeder_sim.measures.statistic import Statistic
from feeder_sim.notebook import cell, line, table
from feeder_sim.records.seed import Seed, Status
from feeder_sim.scene.prepared import Prepared

# What findings have in common: a line for a terminal, and tables for a notebook.
#
# A run of many stages has thousands of numbers; the repr of a dataclass would print them all.

MOST_LISTED = 6  # values of a list in a line; of a longer one their number


class FindingsBase:
    """Findings, or an entry of them: a dataclass with `repr=False`, whose fields carry their units in their names."""

    def __repr__(self) -> str:
        return line(f"{type(self).__name__}: {self._fields()}")

    def _repr_html_(self) -> str:
        """The numbers over seeds, a row each; then a table for every list of entries."""
        values = self._values()
        rows = [
            {"": name, "mean": value.mean, "sd": value.sd, "se": value.se, "n": value.n}
            for name, value in [pair for name, entry in values.items() for pair in _statistics(name, entry)]
        ]
        return "".join([table(repr(self)[1:-1], rows), *_tables(self)])

    def _fields(self) -> str:
        return ", ".join(_named(name, value) for name, value in self._values().items())

    def _values(self) -> dict[str, Any]:
        """The fields by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]


def _statistics(name: str, value: Any) -> list[tuple[str, Statistic]]:
    """The numbers over seeds that a field is, or that it holds by name."""
    if isinstance(value, Statistic):
        return [(name, value)]
    if isinstance(value, FindingsBase):
        return [pair for inner, entry in value._values().items() for pair in _statistics(f"{name}.{inner}", entry)]
    return []


def _tables(findings: FindingsBase, within: str = "") -> Iterator[str]:
    """A table for every list of entries, each with the lists of its entries after it."""
    for name, value in findings._values().items():
        if _has_entries(value):
            yield table(within + name, [_row(entry) for entry in value])
            for number, entry in enumerate(value):
                yield from _tables(entry, f"{within}{name}[{number}].")


def _has_entries(value: Any) -> bool:
    return isinstance(value, tuple) and any(isinstance(entry, FindingsBase) for entry in value)


def _row(entry: FindingsBase) -> dict[str, Any]:
    """The row of an entry: the means of its numbers over seeds, and how many entries its own lists have."""
    return {name: _short(value) for name, value in entry._values().items()}


def _named(name: str, value: Any) -> str:
    """A field in a line."""
    if isinstance(value, FindingsBase):
        return f"{name} ({value._fields()})"
    if isinstance(value, Statistic) and math.isfinite(value.se):
        return f"{name} {value.mean:.4g} +- {value.se:.2g}"
    if isinstance(value, tuple) and (_has_entries(value) or len(value) > MOST_LISTED):
        return f"{len(value)} {name}"
    return f"{name} {_short(value)}"


def _short(value: Any) -> str:
    """A value without its name."""
    if isinstance(value, Statistic):
        return cell(value.mean)
    if isinstance(value, Mapping):
        return ", ".join(f"{number} {name}" for name, number in value.items()) or cell(None)
    if isinstance(value, tuple):
        listed = not _has_entries(value) and 0 < len(value) <= MOST_LISTED
        return " ".join(_short(entry) for entry in value) if listed else str(len(value))
    return cell(value)


Findings = TypeVar("Findings")
Reading = TypeVar("Reading")


class Measure(ABC, Generic[Findings, Reading]):
    """One measure; its findings are a dataclass whose fields carry their units in their names.

    Attributes:
        counts: how a seed has to have ended to be measured.
        headline: its most telling values, which stand first wherever measures are shown.
        missing: why a value has no number in any seed that counts, by name.
    """

    counts: tuple[Status, ...] = (Status.DONE,)
    headline: tuple[str, ...] = ()
    missing: ClassVar[Mapping[str, str]] = MappingProxyType({})

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"

    @property
    def name(self) -> str:
        """What it is called, in results too."""
        return type(self).__name__.lower()

    @abstractmethod
    def applies(self, prepared: Prepared) -> bool:
        """Whether the measure has a meaning for a scene."""

    @abstractmethod
    def reader(self, prepared: Prepared) -> Callable[[Seed], Reading]:
        """A function that reads from all frames of a seed what the measure needs of it; threads may share it."""

    @abstractmethod
    def findings(self, prepared: Prepared, readings: Sequence[Reading]) -> Findings:
        """What an ensemble comes to, from the readings of the seeds that count."""

    @abstractmethod
    def lines(self, prepared: Prepared, findings: Findings) -> list[str]:
        """The findings as lines of label and value; see `labelled`."""

    def without_value(self, prepared: Prepared, findings: Findings) -> dict[str, str]:
        """Values that have no number, by name, each with the reason."""
        return {name: reason for name, reason in self.missing.items() if not getattr(findings, name).n}

    def compute(self, prepared: Prepared, seeds: Sequence[Seed]) -> Findings:
        """Measure an ensemble; seeds that do not count are left out."""
        read = SeedReader(self, prepared)
        readings = [read(seed) for seed in seeds]
        return self.findings(prepared, [reading for reading in readings if reading is not None])


class SeedReader(Generic[Reading]):
    """Reads seeds for a measure, or takes what was read before their frames were dropped."""

    def __init__(self, measure: Measure[Any, Reading], prepared: Prepared) -> None:
        self._measure, self._prepared = measure, prepared

    @cached_property
    def _read(self) -> Callable[[Seed], Reading]:
        return self._measure.reader(self._prepared)  # which may take long, and is not always needed

    def __call__(self, seed: Seed) -> Reading | None:
        """The reading; None for a seed that does not count."""
        if seed.readings is not None:
            reading: Reading | None = seed.readings[self._measure.name]
            return reading
        return self._read(seed) if seed.status in self._measure.counts and len(seed.frames) else None


def labelled(label: str, text: str) -> str:
    """A line of a report: the label, filled up to a fixed width, and the text."""
    return f"{label:<16} {text}"


def as_json(value: Any) -> Any:
    """A value as JSON takes it: dataclasses as dictionaries, tuples as lists, numbers that are not finite as None."""
    if isinstance(value, Statistic):
        return value.as_dict()
    if isinstance(value, Mapping):
        return {name: as_json(entry) for name, entry in value.items()}
    if is_dataclass(value):
        return {field.name: as_json(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, tuple | list):
        return [as_json(entry) for entry in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value
