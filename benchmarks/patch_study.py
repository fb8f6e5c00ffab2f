"""The study of the source on piezo patches: size, shape, orientation, thickness, and which strain makes the motion.

    python benchmarks/patch_study.py [--json] [--picture patches.png]

A patch of 10 x 10 x 2 mm in the middle of the 180 mm plate, and 33.75 mm beside it; amplitudes at the patch over those
of this reference. Takes a minute.

Each patch loads the plate with its mass and stiffness and acts by its own closed form (feeder_sim.plate.actuators). The
figure of every case is the amplitude at the middle of the patch over that of a reference patch, mode by mode, at the
same voltage or at the same field in the ceramic. Damping is the same for all, so that it drops out.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.actuators import PERFECT_BOND, Actuator, bond_share, moment_of_strain
from feeder_sim.plate.materials import MATERIALS, Material
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Layer

SAME_SHAPE = 0.8  # of the correlation of two deflections that belong to the same mode of both plates


@dataclass(frozen=True)
class PatchCase:
    """One patch of the study.

    Attributes:
        name: for people.
        layer: the patch.
        strain: that it would have if it were free [1].
        slip: of its glue over the shear stress [m/Pa]; None: as laminate theory has it, stress up to its edges.
    """

    name: str
    layer: Layer
    strain: float
    slip: float | None


@dataclass(frozen=True)
class PatchAmplitudes:
    """Amplitudes of a case, for the modes of the reference.

    Attributes:
        case: the patch.
        frequency: of the modes, with the reference patch [Hz].
        ratio: amplitude at the middle of the patch over that of the reference, shape (n_modes,).
    """

    case: PatchCase
    frequency: NDArray[np.float64]
    ratio: NDArray[np.float64]


def compare_patches(
    plate: RectangularPlate, cases: Sequence[PatchCase], *, highest_frequency: float, n_modes: int
) -> list[PatchAmplitudes]:
    """Compare patches with the first one, on the modes that this one moves most.

    Raises:
        ValueError: a mode of the reference has no counterpart on the plate with another patch.
    """
    modes, amplitude = _resonant_amplitudes(plate, cases[0], highest_frequency)
    chosen = np.sort(np.argsort(-amplitude)[:n_modes])
    found = []
    for case in cases:
        others, theirs = _resonant_amplitudes(plate, case, 1.05 * highest_frequency)
        same = [_counterpart(modes, int(index), others) for index in chosen]
        found.append(PatchAmplitudes(case, modes.natural_frequency[chosen], theirs[same] / amplitude[chosen]))
    return found


def _resonant_amplitudes(
    plate: RectangularPlate, case: PatchCase, highest_frequency: float
) -> tuple[PlateModes, NDArray[np.float64]]:
    """The modes of a plate with a patch, and 2 zeta times the amplitude of each at its middle [m], (n_modes,)."""
    modes = plate_modes(plate, highest_frequency=highest_frequency, attachments=[case.layer])
    moment = moment_of_strain(plate, case.layer) * case.strain
    if case.slip is not None:
        moment *= bond_share(plate, case.layer, case.slip)
    force = Actuator(case.name, case.layer, moment).force_per_volt(modes)
    at_patch = modes.evaluate_whole(np.array([case.layer.centre]))[:, 0, 0]
    stiffness = modes.modal_mass * (2.0 * math.pi * modes.natural_frequency) ** 2
    return modes, np.abs(force * at_patch) / stiffness


def _counterpart(modes: PlateModes, index: int, others: PlateModes) -> int:
    """Index of the mode in `others` with the shape of a mode."""
    own = modes.coefficients[index, 0].ravel()
    theirs = others.coefficients[:, 0].reshape(len(others), -1)
    likeness = np.abs(theirs @ own) / (np.linalg.norm(theirs, axis=1) * np.linalg.norm(own))
    best = int(likeness.argmax())
    if likeness[best] < SAME_SHAPE:
        raise ValueError(f"the mode at {modes.natural_frequency[index]:.0f} Hz is another one with this patch")
    return best


def inertial_share(
    plate: RectangularPlate, case: PatchCase, thickness_strain: float, *, highest_frequency: float, n_modes: int
) -> NDArray[np.float64]:
    """Modal force of a patch that grows thicker, by the inertia of its mass, over that of its stretch.

    Args:
        plate: the plate.
        case: the patch.
        thickness_strain: relative growth of its thickness, at the voltage of `case.strain`.
        highest_frequency: of the modes [Hz].
        n_modes: so many of them, those that the patch moves most; in order of frequency.
    """
    modes, amplitude = _resonant_amplitudes(plate, case, highest_frequency)
    chosen = np.sort(np.argsort(-amplitude)[:n_modes])
    squared = (2.0 * math.pi * modes.natural_frequency[chosen]) ** 2
    at_patch = modes.evaluate_whole(np.array([case.layer.centre]))[chosen, 0, 0]
    stretch = amplitude[chosen] / np.abs(at_patch) * modes.modal_mass[chosen] * squared
    rise = 0.5 * thickness_strain * case.layer.thickness  # of its centre of mass
    return np.asarray(case.layer.mass * squared * rise * np.abs(at_patch) / stretch)


def square(reference: PatchCase, side: float, *, thickness: float | None = None) -> PatchCase:
    """The reference with another side and thickness [m]; the field in the ceramic, and with it the strain, stays."""
    layer = replace(reference.layer, size=(side, side), thickness=thickness or reference.layer.thickness)
    return replace(reference, name=f"{1e3 * side:g} mm, {1e3 * layer.thickness:g} mm thick", layer=layer)


def reference_case(layer: Layer, strain: float) -> PatchCase:
    """A patch with a perfect bond."""
    return PatchCase("reference", layer, strain, PERFECT_BOND)


PLATE = RectangularPlate(0.18, 0.18, 0.003, MATERIALS["aluminium"])
CERAMIC = Material(7700.0, 1.0 / 13e-12, 0.31)
CENTRE = Layer((0.0, 0.0), (0.01, 0.01), 0.0, 0.002, -1, CERAMIC)
STRAIN = 1e-5
D33_OVER_D31 = 2.2  # of usual ceramics
HIGHEST, N_MODES = 7900.0, 6
SIDES = (5.0, 7.5, 10.0, 15.0)  # [mm]
BONDS = {"laminate theory": None, "perfect bond": PERFECT_BOND, "50 um of glue of 1 GPa": 50e-6 / 1e9}
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
    centre = reference_case(CENTRE, STRAIN)
    beside = reference_case(replace(CENTRE, centre=(0.0, 0.03375)), STRAIN)
    table: dict[str, Any] = {}
    for bond, slip in BONDS.items():
        base = replace(centre, slip=slip)
        cases = [square(base, 1e-3 * side) for side in SIDES if side != 10.0]
        table[f"size, {bond}"] = ratios([base, *cases])
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
    for bond, mark in zip(BONDS, ("o", "s", "^"), strict=True):
        rows = table[f"size, {bond}"]
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
        left.errorbar(np.array(sides)[order], middle, error, marker=mark, capsize=2, label=bond)
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
