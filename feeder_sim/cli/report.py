"""What the commands print on stdout: text for people, or JSON."""

from __future__ import annotations

import cmath
import csv
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feeder_sim.errors import escaped, printable, shortened

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from feeder_sim.measures.circulation import StageWave
    from feeder_sim.plate.impedance_fit import SweepFit
    from feeder_sim.plate.mode_file import ModeFile
    from feeder_sim.plate.pairs import ModePair
    from feeder_sim.plate.response import RankedMode, Response
    from feeder_sim.plate.sequences import Route
    from feeder_sim.run.simulation import Result
    from feeder_sim.studies.width_ratios import RatioRoutes


# What the commands about actuators print: the peaks of a response, the ranking of modes.

MECHANICAL = (
    *("mode", "frequency_hz", "amplitude_um", "amplitude_bounds_um", "damping_ratio"),
    *("current_ma", "power_w", "ceramic_heat_w", "force_per_volt_n"),
)
ELECTRICAL = ("mode", "impedance_ohm", "impedance_phase_deg", "series_resistance_ohm", "resistance_maximum_hz")


def print_response(
    spectrum: Response,
    plate: ModeFile,
    forces: NDArray[np.float64],
    names: Sequence[str],
    volts: float,
    as_json: bool,
) -> None:
    """Print the peaks of a response, and with what force each actuator drives their modes (n_modes, n_actuators)."""
    from feeder_sim.measures.statistic import finite_or_none

    at_peak = [int(abs(spectrum.frequency - peak.frequency).argmin()) for peak in spectrum.peaks]
    rows: list[dict[str, Any]] = [
        {
            "mode": peak.mode + 1,
            "frequency_hz": peak.frequency,
            "amplitude_um": 1e6 * peak.amplitude,
            "amplitude_bounds_um": [1e6 * peak.amplitude * bound for bound in peak.bounds],
            "damping_ratio": finite_or_none(peak.damping_ratio),
            "current_ma": 1e3 * float(abs(spectrum.current[i].sum())),
            "power_w": float(spectrum.power[i]),
            "ceramic_heat_w": float(spectrum.heat[i]),
            "impedance_ohm": finite_or_none(float(abs(spectrum.impedance[i]))),
            "impedance_phase_deg": finite_or_none(math.degrees(cmath.phase(spectrum.impedance[i]))),
            "series_resistance_ohm": finite_or_none(float(spectrum.impedance[i].real)),
            "resistance_maximum_hz": finite_or_none(peak.resistive),
            "force_per_volt_n": dict(zip((a.name for a in plate.actuators), forces[peak.mode].tolist(), strict=True)),
        }
        for peak, i in zip(spectrum.peaks, at_peak, strict=True)
    ]
    if as_json:
        print(json.dumps({"actuator": list(names), "voltage_vpp": volts, "peaks": rows}))
        return
    print(f"driven: {', '.join(names)} at {volts:g} V peak to peak")
    print_rows(rows, MECHANICAL, none="no peak in this range")
    if rows and rows[0]["impedance_ohm"] is not None:
        print("the driven patches in parallel at these frequencies, and where their series resistance is highest:")
        print_rows(rows, ELECTRICAL)


def print_fit(fit: SweepFit, modes: Sequence[int | None], as_json: bool) -> None:
    """Print the resonances of a sweep with their modes (0-based)."""
    rows: list[dict[str, Any]] = [
        {
            "mode": None if mode is None else mode + 1,
            "frequency_hz": resonance.frequency,
            "frequency_error_hz": resonance.frequency_error,
            "damping_ratio": resonance.damping_ratio,
            "damping_error": resonance.damping_error,
        }
        for resonance, mode in zip(fit.resonances, modes, strict=True)
    ]
    if as_json:
        print(json.dumps({"resonances": rows, "loss_tangent": fit.loss_tangent, "scatter": fit.scatter}))
        return
    print_rows(rows)
    print(f"loss tangent of the ceramic {fit.loss_tangent:.3g}, scatter of the resistance {fit.scatter:.2%}")
    for row in rows:
        mode = "# no mode within 2 %" if row["mode"] is None else f"mode = {row['mode']}"
        lines = [f"frequency_hz = {row['frequency_hz']:.3f}", f"damping_ratio = {row['damping_ratio']:.6f}", mode]
        print("\n".join(["", "[[resonance]]", *lines]))


def print_ranking(ranked: Sequence[RankedMode], levels: Sequence[float], as_json: bool) -> None:
    """Print modes in the order of their amplitude at a place, and how loud each is [dB(A) at 1 m]."""
    from feeder_sim.measures.statistic import finite_or_none

    rows: list[dict[str, Any]] = [
        {
            "mode": mode.mode + 1,
            "frequency_hz": mode.frequency,
            "actuator": mode.actuator,
            "force_per_volt_n": mode.force_per_volt,
            "amplitude_um": 1e6 * mode.amplitude,
            "amplitude_bounds_um": [1e6 * mode.amplitude * bound for bound in mode.bounds],
            "antinode_um": 1e6 * mode.antinode,
            "peak_acceleration_g": mode.acceleration,
            "hop_height_mm": 1e3 * mode.hop_height,
            "sound_dba_at_1_m": finite_or_none(level),
            "neighbours": [neighbour + 1 for neighbour in mode.neighbours],
        }
        for mode, level in zip(ranked, levels, strict=True)
    ]
    print_rows(rows, as_json=as_json)


def print_pairs(pairs: Sequence[ModePair], as_json: bool) -> None:
    """Print pairs of modes, the best first."""
    rows: list[dict[str, Any]] = [
        {
            "gather_mode": pair.gather.mode + 1,
            "gather_hz": pair.gather.frequency,
            "gather_actuator": pair.gather.actuator,
            "gather_um": 1e6 * pair.gather.antinode,
            "throw_mode": pair.throw.mode + 1,
            "throw_hz": pair.throw.frequency,
            "throw_actuator": pair.throw.actuator,
            "throw_um": 1e6 * pair.throw.antinode,
            "moved": pair.moved,
            "thrown": pair.thrown,
            "hop_mm": 1e3 * pair.hop,
            "dead_mm": None if pair.dead is None else [round(1e3 * c, 3) for c in pair.dead],
        }
        for pair in pairs
    ]
    print_rows(rows, as_json=as_json, none="no mode moves enough of the plate; a higher voltage may")


def write_response(spectrum: Response, names: Sequence[str], path: Path) -> None:
    """Write a response as CSV: frequency, amplitude, power, and the current of every actuator."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        impedance = ["impedance_ohm", "impedance_phase_deg", "series_resistance_ohm"]
        currents = [f"current_{name}_ma" for name in names]
        writer.writerow(["frequency_hz", "amplitude_um", "power_w", "ceramic_heat_w", *impedance, *currents])
        for i, frequency in enumerate(spectrum.frequency):
            currents = [f"{1e3 * abs(current):.6g}" for current in spectrum.current[i]]
            z = spectrum.impedance[i]
            numbers = [1e6 * spectrum.amplitude[i], spectrum.power[i], spectrum.heat[i], abs(z)]
            numbers += [math.degrees(cmath.phase(z)), z.real]
            writer.writerow([f"{frequency:.4f}", *(f"{number:.6g}" for number in numbers), *currents])


MOST_DRIVE_LINES = 12  # of a run with many stages
LONGEST_TEXT = 300  # characters of a title or a line that holds one
MOST_ENTRIES = 30  # of a list of texts, such as the names of measures of a long schedule


def print_result(result: Result, folder: Path, as_json: bool) -> None:
    """Print the findings of a run, in words or as one JSON object."""
    summary = result.summary()
    if as_json:
        print(json.dumps(summary | {"folder": str(folder)}))
        return
    from feeder_sim.measures.protocol import labelled

    lines = [*_lines_under_parts(result), *result.lines()]
    if summary["left_plate"]:
        lines.append(labelled("left the plate", f"{summary['left_plate']} of {summary['seeds']}"))
    if summary["unresolved_impacts"]:
        lines.append(labelled("unresolved", f"{summary['unresolved_impacts']} impacts, whose iteration was given up"))
    if summary["late_contacts"]:
        lines.append(labelled("late contacts", f"{summary['late_contacts']}, found by going back"))
    if summary["budgets_spent"]:
        lines.append(labelled("budgets spent", f"{summary['budgets_spent']}, times without any bounce"))
    factor, span = summary["real_time_factor"] or 0.0, f"{summary['simulated_s']:.1f} s"
    cost = f"{span} in {summary['wall_s']:.1f} s ({factor:.2f} x real time)"
    lines.append(labelled("seen", span) if result.prepared.is_tracked else labelled("simulated", cost))
    lines.append(labelled("recorded in", str(folder)))
    print(shortened(printable(summary["title"] or folder.name), LONGEST_TEXT))
    for line in lines:
        print(f"  {shortened(escaped(line), LONGEST_TEXT)}")


def _lines_under_parts(result: Result) -> list[str]:
    """How strongly the plate moves where parts start, a line for each drive and part table."""
    from feeder_sim.measures.protocol import labelled
    from feeder_sim.scene.under_parts import motion_under_parts

    lines = []
    for motion in motion_under_parts(result.scene):
        label = "plate under part" if len(result.scene.kinds) == 1 else f"under part[{motion.part}]"
        amplitude = f"{1e6 * motion.median:.3g} um"
        if motion.largest > motion.least:
            amplitude += f" (median; up to {1e6 * motion.largest:.3g} um)"
        lines.append(labelled(label, f"{amplitude}, {motion.acceleration:.3g} g at {motion.frequency:g} Hz"))
    more = len(lines) - MOST_DRIVE_LINES
    return lines if more <= 0 else [*lines[:MOST_DRIVE_LINES], f"and under {more} more drives, as check says"]


def print_modes(mode_file: ModeFile, as_json: bool) -> None:
    """Print the modes of a plate beside the measured resonances."""
    modes, measured = mode_file.modes, {r.mode: r for r in mode_file.resonances}
    rows = []
    for i, (frequency, parity) in enumerate(zip(modes.natural_frequency, modes.parity, strict=True)):
        resonance = measured.get(i)
        rows.append(
            {
                "mode": i + 1,
                "natural_frequency_hz": float(frequency),
                "symmetry": "".join(("e", "o", "-")[p] for p in parity),
                "measured_hz": resonance.frequency if resonance else None,
                "deviation_percent": 100.0 * (frequency / resonance.frequency - 1.0) if resonance else None,
            }
        )
    print_rows(rows, as_json=as_json)


def print_routes(routes: Sequence[Route], frequency: NDArray[np.float64], as_json: bool) -> None:
    """Print sequences of modes, best first: their largest k, and where every mode carries the part.

    `frequency` has the natural frequencies of the plate's modes [Hz].
    """
    from feeder_sim.measures.statistic import finite_or_none

    if as_json:
        rows = [
            {
                "largest_k": route.largest_k,
                "modes": [mode + 1 for mode in route.modes],
                "frequency_hz": [float(frequency[mode]) for mode in route.modes],
                "station_mm": [1e3 * route.steps[0].start, *(1e3 * step.end for step in route.steps)],
                "k": [step.k for step in route.steps],
                "growth": [finite_or_none(step.growth) for step in route.steps],
            }
            for route in routes
        ]
        print(json.dumps(rows))
        return
    for route in routes:
        print(f"largest k {route.largest_k:.3f}, modes {', '.join(str(mode + 1) for mode in route.modes)}")
        print_rows(
            [
                {"mode": step.mode + 1, "frequency_hz": float(frequency[step.mode])}
                | {"from_mm": 1e3 * step.start, "to_mm": 1e3 * step.end, "k": step.k, "offset_grows_by": step.growth}
                for step in route.steps
            ]
        )


def print_ratios(rows: Sequence[RatioRoutes], as_json: bool) -> None:
    """Print the best sequence of every length-to-width ratio."""
    from feeder_sim.measures.statistic import finite_or_none

    entries: list[dict[str, Any]] = [
        {
            "ratio": row.ratio,
            "largest_k": row.routes[0].largest_k if row.routes else None,
            "growth": finite_or_none(row.routes[0].growth) if row.routes else None,
            "modes": [mode + 1 for mode in row.routes[0].modes] if row.routes else [],
        }
        for row in rows
    ]
    print_rows(entries, as_json=as_json)


def print_waves(waves: Sequence[StageWave], as_json: bool) -> None:
    """Print the numbers that describe the waves of a scenario, each set of excitations once."""
    from feeder_sim.measures.circulation import describe
    from feeder_sim.measures.protocol import as_json as as_json_values

    different = {wave.stage.excitations: wave for wave in reversed(waves)}  # the first stage of each set
    rows = [{"stage": wave.stage.name} | as_json_values(describe(wave)) for wave in reversed(different.values())]
    if as_json:
        print(json.dumps(rows))
        return
    for row in rows:
        print(shortened(printable(row["stage"]), LONGEST_TEXT) or "wave")
        print(as_lines({key: value for key, value in row.items() if key != "stage"}, "  "))


def print_rows(
    rows: Sequence[Mapping[str, Any]], keys: Sequence[str] | None = None, *, as_json: bool = False, none: str = ""
) -> None:
    """Print rows by key as a table, of all keys or some, or as JSON; `none` where there is no row."""
    from feeder_sim.document.document import Table

    if as_json:
        print(json.dumps(rows))
    elif rows or not none:
        print("\n".join(Table.of(rows, keys).lines()))
    else:
        print(none)


def as_lines(values: dict[str, Any], indent: str = "") -> str:
    """Nested values, as JSON takes them, as indented 'key: value' lines with four digits."""
    lines = []
    for key, value in values.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            for i, entry in enumerate(value):
                lines += [f"{indent}{key}[{i}]:", as_lines(entry, indent + "  ")]
        elif isinstance(value, list) and value and isinstance(value[0], str):
            lines += [f"{indent}{key}:", *(f"{indent}  {_rounded(entry)}" for entry in value[:MOST_ENTRIES])]
            lines += [f"{indent}  and {more} more, which --json has"] if (more := len(value) - MOST_ENTRIES) > 0 else []
        else:
            lines.append(f"{indent}{key}: {_rounded(value)}")
    return "\n".join(lines)


def _rounded(value: Any) -> str:
    """A value as text; numbers with four digits, lists with commas."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(_rounded(entry) for entry in value) or "none"
    return shortened(printable(str(value)), LONGEST_TEXT)
