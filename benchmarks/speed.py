"""Speed and memory of one nut at 4750 Hz with 40 steps per period in MuJoCo, one core, against the project's limits.

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

from feeder_sim.run_folder import scenario_toml
from feeder_sim.scenario import load_scenario, with_run
from feeder_sim.simulation import simulate

SCENARIO = Path(__file__).parents[1] / "scenarios/drift_4750hz.toml"
REPEATS = 5
LIMITS = {"wall time per simulated second (s)": 1.0, "feeder-sim --help (s)": 0.3, "peak memory, 20 s run (MB)": 500.0}


def step_cost() -> float:
    """Wall time per simulated second of the MuJoCo engine on one core."""
    scenario = with_run(load_scenario(SCENARIO), engine="mujoco", duration_s=2.0, stop="time", seeds=1)
    simulate(scenario)  # compiled and cached
    return statistics.median(
        simulate(scenario, workers=1).summary()["wall_s_per_simulated_s_one_core"] for _ in range(REPEATS)
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
    found = dict(zip(LIMITS, (step_cost(), help_time(), peak_memory()), strict=True))
    for name, value in found.items():
        print(f"{name:<40} {value:>8.2f}   limit {LIMITS[name]:g}")
    return int(any(value > LIMITS[name] for name, value in found.items()))


if __name__ == "__main__":
    sys.exit(main())
