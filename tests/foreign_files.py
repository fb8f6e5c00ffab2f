"""A file as another program could have written it, with what was drawn in it, and how it is damaged."""

from __future__ import annotations

import re
from dataclasses import dataclass
from random import Random
from typing import Any

HOSTILE = ["1e20", "1e300", "-1e300", "nan", "inf", "-1", "0", "99999999999", "1e-300", "", "x"]
NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class ForeignFile:
    """A file, and what is known of it.

    Args:
        content: of the file.
        suffix: of its name.
        said: what is in it, for messages.
        truths: what a reader may take it for: one of them, or it refuses it; None: anything, if it only ends.
        ordinary: it may not be refused.
        slack_mm: how far ends of lines are from each other.
        unit: of a drawing that does not say it, or None.
        patches, feet: whether there are any.
    """

    content: bytes
    suffix: str
    said: str
    truths: tuple[Any, ...] | None
    ordinary: bool = False
    slack_mm: float = 0.0
    unit: str | None = None
    patches: bool = True
    feet: bool = True


def damaged(file: ForeignFile, rng: Random) -> ForeignFile:
    """The file after one to three accidents; whatever it says now, it must be read or refused."""
    content, kinds = file.content, []
    for _ in range(rng.randint(1, 3)):
        kind = rng.choice(["flip", "flip", "cut", "number", "number", "number", "less", "twice", "middle"])
        kinds.append(kind)
        content = _accident(kind, content, rng)
    said = f"{file.said}; damaged: {', '.join(kinds)}"
    return ForeignFile(content, file.suffix, said, None, unit=file.unit, patches=file.patches, feet=file.feet)


def _accident(kind: str, content: bytes, rng: Random) -> bytes:
    if not content:
        return content
    at = rng.randrange(len(content))
    if kind == "flip":
        bent = bytearray(content)
        for _ in range(rng.choice([1, 1, 8, 40])):
            bent[rng.randrange(len(bent))] = rng.randrange(256)
        return bytes(bent)
    if kind == "cut":
        return content[:at]
    if kind == "middle":
        return content[:at] + content[at + rng.randint(1, 400) :]
    if kind == "number":
        numbers = list(NUMBER.finditer(content))
        if not numbers:
            return content
        number = rng.choice(numbers)
        return content[: number.start()] + rng.choice(HOSTILE).encode() + content[number.end() :]
    lines = content.splitlines(keepends=True)
    i = rng.randrange(len(lines))
    more = [] if kind == "less" else lines[i : i + rng.randint(1, 6)] * rng.choice([2, 2, 50])
    return b"".join([*lines[:i], *more, *lines[i + 1 :]])
