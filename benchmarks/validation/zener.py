"""Restitution of a ball on a plate by Zener's theory, and how far its assumptions hold.

    python benchmarks/validation/zener.py [--diameter MM] [--thickness MM] [--ball steel] [--plate aluminium] [--json]
                                          [--picture FILE]

By default a steel ball of 3 mm on 3 mm of aluminium, for which the source of the bouncing ball has 0.2.

The plate counts as infinite: true while the contact is over before bending waves come back from an edge. At the
frequency f = 1/(2 t_c) of a contact of duration t_c their group velocity is 2 (D / rho h)^(1/4) (2 pi f)^(1/2).

The contact counts as elastic. With a yield strength Y of the softer side and the density rho of the ball it yields
above the speed V with rho V^2 / Y = 26 (Y / E*)^4 (Johnson, Contact Mechanics, 1985, section 11.4).
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from arguments import between, new_file
from numpy.typing import NDArray

from feeder_sim.document.figure import empty_figure
from feeder_sim.plate.materials import MATERIALS, Material
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.zener import contact_stiffness, contact_time, inelasticity, restitution

ELASTIC_CONTACT = 3.218  # duration of an impact without losses, in units of T


@dataclass(frozen=True)
class Prediction:
    """An impact of a ball at one speed.

    Attributes:
        speed: normal [m/s].
        inelasticity: Zener's lambda [1].
        restitution: [1].
        contact_time: of the elastic impact [s].
        reach: how far from the ball an edge is at least whose waves come back after the contact [m].
    """

    speed: float
    inelasticity: float
    restitution: float
    contact_time: float
    reach: float


def predict(ball: Material, diameter: float, plate: RectangularPlate, speeds: Sequence[float]) -> list[Prediction]:
    """Impacts of a ball of a diameter [m] on a plate at normal speeds [m/s]."""
    return [_predicted(ball, 0.5 * diameter, plate, speed) for speed in speeds]


def _predicted(ball: Material, radius: float, plate: RectangularPlate, speed: float) -> Prediction:
    value = inelasticity(ball, radius, plate, speed)
    lasts = ELASTIC_CONTACT * contact_time(ball, radius, plate.material, speed)
    group = 2.0 * (plate.bending_stiffness / plate.mass_per_area) ** 0.25 * math.sqrt(math.pi / lasts)
    return Prediction(speed, value, restitution(value), lasts, 0.5 * group * lasts)


def restitution_over_size(
    ball: Material, plate: RectangularPlate, ratios: NDArray[np.float64], speed: float
) -> NDArray[np.float64]:
    """Restitution (n,) of balls of diameters over the plate's thickness (n,), at one speed [m/s]."""
    return np.array([predict(ball, ratio * plate.thickness, plate, [speed])[0].restitution for ratio in ratios])


def yield_speed(ball: Material, plate: Material, yield_strength: float) -> float:
    """Normal speed [m/s] above which the contact yields, the softer side having this yield strength [Pa]."""
    reduced = 0.75 * contact_stiffness(ball, 1.0, plate)  # E* [Pa]
    return math.sqrt(26.0 * yield_strength / ball.density * (yield_strength / reduced) ** 4)


COLOURS = ("#3a60be", "#3a8a5a", "#be3434")


def draw_zener(ball: Material, plate: RectangularPlate, speeds: Sequence[float], marked: float, path: Path) -> None:
    """Draw restitution over diameter / thickness at up to three speeds [m/s], one ratio marked."""
    figure = empty_figure(5.2, 3.4)
    axes = figure.subplots()
    ratios = np.geomspace(0.1, 8.0, 60)
    for speed, colour in zip(speeds, COLOURS, strict=False):
        axes.semilogx(ratios, restitution_over_size(ball, plate, ratios, speed), color=colour, label=f"{speed:g} m/s")
    axes.axvline(marked, color="gray", linewidth=0.8, linestyle="--")
    axes.set(xlabel="diameter of the ball / thickness of the plate", ylabel="restitution", ylim=(0.0, 1.0))
    axes.grid(True, alpha=0.3, which="both")
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)


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
