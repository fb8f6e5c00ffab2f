"""Scenario -> driven surface: which mode each drive excites, how strongly, and the surface that results."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from feeder_sim.errors import InputError
from feeder_sim.plate.drive import ModalDrive, modal_terms
from feeder_sim.plate.mode_file import ModeFile, read_mode_file
from feeder_sim.plate.mode_shapes import ModeShape, Piston, RitzShape, StandingWave, standing_wave
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.surface import Surface, tabulate
from feeder_sim.scenario import Excitation, PistonPlate, Rectangle, Scenario, Strip, resolve_material
from feeder_sim.scene.timetable import Timetable, timed, timetable

# Used where neither the scenario nor a measurement says: the middle of the measured range 0.0009 - 0.0027.
DEFAULT_DAMPING_RATIO = 0.002
# A drive excites the mode nearest in frequency; farther off than this the plate has no such resonance.
MODE_MATCH = 0.02
SEARCH_FACTOR = 1.1  # modes of a plate given by its dimensions are computed this far beyond the highest drive
# Largest amplitude over plate thickness: linear plate theory ends well below it.
LARGEST_DEFLECTION = 1.0
STRIP_WAVELENGTHS = 1.5

Excitations = tuple[tuple[str, Excitation], ...]  # with their keys, for messages


@dataclass(frozen=True)
class DrivenMode:
    """What one excitation of the scenario came to.

    Attributes:
        label: for people, such as "mode 13 (2639.2 Hz computed)".
        shape: the mode shape.
        drive: its modal drive; when it acts is for the timetable to say.
    """

    label: str
    shape: ModeShape
    drive: ModalDrive


@dataclass(frozen=True)
class DrivenPlate:
    """A plate with everything that moves it: one `driven` per excitation of the scenario."""

    surface: Surface
    driven: tuple[DrivenMode, ...]


def assemble_plate(scenario: Scenario) -> DrivenPlate:
    """Build the moving surface of a scenario.

    Raises:
        InputError: unknown mode, a frequency the plate has no mode for, missing gain, unusable mode file.
    """
    plate, times = scenario.plate, timetable(scenario)
    if isinstance(plate, Strip):
        return _strip(plate, scenario.excitations, times)
    if isinstance(plate, Rectangle):
        return _rectangle(plate, scenario.excitations, times)
    return _piston(plate, scenario.excitations, times)


def _strip(plate: Strip, drives: Excitations, times: Timetable) -> DrivenPlate:
    thickness = plate.thickness_mm * 1e-3
    slab = RectangularPlate(1.0, 1.0, thickness, resolve_material(plate.material))
    driven = []
    for i, (key, drive) in enumerate(drives):
        _refuse(drive, key, "strip", "mode", "voltage_vpp", "at_mm")
        try:
            wave = standing_wave(slab, drive.frequency_hz)
        except ValueError as error:
            raise InputError(f"is {drive.frequency_hz}, {error}", key=f"{key}.frequency_hz") from error
        label = f"standing wave, wavelength {wave.wavelength * 1e3:.2f} mm"
        driven.append(DrivenMode(label, wave, _modal_drive(drive, i, _um(drive.amplitude_um))))
    wavelengths = [mode.shape.wavelength for mode in driven if isinstance(mode.shape, StandingWave)]
    length = plate.length_mm * 1e-3 if plate.length_mm else STRIP_WAVELENGTHS * max(wavelengths)
    size = (length, plate.width_mm * 1e-3, thickness)
    return _tabulated(driven, drives, times, *size, min(wavelengths), uniform_y=True)


def _piston(plate: PistonPlate, drives: Excitations, times: Timetable) -> DrivenPlate:
    driven = []
    for i, (key, drive) in enumerate(drives):
        _refuse(drive, key, "piston", "mode", "voltage_vpp", "at_mm")
        driven.append(DrivenMode("piston", Piston(), _modal_drive(drive, i, _um(drive.amplitude_um))))
    size = (plate.length_mm * 1e-3, plate.width_mm * 1e-3, plate.thickness_mm * 1e-3)
    return _tabulated(driven, drives, times, *size, math.inf, uniform_y=True)


def _rectangle(plate: Rectangle, drives: Excitations, times: Timetable) -> DrivenPlate:
    held = _modes_for(plate, drives)
    modes = held.modes
    driven = [_driven_mode(drive, key, i, held) for i, (key, drive) in enumerate(drives)]
    used = [mode.shape.index for mode in driven if isinstance(mode.shape, RitzShape)]
    highest = int(modes.natural_frequency[used].argmax())
    try:
        shortest = standing_wave(modes.plate, float(modes.natural_frequency[used[highest]])).wavelength
    except ValueError as error:
        key, drive = drives[highest]
        raise InputError(f"is {drive.frequency_hz:g}, {error}", key=f"{key}.frequency_hz") from error
    size = (modes.plate.length, modes.plate.width, modes.plate.thickness)
    return _tabulated(driven, drives, times, *size, shortest)


def _modes_for(plate: Rectangle, drives: Excitations) -> ModeFile:
    if plate.mode_file is not None:
        return read_mode_file(plate.mode_file)
    if plate.length_mm is None or plate.width_mm is None or plate.thickness_mm is None:
        raise InputError("length_mm, width_mm and thickness_mm are needed without mode_file", key="plate")
    material = resolve_material(plate.material or "aluminium")
    body = RectangularPlate(plate.length_mm * 1e-3, plate.width_mm * 1e-3, plate.thickness_mm * 1e-3, material)
    wanted = max(drive.natural_frequency_hz or drive.frequency_hz for _, drive in drives)
    try:
        modes = plate_modes(body, highest_frequency=wanted * SEARCH_FACTOR)
    except ValueError as error:
        raise InputError(f"is {wanted:g}, {error}", key=f"{drives[0][0]}.frequency_hz") from error
    if not len(modes):
        key, drive = drives[0]
        raise InputError(f"is {drive.frequency_hz}, below the first mode of the plate", key=f"{key}.frequency_hz")
    return ModeFile(modes)


def _driven_mode(drive: Excitation, key: str, i: int, held: ModeFile) -> DrivenMode:
    """Choose the mode of one drive, and its modal amplitude from an amplitude or a voltage."""
    modes = held.modes
    index = _choose_mode(drive, key, modes)
    measured = next((r for r in held.resonances if r.mode == index), None)
    if drive.voltage_vpp is not None:
        if measured is None or not math.isfinite(measured.gain):
            known = ", ".join(f"{r.frequency:g}" for r in held.resonances if math.isfinite(r.gain)) or "none"
            raise InputError(
                f"mode {index + 1} has no measured gain, allowed are the resonances at {known} Hz",
                key=f"{key}.voltage_vpp",
            )
        level = measured.gain * drive.voltage_vpp
        point: tuple[float, float] | None = measured.driven_point
    else:
        level = _um(drive.amplitude_um)
        point = None if drive.at_mm is None else (drive.at_mm[0] * 1e-3, drive.at_mm[1] * 1e-3)
    if point is not None:
        name = "at_mm" if drive.voltage_vpp is None else "voltage_vpp"
        level /= _deflection_at(modes, index, point, f"{key}.{name}")
    damping = measured.damping_ratio if measured is not None and math.isfinite(measured.damping_ratio) else None
    label = f"mode {index + 1}, {modes.natural_frequency[index]:.1f} Hz computed"
    return DrivenMode(label, RitzShape(modes, index), _modal_drive(drive, i, level, damping))


def _choose_mode(drive: Excitation, key: str, modes: PlateModes) -> int:
    frequencies = modes.natural_frequency
    if drive.mode is not None:
        if drive.mode > len(modes):
            raise InputError(f"is {drive.mode}, allowed is 1 to {len(modes)}", key=f"{key}.mode")
        computed = frequencies[drive.mode - 1]
        if drive.natural_frequency_hz is None and abs(computed / drive.frequency_hz - 1.0) > MODE_MATCH:
            raise InputError(
                f"is {drive.frequency_hz:g}, but mode {drive.mode} lies at {computed:.1f} Hz; allowed is within "
                f"{MODE_MATCH:.0%} of it, or a natural_frequency_hz to drive it off resonance",
                key=f"{key}.frequency_hz",
            )
        return drive.mode - 1
    target = drive.natural_frequency_hz or drive.frequency_hz
    name = "natural_frequency_hz" if drive.natural_frequency_hz else "frequency_hz"
    if target > frequencies[-1] * (1.0 + MODE_MATCH):
        raise InputError(
            f"is {target:g}, beyond the computed modes; allowed is up to {frequencies[-1] * (1 + MODE_MATCH):.0f}",
            key=f"{key}.{name}",
        )
    index = int(np.argmin(np.abs(frequencies - target)))
    if abs(frequencies[index] / target - 1.0) > MODE_MATCH:
        raise InputError(
            f"is {target:g}, no mode within {MODE_MATCH:.0%}; the nearest is mode {index + 1} at "
            f"{frequencies[index]:.1f} Hz (or name a mode)",
            key=f"{key}.{name}",
        )
    return index


def _deflection_at(modes: PlateModes, index: int, point: tuple[float, float], key: str) -> float:
    """|w| of a mode at a point [m] that has to lie on the plate and off the nodal lines; `key` names it in messages."""
    x, y = point
    if abs(x) > 0.5 * modes.plate.length or abs(y) > 0.5 * modes.plate.width:
        raise InputError(f"({x * 1e3:g}, {y * 1e3:g}) mm lies outside the plate", key=key)
    w = abs(float(modes.evaluate(index, x, y)[0]))
    if w < 0.01:
        raise InputError(
            f"({x * 1e3:g}, {y * 1e3:g}) mm lies on a nodal line of mode {index + 1}, where no amplitude can be set",
            key=key,
        )
    return w


def _modal_drive(drive: Excitation, shape: int, amplitude: float, measured_damping: float | None = None) -> ModalDrive:
    damping = drive.damping_ratio or measured_damping or DEFAULT_DAMPING_RATIO
    return ModalDrive(
        shape=shape,
        drive_frequency=drive.frequency_hz,
        natural_frequency=drive.natural_frequency_hz or drive.frequency_hz,
        amplitude=amplitude,
        phase=math.radians(drive.phase_deg),
        damping_ratio=damping if drive.ring_up else None,
    )


def _tabulated(
    driven: list[DrivenMode],
    drives: Excitations,
    times: Timetable,
    length: float,
    width: float,
    thickness: float,
    wavelength: float,
    *,
    uniform_y: bool = False,
) -> DrivenPlate:
    for (key, _), mode in zip(drives, driven, strict=True):
        if mode.drive.amplitude > LARGEST_DEFLECTION * thickness:
            raise InputError(
                f"asks for {1e6 * mode.drive.amplitude:g} um at the antinode, allowed is up to the plate's thickness, "
                f"{1e6 * thickness:g} um",
                key=key,
            )
    shapes = list(dict.fromkeys(mode.shape for mode in driven))  # a mode may be driven many times
    placed = tuple(replace(mode, drive=replace(mode.drive, shape=shapes.index(mode.shape))) for mode in driven)
    surface = tabulate(
        shapes,
        modal_terms(timed([mode.drive for mode in placed], times)),
        length=length,
        width=width,
        thickness=thickness,
        wavelength=wavelength,
        uniform_y=uniform_y,
    )
    return DrivenPlate(surface, placed)


def _refuse(drive: Excitation, key: str, kind: str, *names: str) -> None:
    for name in names:
        if getattr(drive, name) is not None:
            raise InputError(f"is {getattr(drive, name)}, a {kind} takes amplitude_um only", key=f"{key}.{name}")


def _um(value: float | None) -> float:
    return 0.0 if value is None else value * 1e-6
