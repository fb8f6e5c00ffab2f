"""A dimer on a plate that moves up and down: its drift over its aspect ratio, with one ball on the plate.

    python benchmarks/validation/bouncing_dimer.py [--seeds 12] [--json] [--picture FILE]

Steel balls of 5 mm, 25 Hz, 0.9 g, restitution 0.7, three coefficients of friction. The mode depends on the start, so
that only some starts end in it. Speeds are positive toward the ball that bounces. Beside them are those of a program of
its own (dimer_by_steps.py in feeder_sim/studies/validation), with the same law of restitution, Newton's, and with
Poisson's. bouncing_dimer.py there says where the direction changes.
"""

from __future__ import annotations

import argparse
import json

from arguments import new_file, whole

from feeder_sim.plots.validation.bouncing_dimer import draw_bouncing_dimer
from feeder_sim.studies.validation.bouncing_dimer import dimer_drift, speed_by_steps, turning_point

FRICTIONS = (0.1, 0.2, 0.3)
ASPECT_RATIOS = (3.5, 4.0, 4.5, 5.0, 5.5, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=whole(1, 10_000), default=12, help="starts of each dimer")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--picture", type=new_file)
    options = parser.parse_args()
    found, rows = [], []
    for friction in FRICTIONS:
        if not options.json:
            print(f"friction {friction:g}: 1 + 1/mu = {turning_point(friction):.2f}")
            print("  ratio  in the mode  speed (mm/s)  by steps  Poisson")
        for ratio in ASPECT_RATIOS:
            drift = dimer_drift(ratio, friction, options.seeds)
            speed = drift.speed_mm_s
            found.append(drift)
            newton, poisson = (speed_by_steps(ratio, friction, poisson=law) for law in (False, True))
            row = {"friction": friction, "aspect_ratio": ratio, "speed_mm_s": speed.as_dict()}
            rows.append(row | {"by_steps_mm_s": newton, "poisson_mm_s": poisson})
            if not options.json:
                text = f"{speed.mean:+.2f}" if speed.n else "-"
                print(
                    f"  {ratio:5g}  {speed.n:4d} of {options.seeds:<4d}  {text:>9}  {newton:+10.2f}  {poisson:+9.2f}",
                    flush=True,
                )
    if options.json:
        print(json.dumps(rows, indent=1))
    if options.picture:
        draw_bouncing_dimer(found, options.picture)


if __name__ == "__main__":
    main()
