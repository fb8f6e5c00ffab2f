"""What other packages add: shapes of parts, measures, engines and laws of impact, by their entry points.

    [project.entry-points."feeder_sim.parts"]
    ring = "my_package:Ring"

Groups: `feeder_sim.parts` (a subclass of `feeder_sim.scenario.part.PartTable`), `feeder_sim.measures` (a `Measure`, or
a function of a prepared scenario and a seed), `feeder_sim.laws` (of impact: a function that numba compiles) and
`feeder_sim.engines` (a class with the methods of `Engine`). One is imported when it is used for the first time.
"""

from __future__ import annotations

import functools
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from feeder_sim.errors import InputError

GROUPS = ("parts", "measures", "engines", "laws")


@functools.cache
def _declared(group: str) -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=f"feeder_sim.{group}")}


def names_of(group: str) -> tuple[str, ...]:
    """The names that other packages add to a group; none of them is imported."""
    return tuple(sorted(_declared(group)))


@functools.cache
def find(group: str, name: str) -> Any:
    """What another package adds under a name.

    Raises:
        InputError: it cannot be imported.
    """
    entry = _declared(group)[name]
    try:
        return entry.load()
    except Exception as error:  # of any kind: it is the code of somebody else
        problem = f"cannot be imported from {entry.value}: {type(error).__name__}: {error}"
        raise InputError(problem, key=f"feeder_sim.{group}: {name}") from error


def all_of(group: str) -> dict[str, Any]:
    """All that other packages add to a group, by name."""
    return {name: find(group, name) for name in names_of(group)}


def versions() -> dict[str, str]:
    """Packages that add something, with their versions: results depend on them."""
    entries = [entry for group in GROUPS for entry in _declared(group).values()]
    return {entry.dist.name: entry.dist.version for entry in entries if entry.dist is not None}
