"""Measured tosses of a cube against this package, and against Bullet where its results are given.

    python benchmarks/validation/cube_tosses.py [--data FILE] [--json] [--engine mujoco] [--friction 0.15]
    python benchmarks/validation/cube_tosses.py --engine both --steps 20 40 80 160 --csv FILE --picture FILE

The picture also shows what is in cube_tosses_points.csv and, of other engines (benchmarks/peers/tosses.py --csv), in
cube_tosses_peers.csv beside this script.

`same_face`: share of the tosses that end with the measured face up; `median_error_mm`: of the distance between the
computed and the measured last place of the centre. Friction 0.18 and restitution 0.125 are those of the authors of the
data; nothing is fitted.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from pathlib import Path
from typing import get_args

import numpy as np
from arguments import between, new_file, whole

from feeder_sim.errors import FeederSimError
from feeder_sim.plots.validation.cube_tosses import draw_tosses
from feeder_sim.studies.validation.cube_tosses import FRICTION, STEPS, Engine, compute_tosses, read_tosses

DATA = Path(__file__).parent / "cube_tosses.csv"
POINTS = (Path(__file__).parent / "cube_tosses_points.csv", Path(__file__).parent / "cube_tosses_peers.csv")
COLUMNS = ("engine", "steps_per_ms", "same_face", "median_error_mm", "median_angle_deg", "n", "processor_s_per_s")
PERIOD_MS = 4.0  # that the steps of a plate at rest are counted in


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA, help="table of tosses [the one beside this script]")
    parser.add_argument("--engine", choices=("impulse", "mujoco", "both"), default="impulse")
    parser.add_argument(
        "--steps", type=whole(20, 10_000), nargs="+", default=[STEPS], help=f"steps in {PERIOD_MS:g} ms [{STEPS}]"
    )
    parser.add_argument("--friction", type=between(0.0, 10.0), default=FRICTION, help=f"of cube and board [{FRICTION}]")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--csv", type=new_file, help="write a row for each engine and number of steps")
    parser.add_argument("--picture", type=new_file, help="draw the ends, and error over cost")
    options = parser.parse_args()
    try:
        return compared(options)
    except FeederSimError as error:
        print(error, file=sys.stderr)
        return 2


def compared(options: argparse.Namespace) -> int:
    tosses, rows, studies = read_tosses(options.data), [], {}
    for engine in get_args(Engine) if options.engine == "both" else (options.engine,):
        for steps in options.steps:
            study = compute_tosses(tosses, engine, steps=steps, friction=options.friction)
            studies[engine] = study
            rows.append({"engine": engine, "steps_per_ms": steps / PERIOD_MS} | study.summary())
            if not options.json:
                print(
                    f"{engine:<8} {steps / PERIOD_MS:>5g} steps per ms: same face {study.same_face.mean():.3f}, median "
                    f"error {rows[-1]['median_error_mm']:.1f} mm after {rows[-1]['median_way_mm']:.0f} mm, "
                    f"{len(tosses)} tosses, {study.processor_s_per_s:.3f} s of processor time per simulated second",
                    flush=True,
                )
    if len(studies) > 1 and not options.json:
        apart = np.linalg.norm(studies["impulse"].computed - studies["mujoco"].computed, axis=1)
        print(f"ends of the two engines are {1e3 * np.median(apart):.1f} mm apart (median)")
    if options.json:
        print(json.dumps(rows[0] if len(rows) == 1 else rows))
    if options.csv:
        with options.csv.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(rows)
    if options.picture:
        points = []
        for path in POINTS:
            with path.open(newline="", encoding="utf-8") as file:
                points += list(csv.DictReader(file))
        draw_tosses(studies, points, options.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
