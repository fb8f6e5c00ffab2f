"""Ring-up of the plate at 558 Hz, and its resonance curve from 2790 to 2806 Hz.

    python benchmarks/resonance.py [--picture FILE]

Both of the plate of the source (D. Shi, EPFL thesis TH7124, 2016), driven in the centre at 100 V peak to peak. It saw a
ring-up of about 0.4 s at 558 Hz; at 2797 Hz its finite elements give 20.62 um, and it measured 19.70 um. Takes 2 s.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from feeder_sim.plate.drive import modal_terms
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.plate.response import Response, frequency_response, voltages
from feeder_sim.scenario import Drive, HexNut, ModePlate, Run, Scenario
from feeder_sim.scene.scene import build_scene

PLATE = Path(__file__).parents[1] / "models/plate_180_piezos/modes.h5"
RING_UP_HZ, RING_UP_S = 558.0, 0.4
LOW, HIGH, MEASURED_HZ, MEASURED_UM, ELEMENTS_UM = 2790.0, 2806.0, 2797.0, 19.70, 20.62
SHARES = (0.9, 0.95, 0.98)
DAMPING_KNOWN_TO = 0.1  # relative


def envelope(damping_ratio: float | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Amplitude of the plate in its centre over the time, over the last one: (n,) [s], (n,) [1]."""
    drive = Drive(frequency_hz=RING_UP_HZ, voltage_vpp=100.0, actuator=("centre",), damping_ratio=damping_ratio)
    plate = ModePlate(kind="modes", mode_file=PLATE)
    scene = build_scene(Scenario(plate=plate, drive=(drive,), part=(HexNut(size="M2.5"),), run=Run(duration_s=1.0)))
    times = np.arange(0.0, 1.5, 1.0 / (40.0 * RING_UP_HZ))
    (shape,), motion = scene.surface.deflection(0, np.zeros((1, 2))), scene.driven[0].drive
    w = float(shape) * modal_terms([motion]).phasor(times, 1)[:, 0].real
    periods = np.abs(w[: len(w) // 40 * 40].reshape(-1, 40)).max(axis=1)
    return times[: len(periods) * 40 : 40] + 0.5 / RING_UP_HZ, periods / periods[-1]


def main(picture: Annotated[Path | None, typer.Option(help="Draw both to this file.")] = None) -> None:
    nominal = envelope()
    damping = next(r.damping_ratio for r in read_mode_file(PLATE).resonances if r.frequency == RING_UP_HZ)
    for share in SHARES:
        reached = [
            float(times[int(np.argmax(amplitude > share))])
            for times, amplitude in (
                nominal,
                envelope(damping * (1.0 + DAMPING_KNOWN_TO)),
                envelope(damping * (1.0 - DAMPING_KNOWN_TO)),
            )
        ]
        print(f"{share:.0%} of the amplitude after {reached[0]:.3f} s ({reached[1]:.3f} to {reached[2]:.3f})")
    held = read_mode_file(PLATE)
    voltage = voltages(held, ["centre"], 50.0, [0.0])
    response = frequency_response(held, voltage, low=LOW, high=HIGH, point=(0.0, 0.0))
    peak = max(response.peaks, key=lambda peak: peak.amplitude)
    low, high = (1e6 * peak.amplitude * bound for bound in peak.bounds)
    for frequency in (LOW, 2794.0, MEASURED_HZ, 2800.0, HIGH):
        amplitude = 1e6 * float(np.interp(frequency, response.frequency, response.amplitude))
        print(f"{frequency:g} Hz: {amplitude:.2f} um, {amplitude * 1e-6 / peak.amplitude:.0%} of the highest")
    print(
        f"highest {1e6 * peak.amplitude:.2f} um at {peak.frequency:.1f} Hz, {low:.1f} to {high:.1f} um for unknown glue"
    )
    print(f"measured {MEASURED_UM} um, by the source's finite elements {ELEMENTS_UM} um")
    print(f"bandwidth {2.0 * peak.damping_ratio * peak.frequency:.1f} Hz")
    if picture is not None:
        draw(nominal, damping, response, picture)


def draw(
    ring_up: tuple[NDArray[np.float64], NDArray[np.float64]], damping: float, response: Response, path: Path
) -> None:
    """Envelope of the ring-up with its closed form, and the resonance curve with its interval."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    times, amplitude = ring_up
    left.plot(times, amplitude, color="#3a60be", label="558 Hz")
    closed = 1.0 - np.exp(-2.0 * math.pi * damping * RING_UP_HZ * times)
    left.plot(times, closed, "--", color="0.5", label="closed form")
    left.axvline(RING_UP_S, color="#be3434", linewidth=0.8, label="source: about 0.4 s")
    left.set(xlabel="time (s)", ylabel="amplitude over the last", xlim=(0.0, 1.0))
    left.legend(fontsize=8)
    right.plot(response.frequency, 1e6 * response.amplitude, color="#3a60be", label="computed")
    low, high = max(response.peaks, key=lambda peak: peak.amplitude).bounds
    right.fill_between(
        response.frequency, 1e6 * low * response.amplitude, 1e6 * high * response.amplitude, alpha=0.15, label="glue"
    )
    right.plot(MEASURED_HZ, MEASURED_UM, "o", color="#be3434", label="measured")
    right.axhline(ELEMENTS_UM, color="0.6", linestyle="--", label="source's finite elements, highest")
    right.set(xlabel="frequency (Hz)", ylabel="amplitude in the centre (µm)", ylim=(0.0, None))
    right.legend(fontsize=8, loc="upper right")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    typer.run(main)
