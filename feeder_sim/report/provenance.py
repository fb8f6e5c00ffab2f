"""What made a page, and from what."""

from __future__ import annotations

import datetime
import hashlib
import shlex
from collections.abc import Sequence
from pathlib import Path

from feeder_sim import __version__
from feeder_sim.document.document import Block, Table, Text
from feeder_sim.jobs.folder import SCENARIO
from feeder_sim.run.provenance import library_versions


def foot() -> str:
    """The last line of a page: what made it, and when."""
    now = datetime.datetime.now().astimezone().isoformat(" ", "seconds")
    return f"Made by feeder_sim {__version__} on {now}."


def hash_of(file: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def version_rows() -> tuple[tuple[str, str], ...]:
    """Versions of this package and of the libraries that decide the numbers."""
    return tuple(library_versions().items())


def repeated(folder: Path, command: Sequence[str], files: Sequence[str], more: str = "") -> tuple[Block, ...]:
    """How a question is asked again: the command, versions, hashes, and where the data are.

    Args:
        folder: of the question.
        command: its words after the name of the program, without a folder to write to.
        files: that say what was asked and what came out, besides the scenario.
        more: about the command, in words.
    """
    words = " ".join(shlex.quote(word) for word in ("feeder-sim", *command, "--out", "repeated"))
    hashes = tuple((name, hash_of(folder / name)) for name in (files[0], SCENARIO, *files[1:]))
    return (
        Text("This asks the same again:"),
        Text(words, "code"),
        *((Text(more),) if more else ()),
        Text(f"With --out {folder} it goes on with what is not done there."),
        Table("Versions of what made this page", ("library", "version"), version_rows()),
        Table("Files of the folder (SHA-256)", ("file", "hash"), hashes),
    )
