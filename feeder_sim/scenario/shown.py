"""A scenario as people read it: one line, or the TOML of what differs from the defaults."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feeder_sim.notebook import block, counted

if TYPE_CHECKING:
    from feeder_sim.scenario.scenario import Scenario

NAMED = ("kind", "shape")  # keys that say what a table is, so that they are shown even where they are the default
_LIST = re.compile(r"\[\n([^\[\]{}]*?),\n\]")  # of plain values, which the writer puts on a line each
MOST_NAMED = 3  # drives or kinds of parts in the line


def line_of(scenario: Scenario) -> str:
    """Title, plate, drives, parts, duration and seeds in one line."""
    title = f" {scenario.title!r}" if scenario.title else ""
    schedule, run = scenario.schedule, scenario.run
    if schedule is not None:
        motion = f"{counted(schedule.cycles, 'cycle')} of {counted(len(schedule.stage), 'stage')}"
    else:
        motion = _several([f"{drive.frequency_hz:g} Hz" for drive in scenario.drive], "drive") or "no drive"
    kinds = zip(scenario.part, scenario.kind_names, strict=True)
    parts = _several([f"{part.count} {name}" for part, name in kinds], "kind")
    duration = [f"{run.duration_s:g} s"] if run.duration_s is not None else []
    items = [f"{scenario.plate.kind} plate", motion, parts, *duration, counted(run.seeds, "seed")]
    return f"<Scenario{title}: {', '.join(items)}>"


def html_of(scenario: Scenario) -> str:
    """Its line, and below it the scenario as a file."""
    import tomli_w

    text = tomli_w.dumps(written(scenario))
    return block(line_of(scenario)[1:-1], _LIST.sub(lambda match: f"[{' '.join(match[1].split())}]", text).splitlines())


def written(value: Any) -> Any:
    """A value as a file has it; of tables what differs from the defaults."""
    fields = getattr(type(value), "model_fields", None)
    if fields is not None:
        items = {name: getattr(value, name) for name, field in fields.items() if name in NAMED or differs(value, name)}
        return {name: written(entry) for name, entry in items.items() if entry is not None}
    if isinstance(value, Mapping):
        return {key: written(entry) for key, entry in value.items()}
    if isinstance(value, tuple | list):
        return [written(entry) for entry in value]
    return str(value) if isinstance(value, Path) else value


def differs(table: Any, name: str) -> bool:
    """Whether a value of a table is not the default."""
    return bool(getattr(table, name) != type(table).model_fields[name].default)


def _several(entries: list[str], name: str) -> str:
    """A few entries, or how many there are."""
    return ", ".join(entries) if len(entries) <= MOST_NAMED else counted(len(entries), name)
