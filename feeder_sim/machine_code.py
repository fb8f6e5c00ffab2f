"""Compiled functions, and where their machine code is kept between runs.

Numba's own cache looks only at the file of a function itself, so that it runs old code after a change in a function or
a constant that this one uses from another file. Here machine code lies in a folder named after everything that it
depends on: all sources of the package but those of rooms that no compiled function takes anything from, the versions of
the libraries that compile it or are called by it, and the processor. A change of any of them is another folder. The
folders are in the user's folder for caches, or where NUMBA_CACHE_DIR says; the few used last are kept.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import importlib.metadata
import itertools
import os
import pickle
import platform
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import llvmlite.binding
import numba
from filelock import FileLock
from numba.core import targetconfig, types
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from platformdirs import user_cache_path

SHOWING = ("api", "app", "cli", "document", "plots", "replay", "report")  # rooms that decide no number
NOT_COMPILED = (*SHOWING, "feeder", "jobs", "measures", "studies")  # from which no compiled function takes anything
# Lines of words alone: a text that is a statement by itself, a comment, nothing; and other long texts, which are kept.
TEXT = rb'"""(?:[^"\\]|\\.|"(?!""))*"""'
WORDS = re.compile(rb"^[ \t]*(?:r?" + TEXT + rb"[ \t]*|#[^\n]*)?\n|(" + TEXT + rb")", re.MULTILINE | re.DOTALL)
FOLDERS_KEPT = 4  # of other states of sources, libraries and processor: two checkouts, an upgrade and a way back
LIBRARIES = ("numba", "llvmlite", "numpy", "mujoco")
KEY_LENGTH = 24
PARTS = (
    "parts"  # folder of inner functions whose entry point is not compiled yet, so that a killed process loses little
)
OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}  # nothing calls them from C
# Of inner functions. That they are not copied has to be said: numba compiles a function when it comes to a call of it,
# and then takes over from the caller that it is to be copied. All engines became one function in this way.
INNER = OPTIONS | {"no_cpython_wrapper": True, "forceinline": False}

# Parts of numba's inside that an ingredient replaces; without them inner functions are compiled as any other.
INGREDIENTS = all(
    hasattr(JITCodeLibrary, name)
    for name in ("_optimize_final_module", "_finalize_final_module", "_finalize_dynamic_globals", "_ensure_finalized")
) and tuple(map(int, numba.__version__.split(".")[:2])) >= (0, 62)
# In machine code numba names a version of a function by the number at which it was compiled and by the types it takes,
# a record by another number. Both counts begin at 1 in every process. So two versions that two processes have compiled
# may bear the same name, and a third process that loads both runs one of them for the other. It does not where every
# process counts from somewhere else.
TOLD_APART = hasattr(FunctionIdentity, "_unique_ids")  # without it no machine code is kept
if TOLD_APART:
    FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(5), "big"))
KEPT_IN_PARTS = INGREDIENTS and TOLD_APART
# What reading a damaged file of the cache ends in, or one that names a type of a script that is not here.
DAMAGED = (AttributeError, EOFError, ImportError, ValueError, pickle.UnpicklingError)
COMPILED = [0]  # inner functions in this process, also those that a killed one has left, for who waits for it
_njit: Any = numba.njit  # whose stubs do not know all options
F = TypeVar("F", bound=Callable[..., Any])


def entry_point(function: F) -> F:
    """Compile a function that Python calls, with all that it calls, and keep its machine code between runs.

    It runs without Python's lock, and divides by zero as IEEE arithmetic does.
    """
    dispatcher = _njit(**OPTIONS)(function)
    dispatcher.__class__ = _EntryPoint
    if TOLD_APART:
        dispatcher._cache = _EntryCache(function)
    return dispatcher


def compiled(function: F) -> F:
    """Compile a function that only compiled functions call.

    Its machine code is part of theirs. That it has none of its own, and no way in from Python, saves a third of the
    time that compilation takes; `entry_point(function.py_func)` can be called from Python.
    """
    return _inner(_njit(**INNER)(function))


def uncounted(function: F) -> F:
    """As `compiled`, without counting references to arrays, which costs the inner loops more than their arithmetic.

    Neither it nor what it calls may make an array; its caller holds those that it is given.
    """
    return _inner(_njit(**INNER | {"_nrt": False})(function))


def inlined(function: F) -> F:
    """As `uncounted`, and copied into every function that calls it: for what the inner loops call most."""
    return _inner(_njit(**INNER | {"_nrt": False, "forceinline": True})(function))


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
        if KEPT_IN_PARTS and not isinstance(self._cache, _PartCache):
            self._cache = _PartCache(self.py_func)  # here and not on import, when nothing may have to be compiled
        with _compiled_into(self, _Ingredient if INGREDIENTS else JITCodeLibrary):
            made = super().compile(sig)
        COMPILED[0] += 1
        return made

    def __call__(self, *_: Any) -> Any:
        raise TypeError(
            f"{self.py_func.__name__} is for compiled functions only; entry_point(function.py_func) can be called"
        )


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
    said = () if flags is None else tuple(sorted((name, str(value)) for name, value in flags._values.items()))
    key = context, tuple(args), tuple(keywords.items()), said
    known = function.__dict__.setdefault("_feeder_sim_calls", {})
    if key not in known:
        signature = _resolve(function, context, args, keywords)
        known[key] = signature, function._impl_keys[signature.args]
    signature, function._impl_keys[signature.args] = known[key]
    return signature


def _inner(dispatcher: Any) -> Any:
    dispatcher.__class__ = _Inner
    return dispatcher


def base_folder() -> Path:
    """Where machine code lies, and what is known of its sources: the user's folder for caches, or NUMBA_CACHE_DIR."""
    chosen = getattr(numba.config, "CACHE_DIR", "")
    return Path(chosen) if chosen else user_cache_path("feeder_sim")


@functools.cache
def code_folder() -> Path:
    """The folder of the machine code of these sources, libraries and this processor; others are removed here."""
    folder = base_folder() / "machine_code" / code_key()
    with contextlib.suppress(OSError):  # a folder that cannot be made: everything is compiled in every process
        folder.mkdir(parents=True, exist_ok=True)
        folder.touch()
        remove_old_folders(folder.parent)
    return folder


def code_key(package: Path = Path(__file__).parent) -> str:
    """Hash of all that machine code depends on."""
    key = hashlib.sha256(source_hash(package).encode())
    versions = {name: _version(name) for name in LIBRARIES}
    processor = (llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten())
    key.update(repr((versions, processor, platform.python_version())).encode())
    return key.hexdigest()[:KEY_LENGTH]


@functools.cache
def source_hash(
    package: Path = Path(__file__).parent, pattern: str = "**/*.py", without: tuple[str, ...] = NOT_COMPILED
) -> str:
    """Hash of all sources of a package that decide numbers, or of those of a pattern in a folder.

    Rooms that only show them do not count, nor do docstrings, lines of comments and empty ones. It is kept beside the
    machine code for as long as no file has another time or size: to make it takes as long as to load the machine code.
    """
    files = [file for file in sorted(package.glob(pattern)) if file.relative_to(package).parts[0] not in without]
    seen = hashlib.sha256(repr([(str(file), (at := file.stat()).st_mtime_ns, at.st_size) for file in files]).encode())
    place = hashlib.sha256(repr((str(package), pattern, without)).encode()).hexdigest()[:KEY_LENGTH]
    kept = base_folder() / "sources" / place
    with contextlib.suppress(OSError, ValueError):
        then, found = kept.read_text(encoding="ascii").split()
        if then == seen.hexdigest():
            return found
    sources = hashlib.sha256()
    for file in files:
        code = WORDS.sub(lambda found: found[1] or b"", file.read_bytes())
        sources.update(file.relative_to(package).as_posix().encode() + b"\0" + code + b"\0")
    found = sources.hexdigest()[:12]
    with contextlib.suppress(OSError):
        kept.parent.mkdir(parents=True, exist_ok=True)
        partial = kept.with_name(f"{place}.{os.getpid()}")
        partial.write_text(f"{seen.hexdigest()} {found}", encoding="ascii")
        partial.replace(kept)
    return found


def remove_old_folders(base: Path) -> None:
    """Remove machine code of other states than those used last."""
    folders = [path for path in base.iterdir() if len(path.name) == KEY_LENGTH and path.is_dir()]
    folders.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    for path in folders[FOLDERS_KEPT:]:
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
        self._folder = Path(file).resolve().parent

    def get_cache_path(self) -> str:
        return str(code_folder())

    def get_source_stamp(self) -> str:
        """The key says all of a function of the package; of another one, such as a script's, its own folder counts."""
        package = Path(__file__).parent
        own = "" if self._folder.is_relative_to(package) else source_hash(self._folder, "*.py")
        return code_folder().name + own

    def get_disambiguator(self) -> str:
        return str(self._module)

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
        """Save, and remove the parts that it was made of, which take ten times as much room."""
        super().save_overload(signature, data)
        shutil.rmtree(code_folder() / PARTS, ignore_errors=True)


class _PartCache(_Cache):
    _impl_class = _PartFiles
