"""Parts on a tray that moves as a linear feeder does: the engine beside the ODE of a point.

    python benchmarks/tray.py [--seeds 4] [--duration 5] [--parts 2]
    python benchmarks/tray.py --picture conveying.png
    python benchmarks/tray.py --shapes

Cases of stick, slip and flight of a flat block (tests/tray_theory.py), level and inclined; with `--parts` of so many
blocks side by side. The picture has speeds over the throw number at three angles.
`--shapes` puts a ball, a nut and a bracket on scenarios/linear_feeder.toml. Speeds are means from 1 s on. The cost is
processor time per simulated second on one core.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from tray_theory import CASES, INCLINED, Case, speed_in_engine, speed_of_point

from feeder_sim import simulate
from feeder_sim.scenario import load_scenario

ROOT = Path(__file__).parents[1]
ANGLES_DEG = (15.0, 25.0, 35.0)
THROWS = tuple(np.arange(0.3, 2.8, 0.2).round(2).tolist())
LYING: dict[str, Any] = {"kind": "point", "position_mm": [-250.0, 0.0], "drop_height_mm": [0.02, 0.05]}
SHAPES: dict[str, dict[str, Any]] = {
    "ball": {"shape": "ball", "diameter_mm": 5.0},
    "nut": {"shape": "hex_nut", "size": "M5"},
    "bracket": {"shape": "mesh", "file": ROOT / "models/bracket/bracket.stl"},
    "box": {"shape": "box", "size_mm": [8.0, 8.0, 2.0]},
}


def compare(seeds: int, duration: float, parts: int) -> None:
    """Print every case."""
    off = []
    print(f"{'case':<60} ODE (mm/s)  engine (mm/s)    deviation (%)  cost (ms/s)")
    for case in (*CASES, *INCLINED):
        found = speed_in_engine(case, count=parts, duration=duration, seeds=seeds)
        reference, speed = 1e3 * speed_of_point(case), 1e3 * found.speed
        off.append(100.0 * (speed.mean() / reference - 1.0))
        print(
            f"{case!s:<60} {reference:10.3f}  {speed.mean():7.3f} +- {speed.std():5.3f} {off[-1]:+14.2f}"
            f"  {1e3 * found.cost:11.2f}",
            flush=True,
        )
    print(f"deviation: median {np.median(np.abs(off)):.2f} %, largest {np.abs(off).max():.2f} %")


def draw(picture: Path, seeds: int, duration: float) -> None:
    """Speeds over the throw number: of the engine as points, of the ODE as lines."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
    fine = np.linspace(THROWS[0], THROWS[-1], 200)
    for angle, colour in zip(ANGLES_DEG, ("C0", "C1", "C2"), strict=True):
        cases = [Case(50.0, throw, angle, 0.4, 0.0) for throw in THROWS]
        speeds = [1e3 * speed_in_engine(case, duration=duration, seeds=seeds).speed.mean() for case in cases]
        axes.plot(THROWS, speeds, "o", color=colour, label=f"{angle:g} deg")
        curve = [1e3 * speed_of_point(Case(50.0, float(throw), angle, 0.4, 0.0)) for throw in fine]
        axes.plot(fine, curve, "-", color=colour, lw=1.0)
    axes.axvline(1.0, color="0.7", lw=0.8)
    axes.set(xlabel="throw number", ylabel="conveying speed [mm/s]", xlim=(0.0, None), ylim=(0.0, None))
    axes.legend(title="line of motion", frameon=False)
    figure.savefig(picture, dpi=150)


def shapes(seeds: int) -> None:
    """Print how fast parts of several shapes travel."""
    scenario = load_scenario("linear_feeder")
    for name, part in SHAPES.items():
        changed = scenario.changed({"part": [part | {"start": LYING}], "run.seeds": seeds})
        found = simulate(changed).conveying.conveying_speed_mm_s
        print(f"{name:<8} {found.mean:7.2f} +- {found.se:.2f} mm/s, n = {found.n}", flush=True)


def main(
    seeds: Annotated[int, typer.Option()] = 4,
    duration: Annotated[float, typer.Option(help="[s]")] = 5.0,
    parts: Annotated[int, typer.Option(min=1)] = 1,
    picture: Annotated[Path | None, typer.Option()] = None,
    of_shapes: Annotated[bool, typer.Option("--shapes")] = False,
) -> None:
    speed_in_engine(CASES[0], count=parts, duration=1.1, seeds=1)  # compiled
    if picture is not None:
        draw(picture, seeds, duration)
    elif of_shapes:
        shapes(16)
    else:
        compare(seeds, duration, parts)


if __name__ == "__main__":
    typer.run(main)
