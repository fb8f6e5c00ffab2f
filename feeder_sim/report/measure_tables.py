"""All measures as tables: means with standard error, 95 % interval and number of values; those of stages folded."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from feeder_sim.document.document import Block, Folded, Table, Text, Tile
from feeder_sim.document.words import headed, number, split_unit, with_error, worded
from feeder_sim.measures.catalogue import HEADLINES
from feeder_sim.measures.statistic import half_interval
from feeder_sim.studies.sweep.table import MAIN

HEAD = ("measure", "unit", "mean", "SE", "95 % interval", "n")
TELLING = tuple(dict.fromkeys((*MAIN, *HEADLINES)))  # those of questions of many runs
TILES = 4
MOST_ROWS = 200  # of a table of stages; more would make the page too large to mail
LEAST_FOR_INTERVAL = 3  # values; that of two is as wide as 25 standard errors


def in_order(measures: Iterable[str], requested: str = "") -> list[str]:
    """Measures: the one that was asked for, the most telling ones, the others, at last those of stages."""
    rank = {name: i for i, name in enumerate(dict.fromkeys((requested, *TELLING)))}
    return sorted(measures, key=lambda name: (rank.get(name, len(rank)), "[" in name or "." in name))


def tiles(measures: Mapping[str, Any], added: Sequence[str] = ()) -> tuple[Tile, ...]:
    """The most important results of a run; added: values that other packages, or a user, have added."""
    results = []
    if "at_goal" in measures and measures["at_goal_of"]:
        results.append(Tile("arrived", f"{measures['at_goal']} of {measures['at_goal_of']}", "parts", "of all seeds"))
    transport = bool(results)
    for name in (*HEADLINES, *added):
        value = measures.get(name, {})
        if not is_statistic(value) or not value["n"] or (transport and name in ("picked", "lost")):
            continue
        label, unit = split_unit(name)
        text, note = _short(value)
        results.append(Tile(label, text, unit, note))
    return tuple(results[:TILES])


def _short(value: Mapping[str, Any]) -> tuple[str, str]:
    """A mean with few digits, and how sure it is; of two values an interval would say nothing."""
    mean, se, n = float(value["mean"]), _se(value), value["n"]
    half = half_interval(se, n)
    if not half > 0.0:
        return number(mean), f"n = {n}"
    if n < LEAST_FOR_INTERVAL:
        return with_error(mean, se)[0], f"± {with_error(mean, se)[1]} (SE), n = {n}"
    text, spread = with_error(mean, half)
    return (text if half > 1e-4 * abs(mean) else number(mean, 5)), f"± {spread} (95 %), n = {n}"


def _se(value: Mapping[str, Any]) -> float:
    return math.nan if value["se"] is None else float(value["se"])


def interval_text(value: Mapping[str, Any]) -> str:
    """The 95 % interval of a mean as text; empty without one."""
    half = half_interval(_se(value), value["n"])
    if math.isnan(half):
        return ""
    if half == 0.0:
        return "all alike"
    mean = float(value["mean"])
    low, high = (with_error(mean + side * half, half)[0] for side in (-1.0, 1.0))
    return f"{low} to {high}"


def measure_blocks(measures: Mapping[str, Any]) -> tuple[Block, ...]:
    """All measures: a table of those of the whole run, and folded ones of what is nested."""
    rows = [row for name, value in measures.items() for row in _rows(name, value)]
    blocks: list[Block] = [Table("", HEAD, tuple(rows), numbers_from=2)] if rows else []
    for name, value in measures.items():
        nested = tuple(_nested(split_unit(name)[0], value))
        if nested:
            blocks.append(Folded(f"{split_unit(name)[0].capitalize()}, one by one", nested))
    return tuple(blocks)


def is_statistic(value: Any) -> bool:
    """Whether a value is a mean with its error, as JSON takes it."""
    return isinstance(value, Mapping) and set(value) == {"mean", "sd", "se", "n"}


def _rows(name: str, value: Any, prefix: str = "") -> Iterator[tuple[str, ...]]:
    """Rows of the first table: a mean, a plain value, or a small table of them."""
    words, unit = split_unit(name)
    if is_statistic(value):
        yield (prefix + words, unit, *statistic_cells(value))
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _rows(key, inner, f"{prefix}{words}: ")
    elif not isinstance(value, list) and value is not None:
        yield (prefix + words, unit, number(value) if isinstance(value, float) else worded(value), "", "", "")


def statistic_cells(value: Mapping[str, Any]) -> tuple[str, str, str, str]:
    """Mean, SE, interval and n of a mean."""
    if value["mean"] is None:
        return "", "", "", str(value["n"])
    mean, se = with_error(float(value["mean"]), _se(value))
    return mean, se, interval_text(value), str(value["n"])


def _nested(caption: str, value: Any) -> Iterator[Table | Text]:
    """Tables of lists of tables, at any depth: a row per entry, means with SE."""
    if isinstance(value, Mapping):
        if not is_statistic(value):
            for key, inner in value.items():
                yield from _nested(f"{caption}: {split_unit(key)[0]}", inner)
        return
    if not (isinstance(value, list) and value and isinstance(value[0], Mapping) and not is_statistic(value[0])):
        return
    flat = [dict(_flat(entry)) for entry in value]
    keys = list(dict.fromkeys(key for entry in flat for key in entry))
    texts = [key for key in keys if any(isinstance(entry.get(key), str) for entry in flat)]
    keys = [*texts, *(key for key in keys if key not in texts)]
    if flat and keys:
        seeds = sorted({v["n"] for entry in flat for v in entry.values() if is_statistic(v)})
        of_n = f" (mean ± SE, n = {' to '.join(str(n) for n in dict.fromkeys((seeds[0], seeds[-1])))})" if seeds else ""
        rows = tuple(tuple(_cell(entry.get(key)) for key in keys) for entry in flat[:MOST_ROWS])
        yield Table(f"{caption}{of_n}", tuple(headed(key) for key in keys), rows, numbers_from=max(1, len(texts)))
        if len(flat) > MOST_ROWS:
            yield Text(f"{len(flat) - MOST_ROWS} more are not listed here; summary.json of the run has them.", "note")
    for entry in value[:MOST_ROWS]:
        name = next((str(inner) for inner in entry.values() if isinstance(inner, str)), "")
        for key, inner in entry.items():
            yield from _nested(f"{name or caption}: {split_unit(key)[0]}", inner)


def _flat(entry: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Values of an entry without nested tables; of lists of means each one, by the names that stand beside them."""
    for key, value in entry.items():
        if isinstance(value, list):
            for i, inner in enumerate(value):
                if is_statistic(inner) or isinstance(inner, int | float):
                    yield f"{key} {chr(65 + i) if i < 26 else i + 1}", inner
        elif not isinstance(value, Mapping) or is_statistic(value):
            yield key, value


def _cell(value: Any) -> str:
    """A value in a table of many columns."""
    if value is None:
        return ""
    if is_statistic(value):
        mean, se, _, _ = statistic_cells(value)
        return f"{mean} ± {se}" if se not in ("", "0") else mean
    if isinstance(value, bool) or not isinstance(value, int | float):
        return worded(value)
    return number(float(value))
