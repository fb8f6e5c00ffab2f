"""Amplitudes, currents and frequencies of the plate with piezo patches, from the data sheet, and measured.

    python benchmarks/plate_amplitudes.py [PLATE MEASURED] [--json]

Nothing is calibrated; the glue is not known, which makes an interval. Three variants: modes of the bare plate
(`loads = false`), with the mass of the patches, with their mass and stiffness. Takes 20 s.
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
from feeder_sim.plate.response import Oscillators, frequency_response, oscillators, voltages
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
        current: of the patch, per volt [A/V], both as amplitudes.
        resistive: where its series resistance is highest [Hz]; NaN where that was not measured.
    """

    frequency: float
    amplitude: float
    damping_ratio: float
    actuator: str
    current: float
    resistive: float


@dataclass(frozen=True)
class PredictedAmplitude:
    """A measured amplitude beside the one that follows from the patch in the plate file.

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
            float(row["current_a"]) / (0.5 * peak_to_peak),
            float(row["resistance_maximum_hz"] or "nan"),
        )
        for row in rows
    ]


def loaded_variants(file: PlateFile) -> dict[str, ModeFile]:
    """The modes of a plate file without the load of its patches, with their mass, with mass and stiffness."""
    bare, loaded = (
        compute_modes(
            file.model_copy(
                update={
                    "actuator": tuple(table.model_copy(update={"loads": loads}) for table in file.actuator),
                    "resonance": (),
                }
            )
        )
        for loads in (False, True)
    )
    layers = [actuator.layer for actuator in bare.actuators]
    soft = [replace(layer, material=replace(layer.material, youngs_modulus=SOFT)) for layer in layers]
    heavy = plate_modes(bare.modes.plate, highest_frequency=file.plate.highest_frequency_hz, attachments=soft)
    mass = ModeFile(heavy, (), bare.actuators, modal_force_table(heavy, bare.actuators))
    return {"nothing": bare, "mass": mass, "mass and stiffness": loaded}


def electrical(file: PlateFile, measured: Sequence[MeasuredAmplitude]) -> list[dict[str, float]]:
    """Current of the driven patch over the measured one, and maxima of its resistance and of the displacement [Hz]."""
    held = compute_modes(file)
    rows = []
    for one in measured:
        voltage = voltages(held, [one.actuator], 1.0, [0.0])
        span = SEARCH * one.frequency
        response = frequency_response(held, voltage, low=one.frequency - span, high=one.frequency + span)
        peak = min(response.peaks, key=lambda peak: abs(peak.frequency - one.frequency))
        at = int(np.abs(response.frequency - one.frequency).argmin())
        rows.append(
            {
                "current_over_measured": float(np.abs(response.current[at]).max()) / one.current,
                "displacement_maximum_hz": peak.frequency,
                "resistance_maximum_hz": peak.resistive,
                "measured_resistance_maximum_hz": one.resistive,
                "half_bandwidth_hz": one.damping_ratio * one.frequency,
            }
        )
    return rows


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
        spread = held.actuators[0].moment_spread
        deviation = np.array([each.deviation for each in found])
        pair = [f for f in held.modes.natural_frequency if PAIR[0] < f < PAIR[1]]
        table[name] = {
            "natural_frequency_hz": [each.natural_frequency for each in found],
            "frequency_deviation_percent": (100.0 * deviation).tolist(),
            "frequency_deviation_sd_percent": float(100.0 * deviation.std()),
            "amplitude_over_measured": ratio.tolist(),
            "within": [(ratio / spread).tolist(), (ratio * spread).tolist()],
            "holds": int(((ratio / spread <= 1.0) & (ratio * spread >= 1.0)).sum()),
            "largest_deviation_percent": float(100.0 * np.abs(ratio - 1.0).max()),
            "mean_deviation_percent": float(100.0 * np.abs(ratio - 1.0).mean()),
            "pair_hz": pair,
        }
    currents = electrical(file, measured)
    if options.json:
        print(json.dumps(table | {"electrical": currents}))
        return
    print("load of the patches | " + " | ".join(f"{one.frequency:g} Hz" for one in measured) + " | largest | mean")
    for name, row in table.items():
        numbers = " | ".join(f"{value:.3f}" for value in row["amplitude_over_measured"])
        print(
            f"{name}: amplitude over measured | {numbers} | {row['largest_deviation_percent']:.1f} % | "
            f"{row['mean_deviation_percent']:.1f} %"
        )
        low, high = (" | ".join(f"{value:.2f}" for value in bound) for bound in row["within"])
        print(f"{name}: at least | {low}\n{name}: at most | {high}\n{name}: holds {row['holds']} of {len(measured)}")
    for name, row in table.items():
        shifts = " | ".join(f"{value:+.2f} %" for value in row["frequency_deviation_percent"])
        pair_text = ", ".join(f"{value:.1f}" for value in row["pair_hz"])
        print(f"{name}: frequency | {shifts} | SD {row['frequency_deviation_sd_percent']:.2f} % | pair {pair_text} Hz")
    print(f"pair, measured: {PAIR_HZ[0]:g}, {PAIR_HZ[1]:g} Hz")
    print("current over measured | " + " | ".join(f"{row['current_over_measured']:.3f}" for row in currents))
    for title, key in (("computed", "resistance_maximum_hz"), ("measured", "measured_resistance_maximum_hz")):
        places = [
            f"{row[key] - (row['displacement_maximum_hz'] if title == 'computed' else one.frequency):+.2f} Hz"
            for row, one in zip(currents, measured, strict=True)
        ]
        line = " | ".join(place.replace("+nan Hz", "-") for place in places)
        print(f"maximum of the resistance less that of the displacement, {title} | {line}")
    print("half a bandwidth | " + " | ".join(f"{row['half_bandwidth_hz']:.2f} Hz" for row in currents))


if __name__ == "__main__":
    main()
