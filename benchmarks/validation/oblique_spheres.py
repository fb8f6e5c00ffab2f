"""Oblique impact of a sphere: rigid-body theory, the impact law of the impulse engine, and both engines.

    python benchmarks/validation/oblique_spheres.py [--json] [--picture FILE]

Prints a table as CSV: angle of incidence to the normal, tangential restitution of the centre, angular velocity.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys

import numpy as np
from arguments import new_file

from feeder_sim.studies.validation.oblique_spheres import ANGLES, Rebound, by_engine, by_law, sliding_angle, theory


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--picture", type=new_file, help="draw the table")
    options = parser.parse_args()
    angle = np.array(ANGLES)
    methods = {
        "theory": theory(angle),
        "law": by_law(angle),
        "impulse": by_engine(angle, "impulse"),
        "mujoco": by_engine(angle, "mujoco"),
    }
    if options.picture:
        from feeder_sim.plots.validation.oblique_spheres import draw_oblique_spheres

        draw_oblique_spheres(angle, methods, options.picture)
    rows = [_row(methods, i) for i in range(len(angle))]
    if options.json:
        largest = {name: _largest(methods["theory"], found) for name, found in methods.items() if name != "theory"}
        print(json.dumps({"sliding_angle_deg": sliding_angle(), "largest_deviation": largest, "rows": rows}))
        return
    writer = csv.DictWriter(sys.stdout, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: f"{value:.6g}" for key, value in row.items()} for row in rows)


def _row(methods: dict[str, Rebound], i: int) -> dict[str, float]:
    row = {"angle_deg": ANGLES[i]}
    for name, found in methods.items():
        row[f"tangential_restitution_{name}"] = float(found.tangential[i])
        row[f"angular_velocity_rad_s_{name}"] = float(found.spin[i])
        row[f"rebound_angle_deg_{name}"] = float(found.angle[i])
    return row


def _largest(theory: Rebound, found: Rebound) -> dict[str, float]:
    """Largest deviations from theory."""
    return {
        "tangential_restitution": float(np.abs(found.tangential - theory.tangential).max()),
        "angular_velocity_share": float(np.abs(found.spin / theory.spin - 1.0).max()),
    }


if __name__ == "__main__":
    main()
