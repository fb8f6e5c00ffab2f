"""Copies of the files that a scenario reads, in a folder that can then be taken elsewhere."""

from __future__ import annotations

import hashlib
import itertools
import re
from collections.abc import Callable, Mapping
from pathlib import Path

from feeder_sim.errors import InputError, cause_of, not_written
from feeder_sim.records.files import INPUTS, write_whole
from feeder_sim.scenario import Scenario, input_files, with_files

LARGEST_CARRIED = 100_000_000  # [byte]; larger files stay where they are: a run of them is not for the post
_UNUSUAL = re.compile(r"[^A-Za-z0-9._-]+|^\.+")


def carried_names(scenario: Scenario) -> dict[Path, str]:
    """Names for copies of the files that a scenario reads, by their paths.

    Files of the same content and suffix have the same name, other files names of their own, also where capitals do not
    count. Files above `LARGEST_CARRIED` have none.

    Raises:
        InputError: a file cannot be read.
    """
    names: dict[Path, str] = {}
    known: dict[tuple[str, str], str] = {}
    for key, path in input_files(scenario).items():
        if path in names or (path.is_file() and path.stat().st_size > LARGEST_CARRIED):
            continue
        same = hashlib.sha256(_read(path, key)).hexdigest(), path.suffix
        if same not in known:
            known[same] = _free_name(path, {name.lower() for name in known.values()})
        names[path] = known[same]
    return names


def _free_name(path: Path, taken: set[str]) -> str:
    """A name of plain characters near that of a file: the same, or with a number."""
    plain = Path(_UNUSUAL.sub("_", path.name))
    numbered = (plain.with_stem(f"{plain.stem}_{number}") for number in itertools.count(2))
    return next(name.name for name in itertools.chain([plain], numbered) if name.name.lower() not in taken)


def copy_files(names: Mapping[Path, str], folder: Path) -> None:
    """Write copies of files into a folder, which is made.

    Raises:
        RecordingFailed: one cannot be written, as when the disk is full.
        InputError: one cannot be read, or the folder cannot be made.
    """
    if not names:
        return
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise not_written(folder, error) from error
    for name, path in {name: path for path, name in names.items()}.items():
        write_whole(folder / name, _read(path))


def carry_files(scenario: Scenario, run: Path, notify: Callable[[str], None] | None = None) -> Scenario:
    """Copy the files that a scenario reads into a run folder; returns the scenario with the names of the copies.

    Names are relative to the run folder. A file above `LARGEST_CARRIED` keeps its own, which is said by `notify`.

    Raises:
        RecordingFailed, InputError: as for `copy_files` and `carried_names`.
    """
    names = carried_names(scenario)
    if notify:
        for path in sorted(set(input_files(scenario).values()) - names.keys()):
            notify(f"{path} is too large to be copied into {run}, which needs it where it is")
    copy_files(names, run / INPUTS)
    return with_files(scenario, lambda path: Path(INPUTS, names[path]) if path in names else path.absolute())


def _read(path: Path, key: str | None = None) -> bytes:
    if not path.is_file():  # a pipe may never end
        raise InputError("no such file", file=path, key=key)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {cause_of(error)}", file=path, key=key) from error
