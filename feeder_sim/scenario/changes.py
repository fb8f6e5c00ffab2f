"""Values of a scenario by their dotted keys, such as `drive[0].amplitude_um`: to read, and to change with all checks.

A key is written as in error messages: names with dots, and numbers of tables that repeat in brackets, from 0. `stage`
and `prepare` may stand without the `schedule.` before them.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError, nearest, quoted

KeyPath = tuple[str | int, ...]
_ELEMENT = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)((?:\[\d{1,6}\])*)")
_OF_SCHEDULE = ("stage", "prepare", "cycles")


def full_key(key: str) -> str:
    """The key with the `schedule.` that may be left out."""
    first = _ELEMENT.match(key) if isinstance(key, str) else None
    return f"schedule.{key}" if first and first[1] in _OF_SCHEDULE else key


def path_of(key: str) -> KeyPath:
    """The names and numbers of a key.

    Raises:
        InputError: it is not written as a key is.
    """
    if not isinstance(key, str):
        raise InputError("is no key, must be for example drive[0].amplitude_um", key=repr(key))
    path: list[str | int] = []
    for element in full_key(key).split("."):
        match = _ELEMENT.fullmatch(element)
        if match is None:
            raise InputError("is no key, must be for example drive[0].amplitude_um", key=key or '""')
        path += [match[1], *(int(number) for number in re.findall(r"\d+", match[2]))]
    return tuple(path)


def check_variable(key: str) -> None:
    """Refuse a key whose values are no other scenario: they decide nothing, or only the random numbers.

    Raises:
        InputError: as said.
    """
    path = path_of(key)
    if path[0] in ("title", "uncertain") or path == ("run",) or path[:2] in (("run", "seed"), ("run", "seeds")):
        raise InputError("is varied, must be a key that decides what a run does", key=key)


def value_at(raw: Mapping[str, Any], key: str) -> Any:
    """The value at a key of a scenario as a dictionary; None where an optional table or value is not given.

    Raises:
        InputError: there is no such key.
    """
    value: Any = raw
    for element in path_of(key):
        if value is None and isinstance(element, str):
            return None
        value = _entry(value, element, key)
    return value


def changed_values(raw: Mapping[str, Any], changes: Mapping[str, Any], file: Path) -> dict[str, Any]:
    """A copy of a scenario as a dictionary, with other values at some keys; None takes a value out.

    Raises:
        InputError: a key leads nowhere; `file` names the scenario in the message.
    """
    document: Any = dict(raw)
    for key, value in changes.items():
        try:
            document = _replaced(document, path_of(key), value, key)
        except InputError as error:
            raise InputError(error.problem, file=file, key=error.key) from None
    return dict(document)


def read_value(text: str) -> Any:
    """A value as TOML has it; what is none is text, and what is empty is None, which takes a value out."""
    if not text.strip():
        return None
    try:
        table = tomllib.loads(f"value = {text}")
    except (tomllib.TOMLDecodeError, ValueError, RecursionError):
        return text.strip()
    return table["value"] if table.keys() == {"value"} else text.strip()  # a text of several lines may hold more keys


def read_changes(settings: list[str], option: str = "--set") -> dict[str, Any]:
    """Changes from texts `key=value`.

    Raises:
        InputError: one that is not written so, or a key that is given twice.
    """
    changes: dict[str, Any] = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        key = full_key(key.strip())
        if not equals or not key:
            raise InputError(f"is {setting!r}, must be KEY=VALUE", key=option)
        path_of(key)
        if key in changes:
            raise InputError(f"is given twice for {key}, must be once", key=option)
        changes[key] = read_value(text)
    return changes


def _replaced(value: Any, path: KeyPath, new: Any, key: str) -> Any:
    """A copy of a table or list with another value at the end of a path."""
    first, remaining = path[0], path[1:]
    if isinstance(first, int):
        _entry(value, first, key)
        entries = list(value)
        entries[first] = _replaced(entries[first], remaining, new, key) if remaining else new
        return entries
    if value is None:
        value = {}
    if not isinstance(value, Mapping):
        raise InputError(_number_missing(value, first, key) or "leads into a value that is no table", key=key)
    table = dict(value)
    if not remaining:
        table[first] = new
    elif first in table or isinstance(remaining[0], str):
        table[first] = _replaced(table.get(first), remaining, new, key)
    else:
        _entry(table, first, key)
    return table


def _entry(value: Any, element: str | int, key: str) -> Any:
    """What a table or a list has at an element of a path."""
    if isinstance(element, int):
        if not isinstance(value, list | tuple):
            raise InputError(f"has the number [{element}] where there is no list, must be none", key=key)
        if element >= len(value):
            allowed = f"0 to {len(value) - 1}" if value else "none, the list is empty"
            raise InputError(f"has the number [{element}], must be {allowed}", key=key)
        return value[element]
    if not isinstance(value, Mapping) or element not in value:
        if missing := _number_missing(value, element, key):
            raise InputError(missing, key=key)
        names = list(value) if isinstance(value, Mapping) else []
        allowed = f"; must be {', '.join(names)}" if names else ""
        raise InputError(f"unknown key {element}{nearest(element, names)}{allowed}", key=key)
    return value[element]


def _number_missing(value: Any, name: str | int, key: str) -> str:
    """What to write where a name of a key follows on a list of tables without a number; empty elsewhere."""
    if not isinstance(value, list | tuple) or not value or not isinstance(value[0], Mapping):
        return ""
    before, name, after = key.partition(f".{name}")
    return f"{before} is a list; write {before}[0]{name}{after}"


def labels(point: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a point as a table holds them: numbers and texts."""
    return {key: value if isinstance(value, int | float | str) else quoted(value) for key, value in point.items()}
