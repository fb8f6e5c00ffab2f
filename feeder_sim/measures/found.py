"""What findings have in common: a line for a terminal, and tables for a notebook.

A run of many stages has thousands of numbers; the repr of a dataclass would print them all.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

from feeder_sim.measures.statistic import Statistic
from feeder_sim.notebook import cell, line, table

MOST_LISTED = 6  # values of a list in a line; of a longer one their number


class Found:
    """Findings, or an entry of them: a dataclass with `repr=False`, whose fields carry their units in their names."""

    def __repr__(self) -> str:
        return line(f"{type(self).__name__}: {self._fields()}")

    def _repr_html_(self) -> str:
        """The numbers over seeds, a row each; then a table for every list of entries."""
        held = self._held()
        rows = [
            {"": name, "mean": value.mean, "sd": value.sd, "se": value.se, "n": value.n}
            for name, value in [pair for name, entry in held.items() for pair in _statistics(name, entry)]
        ]
        return "".join([table(repr(self)[1:-1], rows), *_tables(self)])

    def _fields(self) -> str:
        return ", ".join(_named(name, value) for name, value in self._held().items())

    def _held(self) -> dict[str, Any]:
        """The fields by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]


def _statistics(name: str, value: Any) -> list[tuple[str, Statistic]]:
    """The numbers over seeds that a field is, or that it holds by name."""
    if isinstance(value, Statistic):
        return [(name, value)]
    if isinstance(value, Found):
        return [pair for inner, entry in value._held().items() for pair in _statistics(f"{name}.{inner}", entry)]
    return []


def _tables(found: Found, within: str = "") -> Iterator[str]:
    """A table for every list of entries, each with the lists of its entries after it."""
    for name, value in found._held().items():
        if _has_entries(value):
            yield table(within + name, [_row(entry) for entry in value])
            for number, entry in enumerate(value):
                yield from _tables(entry, f"{within}{name}[{number}].")


def _has_entries(value: Any) -> bool:
    return isinstance(value, tuple) and any(isinstance(entry, Found) for entry in value)


def _row(entry: Found) -> dict[str, Any]:
    """The row of an entry: the means of its numbers over seeds, and how many entries its own lists have."""
    return {name: _short(value) for name, value in entry._held().items()}


def _named(name: str, value: Any) -> str:
    """A field in a line."""
    if isinstance(value, Found):
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
