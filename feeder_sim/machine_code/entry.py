"""Functions that Python calls, compiled with all that they call when they are called for the first time."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Any, TypeVar

from feeder_sim.machine_code.flat import Result, flattened
from feeder_sim.machine_code.library import built_variant

F = TypeVar("F", bound=Callable[..., Any])
_compiling = threading.RLock()


def entry_point(function: F) -> F:
    """Compile a function that Python calls, with all that it calls, and keep its machine code between runs.

    It runs without Python's lock, and divides by zero as IEEE arithmetic does. It takes numbers, arrays without gaps,
    and tuples of them, and does not count references to the arrays, which costs the inner loops more than arithmetic.
    """
    return EntryPoint(function)  # type: ignore[return-value]


def _variant(function: Any, arguments: tuple[Any, ...], text: str) -> tuple[Callable[[Any, Any], Any], Result]:
    """Machine code that was built before, or else is compiled; numba is imported only for that."""
    built = built_variant(function, text)
    if built is not None:
        return built
    from feeder_sim.machine_code import jit

    return jit.variant(function, arguments, text)


class EntryPoint:
    """A function that is compiled for every combination of types that it is called with."""

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self.__name__, self.py_func = function.__name__, function
        self.variants: dict[str, tuple[Callable[[Any, Any], Any], Result]] = {}

    def __call__(self, *arguments: Any) -> Any:
        flat = flattened(arguments)
        variant = self.variants.get(flat.text)
        if variant is None:
            with _compiling:
                if flat.text not in self.variants:
                    self.variants[flat.text] = _variant(self.py_func, arguments, flat.text)
            variant = self.variants[flat.text]
        call, result = variant
        integers, floats = result.room
        flat.integers += integers
        flat.floats += floats
        call(flat.integers, flat.floats)
        return result.value(flat)
