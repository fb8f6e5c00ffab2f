"""Amplitudes and frequencies of the plate with piezo patches, predicted and measured.

    python benchmarks/plate_amplitudes.py [PLATE MEASURED] [--json]

One moment per volt is calibrated on the first amplitude; the others follow. Three variants: patches that only act,
patches with mass, patches with mass and stiffness. Takes 20 s.

Each variant of the plate loads the modes with more of its patches: nothing, their mass, their mass and their stiffness.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.actuators import modal_force_table
from feeder_sim.plate.mode_file import ModeFile
from feeder_sim.plate.modes import plate_modes
from feeder_sim.plate.response import Oscillators, oscillators
from feeder_sim.plate.ritz.attachments import Layer
from feeder_sim.scenario import PlateFile, load_plate_file
from feeder_sim.scene.plate_modes import compute_modes

SOFT = 1e3  # [Pa]; a patch of this modulus has mass only
SEARCH = 0.04  # relative, around a measured frequency; patches without stiffness lower them by 2 %


@dataclass(frozen=True)
class MeasuredAmplitude:
    """One measured amplitude.

    Attributes:
        frequency: [Hz].
        amplitude: at the driven patch, per volt [m/V], both as amplitudes.
        damping_ratio: [1].
        actuator: name of the driven patch.
    """

    frequency: float
    amplitude: float
    damping_ratio: float
    actuator: str


@dataclass(frozen=True)
class PredictedAmplitude:
    """A measured amplitude beside the one that follows from the moment per volt in the plate file.

    Attributes:
        measured: the measurement.
        mode: 0-based.
        natural_frequency: computed [Hz].
        amplitude: predicted at the driven patch, per volt [m/V].
    """

    measured: MeasuredAmplitude
    mode: int
    natural_frequency: float
    amplitude: float

    @property
    def ratio(self) -> float:
        """Predicted over measured amplitude."""
        return self.amplitude / self.measured.amplitude

    @property
    def deviation(self) -> float:
        """Of the computed frequency from the measured one, relative."""
        return self.natural_frequency / self.measured.frequency - 1.0


def read_amplitudes(path: Path, *, peak_to_peak: float = 100.0) -> list[MeasuredAmplitude]:
    """Read a CSV file of amplitudes measured at a voltage, peak to peak [V]."""
    rows = csv.DictReader(line for line in path.read_text().splitlines() if not line.startswith("#"))
    return [
        MeasuredAmplitude(
            float(row["frequency_hz"]),
            1e-6 * float(row["amplitude_um"]) / (0.5 * peak_to_peak),
            float(row["damping_ratio"]),
            row["actuator"],
        )
        for row in rows
    ]


def loaded_variants(file: PlateFile) -> dict[str, ModeFile]:
    """The modes of a plate file without the load of its patches, with their mass, with mass and stiffness."""
    tables = [table.model_copy(update={"loads": False}) for table in file.actuator]
    held = compute_modes(file.model_copy(update={"actuator": tuple(tables), "resonance": ()}))
    layers = [actuator.layer for actuator in held.actuators]
    soft = [replace(layer, material=replace(layer.material, youngs_modulus=SOFT)) for layer in layers]
    highest = file.plate.highest_frequency_hz

    def with_load(attachments: Sequence[Layer]) -> ModeFile:
        modes = plate_modes(held.modes.plate, highest_frequency=highest, attachments=attachments)
        return ModeFile(modes, (), held.actuators, modal_force_table(modes, held.actuators))

    return {"nothing": held, "mass": with_load(soft), "mass and stiffness": with_load(layers)}


def predict(held: ModeFile, measured: Sequence[MeasuredAmplitude]) -> list[PredictedAmplitude]:
    """Predict amplitudes at their measured frequencies and damping ratios.

    The mode of a measurement is the one within `SEARCH` of its frequency that moves most.
    """
    every = oscillators(held)
    names = [actuator.name for actuator in held.actuators]
    return [_predicted(held, every, one, names.index(one.actuator)) for one in measured]


def _predicted(held: ModeFile, every: Oscillators, measured: MeasuredAmplitude, actuator: int) -> PredictedAmplitude:
    near = np.flatnonzero(np.abs(every.natural_frequency / measured.frequency - 1.0) < SEARCH)
    omega = 2.0 * np.pi * measured.frequency
    at_patch = np.abs(_deflection(held, actuator))[near]
    force = np.abs(held.force_per_volt[near, actuator])
    amplitude = at_patch * force / (2.0 * measured.damping_ratio * every.modal_mass[near] * omega**2)
    best = int(amplitude.argmax())
    mode = int(near[best])
    return PredictedAmplitude(measured, mode, float(every.natural_frequency[mode]), float(amplitude[best]))


def _deflection(held: ModeFile, actuator: int) -> NDArray[np.float64]:
    """Deflection of every mode over the middle of a patch [1], shape (n_modes,)."""
    centre = np.array([held.actuators[actuator].layer.centre])
    return held.modes.evaluate_whole(centre)[:, 0, 0]


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
