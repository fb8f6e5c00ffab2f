"""Whether the scenarios give the same bits as at another commit of this repository.

    python benchmarks/same_bits.py COMMIT

Runs every scenario, shortened, with both engines, once from this checkout and once from COMMIT (in a work tree of its
own), and compares frames, impacts and removals. Exits with 1 where they differ, and says from which time on.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
# Simulated time of a run [s]: MuJoCo is slower, and of many parts much slower.
LONGEST = {("impulse", False): 3.0, ("impulse", True): 1.0, ("mujoco", False): 0.5, ("mujoco", True): 0.05}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit", nargs="?", help="to compare with")
    parser.add_argument("--tree", type=Path, help="a folder to compare with, in place of a commit")
    parser.add_argument("--record", type=Path, help=argparse.SUPPRESS)  # what a process of its own does
    options = parser.parse_args()
    if options.record:
        record(options.record)
        return
    if (options.commit is None) == (options.tree is None):
        parser.error("exactly one of COMMIT and --tree is needed")
    with tempfile.TemporaryDirectory() as folder:
        here, there = Path(folder) / "here.npz", Path(folder) / "there.npz"
        tree = options.tree or Path(folder) / "tree"
        if options.commit:
            _git("worktree", "add", "--detach", str(tree), options.commit)
        try:
            for source, file in ((ROOT, here), (tree, there)):
                # From outside both trees, so that each process imports the package it is told to.
                environment = os.environ | {"PYTHONPATH": str(source)}
                command = [sys.executable, str(Path(__file__).resolve()), "--record", str(file)]
                subprocess.run(command, check=True, cwd=folder, env=environment)
        finally:
            if options.commit:
                _git("worktree", "remove", "--force", str(tree))
        with np.load(here) as new, np.load(there) as old:
            sys.exit(1 if compare(dict(new), dict(old)) else 0)


def record(file: Path) -> None:
    """Run all scenarios with the package that is imported here, and store what they give."""
    import feeder_sim
    from feeder_sim.errors import InputError

    arrays: dict[str, Any] = {}
    for path in sorted((ROOT / "scenarios").glob("*.toml")):
        for engine in ("impulse", "mujoco"):
            name = f"{path.stem} {engine}"
            print(name, file=sys.stderr, flush=True)
            try:
                seeds = feeder_sim.simulate(shortened(path, engine)).seeds
            except InputError as error:  # an engine does not cover it, or the other commit does not know it yet
                print(f"  left out: {error}", file=sys.stderr, flush=True)
                continue
            for i, seed in enumerate(seeds):
                for part in ("frames", "impacts", "removals"):
                    for key, values in columns(getattr(seed, part)).items():
                        arrays[f"{name}|{i}|{part}.{key}"] = values
                arrays[f"{name}|{i}|stops"] = seed.stops
    np.savez(file, **arrays)


def columns(table: Any) -> dict[str, Any]:
    """Arrays by name, of a record array or of the dataclass that stood in its place."""
    return {name: table[name] for name in table.dtype.names} if isinstance(table, np.ndarray) else vars(table)


def shortened(path: Path, engine: str) -> Any:
    """A scenario with two seeds and a short time, whose stages keep their order."""
    import feeder_sim
    from feeder_sim.scenario.tables import validated

    scenario = feeder_sim.load_scenario(path)
    raw = scenario.model_dump()
    longest = LONGEST[engine, scenario.n_parts > 1]
    raw["run"] |= {"engine": engine, "seeds": 2}
    if scenario.schedule is None:
        raw["run"]["duration_s"] = min(longest, raw["run"]["duration_s"])
    else:
        schedule = raw["schedule"]
        schedule["cycles"] = 1
        stages = [*schedule["prepare"], *schedule["stage"]]
        share = min(1.0, longest / sum(stage["duration_s"] + stage["pause_s"] for stage in stages))
        for stage in stages:
            stage["duration_s"] *= share
            stage["pause_s"] *= share
    if engine == "mujoco" and raw["part"][0]["guide"]:
        raw["part"][0]["guide"]["friction"] = 0.0
    return validated(raw, feeder_sim.Scenario, path)  # raises InputError where an engine does not cover it


def compare(new: dict[str, Any], old: dict[str, Any]) -> list[str]:
    """Print what is equal and what is not, run by run; returns the runs that differ."""
    differ = []
    for run in sorted({name.split("|")[0] for name in [*new, *old]}):
        names = sorted(name for name in {*new, *old} if name.startswith(f"{run}|"))
        if not any(name in old for name in names):
            print(f"new     {run}")
            continue
        unequal = [
            name
            for name in names
            if name not in new
            or name not in old
            or not np.array_equal(new[name], old[name], equal_nan=new[name].dtype.kind == "f")
        ]
        if not unequal:
            print(f"same    {run}")
            continue
        differ.append(run)
        print(f"differs {run}: {_since(run, new, old)}; {', '.join(name.split('|', 1)[1] for name in unequal[:3])} ...")
    return differ


def _since(run: str, new: dict[str, Any], old: dict[str, Any]) -> str:
    """When the positions of the first seed begin to differ, and by how much they do in the end."""
    a, b = new.get(f"{run}|0|frames.position"), old.get(f"{run}|0|frames.position")
    if a is None or b is None:
        return "missing on one side"
    n = min(len(a), len(b))
    rows = np.flatnonzero((a[:n] != b[:n]).any(axis=(1, 2)))
    if not len(rows):
        return f"positions are the same for {n} frames, of {len(a)} and {len(b)}"
    time = new[f"{run}|0|frames.time"][rows[0]]
    return f"from {time:.4f} s on, by {1e3 * np.abs(a[n - 1] - b[n - 1]).max():.2g} mm at the end"


def _git(*arguments: str) -> None:
    subprocess.run(["git", "-C", str(ROOT), *arguments], check=True, capture_output=True)


if __name__ == "__main__":
    main()
