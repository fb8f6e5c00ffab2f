"""What the commands about actuators print: the peaks of a response, the ranking of modes."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feeder_sim.cli.report import print_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from feeder_sim.plate.mode_file import ModeFile
    from feeder_sim.plate.ranking import RankedMode
    from feeder_sim.plate.response import Response


def print_response(
    found: Response,
    held: ModeFile,
    forces: NDArray[np.float64],
    names: Sequence[str],
    volts: float,
    as_json: bool,
) -> None:
    """Print the peaks of a response, and with what force each actuator drives their modes (n_modes, n_actuators)."""
    from feeder_sim.measures.statistic import finite_or_none

    at_peak = [int(abs(found.frequency - peak.frequency).argmin()) for peak in found.peaks]
    rows: list[dict[str, Any]] = [
        {
            "mode": peak.mode + 1,
            "frequency_hz": peak.frequency,
            "amplitude_um": 1e6 * peak.amplitude,
            "damping_ratio": finite_or_none(peak.damping_ratio),
            "current_ma": 1e3 * float(abs(found.current[i].sum())),
            "power_w": float(found.power[i]),
            "force_per_volt_n": dict(zip((a.name for a in held.actuators), forces[peak.mode].tolist(), strict=True)),
        }
        for peak, i in zip(found.peaks, at_peak, strict=True)
    ]
    if as_json:
        print(json.dumps({"actuator": list(names), "voltage_vpp": volts, "peaks": rows}))
        return
    print(f"driven: {', '.join(names)} at {volts:g} V peak to peak")
    columns = {"mode": "{mode}", "frequency (Hz)": "{frequency_hz:.1f}", "amplitude (um)": "{amplitude_um:.4g}"}
    columns |= {
        "damping ratio": "{damping_ratio:.5f}",
        "current (mA)": "{current_ma:.4g}",
        "power (W)": "{power_w:.3g}",
    }
    columns |= {f"N/V {actuator.name}": f"{{force{i}:+.3g}}" for i, actuator in enumerate(held.actuators)}
    forced = [{f"force{i}": force for i, force in enumerate(row["force_per_volt_n"].values())} for row in rows]
    print_table([row | force for row, force in zip(rows, forced, strict=True)], columns)
    if not rows:
        print("no peak in this range")


def print_ranking(ranked: Sequence[RankedMode], as_json: bool) -> None:
    """Print modes in the order of their amplitude at a place."""
    rows: list[dict[str, Any]] = [
        {
            "mode": mode.mode + 1,
            "frequency_hz": mode.frequency,
            "actuator": mode.actuator,
            "force_per_volt_n": mode.force_per_volt,
            "amplitude_um": 1e6 * mode.amplitude,
            "antinode_um": 1e6 * mode.antinode,
            "peak_acceleration_g": mode.acceleration,
            "hop_height_mm": 1e3 * mode.hop_height,
            "neighbours": [neighbour + 1 for neighbour in mode.neighbours],
        }
        for mode in ranked
    ]
    if as_json:
        print(json.dumps(rows))
        return
    columns = {"mode": "{mode}", "frequency (Hz)": "{frequency_hz:.1f}", "amplitude (um)": "{amplitude_um:.4g}"}
    columns |= {"antinode (um)": "{antinode_um:.4g}", "peak (g)": "{peak_acceleration_g:.4g}"}
    columns |= {"hop (mm)": "{hop_height_mm:.3g}", "N/V": "{force_per_volt_n:+.3g}", "actuator": "{actuator}"}
    near = [row | {"neighbours": ", ".join(map(str, row["neighbours"]))} for row in rows]
    print_table(near, columns | {"within 2 %": "{neighbours}"})


def write_response(found: Response, names: Sequence[str], path: Path) -> None:
    """Write a response as CSV: frequency, amplitude, power, and the current of every actuator."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["frequency_hz", "amplitude_um", "power_w", *(f"current_{name}_ma" for name in names)])
        for i, frequency in enumerate(found.frequency):
            currents = [f"{1e3 * abs(current):.6g}" for current in found.current[i]]
            numbers = [f"{frequency:.4f}", f"{1e6 * found.amplitude[i]:.6g}", f"{found.power[i]:.6g}"]
            writer.writerow([*numbers, *currents])
