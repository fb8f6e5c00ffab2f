"""Measured tosses of a cube (benchmarks/validation/cube_tosses.csv) in Bullet and in plain MuJoCo.

    python benchmarks/peers/tosses.py [--only bullet|mujoco] [--steps-per-ms 10 20] [--csv FILE]

Prints the share of the tosses that end with the measured face up, the median distance of the final centre from the
measured one, the number of tosses, and the processor time per simulated second. Cube, friction and restitution are
those of benchmarks/validation/cube_tosses.py: the authors' own, nothing is fitted.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from cube_tosses import EDGE_MM, INERTIA_G_MM2, MASS_G, Toss, compare, read_tosses
from numpy.typing import NDArray

DATA = Path(__file__).parents[1] / "validation" / "cube_tosses.csv"
EDGE, MASS, INERTIA = 1e-3 * EDGE_MM, 1e-3 * MASS_G, 1e-9 * INERTIA_G_MM2  # [m], [kg], [kg m2] about every axis
STEPS_PER_MS = 10
ENGINES = {"Bullet": "toss_bullet", "plain MuJoCo": "toss_mujoco"}
COLUMNS = ("engine", "steps_per_ms", "same_face", "median_error_mm", "median_angle_deg", "n", "processor_s_per_s")


def corners() -> NDArray[np.float64]:
    """Of the cube, shape (8, 3) [m]."""
    return 0.5 * EDGE * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)


def start(toss: Toss) -> NDArray[np.float64]:
    """Place of the centre with no corner below z = 0, shape (3,) [m]."""
    lowest = float(toss.position[2] + toss.attitude.apply(corners())[:, 2].min())
    return toss.position - [0.0, 0.0, min(lowest, 0.0)]


def scores(tosses: Sequence[Toss], engine: Any, steps_per_ms: int) -> dict[str, float]:
    """How well an engine agrees with the measured ends, and what it costs."""
    began = time.process_time()
    poses = engine.final_poses(tosses, steps_per_ms=steps_per_ms)
    cost = (time.process_time() - began) / sum(toss.duration for toss in tosses)
    return compare(tosses, poses, processor_s_per_s=cost).summary()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=("bullet", "mujoco"), help="one of the engines")
    parser.add_argument(
        "--steps-per-ms",
        type=int,
        choices=range(1, 1001),
        metavar="N",
        nargs="+",
        default=[STEPS_PER_MS],
        help=f"[{STEPS_PER_MS}]",
    )
    parser.add_argument("--csv", type=Path, help="write a row for each engine and number of steps")
    options = parser.parse_args()
    tosses, rows = read_tosses(DATA), []
    for name, module in ENGINES.items():
        if options.only and not module.endswith(options.only):
            continue
        try:
            engine: Any = importlib.import_module(module)
        except ImportError as error:
            print(f"{name}: skipped, not installed ({error})", file=sys.stderr)
            continue
        for steps in options.steps_per_ms:
            found = scores(tosses, engine, steps)
            rows.append({"engine": name, "steps_per_ms": steps} | found)
            print(
                f"{name}, {steps} steps per ms: same_face {found['same_face']:.3f}, median_error_mm "
                f"{found['median_error_mm']:.1f}, n {found['n']:.0f}, {found['processor_s_per_s']:.2g} s of processor "
                f"time per simulated second; {engine.SETTINGS}",
                flush=True,
            )
    if options.csv:
        with options.csv.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
