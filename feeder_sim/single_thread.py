"""Linear algebra on one thread: its last bits must not depend on the number of cores.

For small matrices further threads only cost time: they wait for work in a loop.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def single_threaded(function: Callable[P, T]) -> Callable[P, T]:
    """The function, in which NumPy and SciPy solve and multiply matrices on one thread."""

    @functools.wraps(function)
    def alone(*args: P.args, **kwargs: P.kwargs) -> T:
        with _libraries().limit(limits=1):
            return function(*args, **kwargs)

    return alone


@functools.cache
def _libraries() -> Any:
    """The libraries of linear algebra that NumPy and SciPy have loaded."""
    import scipy.linalg  # noqa: F401 - only libraries that are loaded can be limited
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api="blas")
