"""What the machine code of a function depends on: all that it calls and all constants in that, and nothing else.

From a function its global names and closures are followed, to other functions, the choosers of overloads, constants,
types of records and named tuples. Of a function its syntax counts, without docstrings: neither comments nor lines, nor
the version of Python, nor other functions in its file.
"""

from __future__ import annotations

import ast
import contextlib
import functools
import hashlib
import json
import os
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from platformdirs import user_cache_path

from feeder_sim.machine_code.flat import fields_of
from feeder_sim.machine_code.functions import OVERLOADS, External, Inner

PACKAGE = Path(__file__).parents[1]
LENGTH = 24  # of a key
CONVENTION = 1  # of calls, and of what is made of marks: another number makes all machine code anew
DOCUMENTED = (ast.FunctionDef, ast.Lambda, ast.ClassDef)
SILENT = ("decorator_list", "returns", "annotation", "type_comment", "type_params", "kind")  # say nothing to a compiler
Digests = dict[tuple[str, str], str]  # of functions, by module and name


def base_folder() -> Path:
    """Where the package keeps what it need not make again: the user's folder for caches, or NUMBA_CACHE_DIR."""
    chosen = os.environ.get("NUMBA_CACHE_DIR", "")
    return Path(chosen) if chosen else user_cache_path("feeder_sim")


@functools.cache
def files_hash(pattern: str = "**/*.py", without: tuple[str, ...] = ()) -> str:
    """Hash of the sources of the package that a pattern names, but for those of some rooms."""
    files = [file for file in sorted(PACKAGE.glob(pattern)) if file.relative_to(PACKAGE).parts[0] not in without]
    sources = hashlib.sha256()
    for file in files:
        sources.update(file.relative_to(PACKAGE).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return sources.hexdigest()[:12]


def key_of(function: Any) -> str:
    """Key of the machine code of a function.

    That of a function of the package is kept for as long as no file of it has changed: to make it takes half a second.
    """
    of_package = Path(function.__code__.co_filename).resolve().is_relative_to(PACKAGE)
    return _stored(function) if of_package else _made(function)


def _stored(function: Any) -> str:
    name, keys = f"{function.__module__}.{function.__qualname__}", _keys()
    if name not in keys:
        keys[name] = _made(function)
        place = _place()
        with contextlib.suppress(OSError):
            place.parent.mkdir(parents=True, exist_ok=True)
            partial = place.with_name(f"{place.name}.{os.getpid()}")
            partial.write_text(json.dumps({"state": _state(), "keys": keys}), encoding="ascii")
            partial.replace(place)
    return keys[name]


def _place() -> Path:
    return base_folder() / "keys" / hashlib.sha256(str(PACKAGE).encode()).hexdigest()[:LENGTH]


@functools.cache
def _keys() -> dict[str, str]:
    """Keys that were made from these files before."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        stored = json.loads(_place().read_text(encoding="ascii"))
        if stored["state"] == _state():
            return dict(stored["keys"])
    return {}


@functools.cache
def _state() -> str:
    """Hash of the times and sizes of all files of the package."""
    files = sorted(PACKAGE.glob("**/*.py"))
    stats = [(str(file), (at := file.stat()).st_mtime_ns, at.st_size) for file in files]
    return hashlib.sha256(repr(stats).encode()).hexdigest()


def _made(function: Any) -> str:
    digests: Digests = {}
    _follow(function, digests)
    return hashlib.sha256(repr((CONVENTION, sorted(digests.items()))).encode()).hexdigest()[:LENGTH]


def _follow(function: Any, digests: Digests) -> None:
    """Add a function, and all that it leads to."""
    name = (str(function.__module__), function.__qualname__)
    if name in digests:
        return
    own = hashlib.sha256(_syntax_of(function).encode())
    own.update(_text(function.__defaults__, digests).encode())
    digests[name] = ""
    for used, value in _used(function):
        own.update(f"{used}={_text(value, digests)};".encode())
    for chooser, options in OVERLOADS.get(function, ()):
        own.update(repr(sorted(options.items())).encode())
        _follow(chooser, digests)
    digests[name] = own.hexdigest()


def _used(function: Any) -> Iterator[tuple[str, Any]]:
    """Global names and closures that a function refers to, with their values; of modules what is taken out of them."""
    closure = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    for name in sorted(names := _names(function.__code__)):
        if name in closure:
            yield name, closure[name].cell_contents
        elif name in function.__globals__:
            value = function.__globals__[name]
            yield name, value
            if isinstance(value, types.ModuleType) and value.__name__.partition(".")[0] == __name__.partition(".")[0]:
                yield from (
                    (f"{name}.{inner}", getattr(value, inner)) for inner in sorted(names) if hasattr(value, inner)
                )


def _names(code: types.CodeType) -> set[str]:
    inner = [_names(constant) for constant in code.co_consts if isinstance(constant, types.CodeType)]
    return set(code.co_names) | set(code.co_freevars) | {name for names in inner for name in names}


def _text(value: Any, digests: Digests) -> str:
    """Text of a value that compiled code refers to; functions are followed."""
    if isinstance(value, Inner):
        return f"{_text(value.py_func, digests)} {sorted(value.options.items())}"
    if hasattr(value, "py_func"):
        return _text(value.py_func, digests)
    if isinstance(value, types.FunctionType):
        _follow(value, digests)
        return f"{value.__module__}.{value.__qualname__}"
    if isinstance(value, External):
        return f"{value.name}{value.kinds}"
    if isinstance(value, np.dtype):
        return repr(fields_of(value))
    if isinstance(value, np.ndarray):
        return f"{fields_of(value.dtype)}{value.shape}{hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, (tuple, list)):
        return f"{type(value).__name__}({','.join(_text(element, digests) for element in value)})"
    if isinstance(value, (bool, int, float, complex, str, bytes, type(None), np.generic)):
        return repr(value)
    if isinstance(value, dict):
        return f"dict({','.join(f'{name}:{_text(element, digests)}' for name, element in value.items())})"
    if isinstance(value, type):
        return f"{value.__module__}.{value.__qualname__}{getattr(value, '_fields', '')}"
    return f"{type(value).__qualname__} {getattr(value, '__name__', '')}"


def _syntax_of(function: Any) -> str:
    code = function.__code__
    node = _functions_in(code.co_filename).get((code.co_firstlineno, function.__name__))
    return _syntax(node) if node is not None else code.co_code.hex() + repr(code.co_consts)


@functools.cache
def _functions_in(file: str) -> dict[tuple[int, str], ast.FunctionDef]:
    """The functions of a file by their first line and name; none of a file that is not there."""
    try:
        tree = ast.parse(Path(file).read_bytes())
    except (OSError, SyntaxError, ValueError):
        return {}
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return {(min([node.lineno, *(mark.lineno for mark in node.decorator_list)]), node.name): node for node in functions}


def _syntax(node: Any) -> str:
    """Text of a syntax tree, the same in every version of Python: what is empty is left out."""
    if isinstance(node, list):
        return f"[{','.join(map(_syntax, node))}]"
    if not isinstance(node, ast.AST):
        return repr(node)
    fields = []
    for name, value in ast.iter_fields(node):
        if name == "body" and isinstance(node, DOCUMENTED) and isinstance(value, list):
            value = value[ast.get_docstring(node, clean=False) is not None :]  # type: ignore[arg-type]
        if name not in SILENT and value is not None and value != []:
            fields.append(f"{name}={_syntax(value)}")
    return f"{type(node).__name__}({','.join(fields)})"
