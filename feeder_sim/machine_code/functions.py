"""Marks on functions that only compiled functions call, which note them and no more."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar

# Options of numba. Of inner functions it has to be said that they are not copied: numba compiles a function when it
# comes to a call of it, and then takes over from the caller that it is to be copied. All engines became one function
# in this way.
OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}  # nothing calls them from C
INNER = OPTIONS | {"no_cpython_wrapper": True, "forceinline": False}
COMPILED = [0]  # inner functions in this process, also those that a killed one has left, for who waits for it
OVERLOADS: dict[Any, list[tuple[Any, dict[str, Any]]]] = {}  # of a function, by the types of its arguments
# How names of fields of records begin that stand for functions of other packages: libraries hold no code of those.
FOREIGN = "own_law_"
F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Compile a function that only compiled functions call.

    Its machine code is part of theirs. That it has none of its own, and no way in from Python, saves a third of the
    time that compilation takes.
    """
    return Inner(function, INNER)  # type: ignore[return-value]


def uncounted(function: F) -> F:
    """As `compiled`, for functions that make no array and call none that does: no references to arrays are counted."""
    return Inner(function, INNER | {"_nrt": False})  # type: ignore[return-value]


def inlined(function: F) -> F:
    """As `uncounted`, and copied into every function that calls it: for what the inner loops call most."""
    return Inner(function, INNER | {"_nrt": False, "forceinline": True})  # type: ignore[return-value]


def overload(function: Any, **options: Any) -> Callable[[F], F]:
    """As numba's: the decorated function chooses what is compiled for a call of `function`, by types of arguments."""

    def note(chooser: F) -> F:
        OVERLOADS.setdefault(function, []).append((chooser, options))
        return chooser

    return note


def is_none(kind: Any) -> bool:
    """Whether a type of numba's, which the chooser of an overload is given, is that of None."""
    from numba.core import types

    return isinstance(kind, types.NoneType)


def borrow(value):
    """The same array without a record of who owns it, or a tuple with all its arrays so.

    References to those are not counted, which costs the inner loops more than their arithmetic. The caller must hold
    the real ones for as long as the borrowed ones are used. Arguments of an entry point are such arrays.
    """
    raise NotImplementedError("for compiled code only")


class External:
    """A function of C that compiled code calls by its name.

    Args:
        name: symbol.
        kinds: of what it returns and then of its arguments, names of numba's types such as "float64" and "voidptr".
    """

    def __init__(self, name: str, *kinds: str) -> None:
        self.name, self.kinds = name, kinds

    def __call__(self, *_: Any) -> Any:
        raise TypeError(f"{self.name} is for compiled functions only")


external = External


class Inner:
    """A compiled function without a way in from Python; `py_func` is the function itself."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func, self.options = function, options

    def __call__(self, *_: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is for compiled functions only")
