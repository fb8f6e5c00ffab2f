"""What the numbers of a scenario depend on, as one short text: its values, the files it reads, the libraries."""

from __future__ import annotations

import functools
import hashlib
import json
from pathlib import Path
from typing import Any

from feeder_sim import extensions
from feeder_sim.errors import InputError, cause_of
from feeder_sim.run.provenance import library_versions
from feeder_sim.scenario import Scenario


def identity_of(scenario: Scenario) -> str:
    """A hash of all that decides the numbers of its seeds: not of its title, nor of how many seeds it has.

    Files count by their content, wherever they are.

    Raises:
        InputError: a file that the scenario names cannot be read.
    """
    raw = scenario.model_dump(exclude={"title": True, "format": True, "uncertain": True, "run": {"seeds"}})
    text = content_text([raw, library_versions() | extensions.versions()])
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def content_text(value: Any) -> str:
    """Values as JSON, files by a hash of their content.

    Raises:
        InputError: a file cannot be read.
    """
    return json.dumps(value, default=_content, sort_keys=True)


def content_hash(file: Path) -> str:
    """SHA-256 of a file.

    Raises:
        InputError: it cannot be read.
    """
    try:
        state = file.stat()
        return _hash(file, state.st_mtime_ns, state.st_size)
    except OSError as error:
        raise InputError(f"cannot be read: {cause_of(error)}", file=file) from error


def _content(value: Any) -> str:
    if not isinstance(value, Path):
        raise TypeError(f"{type(value).__name__} in a scenario")
    return content_hash(value)


@functools.lru_cache(64)
def _hash(path: Path, changed: int, size: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
