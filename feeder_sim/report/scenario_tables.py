"""What was asked, as tables: one for the plate and all other tables of a scenario, one for each list of tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from feeder_sim.document.document import Block, Folded, Table, Text
from feeder_sim.document.words import headed, split_unit, worded_in, worded_of
from feeder_sim.scenario import Scenario

# Shown also where they are at their defaults: results depend on them strongly.
ALWAYS: dict[str, tuple[str, ...]] = {
    "plate": ("kind", "thickness_mm", "material"),
    "contact": ("restitution", "friction"),
    "run": ("duration_s", "seeds", "seed", "engine"),
    "schedule": ("cycles",),
    "part": ("name", "shape", "size", "material", "count", "start"),
}
CAPTIONS = {"drive": "Drives", "part": "Parts", "prepare": "Stages before the cycles", "stage": "Stages of a cycle"}
NOTE = (
    "Values that are not listed are at their defaults; the text below has them all. From a range each seed "
    "draws a value of its own."
)


def scenario_blocks(scenario: Scenario, text: str) -> tuple[Block, ...]:
    """Tables of what a scenario says, most of what is at its default left out, and its whole text folded."""
    specified = scenario.model_dump(mode="json", exclude_defaults=True, exclude_none=True)
    full = scenario.model_dump(mode="json", exclude_none=True)
    selected = {
        key: _selected(specified.get(key), value, ALWAYS.get(key, ()))
        for key, value in full.items()
        if key != "title" and (key in specified or key in ALWAYS)
    }
    lists = {key: selected.pop(key) for key in [k for k, v in selected.items() if _is_list_of_tables(v)]}
    schedule = selected.get("schedule", {})
    stages = {key: schedule.pop(key) for key in ("prepare", "stage") if key in schedule}
    blocks: list[Block] = [_of_tables(selected)]
    for key, entries in (stages | lists).items():
        if entries:
            blocks.append(_of_list(entries, CAPTIONS.get(key, key.capitalize())))
    return (*blocks, Text(NOTE), Folded("The whole scenario as a file (TOML)", (Text(text, "code"),)))


def _selected(specified: Any, full: Any, always: Sequence[str] = ()) -> Any:
    """What differs from the defaults. Of a table that is given as it is by default, all.

    Args:
        specified: a value without its defaults; None where there is nothing else.
        full: the same with all of them.
        always: keys of a table that are shown in any case, and first.
    """
    if isinstance(full, Mapping):
        if not specified and not always:
            return dict(full)
        entries = specified or {}
        first = {key: 0 for key in always if key in full}
        return {key: _selected(entries.get(key), full[key]) for key in first | {k: 0 for k in full if k in entries}}
    if _is_list_of_tables(full) and isinstance(specified, list):
        return [_selected(entry, full_entry, always) for entry, full_entry in zip(specified, full, strict=True)]
    return full


def _is_list_of_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)


def _of_tables(tables: Mapping[str, Any]) -> Table:
    """One table with a row per value; the name of a table stands in its first row."""
    rows: list[tuple[str, ...]] = []
    for name, value in tables.items():
        entries = value if isinstance(value, Mapping) else {"": value}
        for i, (key, inner) in enumerate(entries.items()):
            rows.append((name.replace("_", " ") if i == 0 else "", split_unit(key)[0], worded_in(key, inner)))
    return Table("", ("table", "key", "value"), tuple(rows))


def _of_list(entries: Sequence[Mapping[str, Any]], caption: str) -> Table:
    """A table with a row per entry and a column per key."""
    keys = list(dict.fromkeys(key for entry in entries for key in entry))
    rows = [
        (str(i), *(worded_of(key, entry[key]) if key in entry else "" for key in keys))
        for i, entry in enumerate(entries, 1)
    ]
    return Table(caption, ("no.", *(headed(key) for key in keys)), tuple(rows))
