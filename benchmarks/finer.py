"""What a tolerance ten times finer than the default changes: drifts of a nut and of a ball, and a block on a tray.

    python benchmarks/finer.py [--seeds 96] [--only ball]

Prints both means and their standard errors [mm/s], and the difference, in standard errors and in per cent.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from tray_theory import CASES, Case, speed_in_engine

ROOT = Path(__file__).parents[1]
BALL = {"shape": "ball", "diameter_mm": 5.0, "material": "steel"}
TOLERANCES = (0.1, 0.01)  # [nm]; the first is the default
TRAY_SEEDS = 4
BALL_TIME = 6.0  # [s]
Speed = tuple[float, float]  # mean and standard error [mm/s]


def nut_drift(name: str, tolerance: float, seeds: int) -> Speed:
    scenario = with_run(load_scenario(ROOT / f"scenarios/{name}.toml"), seeds=seeds, tolerance_nm=tolerance)
    speed = simulate(scenario).measures()["transport_speed_mm_s"]
    return speed["mean"], speed["se"]


def ball_drift(name: str, tolerance: float, seeds: int) -> Speed:
    """A ball on the same plate rolls away from the antinode; its way in a given time."""
    raw = load_scenario(ROOT / f"scenarios/{name}.toml").model_dump()
    raw["part"] = [BALL | {"start": raw["part"][0]["start"]}]
    raw["run"] |= {"seeds": seeds, "tolerance_nm": tolerance, "stop": "time", "duration_s": BALL_TIME}
    runs = simulate(Scenario.model_validate(raw)).trajectories
    return mean_of(np.array([run.position[-1, 0, 0] - run.position[0, 0, 0] for run in runs]) / BALL_TIME)


def mean_of(speeds: NDArray[np.float64]) -> Speed:
    return 1e3 * float(speeds.mean()), 1e3 * float(speeds.std(ddof=1)) / math.sqrt(len(speeds))


def on_tray(case: Case, tolerance: float) -> Speed:
    return mean_of(speed_in_engine(case, seeds=TRAY_SEEDS, tolerance_nm=tolerance).speed)


def cases(seeds: int) -> Iterator[tuple[str, Callable[[float], Speed]]]:
    for name in ("drift_4750hz", "drift_8775hz"):
        yield f"nut, {name}", partial(nut_drift, name, seeds=seeds)
        yield f"ball, {name}", partial(ball_drift, name, seeds=seeds)
    for case in CASES:
        yield f"tray, {case}", partial(on_tray, case)


def main(
    seeds: Annotated[int, typer.Option(help="of a drift")] = 96,
    only: Annotated[str, typer.Option(help="cases whose name holds this")] = "",
) -> None:
    print(f"{'case':<52}{'default (mm/s)':>20}{'finer (mm/s)':>20}{'errors':>8}{'per cent':>10}")
    for name, speed in cases(seeds):
        if only not in name:
            continue
        (usual, error), (finer, finer_error) = (speed(tolerance) for tolerance in TOLERANCES)
        apart, both = usual - finer, math.hypot(error, finer_error)
        print(
            f"{name:<52}{usual:>10.4f} +- {error:.4f}{finer:>10.4f} +- {finer_error:.4f}"
            f"{abs(apart) / both:>8.1f}{100.0 * apart / finer:>+10.2f}",
            flush=True,
        )


if __name__ == "__main__":
    typer.run(main)
