"""What every key of a scenario or plate file means, in words: for the docs, for schemas, and so for editors."""

from __future__ import annotations

import functools
import importlib
import re
import tomllib
from pathlib import Path

from pydantic import BaseModel

KEYS = Path(__file__).with_name("keys.toml")
CONSTANT = re.compile(r"\{([\w.]+):(\w+)\}")  # in keys.toml: a value that the package holds


@functools.cache
def key_texts() -> dict[str, dict[str, str]]:
    """Texts by the class that checks a table, and its keys."""
    return tomllib.loads(KEYS.read_text(encoding="utf-8"))


def meaning_of(table: type[BaseModel], key: str) -> str:
    """What a key means: the table's own words, or those of `keys.toml` for it or for a class it comes from; or ""."""
    own = table.model_fields[key].description
    if own:
        return own
    for base in table.__mro__:
        if text := key_texts().get(base.__name__, {}).get(key):
            return CONSTANT.sub(lambda found: _constant(*found.groups()), text)
    return ""


def _constant(module: str, name: str) -> str:
    """The value of a constant of the package, for people; it may stand in any room, and is only looked up."""
    value = getattr(importlib.import_module(module), name)
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
