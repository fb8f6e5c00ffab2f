"""Where the time of `feeder-sim run` on one part goes, from the interpreter to the end.

    python benchmarks/start_up.py [--repeats 5]

Loads what the command loads, in its order, in processes of their own, and prints medians of the wall time in ms. What
is not named is the interpreter, the printed result, and what was loaded twice. Machine code has been compiled before.
PYTHONPATH says of which checkout. Leave the machine idle.
"""

from __future__ import annotations

import itertools
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import typer

SCENARIO = Path(__file__).parents[1] / "scenarios" / "drift_4750hz.toml"
STEPS = {
    "command line: typer": (
        "import feeder_sim.cli.main",
        "from feeder_sim.cli import commands",
        "getattr(commands, 'start_quickly', int)()",  # which older commits have not
    ),
    "scenario: NumPy, pydantic": (
        "from feeder_sim.scenario import load_scenario",
        f"scenario = load_scenario({str(SCENARIO)!r})",
    ),
    "scene and measures": (
        "import feeder_sim.measures.catalogue, feeder_sim.scene.scene",
        "from feeder_sim.run import prepare",
    ),
    "engine": ("from feeder_sim.run import run_folder", "import feeder_sim.engines.impulse.free_part.engine"),
    "parts and their poses": ("made = prepare.prepare(scenario)", "made.scene.poses"),
    "machine code": ("from feeder_sim.run.compilation import compile_engine", "compile_engine(made)"),
    "all seeds": ("result = run_folder.simulate(made)",),
    "files": ("import tempfile", "f = tempfile.mkdtemp()", "run_folder.record_run(scenario, f + '/r', replay=False)"),
}


def main(repeats: Annotated[int, typer.Option()] = 5) -> None:
    found: dict[str, list[float]] = {}
    for _ in range(repeats + 1):
        for name, value in one_command().items():
            found.setdefault(name, []).append(value)
    for name, values in found.items():
        print(f"{name:32}{1e3 * statistics.median(values[1:]):7.0f}")


def one_command() -> dict[str, float]:
    lines = ["import json, time", "at = [time.perf_counter()]"]
    for step in STEPS.values():
        lines += [*step, "at.append(time.perf_counter())"]
    lines += ["print(json.dumps(at))"]
    with tempfile.TemporaryDirectory() as folder:
        how: dict[str, Any] = {"check": True, "cwd": folder, "capture_output": True, "text": True}
        at = json.loads(subprocess.run([sys.executable, "-c", "\n".join(lines)], **how).stdout)
        started = time.perf_counter()
        subprocess.run([sys.executable, "-m", "feeder_sim", "run", str(SCENARIO)], **how)
        whole = time.perf_counter() - started
    found = dict(zip(STEPS, (b - a for a, b in itertools.pairwise(at)), strict=True))
    found["files"] -= found["all seeds"]  # which it runs again
    return found | {"the command, in all": whole}


if __name__ == "__main__":
    typer.run(main)
