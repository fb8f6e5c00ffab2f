"""README's first command in an empty clone with empty caches: how long each of its parts takes.

    python benchmarks/first_command.py [--ways pip,uv,uv-bytecode] [--rounds 1]

Prints wall time and processor time [s] of every part, way by way: environment, installer, installation, first run,
which compiles, and second run. All is downloaded anew. Versions are those of `.ci/constraints.txt`.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer

REPOSITORY = Path(__file__).parents[1]
RUN = [".venv/bin/feeder-sim", "run", "scenarios/drift_4750hz.toml"]
UV = [".venv/bin/uv", "pip", "install", "--quiet", "--python", ".venv", "-e", "."]
PIP = [".venv/bin/pip", "install", "--quiet", "--disable-pip-version-check"]
WAYS: dict[str, dict[str, list[str]]] = {
    "pip": {"installation": [*PIP, "-e", "."]},
    "uv": {"installer": [*PIP, "uv"], "installation": UV},
    "uv-bytecode": {"installer": [*PIP, "uv"], "installation": [*UV[:3], "--compile-bytecode", *UV[3:]]},
}


def timed(command: list[str], folder: Path, environment: dict[str, str]) -> tuple[float, float]:
    """Wall time and processor time of a command [s]."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(
        command, cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def parts_of(way: str) -> dict[str, tuple[float, float]]:
    """Times of the parts of one way, in a new clone."""
    with tempfile.TemporaryDirectory() as name:
        folder, caches = Path(name) / "clone", Path(name) / "cache"
        subprocess.run(["git", "clone", "--quiet", REPOSITORY, folder], check=True)
        constraints = str(folder / ".ci/constraints.txt")
        environment = {**os.environ, "XDG_CACHE_HOME": str(caches), "UV_CACHE_DIR": str(caches / "uv")}
        environment |= {"PIP_CONSTRAINT": constraints, "UV_CONSTRAINT": constraints, "PIP_NO_CACHE_DIR": "1"}
        commands = {"environment": [sys.executable, "-m", "venv", ".venv"], **WAYS[way], "first run": RUN}
        return {part: timed(command, folder, environment) for part, command in (commands | {"second run": RUN}).items()}


def main(
    ways: Annotated[str, typer.Option(help="separated by commas")] = ",".join(WAYS),
    rounds: Annotated[int, typer.Option(help="of all ways, one after the other")] = 1,
) -> None:
    print(f"{'way':<13}{'part':<14}{'wall (s)':>9}{'processor (s)':>15}")
    for way in rounds * ways.split(","):
        parts = parts_of(way)
        total = tuple(sum(times[k] for part, times in parts.items() if part != "second run") for k in (0, 1))
        for part, (wall, processor) in (parts | {"first command": total}).items():
            print(f"{way:<13}{part:<14}{wall:>9.1f}{processor:>15.1f}", flush=True)


if __name__ == "__main__":
    typer.run(main)
