"""What feet and patches do to the degenerate pair of the source's plate, which it measured 9 Hz apart.

    python benchmarks/plate_feet.py

The pair is computed at 1385.6 Hz and was measured at 1398 and 1407 Hz. Three feet as a plate is often laid on, of
several stiffnesses, and the three patches, perfectly bonded and by their mass alone. Takes half a minute.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from feeder_sim.scenario import PlateFile, Ring, Support, load_plate_file
from feeder_sim.scene.plate_modes import compute_modes

ROOT = Path(__file__).parents[1]
HIGHEST_HZ, PAIR = 1600.0, (1300.0, 1500.0)
FEET_MM = ((-60.0, -60.0), (60.0, -60.0), (0.0, 70.0))
FOOT_MM = 8.0
SOFT = 1e6  # um^2/N, a patch that has mass and no stiffness


def bare(*, loads: bool = False, s11: float | None = None) -> PlateFile:
    """The plate with its patches, by elements, without what was measured."""
    file = load_plate_file(ROOT / "models/plate_180_piezos/plate.toml")
    half = 90.0
    edge = Ring(points_mm=((-half, -half), (half, -half), (half, half), (-half, half)))
    body = file.plate.model_copy(
        update={"length_mm": None, "width_mm": None, "outline": edge, "highest_frequency_hz": HIGHEST_HZ}
    )
    patches = tuple(
        patch.model_copy(update={"loads": loads} | ({} if s11 is None else {"s11_um2_per_n": s11}))
        for patch in file.actuator
    )
    return file.model_copy(update={"plate": body, "actuator": patches, "resonance": ()})


def on_feet(file: PlateFile, stiffness: float) -> PlateFile:
    """The plate on three feet [N/mm each]."""
    feet = tuple(Support(at_mm=place, diameter_mm=FOOT_MM, stiffness_n_per_mm=stiffness) for place in FEET_MM)
    return file.model_copy(update={"support": feet})


def main() -> None:
    cases = {"free": bare()}
    cases |= {f"three feet of {k:g} N/mm": on_feet(bare(), k) for k in (1.0, 10.0, 100.0, 1000.0)}
    cases |= {"patches, bonded": bare(loads=True), "patches, mass alone": bare(loads=True, s11=SOFT)}
    cases["both, 100 N/mm"] = on_feet(bare(loads=True), 100.0)
    for name, file in cases.items():
        frequency = compute_modes(file).modes.natural_frequency
        pair = frequency[(frequency > PAIR[0]) & (frequency < PAIR[1])][:2]
        print(f"{name:<24} {pair[0]:7.1f} {pair[1]:7.1f} Hz, {float(np.ptp(pair)):5.2f} Hz apart", flush=True)


if __name__ == "__main__":
    main()
