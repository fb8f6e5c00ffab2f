"""The two engines side by side: transport speed and work for it, and what the second core adds.

    python benchmarks/engines.py

Both run the same seeds of the same scenario in turn, several times, each on one core; the ratio is the median of the
rounds. Both step counts are within 5 % of the converged speed (benchmarks/convergence.py). Exits with 1 when the ratio
or the efficiency falls short of its limit.
"""

from __future__ import annotations

import functools
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

from feeder_sim.pool.work import Work, available_cores
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run

SCENARIOS = Path(__file__).parents[1] / "scenarios"
ROUNDS, SEEDS, ENSEMBLE = 3, 2, 64
LEAST_RATIO = 20.0
LEAST_EFFICIENCY = 0.7  # two cores of a shared machine are less than twice one


def cost(scenario: Scenario) -> float:
    """Wall time per simulated second on one core."""
    result = simulate(scenario, work=Work(1))
    return result.wall_s / sum(float(frames.time[-1]) for frames in result.trajectories)


def compare(scenario: Scenario) -> float:
    """Ratio of the costs of MuJoCo and impulses, in turn."""
    engines = {name: with_run(scenario, engine=name, seeds=SEEDS) for name in ("mujoco", "impulse")}
    for engine in engines.values():
        simulate(with_run(engine, duration_s=0.05, stop="time"))  # compiled
    rounds = [{name: cost(engine) for name, engine in engines.items()} for _ in range(ROUNDS)]
    for name in engines:
        print(f"  {name:<8} {statistics.median(r[name] for r in rounds):.4f} s of wall time per simulated second")
    return statistics.median(r["mujoco"] / r["impulse"] for r in rounds)


def efficiency(run: Callable[..., object]) -> float:
    """Speed-up over one core by all of them, per core; the median of the rounds. run: with a number of threads."""
    found = []
    for _ in range(ROUNDS):
        times = []
        for workers in (1, available_cores()):
            began = time.perf_counter()
            run(work=Work(workers))
            times.append(time.perf_counter() - began)
        found.append(times[0] / times[1] / available_cores())
    return statistics.median(found)


def main() -> int:
    short = []
    for name in ("drift_4750hz", "drift_8775hz"):
        scenario = load_scenario(SCENARIOS / f"{name}.toml")
        print(f"{scenario.title}, {scenario.run.steps_per_period} steps per period")
        ratio = compare(scenario)
        ensemble = prepare(with_run(scenario, engine="impulse", seeds=ENSEMBLE))
        gained = efficiency(functools.partial(simulate, ensemble))
        print(f"  ratio    {ratio:.1f}   (limit {LEAST_RATIO:g})")
        print(f"  {ENSEMBLE} seeds on {available_cores()} cores: {gained:.0%} efficiency (limit ", end="")
        print(f"{LEAST_EFFICIENCY:.0%})")
        short.append(ratio < LEAST_RATIO or gained < LEAST_EFFICIENCY)
    return int(any(short))


if __name__ == "__main__":
    sys.exit(main())
