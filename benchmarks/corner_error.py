"""Contact corners of a screw over the error that is allowed: their number, its height at rest, and how drops end.

python benchmarks/corner_error.py [--drops 300]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from feeder_sim.part.mesh_part import mesh_part
from feeder_sim.scenario import Contact
from feeder_sim.studies.drops import drop

SCREW = Path(__file__).parents[1] / "models" / "screw" / "screw.stl"
ERRORS_UM = (20, 25, 50, 100, 200)
STEEL = 7850.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drops", type=int, default=300)
    drops = parser.parse_args().drops
    print(f"error (um)  corners  poses: centre (mm) and share of {drops} drops")
    for error in ERRORS_UM:
        part = mesh_part(SCREW, 1.0, STEEL, "screw", corner_error=1e-6 * error)
        study = drop(part, drops, contact=Contact())
        poses = ", ".join(f"{s.pose.name} {1e3 * s.pose.height:.3f}, {100 * s.value:.0f} %" for s in study.shares)
        print(f"{error:>10}  {len(part.corners):>7}  {poses}", flush=True)


if __name__ == "__main__":
    main()
