"""Tables and keys of a scenario or plate file as Markdown, from the pydantic models that check the file.

Types, units, defaults, ranges and what a table is for come from the models. What a key means is in
`feeder_sim/scenario/keys.toml`; a key that is missing there, or there and not in a model, is an error.
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, BeforeValidator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from typeset import typeset

from feeder_sim.document.words import split_unit
from feeder_sim.scenario import TrayExcitation
from feeder_sim.scenario.schema import KEYS, key_texts, meaning_of

TAGS = ("kind", "shape")  # keys that say which of several tables is meant
RANGE = "number, or `[low, high]`"  # from which each seed draws
PLAIN = {Any: "value", float: "number", int: "whole number", str: "text", bool: "`true` or `false`", Path: "file"}
LIMITS = {"ge": "at least {}", "gt": "above {}", "le": "at most {}", "lt": "below {}"}


@dataclass
class Section:
    """One table: its model, the places it is written at, and whether each of them may repeat."""

    model: type[BaseModel]
    places: list[str] = field(default_factory=list)


def table_reference(subject: str) -> str:
    """All tables below a model given as MODULE:CLASS.

    Raises:
        ValueError: `keys.toml` and the models do not say the same keys.
    """
    module, _, name = subject.partition(":")
    root = getattr(importlib.import_module(module), name)
    sections: dict[type[BaseModel], Section] = {}
    collect(root, "", sections)
    check_meanings(list(sections))
    return typeset("\n\n".join(written(section, name.lower()) for section in sections.values()))


def collect(model: type[BaseModel], place: str, sections: dict[type[BaseModel], Section]) -> None:
    """Walk the fields of a model; every model is described once, with all places it is written at."""
    section = sections.setdefault(model, Section(model))
    if place not in section.places:
        section.places.append(place)
    for key, info in model.model_fields.items():
        repeated = any(get_args(part)[1:] == (...,) for part in parts_of(info.annotation) if get_origin(part) is tuple)
        path = f"{place.strip('[]')}.{key}" if place else key
        held = list(dict.fromkeys(models_in(info.annotation)))
        for inner in held:  # those a key chooses from stand side by side
            sections.setdefault(inner, Section(inner))
        for inner in held:
            collect(inner, f"[[{path}]]" if repeated else f"[{path}]", sections)


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """All models that a field may hold."""
    for part in parts_of(annotation):
        if inspect.isclass(part) and issubclass(part, BaseModel):
            yield part


def parts_of(annotation: Any) -> Iterator[Any]:
    """An annotation and all that it is made of."""
    yield annotation
    for argument in get_args(annotation) if get_origin(annotation) is not Literal else ():
        yield from parts_of(argument)


def check_meanings(models: Sequence[type[BaseModel]]) -> None:
    """Refuse keys without a meaning, and meanings of keys that these models do not have."""
    missing = [
        f"{model.__name__}.{key}"
        for model in models
        for key in model.model_fields
        if key != tag_of(model) and not meaning_of(model, key)
    ]
    bases = {base.__name__: base for model in models for base in model.__mro__ if issubclass(base, BaseModel)}
    stale = [
        f"{name}.{key}"
        for name, held in key_texts().items()
        for key in held
        if name in bases and key not in bases[name].model_fields
    ]
    if missing or stale:
        raise ValueError(f"{KEYS.name} lacks {missing or 'nothing'} and has {stale or 'nothing'} too many")


def written(section: Section, page: str) -> str:
    """One table as a section of a page."""
    model = section.model
    lines = [f"({anchor(page, model)})=", f"### {title(section)}", "", inspect.cleandoc(model.__doc__ or "")]
    others = [f"`{place}`" for place in section.places[1:]]
    if others:
        lines += ["", f"Also written as {', '.join(others)}."]
    lines += ["", "| key | value | default | allowed | meaning |", "|---|---|---|---|---|"]
    tag = tag_of(model)
    for key, info in sorted(model.model_fields.items(), key=lambda item: item[0] != tag):
        meaning = "which table this is" if key == tag else meaning_of(model, key)
        cells = (f"`{key}`", words(key, info, page), default(info), allowed(info), meaning)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)


def title(section: Section) -> str:
    place = section.places[0]
    tag = tag_of(section.model)
    if not place:
        return "Top of the file"
    if tag is None:
        return f"`{place}`{of_tray(section.model)}"
    value = get_args(section.model.model_fields[tag].annotation)[0]
    return f'`{place}` with `{tag} = "{value}"`'


def of_tray(model: type[BaseModel]) -> str:
    """Which drives stand side by side without a key that tells them apart."""
    return " of a tray" if issubclass(model, TrayExcitation) else ""


def anchor(page: str, model: type[BaseModel]) -> str:
    return f"{page}-{model.__name__.lower()}"


def words(key: str, info: FieldInfo, page: str) -> str:
    """The type of a key in words, with its unit."""
    text, of = type_words(info.annotation, page), unit(key, info)
    if any(isinstance(entry, BeforeValidator) for entry in info.metadata):
        text = RANGE
    return re.sub(r"\bnumbers?\b", lambda found: f"{found.group()} in {of}", text, count=1) if of else text


def type_words(annotation: Any, page: str) -> str:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if annotation in PLAIN:
        return PLAIN[annotation]
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        return f"[{short(annotation)}](#{anchor(page, annotation)})"
    if origin is dict:
        return f"keys, each with a {type_words(arguments[1], page)}"
    if origin is Annotated:
        if get_origin(arguments[0]) is not dict and any(isinstance(entry, BeforeValidator) for entry in arguments[1:]):
            return RANGE
        return type_words(arguments[0], page)
    if origin is Literal:
        return " or ".join(f'`"{value}"`' for value in arguments)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(type_words(a, page) for a in arguments if a is not type(None)))
    if origin is tuple:
        if arguments[1:] == (...,):
            return f"list of {type_words(arguments[0], page)}"
        return f"list of {len(arguments)} numbers"
    raise ValueError(f"no words for {annotation!r}")


def short(model: type[BaseModel]) -> str:
    """What a link to a table says: its tag, or "table"."""
    tag = tag_of(model)
    return f'`"{get_args(model.model_fields[tag].annotation)[0]}"`' if tag else f"table{of_tray(model)}"


def tag_of(model: type[BaseModel]) -> str | None:
    """The key that says which of several tables a table is; a `shape` that names a file is none."""
    fields = model.model_fields
    return next((key for key in TAGS if key in fields and get_origin(fields[key].annotation) is Literal), None)


def unit(key: str, info: FieldInfo) -> str:
    if not any(part in (float, int) for part in parts_of(info.annotation)):
        return ""
    return split_unit(key)[1]


def default(info: FieldInfo) -> str:
    if info.is_required():
        return "required"
    value = info.default if info.default is not PydanticUndefined else info.get_default(call_default_factory=True)
    if isinstance(value, BaseModel):
        return "its defaults"
    if value is None or value == () or value == "":
        return "none"
    return f"`{toml(value)}`"


def toml(value: Any) -> str:
    """A value as it is written in a file."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str | Path):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"[{', '.join(toml(entry) for entry in value)}]"
    return str(value)


def allowed(info: FieldInfo) -> str:
    """Limits of a number, of every number of a list, or of the length of a list."""
    limits = dict(limits_in(info.metadata))
    lengths = [m.min_length for m in info.metadata if getattr(m, "min_length", None)]
    most = [m.max_length for m in info.metadata if getattr(m, "max_length", None)]
    for part in parts_of(info.annotation):
        if get_origin(part) is Annotated:
            for entry in get_args(part)[1:]:
                limits |= limits_in(entry.metadata if isinstance(entry, FieldInfo) else [entry])
    texts = [LIMITS[name].format(f"{limit:g}") for name, limit in limits.items()]
    if set(limits) == {"ge", "le"}:
        texts = [f"{limits['ge']:g} to {limits['le']:g}"]
    texts += [f"at least {n} entry" for n in lengths] + [f"at most {n} entries" for n in most]
    return ", ".join(texts)


def limits_in(metadata: Any) -> dict[str, float]:
    return {name: getattr(m, name) for m in metadata for name in LIMITS if getattr(m, name, None) is not None}
