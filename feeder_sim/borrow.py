"""Arrays that compiled code does not count references to.

Numba counts the references to every array that a function takes out of a tuple or slices, with atomic operations; in
the inner loops that costs more than the arithmetic, and threads wait for each other over it. Arrays without a
record of who owns them are not counted. The caller must hold the real ones for as long as the borrowed ones are used.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils, types
from numba.extending import intrinsic

_intrinsic: Any = intrinsic  # whose stubs take the first argument for the caller's


@_intrinsic
def borrow(typingctx, value):
    """The same array, uncounted; or a tuple with all its arrays borrowed, also those of tuples in it."""

    def generate(context, builder, signature, arguments):
        return _borrowed(context, builder, value, arguments[0])

    return value(value), generate


def _borrowed(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Machine code of a value without the owners of its arrays."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        for owner in ("meminfo", "parent"):
            setattr(array, owner, cgutils.get_null_value(getattr(array, owner).type))
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        kinds: Any = kind  # whose stubs know no elements
        elements = zip(kinds, cgutils.unpack_tuple(builder, value, len(kinds)), strict=True)
        return context.make_tuple(builder, kind, [_borrowed(context, builder, *element) for element in elements])
    return value
