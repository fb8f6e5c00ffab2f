"""One excitation of a scenario -> the mode it drives, how strongly, and the modes that follow off their resonance.

A voltage becomes a modal amplitude in one of two ways. A gain measured on the plate goes before; it holds for the
actuators it was measured with, and others are scaled to them by their computed forces. Without a gain the modal force
F of the actuators counts, and the amplitude at resonance is F / (2 zeta m w^2). Either way a voltage acts at its own
frequency: what it moves depends on how far that is from the natural frequencies, measured or else computed.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError, Unknown
from feeder_sim.plate.drive import ModalDrive, ModalTerms
from feeder_sim.plate.mode_file import ModeFile, Resonance
from feeder_sim.plate.mode_shapes import ModeShape, RitzShape
from feeder_sim.plate.response import (
    DEFAULT_DAMPING_RATIO,
    NO_FORCE,
    Oscillators,
    amplitude_bounds,
    assumption,
    deflection_at,
    modal_forces,
    oscillators,
    voltages,
)
from feeder_sim.scenario import Excitation
from feeder_sim.scene.plate_modes import far_resonances

# How the modes of a plate take impulses: modal mass, natural frequency and damping of every mode shape of a scene.


@dataclass(frozen=True)
class FreeModes:
    """The mode shapes of a surface as free oscillators, q(t) = Re[z exp(rate t)].

    Attributes:
        modal_mass: [kg], shape (n_shapes,).
        rate: s = -zeta w_n + i w_n sqrt(1 - zeta^2) [1/s], shape (n_shapes,).
    """

    modal_mass: NDArray[np.float64]
    rate: NDArray[np.complex128]


def free_modes(driven: Sequence[DrivenMode]) -> FreeModes:
    """The mode shapes that a scene moves, in the order of its surface.

    A shape that is driven in several ways has the natural frequency and the damping ratio of the first of them. One
    that also follows other drives has those of its own.

    Raises:
        InputError: a mode without modal mass, as of a mode file that does not know it.
    """
    moved = [(mode.shape, mode.drive) for mode in driven]
    moved += [(follower.shape, follower.drive) for mode in driven for follower in mode.followers]
    first = {drive.shape: (shape, drive) for shape, drive in reversed(moved)}
    mass, rate = [], []
    for number in sorted(first):
        shape, drive = first[number]
        zeta, w_n = drive.damping_ratio, 2.0 * math.pi * drive.natural_frequency
        modal_mass = float(shape.modes.modal_mass[shape.index]) if isinstance(shape, RitzShape) else math.nan
        if zeta is None or not math.isfinite(modal_mass):
            raise InputError(
                f"the mode at {drive.natural_frequency:g} Hz has no modal mass or no damping, allowed with "
                "run.reaction = true are modes with both",
                key="plate",
            )
        mass.append(modal_mass)
        rate.append(complex(-zeta * w_n, w_n * math.sqrt(1.0 - zeta**2)))
    return FreeModes(np.array(mass), np.array(rate))


# An amplitude is that of the mode nearest in frequency, a voltage moves the nearer ones as it does; farther off than
# this the plate has no such resonance.
MODE_MATCH = 0.02
# Modes follow a voltage from this share of the driven mode's amplitude on. A smaller one changes drifts by less than
# 4 %, twice the share, and a mode costs a tenth of the time of one part (benchmarks/following_modes.py).
FOLLOWS = 0.02
MUCH_LEFT_OUT = 0.1  # of the driven mode's amplitude


@dataclass(frozen=True)
class Follower:
    """A mode that is moved by a drive of another one."""

    shape: ModeShape
    drive: ModalDrive


@dataclass(frozen=True)
class DrivenMode:
    """What one excitation of the scenario came to.

    Attributes:
        label: for people, such as "mode 13 (2639.2 Hz computed)".
        shape: the mode shape.
        drive: its modal drive; when it acts is for the timetable to say.
        followers: other modes that the scenario wants to move, too.
        left_out: root of the sum of squares of the amplitudes [m] of all modes that follow in reality and are left
            out here; None where it is not known, without actuators.
        bounds: least and largest amplitude that a voltage may reach at resonance, over that of `drive` [1].
        doubt: what is odd about it, for people; "" for nothing.
        record: the motion itself where it has no period, with times from its start; its shapes are numbers of `drives`,
            which then only say how far and fast it goes at most.
    """

    label: str
    shape: ModeShape
    drive: ModalDrive
    followers: tuple[Follower, ...] = ()
    left_out: float | None = None
    bounds: tuple[float, float] = (1.0, 1.0)
    doubt: str = ""
    record: ModalTerms | None = None

    @property
    def drives(self) -> tuple[ModalDrive, ...]:
        """The modal drive of the mode, then those of the followers."""
        return (self.drive, *(follower.drive for follower in self.followers))


@dataclass(frozen=True)
class ModalPlate:
    """A plate of a mode file, with what all its drives need; the forces only where a voltage acts."""

    mode_file: ModeFile

    @cached_property
    def oscillators(self) -> Oscillators:
        """Its modes, with the damping of the file."""
        return oscillators(self.mode_file)

    @cached_property
    def forces(self) -> NDArray[np.float64]:
        """Modal force over the voltage [N/V], shape (n_modes, n_actuators); errors as for `modal_forces`."""
        return modal_forces(self.mode_file)


def driven_mode(drive: Excitation, key: str, plate: ModalPlate) -> DrivenMode:
    """Choose the mode of one drive, and its modal amplitude from an amplitude or a voltage; `key` names the drive.

    Raises:
        InputError: no such mode or actuator, no gain, or a point where the mode does not move.
    """
    mode_file, index = plate.mode_file, _choose_mode(drive, key, plate)
    driven = _driven(drive, key, plate, index)
    lines = [line for mode, line in far_resonances(mode_file) if mode == index]
    amplitude = driven.drive.steady_amplitude
    if driven.left_out is not None and driven.left_out > MUCH_LEFT_OUT * amplitude:
        lines.append(
            f"other modes would move by {1e6 * driven.left_out:.3g} um beside the {1e6 * amplitude:.3g} um of the "
            f'driven one, and are left out; {key}.modes = "all" or a smaller share takes them in'
        )
    assumed = drive.damping_ratio is None and plate.oscillators.assumed[index]
    if driven.left_out is not None and not _calibrated(mode_file, index) and assumed:
        lines.append(assumption(plate.oscillators))
    return replace(driven, doubt="; ".join(lines))


def _calibrated(mode_file: ModeFile, index: int) -> bool:
    """Whether the amplitude of a mode over its voltage was measured, so that no damping is needed for it."""
    return any(r.mode == index and math.isfinite(r.gain) for r in mode_file.resonances)


def _driven(drive: Excitation, key: str, plate: ModalPlate, index: int) -> DrivenMode:
    """As `driven_mode`, of a mode that is chosen."""
    mode_file, modes = plate.mode_file, plate.mode_file.modes
    measured = next((r for r in mode_file.resonances if r.mode == index), None)
    damping = drive.damping_ratio or float(plate.oscillators.damping_ratio[index])
    label = _label(mode_file, index)
    shape = RitzShape(modes, index)
    if drive.voltage_vpp is None:
        level = metres(drive.amplitude_um)
        if drive.at_mm is not None:
            level /= deflection_at(modes, index, (drive.at_mm[0] * 1e-3, drive.at_mm[1] * 1e-3), f"{key}.at_mm")
        return DrivenMode(label, shape, modal_drive(drive, level, damping))
    names = _actuators(drive, f"mode {index + 1}", key, mode_file, measured)
    if not names:
        assert measured is not None  # without a gain there is no drive without actuators
        if drive.modes not in (None, "driven"):
            raise InputError(
                f"is {drive.modes!r}, must be 'driven' for a plate file without actuators", key=f"{key}.modes"
            )
        level = measured.gain * drive.voltage_vpp
        level /= deflection_at(modes, index, measured.driven_point, f"{key}.voltage_vpp")
        return DrivenMode(
            label, shape, _of_oscillator(drive, level, drive.natural_frequency_hz or measured.frequency, damping)
        )
    return _actuated(drive, key, plate, index, names, damping)


def _actuated(
    drive: Excitation, key: str, plate: ModalPlate, index: int, names: tuple[str, ...], damping: float
) -> DrivenMode:
    """The mode of a drive and its followers, from the modal forces of actuators."""
    assert drive.voltage_vpp is not None
    mode_file, force = plate.mode_file, plate.forces @ _volts(drive, plate.mode_file, names)
    natural, ratio = plate.oscillators.natural_frequency.copy(), plate.oscillators.damping_ratio.copy()
    natural[index], ratio[index] = drive.natural_frequency_hz or natural[index], damping
    level = force / (2.0 * ratio * plate.oscillators.modal_mass * (2.0 * math.pi * natural) ** 2)
    key_of_names = f"{key}.{'voltage_vpp' if drive.actuator is None else 'actuator'}"
    if abs(force[index]) < NO_FORCE * np.abs(force).max():
        raise InputError(f"is {', '.join(names)}, which does not drive mode {index + 1}", key=key_of_names)
    indices = [i for i, actuator in enumerate(mode_file.actuators) if actuator.name in names]
    drives = [_of_oscillator(drive, *oscillator) for oscillator in zip(level, natural, ratio, strict=True)]
    amplitude = np.array([oscillation.steady_amplitude for oscillation in drives])
    driven_amplitude = amplitude[index]
    amplitude[index] = 0.0
    share = FOLLOWS if drive.modes is None else drive.modes
    threshold = {"driven": math.inf, "all": 0.0}[share] if isinstance(share, str) else share
    is_follower = (amplitude > 0.0) & (amplitude >= threshold * driven_amplitude)
    return DrivenMode(
        label=_label(mode_file, index),
        shape=RitzShape(mode_file.modes, index),
        drive=drives[index],
        followers=tuple(Follower(RitzShape(mode_file.modes, int(j)), drives[j]) for j in np.flatnonzero(is_follower)),
        left_out=float(np.linalg.norm(amplitude[~is_follower])),
        bounds=amplitude_bounds(mode_file, oscillators(mode_file, drive.damping_ratio), index, indices),
    )


def _volts(drive: Excitation, mode_file: ModeFile, names: tuple[str, ...]) -> NDArray[np.complex128]:
    """Complex amplitude of every actuator of a plate [V]."""
    assert drive.voltage_vpp is not None
    phases = np.radians(drive.actuator_phase_deg or (0.0,) * len(names))
    return voltages(mode_file, names, 0.5 * drive.voltage_vpp, phases.tolist())


def _of_oscillator(drive: Excitation, level: complex, natural_frequency: float, damping_ratio: float) -> ModalDrive:
    """The modal drive of a voltage that would reach a complex amplitude [m] at the resonance [Hz] of its mode.

    Without ring-up the motion is the stationary one from the start.
    """
    ringing = ModalDrive(
        shape=0,
        drive_frequency=drive.frequency_hz,
        natural_frequency=float(natural_frequency),
        amplitude=abs(level),
        phase=math.radians(drive.phase_deg) + cmath.phase(level),
        damping_ratio=float(damping_ratio),
    )
    if drive.ring_up:
        return ringing
    phase = cmath.phase(1j * ringing.steady)
    return replace(ringing, amplitude=ringing.steady_amplitude, phase=phase, damping_ratio=None)


def _actuators(
    drive: Excitation, mode: str, key: str, mode_file: ModeFile, measured: Resonance | None
) -> tuple[str, ...]:
    """Names of the actuators behind a voltage; none for a gain that was measured with unknown ones.

    Raises:
        InputError: an unknown name, or neither a gain nor an actuator that could be meant.
    """
    actuator_names = [actuator.name for actuator in mode_file.actuators]
    if drive.actuator is not None:
        for name in drive.actuator:
            if name not in actuator_names:
                raise Unknown(name, actuator_names, key=f"{key}.actuator")
        if len(set(drive.actuator)) < len(drive.actuator):
            raise InputError("names an actuator twice, must be once", key=f"{key}.actuator")
        return drive.actuator
    if measured is not None and math.isfinite(measured.gain):
        return measured.actuators
    if len(actuator_names) == 1:
        return (actuator_names[0],)
    gains = ", ".join(f"{r.frequency:g}" for r in mode_file.resonances if math.isfinite(r.gain))
    allowed = [f"the resonances at {gains} Hz"] if gains else []
    allowed += [f"actuator = [...] of {', '.join(actuator_names)}"] if actuator_names else []
    raise InputError(
        f"{mode} has no measured gain, must be {' or '.join(allowed) or 'amplitude_um'}", key=f"{key}.voltage_vpp"
    )


def _label(mode_file: ModeFile, index: int) -> str:
    kind = "imported" if mode_file.origin else "computed"
    return f"mode {index + 1}, {mode_file.modes.natural_frequency[index]:.1f} Hz {kind}"


def _choose_mode(drive: Excitation, key: str, plate: ModalPlate) -> int:
    mode_file, modes = plate.mode_file, plate.mode_file.modes
    frequencies = modes.natural_frequency
    if drive.mode is not None:
        if drive.mode > len(modes):
            raise InputError(f"is {drive.mode}, must be 1 to {len(modes)}", key=f"{key}.mode")
        peaks = [frequencies[drive.mode - 1], *(r.frequency for r in mode_file.resonances if r.mode == drive.mode - 1)]
        deviation = min(abs(peak / drive.frequency_hz - 1.0) for peak in peaks)
        if drive.natural_frequency_hz is None and deviation > MODE_MATCH:
            frequency_text = " Hz, or ".join(f"{peak:.1f}" for peak in peaks)
            raise InputError(
                f"is {drive.frequency_hz:g}, but mode {drive.mode} lies at {frequency_text} Hz; must be within "
                f"{MODE_MATCH:.0%} of it, or a natural_frequency_hz to drive it off resonance",
                key=f"{key}.frequency_hz",
            )
        return drive.mode - 1
    target = drive.natural_frequency_hz or drive.frequency_hz
    name = "natural_frequency_hz" if drive.natural_frequency_hz else "frequency_hz"
    if target > frequencies[-1] * (1.0 + MODE_MATCH):
        raise InputError(
            f"is {target:g}, beyond the computed modes; must be up to {frequencies[-1] * (1 + MODE_MATCH):.0f}",
            key=f"{key}.{name}",
        )
    index = int(np.argmin(np.abs(frequencies - target)))
    is_near = abs(frequencies[index] / target - 1.0) <= MODE_MATCH
    has_actuator = drive.actuator is not None or len(mode_file.actuators) == 1
    if drive.voltage_vpp is not None and drive.natural_frequency_hz is None and (is_near or has_actuator):
        measured = next((r for r in mode_file.resonances if r.mode == index), None)
        names = _actuators(drive, f"mode {index + 1}", key, mode_file, measured)
        return _strongest(drive, plate, names) if names else index
    if not is_near:
        raise InputError(
            f"is {target:g}, no mode within {MODE_MATCH:.0%}; the nearest is mode {index + 1} at "
            f"{frequencies[index]:.1f} Hz (or name a mode)",
            key=f"{key}.{name}",
        )
    return index


def _strongest(drive: Excitation, plate: ModalPlate, names: tuple[str, ...]) -> int:
    """The mode that a voltage moves most at its frequency."""
    force = plate.forces @ _volts(drive, plate.mode_file, names)
    return int(np.abs(plate.oscillators.modal_coordinates(np.array([drive.frequency_hz]), force)[0]).argmax())


def modal_drive(drive: Excitation, amplitude: float, damping_ratio: float = DEFAULT_DAMPING_RATIO) -> ModalDrive:
    """The modal drive of an excitation that reaches an amplitude [m] at resonance; its shape is not yet numbered."""
    return ModalDrive(
        shape=0,
        drive_frequency=drive.frequency_hz,
        natural_frequency=drive.natural_frequency_hz or drive.frequency_hz,
        amplitude=amplitude,
        phase=math.radians(drive.phase_deg),
        damping_ratio=(drive.damping_ratio or damping_ratio) if drive.ring_up else None,
    )


def metres(micrometres: float | None) -> float:
    """An amplitude in SI units; none is 0."""
    return 0.0 if micrometres is None else micrometres * 1e-6
