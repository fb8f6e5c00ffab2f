"""Mean transport speed over the steps per period of MuJoCo, or the tolerance of impulses: what drift scenarios need.

    python benchmarks/convergence.py scenarios/drift_8775hz.toml --engine mujoco --seeds 48 --steps 40 --steps 80
    python benchmarks/convergence.py scenarios/drift_8775hz.toml --tolerance-nm 1 --tolerance-nm 0.1

Cost is wall time per simulated second on one core, relative to the first setting of the same call.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import load_scenario, with_run


def main(
    scenario_file: Path,
    seeds: Annotated[int, typer.Option()] = 48,
    steps: Annotated[list[int], typer.Option()] = [20, 40, 80],  # noqa: B006
    tolerance_nm: Annotated[list[float], typer.Option()] = [1.0, 0.1, 0.01],  # noqa: B006
    engine: Annotated[str, typer.Option()] = "impulse",
) -> None:
    scenario = load_scenario(scenario_file)
    print(f"{scenario.title}, {seeds} seeds")
    settings: list[Any]
    key, settings = ("steps_per_period", steps) if engine == "mujoco" else ("tolerance_nm", tolerance_nm)
    print(f"{key:>16}  speed (mm/s)       SD  cost (relative)")
    coarsest = 0.0
    for setting in settings:
        changes: dict[str, Any] = {key: setting}
        summary = simulate(with_run(scenario, seeds=seeds, engine=engine, **changes)).summary()
        speed, cost = summary["transport_speed_mm_s"], summary["wall_s_per_simulated_s_one_core"]
        coarsest = coarsest or cost
        interval = f"{speed['mean']:.3f} +- {speed['se']:.3f}"
        print(f"{setting:>16}  {interval:>15}  {speed['sd']:.3f}  {cost / coarsest:>15.2f}", flush=True)


if __name__ == "__main__":
    typer.run(main)
