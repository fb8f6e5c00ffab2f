"""JSON Schema (draft 2020-12) of scenarios and of plate files, for editors and linters that know TOML.

It says which keys there are, of which type and within which limits, and what they mean. What goes by several keys
together, such as that a drive has an amplitude or a voltage, only `feeder-sim check` knows.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_origin

from pydantic import BaseModel

from feeder_sim.scenario.plate import PlateFile
from feeder_sim.scenario.scenario import Scenario
from feeder_sim.scenario.tables import Table

# What every key of a scenario or plate file means, in words: for the docs, for schemas, and so for editors.

KEYS = Path(__file__).with_name("keys.toml")
CONSTANT = re.compile(r"\{([\w.]+):(\w+)\}")  # in keys.toml: a value that the package holds


@functools.cache
def key_texts() -> dict[str, dict[str, str]]:
    """Texts by the class that checks a table, and its keys."""
    return tomllib.loads(KEYS.read_text(encoding="utf-8"))


def meaning_of(table: type[BaseModel], key: str) -> str:
    """What a key means: the table's own words, or those of `keys.toml` for it or for a class it comes from; or ""."""
    description = table.model_fields[key].description
    if description:
        return description
    for base in table.__mro__:
        if text := key_texts().get(base.__name__, {}).get(key):
            return CONSTANT.sub(lambda match: _constant(*match.groups()), text)
    return ""


def _constant(module: str, name: str) -> str:
    """The value of a constant of the package, for people; it may stand in any room, and is only looked up."""
    value = getattr(importlib.import_module(module), name)
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)


TABLES: dict[str, type[Table]] = {"scenario": Scenario, "plate": PlateFile}
DRAFT = "https://json-schema.org/draft/2020-12/schema"
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")


def json_schema(kind: str) -> dict[str, Any]:
    """The schema of a kind of file, one of `TABLES`, as JSON takes it."""
    root = TABLES[kind]
    schema: dict[str, Any] = _plain(root.model_json_schema())
    tables = {table.__name__: table for table in _tables_below(root)}
    definitions = schema.get("$defs", {})
    for name, described in ({root.__name__: schema} | definitions).items():
        _describe(described, tables[name])
    _require_tags(schema, definitions)
    if "BendingPlate" in definitions:  # its file may have it
        definitions["BendingPlate"]["required"].remove("thickness_mm")
    _allow_dotted_keys(schema, definitions)
    return {"$schema": DRAFT, "title": f"feeder_sim {kind} file"} | schema


def schema_text(kind: str) -> str:
    """The same as the text of a file."""
    return json.dumps(json_schema(kind), indent=1) + "\n"


def _plain(value: Any) -> Any:
    """A schema without null, which TOML does not have, without what only other programs read, and made-up titles."""
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    if not isinstance(value, dict):
        return value
    schema = {key: _plain(entry) for key, entry in value.items() if not _superfluous(key, entry)}
    alternatives = [entry for entry in schema.get("anyOf", ()) if entry != {"type": "null"}]
    if "anyOf" in schema and len(alternatives) < len(schema["anyOf"]):
        del schema["anyOf"]
        schema = {**schema, "anyOf": alternatives} if len(alternatives) > 1 else {**alternatives[0], **schema}
    return schema


def _superfluous(key: str, entry: Any) -> bool:
    if key in ("title", "format"):
        return isinstance(entry, str)  # else it is a key of that name
    return key == "default" and (entry is None or isinstance(entry, dict))


def _tables_below(table: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """A table and all that it may hold."""
    seen: set[type[BaseModel]] = set()
    stack = [table]
    while stack:
        model = stack.pop()
        if model not in seen:
            seen.add(model)
            yield model
            stack += [nested for info in model.model_fields.values() for nested in _tables_in(info.annotation)]


def _tables_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if inspect.isclass(annotation) and get_origin(annotation) is None and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _tables_in(argument)


def _describe(described: dict[str, Any], table: type[BaseModel]) -> None:
    """Put in what the table is for, and what its keys mean."""
    described["description"] = _text(inspect.cleandoc(table.__doc__ or ""))
    for key, entry in described.get("properties", {}).items():
        if meaning := meaning_of(table, key):
            entry["description"] = _text(meaning)


def _text(markdown: str) -> str:
    """Words without links, which lead nowhere outside the docs; lines of a paragraph are joined."""
    paragraphs = _LINK.sub(r"\1", markdown).split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)


def _require_tags(value: Any, definitions: dict[str, Any]) -> None:
    """Where a key says which of several tables is meant it has to be there, whatever default it has in Python."""
    if isinstance(value, list):
        for entry in value:
            _require_tags(entry, definitions)
    elif isinstance(value, dict):
        if tag := value.pop("discriminator", {}).get("propertyName"):
            for choice in value["oneOf"]:
                definition = definitions[choice["$ref"].rpartition("/")[2]]
                definition["required"] = list(dict.fromkeys([tag, *definition.get("required", ())]))
        for entry in list(value.values()):
            _require_tags(entry, definitions)


def _allow_dotted_keys(schema: dict[str, Any], definitions: dict[str, Any]) -> None:
    """Let [uncertain] hold tables in tables: that is what keys with dots and without quotes are in TOML."""
    if uncertain := schema["properties"].get("uncertain"):
        either = {"anyOf": [{"$ref": "#/$defs/Uncertain"}, {"$ref": "#/$defs/UncertainKeys"}]}
        uncertain["additionalProperties"] = either
        definitions["UncertainKeys"] = {
            "type": "object",
            "description": "The rest of a key with dots.",
            "minProperties": 1,
            "additionalProperties": either,
        }
