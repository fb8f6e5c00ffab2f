"""Errors that a user can act on: each message is one line and names what is wrong and what is allowed."""

from __future__ import annotations

import difflib
import errno
import functools
import os
import re
from collections.abc import Iterable
from enum import Enum
from numbers import Integral
from pathlib import Path
from types import UnionType
from typing import Any, cast

LONGEST_VALUE = 80  # characters of a value, or of a key, in a message
# Of arguments that have another name where a command is typed.
OPTIONS = {"folder": "out", "budget_s": "budget", "frequencies_hz": "frequency", "amplitudes_um": "amplitude"}
EXTENSIONS = (".so", ".pyd")  # of compiled modules of Python
LIBRARY = re.compile(r"\.(so|dylib|dll)\b|dlopen", re.IGNORECASE)
LONGEST_MESSAGE = 500  # characters: a few lines of a terminal


def printable(text: str) -> str:
    """One line of text without anything that a terminal acts on: control characters, marks that turn the direction."""
    return escaped(" ".join(text.split()))


def escaped(text: str) -> str:
    """The same for a text whose spaces count."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shortened(text: str, longest: int = LONGEST_VALUE) -> str:
    """Text of at most so many characters; what is too much is left out of its middle."""
    if len(text) <= longest:
        return text
    tail = longest // 3
    return f"{text[: longest - tail - 3]}...{text[-tail:]}"


def option_of(argument: str) -> str:
    """The option that stands for an argument of a public function."""
    return f"--{OPTIONS.get(argument, argument).replace('_', '-')}"


def quoted(value: object) -> str:
    """A value as a message shows it, whatever it is."""
    try:
        return shortened(repr(value))
    except (ValueError, RecursionError):  # a whole number of too many digits, lists in lists in lists
        return f"a value that is too long to show ({type(value).__name__})"


class FeederSimError(Exception):
    """Base of every error the package raises on purpose; `exit_code` is what the command line returns.

    Whatever a file or a library puts into the message, it stays one line that a terminal shows and does not act on.
    """

    exit_code = 1

    def __init__(self, message: str) -> None:
        super().__init__(shortened(printable(message), LONGEST_MESSAGE))


class Interrupted(FeederSimError):
    """The user, or the system, has asked the command to end."""

    exit_code = 130


class InputError(FeederSimError):
    """The user's input cannot be used: file, key, value and what is allowed, in one line.

    Args:
        problem: the value and what is allowed; it names no argument, which is an option for users of commands.
        file: where the input is from.
        key: that the value has there.
        argument: of a public function, or several as "low, high"; commands name their option in its place.
    """

    exit_code = 2

    def __init__(
        self, problem: str, *, file: str | Path | None = None, key: str | None = None, argument: str | None = None
    ) -> None:
        self.problem, self.file, self.key, self.argument = problem, file, key, argument
        names = " ".join(shortened(name) for name in (argument, key) if name is not None)
        source = ": ".join(str(part) for part in (file, names) if part)
        super().__init__(f"{source}: {problem}" if source else problem)


class NotAllowed(InputError):
    """A value that is not allowed.

    Args:
        value: as it was given.
        allowed: what it may be.
        where: file, key and argument, as for `InputError`.
    """

    def __init__(self, value: object, allowed: str, **where: Any) -> None:
        super().__init__(f"is {quoted(value)}, must be {allowed}", **where)


class Unknown(InputError):
    """A name that there is not; the message has the one that is meant, and all there are.

    Args:
        name: as it was given.
        existing: the names there are.
        where: file, key and argument, as for `InputError`.
    """

    def __init__(self, name: object, existing: Iterable[str], **where: Any) -> None:
        names = list(existing)
        hint = nearest(str(name), names)
        super().__init__(f"is {quoted(name)}{hint}, must be {', '.join(names) or 'none'}", **where)


class MissingExtra(InputError):
    """A library that is not installed, by the extra of this package that brings it; key and argument as above."""

    def __init__(self, extra: str, **where: Any) -> None:
        super().__init__(f"needs the extra `{extra}`: pip install 'feeder_sim[{extra}]'", **where)


class NotMeasured(InputError, AttributeError):
    """A measure that has no meaning for a scenario; as an attribute that is missing, so that `hasattr` says False."""


class Divergence(Enum):
    """Why a seed was stopped: what no part over a vibrating plate can do; the value says so in words."""

    NOT_FINITE = "its state is not finite"
    THROUGH_PLATE = "its centre lies below the plate's surface"
    TOO_MUCH_ENERGY = "it has more energy than this plate can give"
    TOO_DEEP = "a corner lies too deep below the plate's surface"
    STALLED = "its next frame takes too long"  # not a state, but an engine that does not get on


class SimulationDiverged(FeederSimError):
    """A running simulation left the range of valid states; what was recorded until then is kept.

    Args:
        divergence: what is wrong.
        time_s: of the first state that is not valid [s].
        part: its name.
        seed: index of the seed.
        detail: what is wrong, with numbers; "" for the plain words.
        file: that holds the last states, "" without one.
    """

    def __init__(
        self, divergence: Divergence, *, time_s: float, part: str, seed: int, detail: str = "", file: str = ""
    ) -> None:
        self.divergence, self.detail = divergence, detail
        self.time_s, self.part, self.seed, self.file = time_s, part, seed, file
        saved = "frames up to that time are kept" + (f", last states in {file}" if file else "")
        super().__init__(f"seed {seed}: {part} at {time_s:.6f} s: {self.cause}; {saved}")

    @property
    def cause(self) -> str:
        """What is wrong, in words."""
        return self.detail or self.divergence.value

    def saved_in(self, file: str) -> SimulationDiverged:
        """The same, with the last states in a file."""
        return SimulationDiverged(**{**self._arguments, "file": file})

    @property
    def _arguments(self) -> dict[str, Any]:
        names = ("divergence", "time_s", "part", "seed", "detail", "file")
        return {name: getattr(self, name) for name in names}

    def __reduce__(self) -> tuple[Any, ...]:  # seeds travel between processes
        return functools.partial(SimulationDiverged, **self._arguments), ()


class RecordingFailed(FeederSimError):
    """A file of results cannot be written, as when the disk is full; what was on disk before is kept."""


# Errors of the system about a name that the user gave; all others are failures: the disk is full or broken.
_OF_A_NAME = (
    *(errno.ENOENT, errno.EACCES, errno.EPERM, errno.EROFS, errno.EISDIR, errno.ENOTDIR),
    *(errno.EEXIST, errno.ENAMETOOLONG, errno.ELOOP),
)


def check_type(value: object, kind: type | UnionType, allowed: str, key: str) -> None:
    """Refuse an argument of another type than a public function takes.

    Raises:
        InputError: as said; `key` names the argument, `allowed` says what it takes.
    """
    if not isinstance(value, kind):
        raise NotAllowed(value, allowed, key=key)


def check_whole(value: object, key: str, least: int = 1, most: int | None = None) -> int:
    """A whole number from one on, perhaps up to another, as a user of Python gives it.

    Raises:
        InputError: it is none, or out of these limits.
    """
    number = int(value) if isinstance(value, Integral) and not isinstance(value, bool) else None
    if number is None or number < least or (most is not None and number > most):
        limits = f"from {least} on" if most is None else f"from {least} to {most}"
        raise NotAllowed(value, f"a whole number {limits}", key=key)
    return number


def path_of_user(value: object, key: str) -> Path:
    """The path of a file or a folder, as a user of Python gives it.

    Raises:
        InputError: it is none.
    """
    check_type(value, str | os.PathLike, "a path", key)
    return Path(cast("str | os.PathLike[str]", value))


def cause_of(error: BaseException) -> str:
    """What the system says; h5py wraps it in a thousand words."""
    number = getattr(error, "errno", None)
    return os.strerror(number) if number else str(error)


def not_written(path: str | Path, error: BaseException) -> FeederSimError:
    """Why a file cannot be written: its name is no good, or the disk is."""
    if of_a_name(error):
        return InputError(f"cannot be written: {cause_of(error)}", file=path)
    return RecordingFailed(f"{path}: cannot be written, is the disk full? ({cause_of(error)})")


def library_failure(error: BaseException) -> FeederSimError | None:
    """What to say of an error that is about a library: one that is not there, or that the system cannot load.

    None of any other error. The system's loader gives a text and no number.
    """
    remedy = "install feeder_sim and the packages it needs again"
    if isinstance(error, ModuleNotFoundError):
        package = (error.name or "").partition(".")[0]
        return None if package in ("", __package__) else FeederSimError(f"the package {package} is missing, {remedy}")
    is_load_failure = isinstance(error, ImportError) and str(error.path).endswith(EXTENSIONS)
    is_load_failure |= isinstance(error, OSError) and error.errno is None and LIBRARY.search(str(error)) is not None
    return FeederSimError(f"a library is missing or damaged ({error}), {remedy}") if is_load_failure else None


def of_a_name(error: BaseException) -> bool:
    """Whether another name for the file would help."""
    return getattr(error, "errno", None) in _OF_A_NAME


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Return `' (did you mean X?)'` when one of the allowed names is close to `name`, else an empty string."""
    names = list(allowed)
    hits = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if not hits:  # a key without its unit suffix is too short for the ratio above
        hits = [candidate for candidate in names if candidate.startswith(f"{name}_")][:1]
    return f" (did you mean '{hits[0]}'?)" if hits else ""
