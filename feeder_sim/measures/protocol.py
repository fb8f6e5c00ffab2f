"""The protocol of a measure: which scenes it applies to, its findings in an ensemble, and its lines in a report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any, Protocol, TypeVar

from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.trajectory import SeedRecord, Status
from feeder_sim.scene.prepared import Prepared

Findings = TypeVar("Findings")


class Measure(Protocol[Findings]):
    """One measure; its findings are a dataclass whose fields carry their units in their names."""

    def applies(self, prepared: Prepared) -> bool:
        """Whether the measure has a meaning for a scene."""
        ...

    def compute(self, prepared: Prepared, seeds: Sequence[SeedRecord]) -> Findings:
        """Measure an ensemble; the measure itself leaves out seeds that do not count."""
        ...

    def lines(self, prepared: Prepared, findings: Findings) -> list[str]:
        """The findings as lines of label and value; see `labelled`."""
        ...


def ended(seeds: Sequence[SeedRecord], *, left_plate: bool = False) -> list[SeedRecord]:
    """Seeds that ran to their end; with `left_plate` also those whose parts have all left the plate."""
    counted = (Status.DONE, Status.LEFT_PLATE) if left_plate else (Status.DONE,)
    return [seed for seed in seeds if seed.status in counted and len(seed.frames)]


def labelled(label: str, text: str) -> str:
    """A line of a report: the label, filled up to a fixed width, and the text."""
    return f"{label:<16} {text}"


def as_json(value: Any) -> Any:
    """A value as JSON takes it: dataclasses as dictionaries, tuples as lists, numbers that are not finite as None."""
    if isinstance(value, Statistic):
        return value.as_dict()
    if is_dataclass(value):
        return {field.name: as_json(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, tuple | list):
        return [as_json(entry) for entry in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value
