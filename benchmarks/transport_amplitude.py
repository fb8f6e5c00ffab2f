"""Up to which amplitude a nut keeps its way: the transport scenario with all amplitudes scaled together.

    python benchmarks/transport_amplitude.py [--scenario FILE] [--seeds 16] [--factors 0.5 0.7 1 ...]
        [--steps-per-period N] [--picture FILE]

Prints, for every factor, how many of the seeds arrive within the goal, and how long it took them. The scenario's own
amplitudes are a factor of 1: the same velocity amplitude for all modes.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.scenario.tables import validated

SCENARIO = Path(__file__).parents[1] / "scenarios" / "transport_strip.toml"
FACTORS = [0.5, 0.7, 1.0, 1.4, 2.0, 2.4, 2.8, 3.2, 4.0, 5.6]


def scaled(path: Path, factor: float, seeds: int, steps_per_period: int | None) -> Scenario:
    """The scenario with all amplitudes multiplied, and other steps where they are given."""
    raw = load_scenario(path).model_dump(exclude_none=True)
    raw["run"]["seeds"] = seeds
    if steps_per_period is not None:
        raw["run"]["steps_per_period"] = steps_per_period
    for stage in (*raw["schedule"]["prepare"], *raw["schedule"]["stage"]):
        for drive in stage["drive"]:
            drive["amplitude_um"] *= factor
    return validated(raw, Scenario, path)


def draw(rows: list[tuple[float, int, int, float | None, float | None]], title: str, picture: Path) -> None:
    """Success rate with 95 % intervals (Wilson), and time with standard deviations, over the factor."""
    from matplotlib.figure import Figure
    from scipy.stats import binomtest

    figure = Figure(figsize=(6.4, 4.6), layout="constrained")
    success, time = figure.subplots(2, 1, sharex=True)
    factors = [row[0] for row in rows]
    rate = np.array([100.0 * row[1] / row[2] for row in rows])
    bounds = [binomtest(row[1], row[2]).proportion_ci(method="wilson") for row in rows]
    spread = np.abs(np.array([[100.0 * b.low, 100.0 * b.high] for b in bounds]).T - rate)
    success.errorbar(factors, rate, yerr=spread, fmt="o-", color="#3a60be", capsize=3)
    success.set(ylabel="arrived (%)", ylim=(-5, 105), title=title)
    arrived = [(row[0], row[3], row[4] or 0.0) for row in rows if row[3] is not None]
    if arrived:
        at, mean, sd = zip(*arrived, strict=True)
        time.errorbar(at, mean, yerr=sd, fmt="o-", color="#be3434")
    time.axhline(34.0, color="0.6", linestyle="--", label="source: 34.0 s")
    time.set(xscale="log", xlabel="amplitude over the scenario's", ylabel="time of those (s)", ylim=(0.0, None))
    time.set_xticks(factors, [f"{factor:g}" for factor in factors])
    time.minorticks_off()
    time.legend(fontsize=8)
    figure.savefig(picture, dpi=150)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", type=Path, default=SCENARIO)
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--factors", type=float, nargs="+", default=FACTORS)
    parser.add_argument("--steps-per-period", type=int)
    parser.add_argument("--picture", type=Path)
    arguments = parser.parse_args()
    print("| factor | arrived | time (s), mean and SD | travelled (mm), mean and SD |\n|---|---|---|---|")
    rows = []
    for factor in arguments.factors:
        found = simulate(scaled(arguments.scenario, factor, arguments.seeds, arguments.steps_per_period)).measures()
        took, way = found["arrival_time_s"], found["travelled_mm"]
        rows.append((factor, found["at_goal"], found["at_goal_of"], took["mean"], took["sd"]))
        time = f"{took['mean']:.1f} +- {took['sd'] or 0.0:.1f}" if took["n"] else "-"
        place = f"{way['mean']:.1f} +- {way['sd'] or 0.0:.1f}" if way["n"] else "-"
        print(f"| {factor:g} | {found['at_goal']} of {found['at_goal_of']} | {time} | {place} |", flush=True)
    if arguments.picture:
        draw(rows, load_scenario(arguments.scenario).title, arguments.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
