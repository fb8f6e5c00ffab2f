"""859 measured planar impacts of an ellipse against laws of impact.

    python benchmarks/validation/ellipse_impacts.py [--data FILE] [--json] [--compare] [--picture FILE]

Prints the median error of the velocity change over the measured velocity change, angular velocity weighed by the radius
of gyration, for the engine's law (Newton, Coulomb) with one restitution and one friction for all impacts. `--compare`
fits the constants of four laws to one half of the impacts each, and tries them on the other half.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from arguments import new_file

from feeder_sim.errors import InputError
from feeder_sim.studies.validation.ellipse_impacts import (
    FRICTION,
    HOMOGENEOUS,
    INVERSE_INERTIA,
    RESTITUTION,
    Comparison,
    compare,
    error_shares,
    newton,
    read_impacts,
    torque_slopes,
)

DATA = Path(__file__).with_suffix(".csv")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--compare", action="store_true", help="four laws, each with constants of its own")
    parser.add_argument(
        "--picture", type=new_file, help="draw measured and predicted changes, and the errors of the laws"
    )
    options = parser.parse_args()
    try:
        impacts = read_impacts(options.data)
        if len(impacts.arm) < 2 and (options.compare or options.picture):
            raise InputError("holds one impact, allowed are two and more where laws are compared", file=options.data)
    except InputError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    errors = error_shares(impacts, newton(impacts, RESTITUTION, FRICTION))
    alike = error_shares(impacts, newton(impacts, RESTITUTION, FRICTION, HOMOGENEOUS), HOMOGENEOUS)
    slopes = torque_slopes(impacts)
    found: dict[str, Any] = {
        "median_error_share": float(np.median(errors)),
        "n": len(errors),
        "upper_quartile": float(np.quantile(errors, 0.75)),
        "restitution": RESTITUTION,
        "friction": FRICTION,
        "mass_over_inertia_1_m2": INVERSE_INERTIA,
        "mass_over_inertia_measured_1_m2": slopes,
        "median_error_share_homogeneous": float(np.median(alike)),
    }
    laws = compare(impacts) if options.compare or options.picture else []
    if laws:
        found["laws"] = {law.law.name: _row(law) for law in laws}
    if options.picture:
        from feeder_sim.plots.validation.ellipse_impacts import draw_ellipse_impacts

        draw_ellipse_impacts(impacts, laws, options.picture)
    print(json.dumps(found) if options.json else _text(found))
    return 0


def _row(law: Comparison) -> dict[str, Any]:
    return {"constants": law.constants, "median_fitted_half": law.fitted, "median_other_half": law.held_out}


def _text(found: dict[str, Any]) -> str:
    lines = [
        f"{found['n']} impacts, e {RESTITUTION:g}, mu {FRICTION:g}: median error {found['median_error_share']:.2%} of "
        f"the velocity change, upper quartile {found['upper_quartile']:.2%}",
        f"m / I from the spins {found['mass_over_inertia_measured_1_m2'][0]:.0f} and "
        f"{found['mass_over_inertia_measured_1_m2'][1]:.0f} 1/m2, used {INVERSE_INERTIA:g}; homogeneous "
        f"{HOMOGENEOUS:.0f}: {found['median_error_share_homogeneous']:.2%}",
    ]
    for name, row in found.get("laws", {}).items():
        constants = ", ".join(f"{key} {value:.3f}" for key, value in row["constants"].items())
        halves = f"{row['median_fitted_half']:.2%}, other half {row['median_other_half']:.2%}"
        lines.append(f"{name} ({constants}): fitted half {halves}")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
