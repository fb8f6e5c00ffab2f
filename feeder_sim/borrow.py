"""Arrays that compiled code does not count references to.

Numba counts the references to every array that a function takes out of a tuple or slices, with atomic operations; in
the inner loops that costs more than the arithmetic, and threads wait for each other over it. Arrays made from bare
addresses are not counted. The caller must hold the real ones for as long as the borrowed ones are used.
"""

from __future__ import annotations

from numba import carray, types  # type: ignore[attr-defined]
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic, overload

from feeder_sim.machine_code import compiled


@intrinsic
def _as_pointer(typingctx, address):
    def generate(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(address), generate


@compiled
def borrowed(array):
    """The same contiguous array, uncounted."""
    return carray(_as_pointer(array.ctypes.data), array.shape, array.dtype)  # type: ignore[call-arg]


def borrow(fields):
    """A named tuple with all its arrays borrowed, also those of named tuples in it; None stays None."""
    raise NotImplementedError("for compiled code only")


@overload(borrow, strict=False)
def _borrow(fields):
    if isinstance(fields, types.NoneType):
        return lambda fields: None
    tuple_class = fields.instance_class
    lent = []
    for name, kind in zip(fields.fields, fields.types, strict=True):
        if isinstance(kind, types.Array):
            if kind.layout != "C":  # a bare address says nothing of strides
                raise TypingError(f"{tuple_class.__name__}.{name} is not a contiguous array in C order")
            lent.append(f"borrowed(fields.{name})")
        elif isinstance(kind, types.NamedTuple) or isinstance(getattr(kind, "dtype", None), types.Array):
            lent.append(f"borrow(fields.{name})")
        else:
            lent.append(f"fields.{name}")
    scope = {"borrowed": borrowed, "borrow": borrow, "tuple_class": tuple_class}
    exec(f"def lend(fields):\n    return tuple_class({', '.join(lent)})\n", scope)
    return scope["lend"]
