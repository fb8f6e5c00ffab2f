"""How much of a second process reaches the user: a sweep with one worker and with two, in turns.

    python benchmarks/sweep_workers.py [--seeds 400] [--rounds 3]

Runs the same sweep of scenarios/drift_4750hz.toml with one and with two processes, and prints the efficiency: the time
of one over twice that of two, the start of the processes included. The median of the rounds is to be at least 0.95 on a
machine with two cores that does nothing else; the benchmark exits 1 below. The tables have to be the same to the bit.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from pathlib import Path

import feeder_sim
from feeder_sim.run.compilation import compile_engine
from feeder_sim.scenario import load_scenario

SCENARIO = Path(__file__).parents[1] / "scenarios" / "drift_4750hz.toml"
LEAST = 0.95


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=400)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    scenario = load_scenario(SCENARIO)
    compile_engine(feeder_sim.prepare(scenario))
    efficiencies = []
    for _ in range(arguments.rounds):
        took, tables = [], []
        for workers in (1, 2):
            began = time.perf_counter()
            found = feeder_sim.sweep(
                scenario, {"drive[0].amplitude_um": "0.6:1.5:10"}, seeds=arguments.seeds, workers=workers
            )
            took.append(time.perf_counter() - began)
            tables.append(found.rows)
        if repr(tables[0]) != repr(tables[1]):
            sys.exit("the tables differ")
        efficiencies.append(took[0] / (2.0 * took[1]))
        print(f"one worker {took[0]:.1f} s, two {took[1]:.1f} s, efficiency {efficiencies[-1]:.3f}", flush=True)
    median = statistics.median(efficiencies)
    print(f"efficiency of two workers: {median:.3f} (median), must be at least {LEAST}")
    sys.exit(median < LEAST)


if __name__ == "__main__":
    main()
