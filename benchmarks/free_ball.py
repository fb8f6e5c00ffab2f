"""Mean heights of a free ball on a swinging piston: the engine beside one dimension without a step.

    python benchmarks/free_ball.py [--amplitudes 40] [--seeds 8] [--duration 10]

Amplitudes from 0.5 to 5 um at 2797, 4750 and 8775 Hz, for restitutions 0.2, 0.5 and 0.8; 40 of them make 120 cases for
each restitution. The reference is tests/small_noise_slide.py. The cost is processor time per simulated second on one
core.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from ball_on_piston import Case, compared

FREQUENCIES = (2797.0, 4750.0, 8775.0)
RESTITUTIONS = (0.2, 0.5, 0.8)


def main(
    amplitudes: Annotated[int, typer.Option(help="at each frequency")] = 40,
    seeds: Annotated[int, typer.Option()] = 8,
    duration: Annotated[float, typer.Option(help="[s]")] = 10.0,
    every: Annotated[bool, typer.Option(help="print every case")] = False,
) -> None:
    compared(Case(FREQUENCIES[0], 1e-6, 0.2), duration=0.1, seeds=2)  # compiled
    print("deviation of the mean height       median (%)  90 % (%)  worst (%)  in errors: 90 %  worst  cost (ms/s)")
    for restitution in RESTITUTIONS:
        rows = []
        for frequency in FREQUENCIES:
            for amplitude in np.geomspace(0.5e-6, 5e-6, amplitudes):
                case = Case(frequency, float(amplitude), restitution)
                found = compared(case, duration=duration, seeds=seeds)
                rows.append((100.0 * abs(found.deviation), abs(found.in_errors), 1e3 * found.cost))
                if every:
                    heights = f"{1e6 * found.reference.mean:10.3f} {1e6 * found.engine.mean:10.3f} um"
                    print(f"  {case!s:<32} {heights} {100.0 * found.deviation:+7.2f} % {found.in_errors:+7.1f} errors")
        off, errors, cost = np.array(rows).T
        print(
            f"e {restitution:g}, {len(rows)} cases {'':<17} {np.median(off):10.2f}  {np.quantile(off, 0.9):8.2f}"
            f"  {off.max():9.1f}  {np.quantile(errors, 0.9):15.1f}  {errors.max():5.1f}  {cost.mean():11.2f}",
            flush=True,
        )


if __name__ == "__main__":
    typer.run(main)
