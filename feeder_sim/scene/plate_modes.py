"""Plate file -> content of a mode file: the computed modes, and the measured resonances assigned to them."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.actuators import modal_force_table
from feeder_sim.plate.mode_file import ModeFile, Resonance
from feeder_sim.plate.modes import PlateModes, Unresolved, plate_modes
from feeder_sim.plate.outline import Outline
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.response import modal_forces
from feeder_sim.plate.ritz.attachments import Attachment
from feeder_sim.scenario import Actuator as ActuatorTable
from feeder_sim.scenario import Bar, Mass, MeasuredResonance, PlateFile, Support, resolve_material
from feeder_sim.scene.attachments import build_actuators, build_attachments, build_supports, check_within
from feeder_sim.scene.outlines import outline_of

Moved = TypeVar("Moved", ActuatorTable, Bar, Mass, Support, MeasuredResonance)
HIGHEST_SEARCHED = 1e7  # [Hz], for the first mode of a plate that has none up to its highest frequency
RESONANCE_MATCH = 0.02  # largest relative difference between a measured resonance and its computed mode


class NoModes(InputError):
    """A plate has no mode below the highest frequency that is asked for; `first` is that of its first mode [Hz]."""

    first: float | None = None


def compute_modes(file: PlateFile) -> ModeFile:
    """Compute the modes a plate file asks for.

    Raises:
        NoModes: none below the highest frequency.
        InputError: modes that are not resolved, or a resonance without a computed mode within `RESONANCE_MATCH`.
    """
    body = file.plate
    try:
        outline = outline_of(body.ring, file.hole)
    except ValueError as error:
        raise InputError(str(error), key="plate.outline") from error
    shift = shift_of(file)
    file, outline = _moved(file, shift), outline.moved(1e-3 * shift)
    plate = RectangularPlate(*outline.size, body.thickness_mm * 1e-3, resolve_material(body.material))
    actuators = build_actuators(file.actuator, plate)
    attachments = build_attachments(file, plate, actuators)
    check_within(outline, actuators, attachments)
    try:
        modes, loss = _solved(file, plate, outline, attachments)
    except ValueError as error:
        raise InputError(f"is {body.highest_frequency_hz:g}, {error}", key="plate.highest_frequency_hz") from error
    if not len(modes):
        first = _first_frequency(file, plate, outline, attachments)
        where = "" if first is None else f", which is at {first:.1f} Hz"
        refusal = NoModes(
            f"is {body.highest_frequency_hz:g}, below the first mode of the plate{where}",
            key="plate.highest_frequency_hz",
        )
        refusal.first = first
        raise refusal
    resonances = tuple(_matched(measured, i, modes) for i, measured in enumerate(file.resonance))
    for i, resonance in enumerate(resonances):
        prior = [k for k in range(i) if resonances[k].mode == resonance.mode]
        if prior:
            raise InputError(
                f"is {resonance.frequency:g}, and belongs to mode {resonance.mode + 1} as resonance[{prior[0]}] does; "
                "must be one of each mode (or name the mode)",
                key=f"resonance[{i}].frequency_hz",
            )
    damping = None if body.damping_ratio is None else body.damping_ratio + loss
    mode_file = ModeFile(modes, resonances, actuators, modal_force_table(modes, actuators), damping_ratio=damping)
    modal_forces(mode_file)  # refuses gains that cannot be those of their actuators
    return mode_file


def shift_of(file: PlateFile) -> NDArray[np.float64]:
    """By how much the coordinates of a plate file are moved [mm], so that its bounding box is centred, shape (2,)."""
    if file.plate.outline is None:
        return np.zeros(2)
    edge = 1e3 * outline_of(file.plate.outline, ()).exterior
    return np.asarray(-0.5 * (edge.min(axis=0) + edge.max(axis=0)))


def _moved(file: PlateFile, shift: NDArray[np.float64]) -> PlateFile:
    """The file with all places moved [mm]; the outline stays."""
    dx, dy = shift.tolist()

    def moved(table: Moved, *keys: str) -> Moved:
        places = {key: getattr(table, key) for key in keys if getattr(table, key) is not None}
        return table.model_copy(update={key: (x + dx, y + dy) for key, (x, y) in places.items()})

    return file.model_copy(
        update={
            "actuator": tuple(moved(table, "at_mm") for table in file.actuator),
            "bar": tuple(moved(table, "at_mm") for table in file.bar),
            "mass": tuple(moved(table, "at_mm") for table in file.mass),
            "support": tuple(moved(table, "at_mm", "to_mm") for table in file.support),
            "resonance": tuple(moved(table, "driven_point_mm") for table in file.resonance),
        }
    )


def _solved(
    file: PlateFile, plate: RectangularPlate, outline: Outline, attachments: Sequence[Attachment]
) -> tuple[PlateModes, NDArray[np.float64]]:
    """Modes by the Ritz method, where it can have them, else by finite elements; damping ratios by supports."""
    body = file.plate
    if not file.by_elements:
        with contextlib.suppress(*(() if body.uniform_width else (Unresolved,))):
            modes = plate_modes(
                plate,
                highest_frequency=body.highest_frequency_hz,
                uniform_width=body.uniform_width,
                attachments=attachments,
            )
            return modes, np.zeros(len(modes))
    from feeder_sim.plate.elements.mindlin import element_modes

    return element_modes(
        plate,
        outline,
        highest_frequency=body.highest_frequency_hz,
        attachments=attachments,
        supports=build_supports(file.support, outline),
    )


def _first_frequency(
    file: PlateFile, plate: RectangularPlate, outline: Outline, attachments: Sequence[Attachment]
) -> float | None:
    """That of the first mode [Hz], however high; None where it is not resolved."""
    # A half wave along the longest side; most plates have their first mode up to twice that.
    stiff, dense = plate.material.youngs_modulus, plate.material.density
    speed = plate.thickness * math.sqrt(stiff / (12.0 * dense * (1.0 - plate.material.poisson_ratio**2)))
    highest = max(file.plate.highest_frequency_hz, 0.5 * math.pi * speed / max(outline.size) ** 2)
    with contextlib.suppress(ValueError):
        while highest < HIGHEST_SEARCHED:
            highest *= 2.0
            body = file.plate.model_copy(update={"highest_frequency_hz": highest})
            modes, _ = _solved(file.model_copy(update={"plate": body}), plate, outline, attachments)
            if len(modes):
                return float(modes.natural_frequency[0])
    return None


def modes_of_resonances(mode_file: ModeFile, frequencies: Sequence[float]) -> list[int | None]:
    """The modes (0-based) of resonances [Hz], the nearest first; None without a free one within `RESONANCE_MATCH`."""
    natural = mode_file.modes.natural_frequency
    deviation = np.abs(natural / np.asarray(frequencies)[:, None] - 1.0)
    modes: list[int | None] = [None] * len(frequencies)
    for i, j in sorted(np.argwhere(deviation < RESONANCE_MATCH).tolist(), key=lambda pair: deviation[tuple(pair)]):
        if modes[i] is None and j not in modes:
            modes[i] = j
    return modes


def far_resonances(mode_file: ModeFile) -> Iterator[tuple[int, str]]:
    """Modes (0-based) whose measured resonance is farther than `RESONANCE_MATCH` from them, and a line about each."""
    for resonance in mode_file.resonances:
        frequency = mode_file.modes.natural_frequency[resonance.mode]
        if abs(frequency / resonance.frequency - 1.0) > RESONANCE_MATCH:
            yield (
                resonance.mode,
                f"mode {resonance.mode + 1}: lies at {frequency:.1f} Hz, but its resonance was measured at "
                f"{resonance.frequency:g} Hz, more than {RESONANCE_MATCH:.0%} from it: is it the right mode?",
            )


def _matched(measured: MeasuredResonance, i: int, modes: PlateModes) -> Resonance:
    """The i-th measured resonance in SI units, with the index of its mode: the one it names or the nearest."""
    if measured.mode is not None and measured.mode > len(modes):
        raise InputError(f"is {measured.mode}, must be 1 to {len(modes)}", key=f"resonance[{i}].mode")
    index = int(np.argmin(np.abs(modes.natural_frequency - measured.frequency_hz)))
    nearest = modes.natural_frequency[index]
    if measured.mode is not None:
        index = measured.mode - 1
    elif abs(nearest / measured.frequency_hz - 1.0) > RESONANCE_MATCH:
        raise InputError(
            f"is {measured.frequency_hz:g}, must be within {RESONANCE_MATCH:.0%} of a computed mode (or name a "
            f"mode); the nearest is {nearest:.1f}",
            key=f"resonance[{i}].frequency_hz",
        )
    gain = measured.amplitude_um_per_vpp
    x, y = measured.driven_point_mm
    return Resonance(
        mode=index,
        frequency=measured.frequency_hz,
        damping_ratio=math.nan if measured.damping_ratio is None else measured.damping_ratio,
        gain=math.nan if gain is None else gain * 1e-6,
        driven_point=(x * 1e-3, y * 1e-3),
        actuators=measured.actuator,
    )
