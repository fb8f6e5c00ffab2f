"""TOML text -> validated, frozen tables, or one line that says what is wrong.

`Table` is the base of every table a user writes; pydantic checks it, and `parse` turns its first complaint into a line
that names the file, the dotted key, the value and what is allowed.
"""

from __future__ import annotations

import re
import stat
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, ValidationInfo

from feeder_sim.errors import InputError, cause_of, nearest, quoted, shortened
from feeder_sim.scenario.shown import differs

# Wide enough for any plate and part, narrow enough that no formula over- or underflows.
Positive = Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False, strict=True)]
NonNegative = Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False, strict=True)]
DurationS = Annotated[float, Field(gt=0, le=1e5, strict=True)]  # a day of a feeder
LengthMm = Annotated[float, Field(ge=1e-3, le=1e5, allow_inf_nan=False, strict=True)]
FrequencyHz = Annotated[float, Field(ge=0.1, le=1e7, allow_inf_nan=False, strict=True)]
AngleDeg = Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False, strict=True)]
CoordinateMm = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False, strict=True)]
PointMm = tuple[CoordinateMm, CoordinateMm]
DrawingUnit = Literal["mm", "cm", "m", "inch"]
SpeedMmS = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False, strict=True)]
VelocityMmS = tuple[SpeedMmS, SpeedMmS, SpeedMmS]
SpinRadS = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False, strict=True)]
Flag = Annotated[bool, Field(strict=True)]


def _as_range(value: Any) -> Any:
    return (value, value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _ascending(value: tuple[float, float]) -> tuple[float, float]:
    if value[0] > value[1]:
        raise ValueError("must be [low, high] with low <= high")
    return value


DropHeightMm = Annotated[float, Field(ge=0, le=1e5, allow_inf_nan=False, strict=True)]
# A number, or [low, high] from which each seed draws uniformly.
AngleRange = Annotated[
    tuple[AngleDeg, AngleDeg],
    BeforeValidator(_as_range, json_schema_input_type=AngleDeg | tuple[AngleDeg, AngleDeg]),
    AfterValidator(_ascending),
]
DropHeightRange = Annotated[
    tuple[DropHeightMm, DropHeightMm],
    BeforeValidator(_as_range, json_schema_input_type=DropHeightMm | tuple[DropHeightMm, DropHeightMm]),
    AfterValidator(_ascending),
]


class Table(BaseModel):
    """A TOML table: unknown keys are refused, values are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def __repr_args__(self) -> Iterator[tuple[str, Any]]:
        """What differs from the defaults: the shortest call that makes the table again."""
        return ((name, getattr(self, name)) for name in type(self).model_fields if differs(self, name))


T = TypeVar("T", bound=Table)

DEEPEST = 20  # tables and lists in each other; scenarios need five
MOST_DOTS = 100  # in a key; the parser takes minutes for tens of thousands
_OUTSIDE_KEYS = re.compile(
    r"""\"{3}.*?\"{3}|'{3}.*?'{3}|"(?:\\.|[^"\\\n])*"|'[^'\n]*'|\#[^\n]*|[=,{}\[\]\n]""", re.DOTALL
)
LONGEST_TEXT = 2_000_000  # bytes; the longest scenarios have thousands of lines
LARGEST_INTEGER = 10**300  # nothing that is checked here reaches it, and it can still be shown


def read_text(path: Path, longest: int = LONGEST_TEXT) -> str:
    """Read a text file of up to so many bytes.

    Raises:
        InputError: missing, unreadable, too long, or no file but a folder, a device or a pipe, which may never end.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError("is no file, must be a text file", file=path)
        if status.st_size > longest:
            raise InputError(
                f"is {status.st_size / 1e6:.1f} MB long, must be up to {longest / 1e6:g} MB of text", file=path
            )
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InputError("no such file", file=path) from error
    except UnicodeDecodeError as error:
        raise InputError(f"cannot be read as text: {error}", file=path) from error
    except OSError as error:
        raise InputError(f"cannot be read: {cause_of(error)}", file=path) from error


def parse(text: str, table: type[T], file: Path) -> T:
    """Parse and check a TOML document.

    Raises:
        InputError: TOML syntax, or any key or value that is not allowed.
    """
    return validated(document_in(text, file), table, file)


def document_in(text: str, file: Path) -> dict[str, Any]:
    """The TOML document of a text, whatever its keys and values are.

    Raises:
        InputError: TOML syntax, deep nesting, or a whole number of too many digits.
    """
    if max(line.count(".") for line in _OUTSIDE_KEYS.split(text)) > MOST_DOTS:
        raise InputError(f"holds keys nested too deep, must be {DEEPEST} levels", file=file)
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"not valid TOML: {error}", file=file) from error
    except ValueError as error:  # Python reads no more digits than it can write
        raise InputError("holds a whole number of thousands of digits, must be 300", file=file) from error
    except RecursionError as error:
        raise InputError(f"holds lists or tables nested too deep, must be {DEEPEST} levels", file=file) from error
    _refuse_absurd(raw, file)
    return raw


def folder_of(info: ValidationInfo) -> Path:
    """Where names of files start from."""
    return Path((info.context or {}).get("folder", ""))


def validated(raw: dict[str, Any], table: type[T], file: Path) -> T:
    """Check a document that is already parsed; `file` names it in the message.

    In Python its values may come from numpy: numbers of an array, or a short one for a list.

    Raises:
        InputError: any key or value that is not allowed.
    """
    _refuse_absurd(raw, file)
    try:
        return table.model_validate(_without_numpy(raw), context={"folder": file.resolve().parent})
    except ValidationError as error:
        raise first_error(error, table, file) from None
    except InputError as error:  # of a file that this one names
        if error.file is not None:
            raise
        raise InputError(error.problem, file=file, key=error.key) from None


def _refuse_absurd(raw: dict[str, Any], file: Path) -> None:
    """Refuse what neither pydantic nor a message could deal with: deep nesting, whole numbers of too many digits."""
    stack: list[tuple[str, int, Any]] = [("", 0, raw)]
    while stack:
        key, depth, value = stack.pop()
        if depth > DEEPEST:
            raise InputError(f"is nested too deep, must be {DEEPEST} levels", file=file, key=key)
        if isinstance(value, dict):
            stack += [(f"{key}.{name}" if key else str(name), depth + 1, entry) for name, entry in value.items()]
        elif isinstance(value, list | tuple):
            stack += [(f"{key}[{i}]", depth + 1, entry) for i, entry in enumerate(value)]
        elif isinstance(value, int) and abs(value) > LARGEST_INTEGER:
            raise InputError("is a whole number of more than 300 digits, must be fewer", file=file, key=key)


def _without_numpy(value: Any) -> Any:
    """A document with numpy's numbers and arrays as those of Python, which strict types ask for."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {key: _without_numpy(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_without_numpy(entry) for entry in value]
    return value


def first_error(error: ValidationError, root: type[BaseModel], file: Path) -> InputError:
    """One line for the first thing wrong, and how many more there are."""
    details = error.errors(include_url=False)
    # An error inside a list makes pydantic call the list too short as well: only the innermost counts.
    outer = {d["loc"][:depth] for d in details for depth in range(len(d["loc"]))}
    details = [d for d in details if d["loc"] not in outer]
    # A misspelt key also shows up as a missing one; the misspelling is the cause.
    first = min(details, key=lambda d: d["type"] != "extra_forbidden")
    loc = first["loc"]
    table, key = _locate(root, loc)
    name = str(loc[-1]) if loc else ""
    if first["type"] == "extra_forbidden":
        allowed = list(table.model_fields) if table else []
        problem = f"unknown key{nearest(name, allowed)}; must be {', '.join(allowed)}"
    elif first["type"] == "missing":
        problem = f"is missing, must be {_allowed(table, name)}"
    elif first["type"] == "value_error":
        problem = first["msg"].removeprefix("Value error, ")
        if not isinstance(first["input"], dict):
            problem = f"is {quoted(first['input'])}, {problem}"
    elif first["type"].startswith("union_tag"):
        context = first.get("ctx", {})
        tag = str(context.get("discriminator", "")).strip("'")
        tag = "kind" if tag.endswith("()") else tag  # found by a function, which has no name to show
        key = f"{key}.{tag}" if tag else key
        tag_text = shortened(str(context.get("tag", "missing")))
        problem = f"is {tag_text}, must be {context.get('expected_tags', 'one kind')}"
    else:
        problem = f"is {quoted(first['input'])}, {_lower(first['msg'])}"
    more = f" (and {len(details) - 1} more)" if len(details) > 1 else ""
    return InputError(problem + more, file=file, key=key or None)


def _lower(message: str) -> str:
    message = _TABLE_EXPECTED.sub("must be a table", message)
    for phrase, replacement in _PLAIN_WORDS.items():
        message = message.replace(phrase, replacement)
    return message


_TABLE_EXPECTED = re.compile(r"Input should be a valid dictionary or (object to extract fields from|instance of \w+)")
_PLAIN_WORDS = {
    "Input should be a valid tuple": "must be a list (a table that may repeat is written [[...]])",
    "Input should be": "must be",
    "Tuple should have": "must be a list with",
}


def _allowed(table: type[BaseModel] | None, name: str) -> str:
    """Describe a field in words from its type and limits."""
    if table is None or name not in table.model_fields:
        return "a value"
    field = table.model_fields[name]
    least = next((m.ge for m in field.metadata if getattr(m, "ge", None) is not None), None)
    if least is not None:
        return f"a number of at least {least:g}"
    if any(getattr(m, "gt", None) == 0 for m in field.metadata):
        return "a number above 0"
    return "a table" if _variants(field.annotation) else "a value"


def _locate(root: type[BaseModel], loc: tuple[int | str, ...]) -> tuple[type[BaseModel] | None, str]:
    """Follow a pydantic location: the table that holds its last key, and the dotted key without union tags."""
    table: type[BaseModel] | None = root
    key, variants = "", _Variants()
    for depth, element in enumerate(loc):
        if isinstance(element, int):
            key += f"[{element}]"
        elif element in variants or (element == "name" and table is not None and "name" not in table.model_fields):
            table, variants = variants.get(element), _Variants()
        else:
            key += f".{element}" if key else element
            if depth < len(loc) - 1 and table is not None and element in table.model_fields:
                variants = _variants(table.model_fields[element].annotation)
                table = variants.only
    return table, key


class _Variants(dict[Any, type[BaseModel]]):
    """Tables a field may hold, by union tag."""

    only: type[BaseModel] | None = None


def _variants(annotation: Any) -> _Variants:
    variants = _Variants()
    stack = [annotation]
    while stack:
        item = stack.pop()
        if isinstance(item, type) and issubclass(item, BaseModel):
            variants.only = item
            variants[item.__name__] = item
            # tags of a choice between a name and a table, or between a table and a list of them
            variants["table"] = variants["list"] = item
            for tag in ("kind", "shape"):
                if tag in item.model_fields:
                    variants |= dict.fromkeys(get_args(item.model_fields[tag].annotation), item)
        elif get_origin(item) is not None:
            stack += list(get_args(item))
    return variants
