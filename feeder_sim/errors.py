"""Errors that a user can act on: each message is one line and names what is wrong and what is allowed."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path


class FeederSimError(Exception):
    """Base of every error the package raises on purpose; `exit_code` is what the command line returns.

    Whatever a file or a library puts into the message, it stays one line.
    """

    exit_code = 1

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.split()))


class InputError(FeederSimError):
    """The user's input cannot be used: file, key, value and what is allowed, in one line."""

    exit_code = 2

    def __init__(self, problem: str, *, file: str | Path | None = None, key: str | None = None) -> None:
        self.problem, self.file, self.key = problem, file, key
        where = ": ".join(str(part) for part in (file, key) if part is not None)
        super().__init__(f"{where}: {problem}" if where else problem)


class SimulationDiverged(FeederSimError):
    """A running simulation left the range of valid states; what was recorded until then is kept."""

    def __init__(self, *, cause: str, time_s: float, part: str, seed: int) -> None:
        self.cause, self.time_s, self.part, self.seed = cause, time_s, part, seed
        super().__init__(f"seed {seed}: {part} at {time_s:.6f} s: {cause}; frames up to that time are kept")


class RecordingFailed(FeederSimError):
    """The trajectory file cannot be written any further; its blocks so far are on disk."""


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Return `' (did you mean X?)'` when one of the allowed names is close to `name`, else an empty string."""
    names = list(allowed)
    hits = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if not hits:  # a key without its unit suffix is too short for the ratio above
        hits = [candidate for candidate in names if candidate.startswith(f"{name}_")][:1]
    return f" (did you mean '{hits[0]}'?)" if hits else ""
