"""Where the two engines differ in the drift, and what of it the surface model explains.

    python benchmarks/engine_difference.py --seeds 96

The MuJoCo engine takes the surface under a part for its tangent plane; the impulse engine can do so, too.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import load_scenario, with_run

SCENARIOS = Path(__file__).parents[1] / "scenarios"
CASES: dict[str, dict[str, Any]] = {
    "impulse, curved surface": {"engine": "impulse"},
    "impulse, tangent plane": {"engine": "impulse", "tangent_surface": True},
    "mujoco, tangent plane": {"engine": "mujoco"},
}


def main(seeds: Annotated[int, typer.Option()] = 96) -> None:
    for name in ("drift_4750hz", "drift_8775hz"):
        scenario = load_scenario(SCENARIOS / f"{name}.toml")
        print(f"{scenario.title}, {seeds} seeds (mm/s)")
        for case, changes in CASES.items():
            speed = simulate(with_run(scenario, seeds=seeds, **changes)).measures()["transport_speed_mm_s"]
            print(f"  {case:<26} {speed['mean']:.3f} +- {speed['se']:.3f}", flush=True)


if __name__ == "__main__":
    typer.run(main)
