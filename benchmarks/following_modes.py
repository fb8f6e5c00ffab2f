"""What the modes that follow off their resonance change, and what they cost.

    python benchmarks/following_modes.py [--seeds 24] [--cycles 2]

A nut on the ring mode of the plate with patches (transport speed), and scenarios/separation_piezos.toml (picks): the
driven mode alone, those above 1 % of its amplitude, and all (the nut only). Takes some minutes.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from feeder_sim import simulate
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario import Scenario, load_scenario

ROOT = Path(__file__).parents[1]
PLATE = ROOT / "models/plate_180_piezos/modes.h5"


def nut(modes: str | float, seeds: int) -> Scenario:
    """scenarios/drift_2797hz_plate.toml, driven by the patch in the centre at the same voltage."""
    raw = load_scenario(ROOT / "scenarios/drift_2797hz_plate.toml").model_dump()
    raw["plate"]["mode_file"] = PLATE
    raw["drive"] = [raw["drive"][0] | {"actuator": ["centre"], "modes": modes}]
    raw["run"]["seeds"] = seeds
    return Scenario.model_validate(raw)


def separation(modes: str | float, seeds: int, cycles: int) -> Scenario:
    raw = load_scenario(ROOT / "scenarios/separation_piezos.toml").model_dump()
    raw["schedule"]["cycles"] = cycles
    for stage in raw["schedule"]["stage"]:
        for drive in stage["drive"]:
            drive["modes"] = modes
    raw["run"]["seeds"] = seeds
    return Scenario.model_validate(raw)


def compare(name: str, measure: str, scenarios: dict[str, Scenario]) -> None:
    """Print a measure of each scenario, how many modes follow, and the cost over that of the first."""
    first: float | None = None
    for label, scenario in scenarios.items():
        result = simulate(scenario)
        summary: dict[str, Any] = result.summary()
        found = Statistic(**summary[measure])
        cost = float(summary["wall_s_per_simulated_s_one_core"])
        first = first or cost
        follow = max(len(mode.followers) for mode in result.scene.driven)
        print(
            f"{name}, {label}: {found.mean:.3f} +- {found.se:.3f}, {follow} follow, cost {cost / first:.2f}", flush=True
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=24)
    parser.add_argument("--cycles", type=int, default=2)
    options = parser.parse_args()
    shares: dict[str, str | float] = {"driven mode": "driven", "above 1 %": 0.01, "all": "all"}
    speeds = {label: nut(share, options.seeds) for label, share in shares.items()}
    compare("nut, transport speed [mm/s]", "transport_speed_mm_s", speeds)
    picks = {label: separation(shares[label], options.seeds, options.cycles) for label in ("driven mode", "above 1 %")}
    compare(f"separation, picked in {options.cycles} cycles", "picked", picks)


if __name__ == "__main__":
    main()
