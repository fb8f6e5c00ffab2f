"""Machine code that was built before: a shared library for each variant of an entry point, and an index of them.

    linux_x86_64_v3/NAME.so      a C function of two arrays
    linux_x86_64_v3/index.json   of every variant its key, what it returns, and a hash

They depend on neither numba nor the version of Python. What has another key by now is compiled, as is everything on
another platform or processor, and where FEEDER_SIM_COMPILE is set.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import importlib
import json
import os
import platform
import sys
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.machine_code.flat import Kind, Result, variant_name
from feeder_sim.machine_code.key import key_of

FOLDER = Path(__file__).with_name("linux_x86_64_v3")
FEATURES = ("AVX2", "BMI2", "FMA3", "LZCNT", "MOVBE")  # of the processors that they are for, by numpy's names
RELEASE = "feeder_sim_release"  # symbol of the function that gives back an array


def built_variant(entry: Any, text: str) -> tuple[Callable[[Any, Any], Any], Result] | None:
    """The machine code of an entry point for arguments of such types, and what it returns; None if it is not there."""
    name = variant_name(entry, text)
    if name not in _index() or _index()[name]["key"] != key_of(entry):
        return None
    file = FOLDER / f"{name}.so"
    try:
        if file_hash(file) != _index()[name]["hash"]:
            return None  # to open half a library would end the process
        code = ctypes.CDLL(str(file))
    except OSError:  # not there, made with a younger C library, or a library that it calls is not there
        return None
    function, release = getattr(code, name), getattr(code, RELEASE)
    release.argtypes = (ctypes.c_void_p,)
    function.argtypes = (ctypes.c_void_p, ctypes.c_void_p)

    def call(integers: array[int], floats: array[float]) -> None:
        if status := function(integers.buffer_info()[0], floats.buffer_info()[0]):
            raise RuntimeError(f"{entry.__name__} ended with status {status}")

    return call, Result(kind_from(_index()[name]["returns"]), release)


@functools.cache
def _index() -> dict[str, Any]:
    if os.environ.get("FEEDER_SIM_COMPILE") or not fits():
        return {}
    try:
        return dict(json.loads((FOLDER / "index.json").read_text(encoding="ascii")))
    except (OSError, ValueError):  # nothing has been built
        return {}


def file_hash(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()[:24]


def fits() -> bool:
    """Whether the libraries are for this platform and processor."""
    features = np._core._multiarray_umath.__cpu_features__  # type: ignore[attr-defined]
    platform_fits = sys.platform == "linux" and platform.machine() == "x86_64"
    return platform_fits and all(features.get(name, True) for name in FEATURES) and features.get("AVX2", False)


def kind_to(kind: Kind) -> list[Any]:
    """A kind as the index holds it."""
    own: Any = None
    if kind.of == "array":
        own = _dtype_to(kind.type)
    elif kind.type is not None:
        own = f"{kind.type.__module__}:{kind.type.__qualname__}"
    return [kind.of, own, kind.ndim, [kind_to(inner) for inner in kind.inner]]


def kind_from(text: list[Any]) -> Kind:
    """A kind as the index holds it."""
    of, own, ndim, inner = text
    if of == "array":
        own = _dtype_from(own)
    elif own is not None:
        module, _, name = own.partition(":")
        own = getattr(importlib.import_module(module), name)
    return Kind(of, own, ndim, tuple(map(kind_from, inner)))


def _dtype_to(dtype: np.dtype[Any]) -> Any:
    """A type of elements in JSON: numpy's own text says nothing of alignment, by which machine code goes."""
    if dtype.subdtype is not None:
        return [_dtype_to(dtype.subdtype[0]), list(dtype.subdtype[1])]
    if dtype.fields is None:
        return dtype.str
    fields = {"names": list(dtype.fields), "formats": [_dtype_to(kind) for kind, *_ in dtype.fields.values()]}
    layout = {"offsets": [at for _, at, *_ in dtype.fields.values()], "itemsize": dtype.itemsize}
    return fields | layout | {"aligned": dtype.isalignedstruct}


def _dtype_from(text: Any) -> np.dtype[Any]:
    if isinstance(text, str):
        return np.dtype(text)
    if isinstance(text, list):
        return np.dtype((_dtype_from(text[0]), tuple(text[1])))
    fields = text | {"formats": [_dtype_from(kind) for kind in text["formats"]]}
    return np.dtype(fields, align=fields.pop("aligned"))
