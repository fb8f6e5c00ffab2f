"""Every measure of a single seed as one number by a dotted name: what tables, sweeps and comparisons are made of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from feeder_sim.measures.catalogue import measures_of
from feeder_sim.measures.protocol import as_json
from feeder_sim.records.seed import Seed
from feeder_sim.scene.prepared import Prepared

_STATISTIC = {"mean", "sd", "se", "n"}
_LABELS = ("kind", "pose")  # of entries that have no number of their own


def values_of_seed(prepared: Prepared, seed: Seed) -> dict[str, float]:
    """All measures of one seed that are means over seeds, as numbers; NaN where the seed has no value.

    The mean of a number over seeds is the mean that the measure itself finds for them.
    """
    return _values_over(prepared, [seed])


def names_of_measures(prepared: Prepared) -> list[str]:
    """The names that `values_of_seed` has for every seed of a scene, in order; known before any is run."""
    return list(_values_over(prepared, []))


def _values_over(prepared: Prepared, seeds: Sequence[Seed]) -> dict[str, float]:
    found: dict[str, float] = {}
    for measure in measures_of(prepared):
        found |= dict(_numbers(as_json(measure.compute(prepared, seeds)), ""))
    return found


def _numbers(value: Any, name: str) -> Iterator[tuple[str, float]]:
    """The means within nested findings, with the names that lead to them."""
    if isinstance(value, dict) and set(value) == _STATISTIC:
        yield name, math.nan if value["mean"] is None else float(value["mean"])
    elif isinstance(value, dict):
        for key, entry in value.items():
            yield from _numbers(entry, f"{name}.{key}" if name else key)
    elif isinstance(value, list):
        for number, entry in enumerate(value):
            label = next((entry[key] for key in _LABELS if isinstance(entry, dict) and key in entry), number)
            yield from _numbers(entry, f"{name}[{label}]")
