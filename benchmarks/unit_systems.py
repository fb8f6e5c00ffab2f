"""Does the unit system of the MJCF change the drift? The same scene in SI and in mm-g-ms, and why they differ.

    python benchmarks/unit_systems.py --seeds 24

Two solver tolerances: MuJoCo's default, and the one the package sets (that default scaled back from the trace of the
whole inertia matrix, heavy patches included, to the trace of the part).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.scenario.tables import validated

SCENARIO = Path(__file__).parents[1] / "scenarios/drift_4750hz.toml"


def main(seeds: Annotated[int, typer.Option(min=2)] = 24) -> None:
    raw = load_scenario(SCENARIO).model_dump(exclude_none=True)
    raw["run"] |= {"engine": "mujoco", "seeds": seeds}
    print(f"{raw['title']}, {seeds} seeds\ntolerance  units    speed (mm/s)")
    for tolerance in ("default", "scaled"):
        for units in ("SI", "mm-g-ms"):
            raw["mujoco"] = {"tolerance": tolerance, "units": units}
            found = simulate(validated(raw, Scenario, SCENARIO)).measures()["transport_speed_mm_s"]
            print(f"{tolerance:<10} {units:<8} {found['mean']:.3f} +- {found['se']:.3f}", flush=True)


if __name__ == "__main__":
    typer.run(main)
