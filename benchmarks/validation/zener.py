"""Restitution of a ball on a plate by Zener's theory, and how far its assumptions hold.

    python benchmarks/validation/zener.py [--diameter MM] [--thickness MM] [--ball steel] [--plate aluminium] [--json]
                                          [--picture FILE]

By default a steel ball of 3 mm on 3 mm of aluminium, for which the source of the bouncing ball has 0.2.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from arguments import between, new_file

from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.studies.validation.zener_prediction import predict, yield_speed

SPEEDS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
DRAWN = (0.1, 0.3, 1.0)
MEASURED = 0.2  # the source's, for parts of steel on its plate
STRENGTHS = (100e6, 250e6, 400e6)  # [Pa]; aluminium alloys


def main() -> None:
    isotropic = [name for name, material in MATERIALS.items() if material.isotropic]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--diameter", type=between(1e-3, 1e3), default=3.0, help="of the ball [mm]")
    parser.add_argument("--thickness", type=between(1e-3, 1e3), default=3.0, help="of the plate [mm]")
    parser.add_argument("--ball", choices=isotropic, default="steel")
    parser.add_argument("--plate", choices=isotropic, default="aluminium")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--picture", type=new_file, help="draw restitution over diameter / thickness")
    options = parser.parse_args()
    ball, plate = (
        MATERIALS[options.ball],
        RectangularPlate(1.0, 1.0, 1e-3 * options.thickness, MATERIALS[options.plate]),
    )
    rows = predict(ball, 1e-3 * options.diameter, plate, SPEEDS)
    yields = {f"{strength / 1e6:g}": yield_speed(ball, plate.material, strength) for strength in STRENGTHS}
    if options.picture:
        from feeder_sim.plots.validation.zener import draw_zener

        draw_zener(ball, plate, DRAWN, options.diameter / options.thickness, options.picture)
    if options.json:
        print(json.dumps({"rows": [asdict(row) for row in rows], "measured": MEASURED, "yield_speed_m_s": yields}))
        return
    print("speed (m/s)  lambda   restitution  contact (us)  infinite if no edge within (mm)")
    for row in rows:
        print(
            f"{row.speed:<11g}  {row.inelasticity:.4f}   {row.restitution:.3f}        {1e6 * row.contact_time:<12.1f}  "
            f"{1e3 * row.reach:.0f}"
        )
    print(f"the source has {MEASURED:g} for steel on its plate of 3 mm of aluminium")
    speeds = ", ".join(f"{speed:.3f} m/s at {strength} MPa" for strength, speed in yields.items())
    print(f"the contact yields above {speeds}")


if __name__ == "__main__":
    main()
