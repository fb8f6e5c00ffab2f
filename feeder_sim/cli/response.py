"""Commands about what actuators make of a plate: its frequency response, and which mode is worth its volts.

A measured sweep of a patch becomes resonances of a plate file.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from feeder_sim.cli.files import file_in_errors, modes_of, new_picture, scenario_of_plate, writable
from feeder_sim.errors import InputError, Unknown

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from feeder_sim.plate.impedance_fit import SweepFit
    from feeder_sim.plate.mode_file import ModeFile

VOLTS = 100.0  # peak to peak
HIGHEST_VOLTS = 1e5
MOST_PAIRS = 12  # that are listed


def response(
    source: Annotated[
        Path, typer.Argument(help="Plate file or scenario (.toml), or mode file (.h5).", show_default=False)
    ],
    *,
    low: Annotated[float | None, typer.Option("--from", help="Lowest frequency [Hz]; else half of the first.")] = None,
    high: Annotated[float | None, typer.Option("--to", help="Highest frequency [Hz]; else the last one.")] = None,
    actuator: Annotated[
        list[str] | None, typer.Option("--actuator", help="Drive this one; may be repeated. [the first of the plate]")
    ] = None,
    at: Annotated[
        str | None, typer.Option("--at", help="Amplitude at x,y [mm]; else the largest on the plate.")
    ] = None,
    volts: Annotated[float, typer.Option("--volts", help="Voltage, peak to peak [V].")] = VOLTS,
    damping: Annotated[
        float | None, typer.Option("--damping", help="Damping ratio of all modes, over those of the file.")
    ] = None,
    picture: Annotated[Path | None, typer.Option("--picture", help="Draw the response to this file.")] = None,
    data: Annotated[Path | None, typer.Option("--data", help="Write the response to this CSV file.")] = None,
    measured: Annotated[
        Path | None,
        typer.Option("--measured", help="Fit resonances to this sweep (CSV) of the series resistance of a patch."),
    ] = None,
    write: Annotated[
        Path | None, typer.Option("--write", help="Write the plate file with the resonances of --measured to this one.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Compute how a plate answers its actuators: amplitude, current, power and impedance over the frequency.

    With --measured, fit natural frequencies and damping ratios to what an LCR meter measured at one actuator.
    """
    from feeder_sim.cli.report import print_response, write_response
    from feeder_sim.plate.response import assumption, frequency_response, modal_forces, oscillators

    for path in (picture, data):
        if path is not None:
            (new_picture if path is picture else writable)(path)
    mode_file = modes_of(source)
    _check_actuators(mode_file, source)
    if measured is not None:
        _fit_measured(mode_file, source, measured, actuator, write, picture, as_json)
        return
    if write is not None:
        raise InputError("is given without --measured, must be with it", file=source, key="--write")
    frequencies = mode_file.modes.natural_frequency
    low = 0.5 * float(frequencies[0]) if low is None else low
    high = float(frequencies[-1]) if high is None else high
    if not 0.0 < low < high <= frequencies[-1] * 1.02:
        raise InputError(
            f"is {low:g} to {high:g}, must be a range within 0 to {frequencies[-1]:.0f} Hz, the last computed mode",
            file=source,
            key="--from, --to",
        )
    if damping is not None and not 1e-6 <= damping < 1.0:
        raise InputError(f"is {damping:g}, must be 1e-06 to 1", file=source, key="--damping")
    point = point_on_plate(at, mode_file, source, "--at")
    names = actuator or [mode_file.actuators[0].name]
    with file_in_errors(source):
        voltage = amplitudes_of(mode_file, names, volts, source)
        spectrum = frequency_response(mode_file, voltage, low=low, high=high, point=point, damping_ratio=damping)
        forces = modal_forces(mode_file)
    if data is not None:
        write_response(spectrum, [a.name for a in mode_file.actuators], data)
    if picture is not None:
        from feeder_sim.plots.pictures import draw_response

        draw_response(spectrum, picture, title=f"Driven by {', '.join(names)} at {volts:g} V peak to peak", point=point)
    print_response(spectrum, mode_file, forces, names, volts, as_json)
    _say(assumption(oscillators(mode_file, damping)))


def _fit_measured(
    mode_file: ModeFile,
    source: Path,
    measured: Path,
    actuator: list[str] | None,
    out: Path | None,
    picture: Path | None,
    as_json: bool,
) -> None:
    """Fit the resonances of a sweep, print them with their modes, draw them, and write them into a plate file."""
    from feeder_sim.cli.report import print_fit
    from feeder_sim.plate.impedance_fit import fit_sweep, read_sweep
    from feeder_sim.plots.pictures import draw_fit
    from feeder_sim.scene.plate_modes import modes_of_resonances

    names = [each.name for each in mode_file.actuators]
    name = actuator[0] if actuator else names[0]
    if name not in names or len(actuator or []) > 1:
        raise Unknown(" and ".join(actuator or []), names, file=source, key="--actuator")
    if out is not None:
        _check_new_plate_file(out, source)
    with file_in_errors(measured):
        sweep = read_sweep(measured)
        low, high = float(sweep.frequency[0]), float(sweep.frequency[-1])
        natural = mode_file.modes.natural_frequency
        if high < natural[0] or low > natural[-1]:
            raise InputError(
                f"goes from {low:g} to {high:g} Hz, must be a sweep in Hz over modes of the plate, which lie at "
                f"{natural[0]:.0f} to {natural[-1]:.0f} Hz",
                key="frequency_hz",
            )
        fit = fit_sweep(sweep, mode_file.actuators[names.index(name)].capacitance)
        modes = modes_of_resonances(mode_file, [resonance.frequency for resonance in fit.resonances])
    if picture is not None:
        draw_fit(sweep, fit, picture, title=f"Series resistance of {name}")
    if out is not None:
        _write_resonances(mode_file, fit, modes, source, out)
    print_fit(fit, modes, as_json)


def _check_new_plate_file(out: Path, source: Path) -> None:
    """Refuse a file to which no plate file can be written that finds the files which it names."""
    writable(out)
    if source.suffix != ".toml" or scenario_of_plate(source) is not None:
        raise InputError("goes with a plate file (.toml)", file=source, key="--write")
    if out.suffix != ".toml" or out.resolve().parent != source.resolve().parent:
        raise InputError(f"must be a .toml file in the folder of {source.name}", file=out, key="--write")


def _write_resonances(mode_file: ModeFile, fit: SweepFit, modes: Sequence[int | None], source: Path, out: Path) -> None:
    """Write a plate file with measured resonances, in place of those that it has of the same modes; gains stay."""
    import tomllib

    import tomli_w

    table = tomllib.loads(source.read_text(encoding="utf-8"))
    records = {r.mode: row for r, row in zip(mode_file.resonances, table.get("resonance", []), strict=True)}
    for resonance, mode in zip(fit.resonances, modes, strict=True):
        if mode is not None:
            measured = {"frequency_hz": round(resonance.frequency, 4), "damping_ratio": resonance.damping_ratio}
            records[mode] = records.get(mode, {}) | measured | {"mode": mode + 1}
    table["resonance"] = sorted(records.values(), key=lambda row: row["frequency_hz"])
    text = f"# {source.name} with resonances measured at a patch.\n\n{tomli_w.dumps(table)}"
    out.write_text(text, encoding="utf-8")


def print_ranked(mode_file: ModeFile, volts: float, near: str | None, source: Path, as_json: bool) -> None:
    """Print the modes of a plate in the order of what a voltage, peak to peak, does near a point x,y [mm]."""
    from feeder_sim.cli.report import print_ranking
    from feeder_sim.plate.response import assumption, oscillators, rank_modes
    from feeder_sim.plate.sound import loudness

    _check_actuators(mode_file, source)
    _check_volts(volts, source)
    with file_in_errors(source):
        ranked = rank_modes(mode_file, 0.5 * volts, point_on_plate(near, mode_file, source, "--near"))
        levels = [loudness(mode_file.modes, {mode.mode: mode.antinode}, mode.frequency) for mode in ranked]
    print_ranking(ranked, levels, as_json)
    _say(assumption(oscillators(mode_file)))


def print_mode_pairs(mode_file: ModeFile, volts: float, source: Path, as_json: bool) -> None:
    """Print pairs of modes for gathering and throwing apart, at a voltage, peak to peak."""
    from feeder_sim.cli.report import print_pairs
    from feeder_sim.plate.pairs import best_of_each, mode_pairs
    from feeder_sim.plate.response import assumption, oscillators

    _check_actuators(mode_file, source)
    _check_volts(volts, source)
    with file_in_errors(source):
        print_pairs(best_of_each(mode_pairs(mode_file, 0.5 * volts), MOST_PAIRS), as_json)
    _say(assumption(oscillators(mode_file)))


def _say(warning: str) -> None:
    if warning:
        print(f"feeder-sim: warning: {warning}", file=sys.stderr)


def _check_actuators(mode_file: ModeFile, source: Path) -> None:
    if not mode_file.actuators:
        raise InputError("has no actuator, must be a plate with at least one [[actuator]]", file=source)


def _check_volts(volts: float, source: Path) -> None:
    if not 0.0 < volts <= HIGHEST_VOLTS:
        raise InputError(f"is {volts:g}, must be above 0 and up to {HIGHEST_VOLTS:g}", file=source, key="--volts")


def point_on_plate(text: str | None, mode_file: ModeFile, source: Path, option: str) -> tuple[float, float] | None:
    """The point x,y [mm] of an option in [m]; None where it is not given.

    Raises:
        InputError: it is no point, or not on the plate.
    """
    if text is None:
        return None
    plate = mode_file.modes.plate
    try:
        x, y = (1e-3 * float(number) for number in text.split(","))
    except ValueError:
        x = y = math.nan
    if not (abs(x) <= 0.5 * plate.length and abs(y) <= 0.5 * plate.width):
        raise InputError(
            f"is {text}, must be x,y within +-{500.0 * plate.length:g}, +-{500.0 * plate.width:g} mm",
            file=source,
            key=option,
        )
    return x, y


def amplitudes_of(mode_file: ModeFile, names: list[str], volts: float, source: Path) -> NDArray[np.complex128]:
    """Complex amplitude [V] of every actuator when those named are driven in phase by `volts`, peak to peak.

    Raises:
        InputError: an unknown name, or a voltage that is not allowed.
    """
    from feeder_sim.plate.response import voltages

    actuator_names = [each.name for each in mode_file.actuators]
    for name in names:
        if name not in actuator_names:
            raise Unknown(name, actuator_names, file=source, key="--actuator")
    _check_volts(volts, source)
    return voltages(mode_file, list(dict.fromkeys(names)), 0.5 * volts, [0.0] * len(set(names)))
