"""One excitation of a tray -> the rigid motions that it makes: along a line, about an axis, or from a file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.errors import InputError
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.plate.mode_shapes import Rigid
from feeder_sim.plate.record import AT_REST, random_motion, read_record
from feeder_sim.plate.waveform import CLOSE, read_waveform
from feeder_sim.scenario import TrayExcitation
from feeder_sim.scenario.tables import read_text
from feeder_sim.scene.driven_mode import DrivenMode, Follower

LARGEST_STROKE = 0.02  # [m]
DAMPING_RATIO = 0.1  # the amplitude is there within 1 / 2 pi zeta = 1.6 periods, but for 1/e of it
SAME_PERIOD = 0.01  # relative
SAME_DURATION = 1e-9  # relative
MOVES = 1e-6  # of the largest of a harmonic; a smaller part of it is round-off
MISSED = 0.05  # of the acceleration of a table: what is left out is said if it is more
NOTHING = 0.01  # [m/s^2]; and more than this
AXES = np.eye(3)


def tray_motion(drive: TrayExcitation, key: str, size: Sequence[float], duration: float) -> DrivenMode:
    """The motion of one drive; size: length, width and thickness of the tray [m]; duration: of it at most [s].

    A turn is in the modal coordinate a way: what half of the longer side moves by. The tray swings up like an
    oscillator at its resonance, so that neither place nor speed jump.

    Raises:
        InputError: a motion that is too large, or a table that cannot be used.
    """
    arm = 0.5 * max(size[:2])
    if drive.is_record:
        return _from_record(drive, key, size, arm, duration)
    if drive.motion_file is not None:
        return _from_table(drive, key, size, arm)
    if drive.stroke_um is not None:
        rise, heading = math.radians(drive.angle_deg), math.radians(drive.direction_deg)
        across = math.cos(rise)
        line = across * math.cos(heading), across * math.sin(heading), math.sin(rise)
        shape, amplitude = Rigid(move=line, thickness=size[2]), 1e-6 * drive.stroke_um
        label = f"along a line, {drive.angle_deg:g} deg above the horizontal"
    else:
        assert drive.turn_mrad is not None and drive.axis is not None  # the table's own check
        turn = AXES["xyz".index(drive.axis)] / arm
        shape = Rigid((0.0, 0.0, 0.0), (float(turn[0]), float(turn[1]), float(turn[2])), size[2])
        amplitude, label = 1e-3 * drive.turn_mrad * arm, f"about {drive.axis}"
    motion = ModalDrive(
        shape=0,
        drive_frequency=drive.frequency_hz,
        natural_frequency=drive.natural_frequency_hz or drive.frequency_hz,
        amplitude=amplitude,
        phase=math.radians(drive.phase_deg),
        damping_ratio=_damping(drive),
    )
    _check_stroke(motion.steady_amplitude, key)
    return DrivenMode(f"tray, {label}", shape, motion)


def _damping(drive: TrayExcitation) -> float | None:
    return (drive.damping_ratio or DAMPING_RATIO) if drive.ring_up else None


def _check_stroke(amplitude: float, key: str) -> None:
    if amplitude > LARGEST_STROKE:
        raise InputError(
            f"moves the tray by {1e3 * amplitude:.3g} mm, must be up to {1e3 * LARGEST_STROKE:g} mm", key=key
        )


def _from_table(drive: TrayExcitation, key: str, size: Sequence[float], arm: float) -> DrivenMode:
    """The harmonics of a table: one shape and drive for every direction of each."""
    assert drive.motion_file is not None
    wave = read_waveform(read_text(drive.motion_file), drive.motion_file, arm)
    frequency = 1.0 / wave.period
    if abs(drive.frequency_hz / frequency - 1.0) > SAME_PERIOD:
        raise InputError(
            f"is {drive.frequency_hz:g}, must be {frequency:.6g}, one over the period of the table of "
            f"{1e3 * wave.period:g} ms",
            key=f"{key}.frequency_hz",
        )
    shapes = _shapes(size, arm)
    coefficient = wave.coefficient * np.array([1.0, 1.0, 1.0, arm, arm, arm])
    largest = np.abs(coefficient).max(initial=0.0)
    if largest == 0.0:
        raise InputError("moves nothing, must be a table with a motion in it", file=drive.motion_file)
    _check_stroke(largest, key)
    motions = [
        Follower(
            shapes[j],
            ModalDrive(
                shape=0,
                drive_frequency=harmonic * drive.frequency_hz,
                natural_frequency=harmonic * drive.frequency_hz,
                amplitude=float(abs(coefficient[i, j])),
                phase=float(np.angle(1j * coefficient[i, j])) + harmonic * math.radians(drive.phase_deg),
                damping_ratio=_damping(drive),
            ),
        )
        for i, harmonic in enumerate(wave.harmonic.tolist())
        for j in np.flatnonzero(np.abs(coefficient[i]) > MOVES * np.abs(coefficient[i]).max())
    ]
    motions.sort(key=lambda motion: -motion.drive.amplitude)
    warnings = []
    if wave.residual > CLOSE:
        warnings.append(f"{len(coefficient)} harmonics come within {wave.residual:.1%} of its table")
    if wave.left_out > max(MISSED * wave.acceleration, NOTHING):
        warnings.append(
            f"{wave.left_out / GRAVITY:.3g} g of its table are left out, most of them at "
            f"{wave.left_out_frequency:.4g} Hz, beside the {wave.acceleration / GRAVITY:.3g} g that it moves with"
        )
    main_motion = motions[0]
    return DrivenMode(
        f"tray, by {drive.motion_file.name}, {len(coefficient)} harmonics",
        main_motion.shape,
        main_motion.drive,
        followers=tuple(motions[1:]),
        doubt="; ".join(warnings),
    )


def _from_record(drive: TrayExcitation, key: str, size: Sequence[float], arm: float, duration: float) -> DrivenMode:
    """The motion of a record or a spectrum: one shape for every direction in which it moves."""
    path = drive.psd_file or drive.motion_file
    assert path is not None
    if drive.psd_file is not None:
        record = random_motion(read_text(path), path, drive.frequency_hz, duration, drive.psd_seed)
    else:
        record = read_record(read_text(path), path, drive.frequency_hz)
    arms = np.array([1.0, 1.0, 1.0, arm, arm, arm])
    largest, speed, acceleration = record.largest * arms
    if not largest.any():
        raise InputError("moves nothing, must be a table with a motion in it", file=path)
    farthest = int(largest.argmax())
    if largest[farthest] > LARGEST_STROKE:
        raise InputError(
            f"moves the tray by {1e3 * largest[farthest]:.3g} mm after {record.largest_time[farthest]:.4g} s, must be "
            f"up to {1e3 * LARGEST_STROKE:g} mm",
            file=path,
        )
    if record.duration < duration * (1.0 - SAME_DURATION) and record.final_speed > AT_REST:
        raise InputError(
            f"ends after {record.duration:g} s with {record.final_speed:.0%} of its largest speed, must last "
            f"{duration:g} s or end at rest",
            file=path,
        )
    moving = np.array(sorted(np.flatnonzero(largest), key=lambda direction: -largest[direction]))
    # An oscillation that is as far, and at least as fast, in speed and in acceleration.
    rate = np.maximum(speed[moving] / largest[moving], np.sqrt(acceleration[moving] / largest[moving]))
    shapes = _shapes(size, arm)
    main, *followers = (
        Follower(shapes[j], ModalDrive(0, frequency, frequency, float(largest[j])))
        for j, frequency in zip(moving, (rate / (2.0 * math.pi)).tolist(), strict=True)
    )
    terms = record.handed_over
    number = np.zeros(6, np.int64)
    number[moving] = np.arange(len(moving))
    warning = f"{record.missed:.1%} of its record are left out, above {drive.frequency_hz:g} Hz"
    return DrivenMode(
        f"tray, by {path.name}, up to {drive.frequency_hz:g} Hz",
        main.shape,
        main.drive,
        followers=tuple(followers),
        doubt=warning if record.missed > CLOSE else "",
        record=replace(terms, shape=number[terms.shape], coefficient=terms.coefficient * arms[terms.shape]),
    )


def _shapes(size: Sequence[float], arm: float) -> list[Rigid]:
    """Moves along x, y and z, and turns about them by which the arm [m] moves as far."""
    moves = [Rigid(move=_three(axis), thickness=size[2]) for axis in AXES]
    return moves + [Rigid((0.0, 0.0, 0.0), _three(axis / arm), size[2]) for axis in AXES]


def _three(vector: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
