"""What a measure is: which scenes it applies to, what it reads from a seed, its findings in an ensemble, its lines.

A measure first reads from every seed what it needs of it, and then makes its findings of these readings. So the frames
of a seed can be dropped once all measures have read it, and the findings stay what they are, to the last bit.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cached_property
from typing import Any, Generic, TypeVar

from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.seed import Seed, Status
from feeder_sim.scene.prepared import Prepared

Findings = TypeVar("Findings")
Reading = TypeVar("Reading")


class Measure(ABC, Generic[Findings, Reading]):
    """One measure; its findings are a dataclass whose fields carry their units in their names.

    Attributes:
        counts: how a seed has to have ended to be measured.
    """

    counts: tuple[Status, ...] = (Status.DONE,)

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
