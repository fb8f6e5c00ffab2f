"""The study of the source on piezo patches: size, shape, orientation, thickness, and which strain makes the motion.

    python benchmarks/patch_study.py [--json] [--picture patches.png]

A patch of 10 x 10 x 2 mm in the middle of the 180 mm plate, and 33.75 mm beside it; amplitudes at the patch over those
of this reference. Takes a minute.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.plate.materials import MATERIALS, Material
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Layer
from feeder_sim.studies.patch_study import (
    PatchCase,
    compare_patches,
    inertial_share,
    reference_case,
    square,
)

PLATE = RectangularPlate(0.18, 0.18, 0.003, MATERIALS["aluminium"])
CERAMIC = Material(7700.0, 1.0 / 13e-12, 0.31)
CENTRE = Layer((0.0, 0.0), (0.01, 0.01), 0.0, 0.002, -1, CERAMIC)
STRAIN = 1e-5
D33_OVER_D31 = 2.2  # of usual ceramics
HIGHEST, N_MODES = 7900.0, 6
SIDES = (5.0, 7.5, 10.0, 15.0)  # [mm]
LAGS = (0.0, 0.55, 0.9)  # [mm]
SHAPES = ((20.0, 5.0), (12.5, 8.0), (8.0, 12.5), (5.0, 20.0))  # [mm]


def shaped(reference: PatchCase, size: tuple[float, float], angle: float = 0.0) -> PatchCase:
    a, b = (1e-3 * side for side in size)
    name = f"{size[0]:g} x {size[1]:g} mm" + (f", turned by {math.degrees(angle):g} deg" if angle else "")
    return replace(reference, name=name, layer=replace(reference.layer, size=(a, b), angle=angle))


def ratios(cases: list[PatchCase], n_modes: int = N_MODES) -> dict[str, Any]:
    found = compare_patches(PLATE, cases, highest_frequency=HIGHEST, n_modes=n_modes)
    return {
        "frequency_hz": found[0].frequency.tolist(),
        **{f"{each.case.name}": each.ratio.tolist() for each in found[1:]},
    }


def study() -> dict[str, Any]:
    centre = reference_case(PLATE, CENTRE, STRAIN)
    beside = reference_case(PLATE, replace(CENTRE, centre=(0.0, 0.03375)), STRAIN)
    table: dict[str, Any] = {}
    for lag in LAGS:
        base = square(centre, 10e-3, shear_lag=1e-3 * lag)
        cases = [square(base, 1e-3 * side) for side in SIDES if side != 10.0]
        table[f"size, shear lag {lag:g} mm"] = ratios([base, *cases])
    table["half the thickness at the same field"] = ratios([centre, square(centre, 10e-3, thickness=1e-3)])
    table["shape of 100 mm2, in the middle"] = ratios([centre, *(shaped(centre, size) for size in SHAPES)])
    table["shape of 100 mm2, 33.75 mm beside it"] = ratios([beside, *(shaped(beside, size) for size in SHAPES)], 4)
    table["orientation"] = ratios([centre, shaped(centre, (10.0, 10.0), 0.25 * math.pi)])
    share = inertial_share(PLATE, centre, D33_OVER_D31 * STRAIN, highest_frequency=HIGHEST, n_modes=N_MODES)
    table["force by inertia of a patch that grows thicker, over that of its stretch"] = {
        "frequency_hz": table["orientation"]["frequency_hz"],
        "share": share.tolist(),
    }
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    table = study()
    if options.picture:
        draw(table, options.picture)
    if options.json:
        print(json.dumps(table))
        return
    for subject, rows in table.items():
        print(subject)
        for name, values in rows.items():
            digits = 0 if name == "frequency_hz" else 3
            print(f"  {name:<28}" + "".join(f"{value:>9.{digits}f}" for value in values))


def draw(table: dict[str, Any], path: Path) -> None:
    """Amplitude over the side of a square patch, and over the shape of a patch of 100 mm2."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    for lag, mark in zip(LAGS, ("o", "s", "^"), strict=True):
        rows = table[f"size, shear lag {lag:g} mm"]
        sides, means, low, high = [10.0], [1.0], [1.0], [1.0]
        for side in SIDES:
            if side != 10.0:
                values = rows[f"{side:g} mm, 2 mm thick"]
                sides.append(side)
                means.append(float(np.mean(values)))
                low.append(min(values))
                high.append(max(values))
        order = np.argsort(np.array(sides))
        middle = np.array(means)[order]
        error = [middle - np.array(low)[order], np.array(high)[order] - middle]
        left.errorbar(np.array(sides)[order], middle, error, marker=mark, capsize=2, label=f"shear lag {lag:g} mm")
    line = np.linspace(4.0, 16.0, 50)
    left.plot(line, (line / 10.0) ** 2, color="0.6", linestyle="--", label="area")
    left.set(xlabel="side of a square patch (mm)", ylabel="amplitude over that of 10 mm")
    left.legend(fontsize=8)
    rows = table["shape of 100 mm2, 33.75 mm beside it"]
    names = [name for name in rows if name != "frequency_hz"]
    for i, frequency in enumerate(rows["frequency_hz"]):
        right.plot(range(len(names)), [rows[name][i] for name in names], "o-", label=f"{frequency:.0f} Hz")
    right.axhline(1.0, color="0.6", linestyle="--")
    right.set_xticks(range(len(names)), [name.replace(" mm", "") for name in names])
    right.set(xlabel="shape (mm x mm), first side along x", ylabel="amplitude over that of 10 x 10")
    right.legend(fontsize=8)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main()
