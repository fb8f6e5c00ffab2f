"""Scenario -> driven surface: which mode each drive excites, how strongly, and the surface that results."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from feeder_sim.errors import InputError
from feeder_sim.plate.drive import ModalTerms, modal_terms
from feeder_sim.plate.mode_file import ModeFile, read_mode_file
from feeder_sim.plate.mode_shapes import ModeShape, Rigid, RitzShape, StandingWave, shortest_wavelength, standing_wave
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.surface import POINTS_PER_WAVELENGTH, Surface, tabulate
from feeder_sim.scenario import (
    BendingPlate,
    Excitation,
    ModePlate,
    RigidPlate,
    Scenario,
    Strip,
    TrayExcitation,
    excitations_of,
    resolve_material,
)
from feeder_sim.scenario.rules import lines_of, plate_with_outline
from feeder_sim.scene.driven_mode import DrivenMode, ModalPlate, driven_mode, metres, modal_drive
from feeder_sim.scene.mode_cache import modes_of_plate
from feeder_sim.scene.plate_modes import NoModes
from feeder_sim.scene.timetable import Timetable
from feeder_sim.scene.tray import tray_motion

ABOVE = 1.3  # of the highest drive, up to where modes of a described plate are computed
STEPS = 4  # per octave
# Largest amplitude over plate thickness: linear plate theory ends well below it.
LARGEST_DEFLECTION = 1.0
STRIP_WAVELENGTHS = 1.5

Excitations = tuple[tuple[str, Excitation], ...]  # with their keys, for messages
TrayExcitations = tuple[tuple[str, TrayExcitation], ...]


@dataclass(frozen=True)
class DrivenPlate:
    """A plate with everything that moves it: one `driven` per excitation of the scenario."""

    surface: Surface
    driven: tuple[DrivenMode, ...]


def assemble_plate(scenario: Scenario, times: Timetable) -> DrivenPlate:
    """Build the moving surface of a scenario; times: its timetable.

    Raises:
        InputError: unknown mode, a frequency the plate has no mode for, missing gain, unusable mode file.
    """
    plate = scenario.plate
    if isinstance(plate, RigidPlate):
        return _rigid(plate, scenario, times)
    drives = excitations_of(scenario, Excitation)
    if isinstance(plate, Strip):
        return _strip(plate, drives, times, scenario.run.points_per_wavelength)
    mode_file = read_mode_file(plate.mode_file) if isinstance(plate, ModePlate) else modes_of(plate, drives)
    if mode_file.modes.outline is not None:
        for problem in lines_of(scenario, plate_with_outline):
            raise InputError(problem)
    return _from_modes(mode_file, drives, times, scenario.run.points_per_wavelength)


def _strip(plate: Strip, drives: Excitations, times: Timetable, per_wavelength: int | None) -> DrivenPlate:
    thickness = plate.thickness_mm * 1e-3
    slab = RectangularPlate(1.0, 1.0, thickness, resolve_material(plate.material))
    driven = []
    for key, drive in drives:
        _refuse(drive, key, "strip", "mode", "voltage_vpp", "at_mm")
        try:
            wave = standing_wave(slab, drive.frequency_hz)
        except ValueError as error:
            raise InputError(f"is {drive.frequency_hz}, {error}", key=f"{key}.frequency_hz") from error
        label = f"standing wave, wavelength {wave.wavelength * 1e3:.2f} mm"
        driven.append(DrivenMode(label, wave, modal_drive(drive, metres(drive.amplitude_um))))
    wavelengths = [mode.shape.wavelength for mode in driven if isinstance(mode.shape, StandingWave)]
    length = plate.length_mm * 1e-3 if plate.length_mm else STRIP_WAVELENGTHS * max(wavelengths)
    size = (length, plate.width_mm * 1e-3, thickness)
    return _tabulated(driven, drives, times, *size, min(wavelengths), per_wavelength, uniform_y=True)


def _rigid(plate: RigidPlate, scenario: Scenario, times: Timetable) -> DrivenPlate:
    if plate.kind == "tray":
        return _tray(plate, excitations_of(scenario, TrayExcitation), times)
    drives = excitations_of(scenario, Excitation)
    driven = []
    for key, drive in drives:
        _refuse(drive, key, plate.kind, "mode", "voltage_vpp", "at_mm")
        driven.append(DrivenMode(plate.kind, Rigid(), modal_drive(drive, metres(drive.amplitude_um))))
    if not driven:  # engines want a shape, which nothing drives
        length, width, thickness = plate.size
        terms = modal_terms(())
        surface = tabulate([Rigid()], terms, length=length, width=width, thickness=thickness, uniform_y=True)
        return DrivenPlate(surface, ())
    return _tabulated(driven, drives, times, *plate.size, math.inf, uniform_y=True)


def _tray(plate: RigidPlate, drives: TrayExcitations, times: Timetable) -> DrivenPlate:
    """A rigid tray; one that is tilted has a shape more, which nothing drives and which stays as it is.

    Its lower end stays at z = 0.
    """
    size = plate.size
    driven = [tray_motion(drive, key, size, _longest(times, i)) for i, (key, drive) in enumerate(drives)]
    level = _tabulated(driven, drives, times, *size, math.inf, bends=False)
    if not plate.tilt_deg:
        return level
    slope = math.tan(math.radians(plate.tilt_deg))
    rises = Rigid(move=(0.0, 0.0, math.copysign(0.5 * size[0], slope)), turn=(0.0, -1.0, 0.0))
    surface = level.surface
    n, always = surface.n_shapes, (np.zeros(1), np.full(1, math.inf))
    resting = ModalTerms(np.array([n]), *always, np.array([complex(slope)]), np.zeros(1, complex))
    table = np.concatenate([surface.table, rises.evaluate_grid(surface.x, surface.y)[None]])
    table[:n, 0] += slope * 0.5 * size[2] * table[:n, 1]  # an incline that moves along rises where one stays
    tilted = replace(surface, table=table, terms=surface.terms.joined(resting), resting=resting)
    return replace(level, surface=tilted)


def _longest(times: Timetable, excitation: int) -> float:
    """How long an excitation acts at most without a break [s]."""
    acting = [o for o in times.occurrences if o.excitation == excitation]
    return max((min(o.stop, times.duration) - o.start for o in acting), default=times.duration)


def _from_modes(mode_file: ModeFile, drives: Excitations, times: Timetable, per_wavelength: int | None) -> DrivenPlate:
    modes = mode_file.modes
    plate = ModalPlate(mode_file)
    driven = [driven_mode(drive, key, plate) for key, drive in drives]
    highest = [float(modes.natural_frequency[_indices(mode)].max()) for mode in driven]
    key, drive = drives[int(np.argmax(highest))]
    try:
        shortest = shortest_wavelength(modes.plate, max(highest))
    except ValueError as error:
        raise InputError(f"is {drive.frequency_hz:g}, {error}", key=f"{key}.frequency_hz") from error
    size = (modes.plate.length, modes.plate.width, modes.plate.thickness)
    tabulated = _tabulated(driven, drives, times, *size, shortest, per_wavelength)
    return replace(tabulated, surface=replace(tabulated.surface, outline=modes.outline))


def _indices(mode: DrivenMode) -> list[int]:
    """0-based indices of the modes that a drive moves."""
    shapes = (mode.shape, *(follower.shape for follower in mode.followers))
    return [shape.index for shape in shapes if isinstance(shape, RitzShape)]


def modes_of(plate: BendingPlate, drives: Excitations) -> ModeFile:
    """The modes of a plate that a scenario describes, as far as its drives can move them.

    Raises:
        InputError: as `compute_modes`, with keys of the scenario.
    """
    highest = max((drive.natural_frequency_hz or drive.frequency_hz for _, drive in drives), default=0.0)
    # In coarse steps, so that a drive of another frequency often needs no others.
    step = 2.0 ** (math.ceil(STEPS * math.log2(ABOVE * highest)) / STEPS) if highest else 0.0
    while True:
        try:
            mode_file = modes_of_plate(plate.as_file(step))
        except NoModes as error:
            mode_file, step = None, max(step, 0.6 * (error.first or 0.0))  # which is doubled below
        except InputError as error:
            key = error.key or "plate"
            raise InputError(error.problem, key=key if key.startswith("plate") else f"plate.{key}") from error
        if mode_file is not None and mode_file.modes.natural_frequency[-1] >= highest:
            return mode_file
        step *= 2.0  # a small plate, whose modes lie far apart


def _tabulated(
    driven: list[DrivenMode],
    drives: Excitations | TrayExcitations,
    times: Timetable,
    length: float,
    width: float,
    thickness: float,
    wavelength: float,
    per_wavelength: int | None = None,
    *,
    uniform_y: bool = False,
    bends: bool = True,
) -> DrivenPlate:
    for (key, _), mode in zip(drives, driven, strict=True):
        if bends and mode.drive.steady_amplitude > LARGEST_DEFLECTION * thickness:
            raise InputError(
                f"asks for {1e6 * mode.drive.steady_amplitude:g} um at the antinode, must be up to the plate's "
                f"thickness, {1e6 * thickness:g} um",
                key=key,
            )
    # A mode may be driven many times. The modes of the drives come first, then those that only follow.
    followers = [follower for mode in driven for follower in mode.followers]
    shapes = list(dict.fromkeys([mode.shape for mode in driven] + [follower.shape for follower in followers]))
    numbered = tuple(_numbered(mode, shapes) for mode in driven)
    surface = tabulate(
        shapes,
        motion_terms(numbered, times),
        length=length,
        width=width,
        thickness=thickness,
        wavelength=wavelength,
        per_wavelength=per_wavelength or POINTS_PER_WAVELENGTH,
        uniform_y=uniform_y,
    )
    return DrivenPlate(surface, numbered)


def _numbered(mode: DrivenMode, shapes: list[ModeShape]) -> DrivenMode:
    """A driven mode whose drives have the numbers of their shapes in a list."""
    followers = tuple(
        replace(follower, drive=replace(follower.drive, shape=shapes.index(follower.shape)))
        for follower in mode.followers
    )
    return replace(mode, drive=replace(mode.drive, shape=shapes.index(mode.shape)), followers=followers)


def motion_terms(driven: Sequence[DrivenMode], times: Timetable) -> ModalTerms:
    """The modal coordinates in time of driven modes and their followers, one per excitation of a scenario."""
    acting = (
        replace(drive, start=occurrence.start, stop=occurrence.stop)
        for occurrence in times.occurrences
        for drive in driven[occurrence.excitation].drives
        if driven[occurrence.excitation].record is None
    )
    terms = modal_terms(acting)
    for occurrence in times.occurrences:
        mode = driven[occurrence.excitation]
        if mode.record is not None:
            shapes = np.array([drive.shape for drive in mode.drives])
            terms = terms.joined(mode.record.between(occurrence.start, occurrence.stop, shapes))
    return terms


def _refuse(drive: Excitation, key: str, kind: str, *names: str) -> None:
    for name in names:
        if getattr(drive, name) is not None:
            raise InputError(f"is {getattr(drive, name)}, a {kind} takes amplitude_um only", key=f"{key}.{name}")
