"""Speed and memory against the project's limits, on one core: a nut at 4750 Hz in MuJoCo, a ball on a slide at 558 Hz.

    python benchmarks/speed.py

Exits with 1 when a limit is exceeded. Times are the median of the repeats; on a shared machine only their order of
magnitude is worth anything.
"""

from __future__ import annotations

import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from feeder_sim.pool.work import Work
from feeder_sim.run.run_folder import scenario_toml
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run

SCENARIOS = Path(__file__).parents[1] / "scenarios"
SCENARIO = SCENARIOS / "drift_4750hz.toml"
REPEATS = 5
LIMITS = {
    "nut in MuJoCo, wall time per simulated second (s)": 1.0,
    "ball on a slide, the same (s)": 0.001,
    "feeder-sim --help (s)": 0.3,
    "peak memory, 20 s run of the nut (MB)": 500.0,
}


def step_cost(scenario: Scenario) -> float:
    """Wall time per simulated second on one core."""
    simulate(scenario)  # compiled and cached
    return statistics.median(
        simulate(scenario, work=Work(1)).summary()["wall_s_per_simulated_s_one_core"] for _ in range(REPEATS)
    )


def help_time() -> float:
    """Wall time of `feeder-sim --help` as a whole process."""
    command = [str(Path(sys.executable).with_name("feeder-sim")), "--help"]

    def once() -> float:
        started = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        return time.perf_counter() - started

    return statistics.median(once() for _ in range(REPEATS))


def peak_memory() -> float:
    """Largest resident size [MB] of a run of 20 simulated seconds with its recording and replay."""
    with tempfile.TemporaryDirectory() as folder:
        scenario = Path(folder) / "long.toml"
        long = with_run(load_scenario(SCENARIO), engine="mujoco", duration_s=20.0, stop="time", seeds=1)
        scenario.write_text(scenario_toml(long))
        command = [sys.executable, "-m", "feeder_sim", "run", str(scenario), "--out", f"{folder}/run", "--json"]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        assert json.loads(done.stdout)["simulated_s"] > 19.9
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0


def main() -> int:
    nut = with_run(load_scenario(SCENARIO), engine="mujoco", duration_s=2.0, stop="time", seeds=1)
    ball = with_run(load_scenario(SCENARIOS / "ball_558hz.toml"), duration_s=200.0, seeds=1)
    figures = (step_cost(nut), step_cost(ball), help_time(), peak_memory())
    found = dict(zip(LIMITS, figures, strict=True))
    for name, value in found.items():
        print(f"{name:<50} {value:>10.5f}   limit {LIMITS[name]:g}")
    return int(any(value > LIMITS[name] for name, value in found.items()))


if __name__ == "__main__":
    sys.exit(main())
