"""The file of a folder that says what was asked: a dataclass as TOML, and back."""

from __future__ import annotations

import math
import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from feeder_sim.errors import InputError

Q = TypeVar("Q")


def question_toml(question: Any) -> str:
    """The fields of a question as a text; those that are NaN, which is none, left out."""
    import tomli_w

    fields = asdict(question).items()
    given = {name: value for name, value in fields if not (isinstance(value, float) and math.isnan(value))}
    return tomli_w.dumps({name: list(v) if isinstance(v, tuple) else v for name, v in given.items()})


def read_question(path: Path, usual: Q, kind: str) -> Q:
    """A question out of a folder.

    Args:
        path: of the file.
        usual: a question of the same type, whose fields have the types that are allowed; tuples are of texts.
        kind: of the folder, in words.

    Raises:
        InputError: the file is missing or holds no such question.
    """
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
        found = type(usual)(**{name: tuple(v) if isinstance(v, list) else v for name, v in raw.items()})
        for name, value in vars(found).items():
            wrong = type(value) is not type(getattr(usual, name))
            if wrong or (isinstance(value, tuple) and not all(isinstance(text, str) for text in value)):
                raise TypeError(f"{name} is {raw[name]!r}")
        return found
    except FileNotFoundError as error:
        raise InputError(f"no such file, allowed is the folder of a {kind}", file=path) from error
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"holds no {kind}: {error}", file=path) from error
