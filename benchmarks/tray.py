"""A flat block on a tray that moves as a linear feeder does: the engine beside the ODE of a point.

    python benchmarks/tray.py [--seeds 4] [--duration 5]

Twelve cases of stick, slip and flight (tests/tray_theory.py). Speeds are means from 1 s on. The cost is processor time
per simulated second on one core.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from tray_theory import CASES, speed_in_engine, speed_of_point


def main(seeds: Annotated[int, typer.Option()] = 4, duration: Annotated[float, typer.Option(help="[s]")] = 5.0) -> None:
    speed_in_engine(CASES[0], duration=1.1, seeds=1)  # compiled
    off = []
    print(f"{'case':<46} ODE (mm/s)  engine (mm/s)    deviation (%)  cost (ms/s)")
    for case in CASES:
        reference, found = 1e3 * speed_of_point(case), speed_in_engine(case, duration=duration, seeds=seeds)
        speed = 1e3 * found.speed
        off.append(100.0 * (speed.mean() / reference - 1.0))
        print(
            f"{case!s:<46} {reference:10.3f}  {speed.mean():7.3f} +- {speed.std():5.3f} {off[-1]:+14.2f}"
            f"  {1e3 * found.cost:11.2f}",
            flush=True,
        )
    print(f"deviation: median {np.median(np.abs(off)):.2f} %, largest {np.abs(off).max():.2f} %")


if __name__ == "__main__":
    typer.run(main)
