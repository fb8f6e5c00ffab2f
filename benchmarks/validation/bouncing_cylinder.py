"""A cylinder on a standing wave, beside a published program: speeds at seven settings, by its rules and by the engine.

    python benchmarks/validation/bouncing_cylinder.py [--seeds 100] [--json] [--picture FILE]

Columns: what the program gave; its rules in a program of our own, with Poisson's restitution as it has and with
Newton's as the engines have; the engine with the same rectangle in the same plane; and a cylinder in space. Then on a
surface whose points move in the plane of the plate too, as those of a plate of 0.5 mm would: its rules, the same with
an impulse at each vertex in place of one at their mean, and the engine.
feeder_sim/studies/validation/bouncing_cylinder.py says more.
"""

from __future__ import annotations

import argparse
import json

from arguments import new_file, whole

from feeder_sim.plots.validation.bouncing_cylinder import draw_bouncing_cylinder
from feeder_sim.studies.validation.bouncing_cylinder import METHODS, compare

HEADS = {
    "rules": "its rules",
    "newton": "Newton",
    "engine": "engine",
    "cylinder": "in space",
    "rules_in_plane": "its rules, i.p.",
    "vertices_in_plane": "vertices, i.p.",
    "engine_in_plane": "engine, i.p.",
    "cylinder_in_plane": "in space, i.p.",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=whole(1, 10_000), default=100, help="starts, within 10 um of each other")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--picture", type=new_file)
    options = parser.parse_args()
    found, rows = [], []
    if not options.json:
        heads = "  ".join(f"{HEADS[method]:>15}" for method in METHODS)
        print(f"speeds in mm/s; i.p.: with in-plane velocity\n{'setting':<32}  program  {heads}")
    for setting, speeds in compare(options.seeds):
        found.append((setting, speeds))
        means = {method: each.speed_mm_s for method, each in speeds.items()}
        rows.append(
            {"setting": setting.name, "published_mm_s": 1e3 * setting.speed}
            | {method: mean.as_dict() for method, mean in means.items()}
        )
        if not options.json:
            columns = "  ".join(f"{m.mean:7.2f} +- {m.se:.2f}".rjust(15) for m in means.values())
            print(f"{setting.name:<32}  {1e3 * setting.speed:7.2f}  {columns}", flush=True)
    if options.json:
        print(json.dumps(rows, indent=1))
    if options.picture:
        draw_bouncing_cylinder(found, options.picture)


if __name__ == "__main__":
    main()
