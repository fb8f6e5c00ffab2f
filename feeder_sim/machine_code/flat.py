"""The arguments and the result of an entry point as two arrays of numbers, which is all that machine code is given.

    integers   in the order of the arguments: numbers, and of every array its address and its shape
    floats     numbers

What was flattened is described by a text, such as `Span(f,f,f),r0c1f2a3b:1,n`: by this text the machine code is chosen,
and from it and the types follows the function that puts the arguments together again and calls the entry point.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

_dtypes: dict[int, tuple[np.dtype[Any], str]] = {}  # by identity: a record's own hash goes over all of its fields
MANY_DTYPES = 1000
_BYTE: Any = ctypes.c_char


@dataclass(slots=True)
class Flat:
    """Numbers of arguments, the text that describes them, and the arrays among them, by address and shape."""

    texts: list[str] = field(default_factory=list)
    integers: array[int] = field(default_factory=lambda: array("q"))
    floats: array[float] = field(default_factory=lambda: array("d"))
    arrays: list[dict[tuple[int, tuple[int, ...]], NDArray[Any]]] = field(default_factory=lambda: [{}])

    @property
    def text(self) -> str:
        return "".join(self.texts)


def dtype_text(dtype: np.dtype[Any]) -> str:
    """Short text of a type of elements: of a record a hash of its fields."""
    known = _dtypes.get(id(dtype))
    if known is not None:
        return known[1]
    text = dtype.str
    if dtype.names is not None:
        text = f"r{hashlib.sha256(repr(fields_of(dtype)).encode()).hexdigest()[:12]}"
    if len(_dtypes) < MANY_DTYPES:
        _dtypes[id(dtype)] = dtype, text  # which keeps it, so that no other gets its identity
    return text


@functools.cache
def class_text(kind: Any) -> str:
    """Short text of the class of a named tuple, a hash of its fields with it; empty for another tuple."""
    return "" if kind is None else f"{kind.__name__}{hashlib.sha256(repr(kind._fields).encode()).hexdigest()[:6]}"


def fields_of(dtype: np.dtype[Any]) -> Any:
    """Names, types, shapes and offsets of the fields of a record, which numpy's own text does not tell in full."""
    if dtype.subdtype is not None:
        return fields_of(dtype.subdtype[0]), dtype.subdtype[1]
    if dtype.fields is None:
        return dtype.str
    return [(name, fields_of(kind), at) for name, (kind, at, *_) in dtype.fields.items()], dtype.itemsize


def variant_name(entry: Any, text: str) -> str:
    """Name of the machine code of an entry point for arguments of such types."""
    return f"{entry.__name__}_{hashlib.sha256(text.encode()).hexdigest()[:16]}"


def flattened(arguments: tuple[Any, ...]) -> Flat:
    """Flatten the arguments of an entry point.

    Raises:
        TypeError: an argument is no number, array without gaps, None or tuple of them.
    """
    flat = Flat()
    for argument in arguments:
        _flatten(argument, flat)
        flat.texts.append(",")
    return flat


class Lasting:
    """A named tuple that remembers its numbers, see `lasting`."""

    flat: Flat | None = None


def lasting(value: Any) -> Any:
    """The same named tuple, whose numbers are remembered once it has been flattened.

    For those that are arguments again and again: of hundreds of arrays each takes half a microsecond. Its arrays stay
    where they are for as long as it lives.
    """
    kind: Any = own_class(value)
    return _lasting(kind)(*value)


@functools.cache
def _lasting(kind: Any) -> Any:
    return type(kind.__name__, (kind, Lasting), {"lasting": kind})


def own_class(value: Any) -> Any:
    """The class of a named tuple, and None of another tuple."""
    return getattr(value, "lasting", type(value)) if hasattr(value, "_fields") else None


def _flatten(value: Any, flat: Flat) -> None:
    kind = type(value)
    if isinstance(value, np.ndarray):
        if not value.flags.c_contiguous:
            raise TypeError(f"an array of shape {value.shape} has gaps; compiled functions take arrays without")
        flat.texts.append(f"{dtype_text(value.dtype)}:{value.ndim}")
        address, shape = address_of(value), value.shape
        flat.integers.append(address)
        flat.integers.extend(shape)
        flat.arrays[0][address, shape] = value
    elif kind is float or isinstance(value, np.floating):
        flat.texts.append("f")
        flat.floats.append(value)
    elif value is None:
        flat.texts.append("n")
    elif kind is bool or isinstance(value, np.bool_):
        flat.texts.append("b")
        flat.integers.append(int(value))
    elif kind is int or isinstance(value, np.integer):
        flat.texts.append("i")
        flat.integers.append(value)
    elif isinstance(value, Lasting):
        if value.flat is None:
            block = Flat()
            _flatten_tuple(value, block)
            block.texts = [block.text]
            value.flat = block
        flat.texts += value.flat.texts
        flat.integers += value.flat.integers
        flat.floats += value.flat.floats
        flat.arrays += value.flat.arrays
    elif isinstance(value, tuple):
        _flatten_tuple(value, flat)
    else:
        raise TypeError(f"a {kind.__name__} is nothing that compiled functions take")


def _flatten_tuple(value: Any, flat: Flat) -> None:
    flat.texts.append(f"{class_text(own_class(value))}(")
    for element in value:
        _flatten(element, flat)
        flat.texts.append(",")
    flat.texts.append(")")


def address_of(elements: NDArray[Any]) -> int:
    """Where the elements of an array lie."""
    if elements.size and elements.dtype.names is None:
        with contextlib.suppress(TypeError, ValueError, BufferError):  # it cannot be written to
            return ctypes.addressof(_BYTE.from_buffer(elements))  # three times as fast as numpy's own attribute
    return elements.ctypes.data


@dataclass
class Source:
    """Text of the arguments put together from the numbers, and the classes and types that it names."""

    scope: dict[str, Any]
    integers: int = 0
    floats: int = 0

    def named(self, value: Any) -> str:
        name = f"_{len(self.scope)}"
        self.scope[name] = value
        return name

    def argument(self, kind: Kind) -> str:
        """Text of one argument; the numbers are taken in the order in which `flattened` lays them down."""
        if kind.of == "none":
            return "None"
        if kind.of == "array":
            first, self.integers = self.integers, self.integers + 1 + kind.ndim
            shape = "".join(f"integers[{first + 1 + axis}], " for axis in range(kind.ndim))
            return f"carray(pointer(integers[{first}]), ({shape}), {self.named(kind.type)})"
        if kind.of == "tuple":
            elements = "".join(f"{self.argument(inner)}, " for inner in kind.inner)
            return f"{'' if kind.type is None else self.named(kind.type)}({elements})"
        if kind.of == "float":
            self.floats += 1
            return f"floats[{self.floats - 1}]"
        self.integers += 1
        return f"integers[{self.integers - 1}]" + (" != 0" if kind.of == "bool" else "")

    def stored(self, kind: Kind, value: str) -> list[str]:
        """Statements that lay down a result of a kind, of which `value` is the text."""
        if kind.of == "tuple":
            return [line for i, inner in enumerate(kind.inner) for line in self.stored(inner, f"{value}[{i}]")]
        if kind.of == "float":
            self.floats += 1
            return [f"floats[{self.floats - 1}] = {value}"]
        if kind.of == "none":
            return []
        numbers = [value]
        if kind.of == "array":
            numbers = [f"owner({value})", f"{value}.ctypes.data", *(f"{value}.shape[{i}]" for i in range(kind.ndim))]
        self.integers += len(numbers)
        first = self.integers - len(numbers)
        return [f"integers[{first + i}] = {number}" for i, number in enumerate(numbers)]


@dataclass(frozen=True)
class Kind:
    """What an argument or a result is: "none", "bool", "integer", "float", "array", or a "tuple" of `inner` kinds.

    type: of the elements of an array, or the class of a named tuple.
    """

    of: str
    type: Any = None
    ndim: int = 0
    inner: tuple[Kind, ...] = ()

    @property
    def integers(self) -> int:
        """How many integers hold it; an array has its owner, address and shape."""
        own = {"bool": 1, "integer": 1, "array": 2 + self.ndim}.get(self.of, 0)
        return own + sum(kind.integers for kind in self.inner)

    @property
    def floats(self) -> int:
        return (self.of == "float") + sum(kind.floats for kind in self.inner)


def kind_of(value: Any) -> Kind:
    """The kind of an argument that `flattened` takes."""
    if isinstance(value, np.ndarray):
        return Kind("array", value.dtype, value.ndim)
    if isinstance(value, tuple):
        return Kind("tuple", own_class(value), inner=tuple(map(kind_of, value)))
    if isinstance(value, (bool, np.bool_)):
        return Kind("bool")
    if isinstance(value, (int, np.integer)):
        return Kind("integer")
    return Kind("none" if value is None else "float")


@dataclass(frozen=True)
class Result:
    """Room for what an entry point returns, behind its arguments, and how it is taken out of there.

    release: gives an array back that the machine code has made, by its owner; or an object that does so as it goes.
    """

    kind: Kind
    release: Callable[[int], Any]

    @functools.cached_property
    def room(self) -> tuple[array[int], array[float]]:
        return array("q", [0] * self.kind.integers), array("d", [0.0] * self.kind.floats)

    def value(self, flat: Flat) -> Any:
        """What was returned, behind the arguments; arrays among them are themselves, others are copied."""
        if self.kind.of == "none":
            return None
        integers, floats = self.room
        rest = flat.integers[len(flat.integers) - len(integers) :], flat.floats[len(flat.floats) - len(floats) :]
        return self._value(self.kind, flat, iter(rest[0]), iter(rest[1]))

    def _value(self, kind: Kind, flat: Flat, integers: Iterator[int], floats: Iterator[float]) -> Any:
        if kind.of == "tuple":
            elements = [self._value(inner, flat, integers, floats) for inner in kind.inner]
            return tuple(elements) if kind.type is None else kind.type(*elements)
        if kind.of == "array":
            owner, address, *shape = (next(integers) for _ in range(2 + kind.ndim))
            if owner == 0:
                place = address, tuple(shape)
                return next(arrays[place] for arrays in flat.arrays if place in arrays)
            copy: NDArray[Any] = np.empty(shape, kind.type)
            if copy.size:
                ctypes.memmove(copy.ctypes.data, address, copy.nbytes)
            self.release(owner)
            return copy
        if kind.of == "none":
            return None
        if kind.of == "float":
            return next(floats)
        return bool(next(integers)) if kind.of == "bool" else next(integers)
