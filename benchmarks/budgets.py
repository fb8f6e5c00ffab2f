"""Error budgets of the two measured drifts, of the transport and of the separation (docs/budget.md).

    python benchmarks/budgets.py [--only drift_4750hz] [--folder FOLDER]

What was not measured is uncertain: restitution and friction everywhere, the amplitude by a tenth where the source gives
none, and whether the plate of the separation has a rim. The separation takes half an hour, the others some minutes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from feeder_sim import budget, load_scenario

SCENARIOS = Path(__file__).parents[1] / "scenarios"
CONTACT: dict[str, Any] = {
    "contact.restitution": {"uniform": (0.1, 0.4), "also": ("contact.part_restitution",)},
    "contact.friction": {"uniform": (0.2, 0.4), "also": ("contact.part_friction",)},
}


def unmeasured(*amplitudes: tuple[str, float]) -> dict[str, Any]:
    return {key: {"log_normal": (value, 0.1)} for key, value in amplitudes}


STAGES = [(f"schedule.stage[{i}].drive[0].amplitude_um", um) for i, um in enumerate((23.75, 2.69, 4.26, 2.01, 8.27))]
# By scenario: what is uncertain, measure, seeds of an entry, draws of the inputs.
BUDGETS: dict[str, tuple[dict[str, Any], str, int, int]] = {
    "drift_4750hz": (CONTACT, "transport_speed_mm_s", 128, 64),
    "drift_8775hz": (CONTACT | unmeasured(("drive[0].amplitude_um", 1.0)), "transport_speed_mm_s", 128, 64),
    "transport_strip": (CONTACT | unmeasured(*STAGES), "arrival_time_s", 32, 32),
    "separation_100": (CONTACT | {"plate.rim": {"choice": (False, True)}}, "picked", 8, 8),
}


def main(
    only: Annotated[str | None, typer.Option("--only", help="of these scenarios")] = None,
    folder: Annotated[Path, typer.Option("--folder", help="for tables and pictures")] = Path("budgets"),
) -> None:
    for name, (uncertain, measure, seeds, inputs) in BUDGETS.items():
        if only not in (None, name):
            continue
        scenario = load_scenario(SCENARIOS / f"{name}.toml").changed({"uncertain": uncertain})
        study = budget(scenario, measure=measure, seeds=seeds, inputs=inputs, out=folder / name)
        print(name, *study.lines(), sep="\n", flush=True)


if __name__ == "__main__":
    typer.run(main)
