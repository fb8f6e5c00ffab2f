"""Compilation by numba, and where its machine code is kept between runs.

Numba's own cache looks only at the file of a function itself, so that it runs old code after a change in a function or
a constant that this one uses from another file. Here the name of a file of machine code holds the key of its function,
and its folder that of the libraries that compile it or are called by it, and of the processor. The folders are in the
user's folder for caches, or where NUMBA_CACHE_DIR says; the few used last are kept.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import importlib.metadata
import itertools
import math
import os
import pickle
import platform
import shutil
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, cast

import llvmlite.binding
import numba
import numba.extending
import numpy as np
from filelock import FileLock
from numba import carray  # type: ignore[attr-defined]
from numba.core import cgutils, targetconfig, types
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.runtime.nrt import MemInfo
from numba.core.typing.typeof import typeof_impl
from numba.np.numpy_support import as_dtype, from_dtype

from feeder_sim.machine_code.flat import Kind, Result, Source, kind_of, variant_name
from feeder_sim.machine_code.functions import COMPILED, INNER, OPTIONS, OVERLOADS, External, Inner, borrow
from feeder_sim.machine_code.key import LENGTH, base_folder, key_of

MOST_FOLDERS = 4  # of other libraries and processors
MOST_STATES = 4  # of the machine code of a function: two checkouts, a change and a way back
LIBRARIES = ("numba", "llvmlite", "numpy", "mujoco")
# Folder of inner functions whose entry point is not compiled yet, so that a killed process loses little.
PARTS = "parts"
# Parts of numba's inside that an ingredient replaces; without them inner functions are compiled as any other.
INGREDIENTS = all(
    hasattr(JITCodeLibrary, name)
    for name in ("_optimize_final_module", "_finalize_final_module", "_finalize_dynamic_globals", "_ensure_finalized")
) and tuple(map(int, numba.__version__.split(".")[:2])) >= (0, 62)
# In machine code numba names a version of a function by the number at which it was compiled and by the types it takes,
# a record by another number. Both counts begin at 1 in every process. So two versions that two processes have compiled
# may bear the same name, and a third process that loads both runs one of them for the other. It does not where every
# process counts from somewhere else.
DISTINCT_NAMES = hasattr(FunctionIdentity, "_unique_ids")  # without it no machine code is kept
if DISTINCT_NAMES:
    FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(5), "big"))
STORES_PARTS = INGREDIENTS and DISTINCT_NAMES
# What reading a damaged file of the cache ends in, or one that names a type of a script that is not here.
DAMAGED = (AttributeError, EOFError, ImportError, ValueError, pickle.UnpicklingError)
TWO_ARRAYS = (types.int64[::1], types.float64[::1])
_njit: Any = numba.njit  # whose stubs do not know all options
_intrinsic: Any = numba.extending.intrinsic  # whose stubs take the first argument for the caller's


class Variant(NamedTuple):
    """An entry point with arguments of certain types, of which the text is that of `flat`."""

    entry: Any
    text: str
    arguments: tuple[Kind, ...]

    @property
    def name(self) -> str:
        return variant_name(self.entry, self.text)


def variant(entry: Any, arguments: tuple[Any, ...], text: str) -> tuple[Callable[[Any, Any], Any], Result]:
    """Compile an entry point for arguments of such types, or load it: a function of two arrays, and what it returns."""
    dispatcher, kind = made(Variant(entry, text, tuple(map(kind_of, arguments))))
    return functools.partial(_call, dispatcher), Result(kind, MemInfo)


def _call(dispatcher: Any, integers: array[int], floats: array[float]) -> None:
    dispatcher(np.asarray(integers), np.asarray(floats))


def made(variant: Variant) -> tuple[Any, Kind]:
    """Numba's dispatcher of the function of two arrays, compiled, and the kind of what it returns."""
    inner_function = Inner(variant.entry, INNER)
    kind = _returned(variant, inner_function)
    source = Source({"carray": carray, "pointer": pointer, "owner": owner_of, "inner": inner_function})
    call = f"inner({', '.join(map(source.argument, variant.arguments))})"
    lines = [f"result = {call}", *source.stored(kind, "result")]
    code = f"def {variant.name}(integers, floats):\n" + "".join(f"    {line}\n" for line in lines)
    exec(compile(code, variant.entry.__code__.co_filename, "exec"), source.scope)
    function = source.scope[variant.name]
    function.__module__, function.stands_for = variant.entry.__module__, variant.entry
    dispatcher = callable_from_python(function)
    dispatcher.compile(TWO_ARRAYS)
    return dispatcher, kind


def _returned(variant: Variant, inner_function: Inner) -> Kind:
    """What an entry point returns, by the types of its arguments.

    It is kept beside the machine code, since it takes all of its compilation to say; with it what the variant is, for
    who builds a library of all that were needed.
    """
    entry = variant.entry
    file = f"{Path(entry.__code__.co_filename).stem}.{variant.name}-{entry.__module__}-{key_of(entry)}.variant"
    place = code_folder() / file
    with contextlib.suppress(OSError, *DAMAGED):
        stored = pickle.loads(place.read_bytes())
        if isinstance(stored[-1], Kind):
            return stored[-1]
    kind = returned_by(inner_function, variant.arguments)
    with contextlib.suppress(OSError, AttributeError, pickle.PicklingError):  # of a class within a function
        partial = place.with_name(f"{place.name}.{os.getpid()}")
        partial.write_bytes(pickle.dumps((variant.text, variant.arguments, kind)))
        partial.replace(place)
    return kind


def returned_by(function: Inner, arguments: tuple[Kind, ...]) -> Kind:
    """What a function that only compiled functions call returns for arguments of such types; it is compiled for them.

    Raises:
        NumbaError: it cannot be.
    """
    signature, dispatcher = tuple(map(type_of, arguments)), dispatcher_of(function)
    dispatcher.compile(signature)
    return _kind_of(dispatcher.overloads[signature].signature.return_type)


def type_of(kind: Kind) -> Any:
    """Numba's type of a kind, as compiled code puts it together."""
    if kind.of == "array":
        return types.Array(from_dtype(kind.type), kind.ndim, "C")
    if kind.of == "tuple":
        return types.BaseTuple.from_types([type_of(inner) for inner in kind.inner], kind.type)
    return {"bool": types.boolean, "integer": types.int64, "float": types.float64, "none": types.none}[kind.of]


def _kind_of(kind: Any) -> Kind:
    if isinstance(kind, types.Array):
        return Kind("array", as_dtype(kind.dtype), kind.ndim)
    if isinstance(kind, types.BaseTuple):
        inner_kinds: Any = kind  # whose stubs know no elements
        return Kind("tuple", getattr(kind, "instance_class", None), inner=tuple(map(_kind_of, inner_kinds)))
    for of, numbers in (("bool", types.Boolean), ("integer", types.Integer), ("float", types.Float)):
        if isinstance(kind, numbers):
            return Kind(of)
    if isinstance(kind, types.NoneType):
        return Kind("none")
    raise TypeError(f"an entry point cannot return {kind}")


@_intrinsic
def pointer(typingctx, address):
    """An address as what `carray` takes."""

    def generate(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(types.int64), generate


@_intrinsic
def owner_of(typingctx, array):
    """Address of the record of who owns an array, which then lives on until it is released; 0 of one from outside."""

    def generate(context, builder, signature, arguments):
        context.nrt.incref(builder, array, arguments[0])
        record = context.make_array(array)(context, builder, arguments[0]).meminfo
        return builder.ptrtoint(record, context.get_value_type(types.int64))

    return types.int64(array), generate


@numba.extending.overload(borrow)
def _borrowed(value):
    return lambda value: lend(value)


@_intrinsic
def lend(typingctx, value):
    """See `borrow`."""

    def generate(context, builder, signature, arguments):
        return _without_owners(context, builder, value, arguments[0])

    return value(value), generate


def _without_owners(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        for owner in ("meminfo", "parent"):
            setattr(array, owner, cgutils.get_null_value(getattr(array, owner).type))
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        kinds: Any = kind  # whose stubs know no elements
        elements = zip(kinds, cgutils.unpack_tuple(builder, value, len(kinds)), strict=True)
        return context.make_tuple(builder, kind, [_without_owners(context, builder, *element) for element in elements])
    return value


def callable_from_python(function: Callable[..., Any]) -> Any:
    """Numba's dispatcher of a function and of all that it calls; its machine code is kept between runs."""
    register_overloads()
    dispatcher = _njit(**OPTIONS)(function)
    dispatcher.__class__ = _EntryPoint
    if DISTINCT_NAMES:
        dispatcher._cache = _EntryCache(function)
    return dispatcher


@functools.cache
def dispatcher_of(function: Inner) -> Any:
    """Numba's dispatcher of a function that only compiled functions call."""
    register_overloads()
    dispatcher = _njit(**function.options)(function.py_func)
    dispatcher.__class__ = _Inner
    return dispatcher


@typeof_impl.register(Inner)
def _type_of_inner(function: Inner, _: Any) -> Any:
    return dispatcher_of(function)._numba_type_


@typeof_impl.register(External)
def _type_of_external(function: External, _: Any) -> Any:
    returned, *arguments = (getattr(types, kind) for kind in function.kinds)
    return types.ExternalFunction(function.name, returned(*arguments))


_registered: set[Any] = set()


def register_overloads() -> None:
    """Tell numba of the overloads that have been noted since."""
    for function, choosers in list(OVERLOADS.items()):
        for chooser, options in choosers:
            if chooser not in _registered:
                _registered.add(chooser)
                numba.extending.overload(function, jit_options=cast(Any, options))(chooser)


class _EntryPoint(CPUDispatcher):
    def compile(self, sig: Any) -> Any:
        """Compile without collecting garbage, which would look through all that the compiler holds, again and again."""
        collecting = gc.isenabled()
        gc.disable()
        try:
            with _compiled_into(self, _Whole if INGREDIENTS else JITCodeLibrary):
                return super().compile(sig)
        finally:
            if collecting:
                gc.enable()


class _Inner(CPUDispatcher):
    """A compiled function without a way in from Python, where a call would end the process."""

    _cache: Any  # none, until it has to be compiled

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """A constant as an argument makes no version of its own, as which numba would compile it first."""
        return super().get_call_template([types.unliteral(kind) for kind in args], kws)

    def compile(self, sig: Any) -> Any:
        if sig in self.overloads:
            return super().compile(sig)
        if STORES_PARTS and not isinstance(self._cache, _PartCache):
            self._cache = _PartCache(self.py_func)  # here and not on import, when nothing may have to be compiled
        with _compiled_into(self, _Ingredient if INGREDIENTS else JITCodeLibrary):
            made = super().compile(sig)
        COMPILED[0] += 1
        return made


class _Whole(JITCodeLibrary):
    """Code of an entry point, which no compiled function calls: what others would need to copy it is not kept.

    Reading that takes as long as linking the machine code.
    """

    def serialize_using_object_code(self) -> Any:
        name, kind, (machine_code, _) = super().serialize_using_object_code()
        nothing = llvmlite.binding.parse_assembly(str(self._codegen._create_empty_module(name)))
        return name, kind, (machine_code, nothing.as_bitcode())

    def get_pointer_to_function(self, name: str) -> int:
        """Its address; numba would look the name up in what is not kept."""
        self._ensure_finalized()
        return int(self._codegen._engine.get_function_address(name))


class _Ingredient(JITCodeLibrary):
    """Code of an inner function, which is copied into what calls it and becomes machine code there only.

    Numba would optimise it in full and make machine code of it, and of its copies again in every function on the way to
    the entry point, which takes a third of the time of compilation.
    """

    @property
    def codegen(self) -> Any:
        return _WithoutAddresses(self._codegen)

    def _optimize_final_module(self) -> None:
        light = self._codegen._module_pass_manager(
            loop_vectorize=self._codegen._loopvect, slp_vectorize=False, opt=self._codegen._opt_level, cost="cheap"
        )
        manager, builder = light
        manager.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """The code itself, with functions that may be there more than once; numba would change a copy of it."""
        self._ensure_finalized()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvmlite.binding.Linkage.external:
                function.linkage = "linkonce_odr"
        return self._final_module

    def serialize_using_object_code(self) -> Any:
        """Its code as it is: there is no machine code."""
        return self.serialize_using_bitcode()

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0


class _WithoutAddresses:
    """Numba's code generator, for code that has no address yet."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, env_name: str, env: Any) -> None:
        """Nothing: the environment is for exceptions and printing."""


@contextlib.contextmanager
def _compiled_into(dispatcher: Any, kind: type[JITCodeLibrary]) -> Iterator[None]:
    """Numba puts what it compiles into libraries of this kind."""
    codegen = dispatcher.targetctx.codegen()
    with global_compiler_lock:
        before = codegen._library_class
        codegen._library_class = kind
        _Calls.get_call_type = _remembered
        try:
            yield
        finally:
            codegen._library_class = before
            _Calls.get_call_type = _resolve


_Calls: Any = types.BaseFunction
_resolve = _Calls.get_call_type


def _remembered(function: Any, context: Any, args: Any, keywords: Any) -> Any:
    """What a call of a library's function is with these types, asked once: a tenth of the time of compilation.

    Nearly all calls are sums, products and comparisons of the same few types, for each of which numba tries tens of
    ways to read it.
    """
    flags = targetconfig.ConfigStack.top_or_none()
    flag_texts = () if flags is None else tuple(sorted((name, str(value)) for name, value in flags._values.items()))
    key = context, tuple(args), tuple(keywords.items()), flag_texts
    known = function.__dict__.setdefault("_feeder_sim_calls", {})
    if key not in known:
        signature = _resolve(function, context, args, keywords)
        known[key] = signature, function._impl_keys[signature.args]
    signature, function._impl_keys[signature.args] = known[key]
    return signature


@functools.cache
def code_folder() -> Path:
    """The folder of the machine code of these sources, libraries and this processor; others are removed here."""
    folder = base_folder() / "machine_code" / code_key()
    with contextlib.suppress(OSError):  # a folder that cannot be made: everything is compiled in every process
        folder.mkdir(parents=True, exist_ok=True)
        folder.touch()
        remove_old_folders(folder.parent)
    return folder


def code_key() -> str:
    """Hash of what machine code depends on besides its functions: libraries, processor, version of Python."""
    versions = {name: _version(name) for name in LIBRARIES}
    processor = (llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten())
    return hashlib.sha256(repr((versions, processor, platform.python_version())).encode()).hexdigest()[:LENGTH]


def remove_old_folders(base: Path) -> None:
    """Remove machine code of other states than those used last."""
    folders = [path for path in base.iterdir() if len(path.name) == LENGTH and path.is_dir()]
    folders.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    for path in folders[MOST_FOLDERS:]:
        shutil.rmtree(path, ignore_errors=True)


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ""


class _Locator(_CacheLocator):
    """Numba's notion of where the machine code of a function lies, and of what it was made from."""

    def __init__(self, function: Any, file: str) -> None:
        self._py_file = file  # numba names it in its warnings
        self._module = function.__module__
        self._key = key_of(getattr(function, "stands_for", function))

    def get_cache_path(self) -> str:
        return str(code_folder())

    def get_source_stamp(self) -> str:
        return self._key

    def get_disambiguator(self) -> str:
        return f"{self._module}-{self._key}"

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Locator:
        return cls(function, file)


class _CacheFiles(CompileResultCacheImpl):
    _locator_classes = [_Locator]  # noqa: RUF012 - as numba has it


class _PartLocator(_Locator):
    def get_cache_path(self) -> str:
        return str(code_folder() / PARTS)


class _PartFiles(CompileResultCacheImpl):
    _locator_classes = [_PartLocator]  # noqa: RUF012 - as numba has it


class _Cache(FunctionCache):
    _impl_class: type[CompileResultCacheImpl] = _CacheFiles

    def save_overload(self, signature: Any, data: Any) -> None:
        """Save under a lock: of two processes that compile at once, each adds to what the other has saved."""
        with contextlib.suppress(OSError), FileLock(Path(self.cache_path) / "lock"):
            try:
                super().save_overload(signature, data)
            except DAMAGED:
                self.flush()
                super().save_overload(signature, data)

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        with contextlib.suppress(OSError, *DAMAGED):  # what cannot be read is compiled
            return super().load_overload(signature, target_context)
        return None


class _EntryCache(_Cache):
    def save_overload(self, signature: Any, data: Any) -> None:
        """Save, and remove the parts that it was made of, which take ten times as much room, and old states."""
        super().save_overload(signature, data)
        shutil.rmtree(code_folder() / PARTS, ignore_errors=True)
        name = self._impl.filename_base.partition(self._impl.locator.get_source_stamp())[0]
        states: dict[str, list[Path]] = {}
        for file in sorted(code_folder().glob(f"{name}*"), key=_age):
            states.setdefault(file.name[len(name) :][:LENGTH], []).append(file)
        for files in list(states.values())[MOST_STATES:]:
            for file in files:
                file.unlink(missing_ok=True)

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        data = super().load_overload(signature, target_context)
        if data is not None:
            with contextlib.suppress(OSError):  # one that is used is young
                os.utime(code_folder() / f"{self._impl.filename_base}.nbi")
        return data


def _age(file: Path) -> float:
    with contextlib.suppress(OSError):
        return -file.stat().st_mtime
    return math.inf


class _PartCache(_Cache):
    _impl_class = _PartFiles
