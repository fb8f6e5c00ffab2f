"""What a run's numbers depend on besides its scenario: libraries, the package's own sources, files it reads."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import json
from pathlib import Path
from typing import Any

from feeder_sim import __version__, extensions
from feeder_sim.errors import InputError, cause_of
from feeder_sim.machine_code.key import files_hash
from feeder_sim.scenario import Scenario, input_files

# What the numbers of a scenario depend on, as one short text: its values, the files it reads, the libraries.


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


SHOWING = ("api", "app", "cli", "document", "plots", "replay", "report")  # rooms that decide no number
ASKING = ("feeder", "jobs", "studies")  # rooms that say what is run, and decide no number of a seed
LIBRARIES = ("mujoco", "numpy", "scipy", "numba", "h5py")


def library_versions() -> dict[str, str]:
    """Versions of the libraries that decide the numbers, and of this package with a hash of its sources."""
    return {"feeder_sim": f"{__version__}+{files_hash(without=(*SHOWING, *ASKING))}"} | _installed()


@functools.cache
def _installed() -> dict[str, str]:
    versions = {}
    for name in LIBRARIES:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return versions


def input_hashes(scenario: Scenario) -> dict[str, str]:
    """SHA-256 of the files that a scenario reads, by its keys: mode file, meshes of parts, their pieces, grippers."""
    files = input_files(scenario)
    return {key: hashlib.sha256(file.read_bytes()).hexdigest() for key, file in files.items()}


def changed_inputs(then: dict[str, str], scenario: Scenario) -> list[str]:
    """Keys of the files that a scenario reads and that are no longer what a run has read.

    Raises:
        InputError: a file is missing.
    """
    try:
        now = input_hashes(scenario)
    except OSError as error:
        raise InputError(f"cannot be read: {cause_of(error)}", file=error.filename) from error
    return _different(then, now)


def check_libraries(then: dict[str, str], folder: Path) -> None:
    """Refuse to go on with a run that was made by other libraries.

    Raises:
        InputError: it names the first of them.
    """
    if changed := _different(then, library_versions()):
        raise InputError(f"was begun with another version of {changed[0]}, must be the same one", file=folder)


def _different(then: dict[str, str], now: dict[str, str]) -> list[str]:
    """Names that two tables have with different values, or that only one of them has."""
    return sorted({name for name, _ in set(then.items()) ^ set(now.items())})
