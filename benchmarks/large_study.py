"""Time to open and to report a study of many points, whose seeds are made up.

    python benchmarks/large_study.py --points 10000

Prints wall times; of 10,000 points with 4 seeds each it writes for a few minutes first.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import numpy as np

import feeder_sim
from feeder_sim.jobs.task import SeedValues, Task
from feeder_sim.pool.work import Work
from feeder_sim.studies.ask import ask, folder_of
from feeder_sim.studies.sweep.sweep import SweepQuestion

SCENARIO = Path(__file__).resolve().parent.parent / "scenarios/drift_4750hz.toml"
SEEDS = 4


class MadeUp(Executor):
    """Has a speed for every seed at once."""

    def submit(self, function: Any, task: Task, /, *_: Any) -> Future[Any]:  # type: ignore[override]
        future: Future[Any] = Future()
        speeds = (float(np.random.default_rng(seed).normal(1.5, 0.1)) for seed in task.seeds)
        values = [SeedValues(seed, {"speed": speed}, 0.1) for seed, speed in zip(task.seeds, speeds, strict=True)]
        future.set_result(tuple(values))
        return future


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=10_000)
    points = parser.parse_args().points
    scenario = feeder_sim.load_scenario(SCENARIO).changed({"run.seeds": SEEDS})
    question = SweepQuestion.of(vary=(f"drive[0].amplitude_um=1:5:{points}",))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "study"
        ask(question, scenario, folder_of(question, scenario, folder), work=Work(2, MadeUp()))
        for name, read in (("opened", feeder_sim.open_study), ("report", feeder_sim.document_of)):
            started = time.perf_counter()
            made: Any = read(folder)
            if name == "report":
                made.html()
            print(f"{name} of {points} points x {SEEDS} seeds: {time.perf_counter() - started:.2f} s", flush=True)


if __name__ == "__main__":
    main()
