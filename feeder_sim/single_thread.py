"""Linear algebra on one thread: its last bits must not depend on the number of cores.

For small matrices further threads only cost time: they wait for work in a loop.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def single_threaded(function: Callable[P, T]) -> Callable[P, T]:
    """The function, in which NumPy solves and multiplies matrices on one thread, and so does SciPy if it is loaded."""

    @functools.wraps(function)
    def alone(*args: P.args, **kwargs: P.kwargs) -> T:
        with _libraries("scipy.linalg" in sys.modules).limit(limits=1):
            return function(*args, **kwargs)

    return alone


def solver_single_threaded(function: Callable[P, T]) -> Callable[P, T]:
    """As `single_threaded`, of a function that solves by SciPy: only a library that is loaded can be limited."""
    limited = single_threaded(function)

    @functools.wraps(function)
    def loaded(*args: P.args, **kwargs: P.kwargs) -> T:
        import scipy.linalg  # noqa: F401

        return limited(*args, **kwargs)

    return loaded


@functools.cache
def _libraries(with_scipy: bool) -> Any:
    """The libraries of linear algebra that are loaded."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api="blas")
