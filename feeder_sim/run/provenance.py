"""What a run's numbers depend on besides its scenario: libraries, the package's own sources, files it reads."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata

from feeder_sim import __version__
from feeder_sim.machine_code import source_hash
from feeder_sim.scenario import Scenario, input_files

LIBRARIES = ("mujoco-core", "mujoco", "numpy", "scipy", "numba", "h5py")


def library_versions() -> dict[str, str]:
    """Versions of the libraries that decide the numbers, and of this package with a hash of its sources."""
    return {"feeder_sim": f"{__version__}+{source_hash()}"} | _installed()


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
