"""Mean transport speed over steps per period: how fine a step the drift scenarios need.

    python benchmarks/convergence.py scenarios/drift_8775hz.toml --engine mujoco --seeds 48 --steps 40 --steps 80

Cost is wall time per simulated second on one core, relative to the coarsest step of the same call.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import load_scenario, with_run


def main(
    scenario_file: Path,
    seeds: Annotated[int, typer.Option()] = 48,
    steps: Annotated[list[int], typer.Option()] = [20, 40, 80],  # noqa: B006
    engine: Annotated[str, typer.Option()] = "auto",
) -> None:
    scenario = load_scenario(scenario_file)
    print(f"{scenario.title}, {seeds} seeds")
    print("steps per period  speed (mm/s)       SD  cost (relative)")
    coarsest = 0.0
    for steps_per_period in steps:
        summary = simulate(with_run(scenario, seeds=seeds, steps_per_period=steps_per_period, engine=engine)).summary()
        speed, cost = summary["transport_speed_mm_s"], summary["wall_s_per_simulated_s_one_core"]
        coarsest = coarsest or cost
        interval = f"{speed['mean']:.3f} +- {speed['se']:.3f}"
        print(f"{steps_per_period:>16}  {interval:>15}  {speed['sd']:.3f}  {cost / coarsest:>15.2f}", flush=True)


if __name__ == "__main__":
    typer.run(main)
