"""What made a page, and from what."""

from __future__ import annotations

import datetime
import hashlib
from pathlib import Path

from feeder_sim import __version__
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
