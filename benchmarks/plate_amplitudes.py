"""Amplitudes and frequencies of the plate with piezo patches, predicted and measured.

    python benchmarks/plate_amplitudes.py [PLATE MEASURED] [--json]

One moment per volt is calibrated on the first amplitude; the others follow. Three variants: patches that only act,
patches with mass, patches with mass and stiffness. Takes 20 s.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.scenario import load_plate_file
from feeder_sim.studies.plate_amplitudes import loaded_variants, predict, read_amplitudes

MODELS = Path(__file__).parents[1] / "models/plate_180_piezos"
PAIR_HZ = (1398.0, 1407.0)  # measured resonances of the degenerate pair; the patches of that trial lay elsewhere
PAIR = (1360.0, 1400.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plate", nargs="?", type=Path, default=MODELS / "plate.toml")
    parser.add_argument("measured", nargs="?", type=Path, default=MODELS / "measured.csv")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    file, measured = load_plate_file(options.plate), read_amplitudes(options.measured)
    table: dict[str, dict[str, Any]] = {}
    for name, held in loaded_variants(file).items():
        found = predict(held, measured)
        ratio = np.array([each.ratio for each in found])
        calibrated = ratio / ratio[0]
        deviation = np.array([each.deviation for each in found])
        pair = [f for f in held.modes.natural_frequency if PAIR[0] < f < PAIR[1]]
        table[name] = {
            "natural_frequency_hz": [each.natural_frequency for each in found],
            "frequency_deviation_percent": (100.0 * deviation).tolist(),
            "frequency_deviation_sd_percent": float(100.0 * deviation.std()),
            "amplitude_over_measured": calibrated.tolist(),
            "moment_per_volt_n": float(file.actuator[0].moment_per_volt_n or np.nan) / ratio[0],
            "largest_deviation_percent": float(100.0 * np.abs(calibrated - 1.0).max()),
            "mean_deviation_percent": float(100.0 * np.abs(calibrated[1:] - 1.0).mean()),
            "pair_hz": pair,
        }
    if options.json:
        print(json.dumps(table))
        return
    print("load of the patches | " + " | ".join(f"{one.frequency:g} Hz" for one in measured) + " | largest | mean")
    for name, row in table.items():
        numbers = " | ".join(f"{value:.3f}" for value in row["amplitude_over_measured"])
        print(
            f"{name}: amplitude over measured | {numbers} | {row['largest_deviation_percent']:.1f} % | "
            f"{row['mean_deviation_percent']:.1f} % (moment {row['moment_per_volt_n']:.4f} N/V)"
        )
    for name, row in table.items():
        shifts = " | ".join(f"{value:+.2f} %" for value in row["frequency_deviation_percent"])
        pair_text = ", ".join(f"{value:.1f}" for value in row["pair_hz"])
        print(f"{name}: frequency | {shifts} | SD {row['frequency_deviation_sd_percent']:.2f} % | pair {pair_text} Hz")
    print(f"pair, measured: {PAIR_HZ[0]:g}, {PAIR_HZ[1]:g} Hz")


if __name__ == "__main__":
    main()
