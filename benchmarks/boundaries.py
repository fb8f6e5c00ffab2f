"""Where periodic motion of the bouncing ball begins and ends, by bisection in both engines, beside the theory.

python benchmarks/boundaries.py [--steps-per-period 200]
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.scenario import load_scenario, with_run

sys.path.append(str(Path(__file__).parents[1] / "docs/examples"))

from bifurcation import bisect, theoretical_boundaries

SCENARIOS = Path(__file__).parents[1] / "scenarios"
BRACKET = 0.04  # to each side of the theory
SETTLE = {"impulse": 4000, "mujoco": 400}  # plate periods


def main(steps_per_period: Annotated[int, typer.Option(help="of MuJoCo")] = 200) -> None:
    print("scenario     engine   begin of period   amplitude (um)   theory (um)   deviation (%)")
    for name in ("ball_50hz", "ball_500hz"):
        for engine, settle in SETTLE.items():
            scenario = with_run(load_scenario(SCENARIOS / f"{name}.toml"), engine=engine)
            if engine == "mujoco":
                scenario = with_run(scenario, steps_per_period=steps_per_period)
            for period, theory in theoretical_boundaries(scenario).items():
                low, high = (1.0 - BRACKET) * theory, (1.0 + BRACKET) * theory
                found, _ = bisect(scenario, low, high, "1", begins=period == "1", settle=settle)
                print(
                    f"{name:<12} {engine:<8} {period:>15}   {1e6 * found:14.5g}   {1e6 * theory:11.5g}"
                    f"   {100.0 * (found / theory - 1.0):+13.4f}",
                    flush=True,
                )


if __name__ == "__main__":
    typer.run(main)
