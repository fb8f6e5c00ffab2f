"""What the guide of the cylinder at 558 Hz does to its bounces: from one degree of freedom to a leaning tube that rubs.

    python benchmarks/guided_cylinder.py [--seeds 8] [--duration 20]

Each row changes the guide of scenarios/cylinder_558hz.toml only. The last column is wall time per simulated second over
that of the slide, on one core, in the same run.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from feeder_sim.pool.work import Work
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, Slide, Tube, load_scenario, with_run

SCENARIO = Path(__file__).parents[1] / "scenarios/cylinder_558hz.toml"
AMPLITUDES_UM = (18.9, 94.5)
GUIDES: dict[str, dict[str, Any]] = {
    "slide": {"kind": "slide"},
    "tube, free": {},
    "tube, friction 0.2": {"friction": 0.2},
    "tube, friction 0.4": {"friction": 0.4},
    "tube, leaning by 1 deg": {"tilt_deg": 1.0},
    "tube, leaning by 2 deg": {"tilt_deg": 2.0},
    "tube, 2 deg, friction 0.2": {"tilt_deg": 2.0, "friction": 0.2},
    "slide, 2 deg, friction 0.2": {"kind": "slide", "tilt_deg": 2.0, "friction": 0.2},
}


def variant(base: Scenario, amplitude_um: float, guide: dict[str, Any], **run: Any) -> Scenario:
    """The scenario with another amplitude and some keys of its guide replaced."""
    part = base.part[0]
    assert part.guide is not None
    new = Slide(**guide) if "kind" in guide else Tube(**(part.guide.model_dump() | guide))
    changes = {
        "drive": (base.drive[0].model_copy(update={"amplitude_um": amplitude_um}),),
        "part": (part.model_copy(update={"guide": new}),),
    }
    return with_run(base.model_copy(update=changes), **run)


def main(
    seeds: Annotated[int, typer.Option()] = 8,
    duration: Annotated[float, typer.Option(help="[s]")] = 20.0,
) -> None:
    base = load_scenario(SCENARIO)
    run = {"seeds": seeds, "duration_s": duration, "frames_per_second": 100.0}
    for amplitude in AMPLITUDES_UM:
        print(f"558 Hz, {amplitude:g} um              interval (ms)         flight height (mm)  wall time over slide")
        slide = None
        for name, guide in GUIDES.items():
            scenario = variant(base, amplitude, guide, **run)
            simulate(with_run(scenario, duration_s=0.1, seeds=1))  # compiled
            found = simulate(scenario, work=Work(1)).summary()
            cost = found["wall_s_per_simulated_s_one_core"]
            slide = slide or cost
            interval, height = found["bounce_interval_ms"], found["flight_height_mm"]
            print(
                f"  {name:<28} {interval['mean']:6.2f} +- {interval['se']:.2f} (n = {interval['n']:5d})"
                f"  {height['mean']:8.3f} +- {height['se']:.3f}  {cost / slide:10.1f}",
                flush=True,
            )


if __name__ == "__main__":
    typer.run(main)
