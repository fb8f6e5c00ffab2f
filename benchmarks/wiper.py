"""Which share of parts passes a wiper, over its height above the tray: screws, discs and brackets on a straight track.

    python benchmarks/wiper.py --picture docs/figures/wiper.png

The scene is `scenarios/wiper.toml`, with another part and height of the wiper, 16 seeds of four parts each. Below the
thinnest of a part nothing passes; high above the tallest all do.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import matplotlib.pyplot as plt
import numpy as np
import typer

from feeder_sim import load_scenario, simulate
from feeder_sim.run.keep import StatisticsOnly
from feeder_sim.scenario import Scenario

COUNT = 4  # parts of a run
MODELS = Path(__file__).resolve().parents[1] / "models"
KINDS: dict[str, tuple[dict[str, Any], list[float]]] = {
    "screw M3 x 8": (
        {"shape": "mesh", "file": str(MODELS / "screw/screw.stl"), "contact": "parts"},
        [4.5, 5.8, 7.5, 11.5],
    ),
    "disc 8 x 1.6 mm": ({"shape": "cylinder", "diameter_mm": 8.0, "height_mm": 1.6}, [1.4, 2.0, 3.0, 12.0]),
    "bracket": (
        {"shape": "mesh", "file": str(MODELS / "bracket/bracket.stl"), "contact": "parts"},
        [5.0, 9.2, 13.0],
    ),
}


def with_wiper(base: Scenario, part: dict[str, Any], height: float, seeds: int) -> Scenario:
    """The scene with another part, and the wiper at a height [mm]."""
    raw = base.model_dump(mode="python", exclude_unset=True)
    start = raw["part"][0]["start"]
    raw["part"] = [part | {"count": COUNT, "start": start}]
    raw["fixture"][1]["position_mm"] = (*raw["fixture"][1]["position_mm"][:2], height)
    raw["run"] |= {"seeds": seeds}
    return Scenario.model_validate(raw)


def main(
    picture: Annotated[Path | None, typer.Option(help="to write")] = None,
    seeds: Annotated[int, typer.Option()] = 16,
) -> None:
    base = load_scenario("wiper")
    figure, axes = plt.subplots(figsize=(7.0, 3.6), layout="constrained")
    print("part              wiper [mm]   share   SE")
    for name, (part, heights) in KINDS.items():
        shares = []
        for height in heights:
            result = simulate(with_wiper(base, part, height, seeds), record=StatisticsOnly())
            if result.failures:
                print(*result.failures, sep="\n", file=sys.stderr)
            through = result.outlets.parts_through
            shares.append((through.mean / COUNT, through.se / COUNT))
            print(f"{name:<18}{height:>10.1f}{shares[-1][0]:>8.3f}{shares[-1][1]:>7.3f}", flush=True)
        share, error = np.array(shares).T
        axes.errorbar(heights, share, 2.0 * error, marker="o", capsize=3, label=name)
    axes.set(xlabel="height of the wiper above the tray [mm]", ylabel="share that passes", ylim=(-0.03, 1.05))
    axes.legend(frameon=False)
    if picture is not None:
        figure.savefig(picture, dpi=130)


if __name__ == "__main__":
    typer.run(main)
