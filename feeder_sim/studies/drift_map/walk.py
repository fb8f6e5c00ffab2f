"""Parts that walk on the plate of a scenario as a drift map says: dx = v dt + sqrt(2 D dt) noise.

They know nothing of each other. At any moment the mode with the largest velocity amplitude moves them: the driven one
as it rings up, or the one before as it dies out. A part whose centre leaves the plate is lost.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.measures.stage_lines import stage_lines
from feeder_sim.plate.drive import ModalDrive, modal_terms
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.surface import Surface
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.timetable import TimedStage
from feeder_sim.studies.drift_map.drift_map import DriftMap
from feeder_sim.studies.drift_map.files import check_made

Floats = NDArray[np.float64]
STEP_S = 0.02
CHECK_INTERVAL_S = 0.04  # between two checks whether a part has settled
Observer = Callable[[float, Floats], bool]  # takes time [s] and places (n, 2) [m], NaN of lost parts; True: enough


@dataclass(frozen=True)
class Mode:
    """A mode that moves: its shape alone as a surface, its frequency [Hz], and its waves on the strip of the map.

    `wavenumber` [1/m]; `per_rotation` is the slope of the surface over its rotation [1].
    """

    surface: Surface
    frequency: float
    wavenumber: float
    per_rotation: float

    @staticmethod
    def of(drift_map: DriftMap, surface: Surface, shape: int, frequency: float) -> Mode:
        wave = standing_wave(drift_map.plate, frequency)
        alone = replace(surface, table=surface.table[shape : shape + 1])
        return Mode(alone, frequency, wave.wavenumber, wave.wavenumber / wave.rotation)

    def local(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Amplitude (n,) [1], slope over the wavenumber (n,) [1], direction in which the amplitude falls (n, 2)."""
        w, bx, by = self.surface.modes_at(points)[0].T
        rotation = np.hypot(bx, by)
        with np.errstate(invalid="ignore", divide="ignore"):
            down = np.where(rotation > 0.0, -np.sign(w) * np.stack([bx, by]) / rotation, [[1.0], [0.0]])
        return np.abs(w), rotation * (self.per_rotation / self.wavenumber), down.T


def velocity(drift_map: DriftMap, mode: Mode, amplitude: float, points: Floats) -> Floats:
    """Mean drift (n, 2) [m/s] at points (n, 2) [m] of a plate whose mode moves with a modal amplitude [m]."""
    w, quadrature, down = mode.local(points)
    drift, _, _ = drift_map.at_wave(mode.frequency, amplitude * w, amplitude * quadrature, mode.wavenumber)
    return np.asarray(drift[:, None] * down)


def advance(
    drift_map: DriftMap, mode: Mode, amplitude: float, points: Floats, step: float, rng: np.random.Generator
) -> Floats:
    """Places (n, 2) [m] a time step [s] later."""
    w, quadrature, down = mode.local(points)
    drift, along, across = drift_map.at_wave(mode.frequency, amplitude * w, amplitude * quadrature, mode.wavenumber)
    noise = rng.standard_normal((2, len(points)))
    ahead = drift * step + np.sqrt(2.0 * step * along) * noise[0]
    aside = np.sqrt(2.0 * step * across) * noise[1]
    return np.asarray(points + ahead[:, None] * down + aside[:, None] * down[:, ::-1] * [-1.0, 1.0])


@dataclass(frozen=True)
class Walked:
    """What came of a walk.

    Attributes:
        points: places at the end (n, 2) [m]; NaN for lost parts.
        duration: how long the drives of each stage acted (stages, n) [s].
        total: when each part had come to the end (n,) [s].
    """

    points: Floats
    duration: Floats
    total: Floats

    @property
    def lost(self) -> NDArray[np.bool_]:
        return np.isnan(self.points[:, 0])


def walk(
    drift_map: DriftMap,
    prepared: Prepared,
    points: Floats,
    rng: np.random.Generator,
    *,
    step: float = STEP_S,
    observer: Observer | None = None,
) -> Walked:
    """Let parts walk through the schedule of a scenario, or under its drives, each as if it were alone.

    Args:
        drift_map: of the part and the contact of the scenario.
        prepared: the scenario; its number of parts and its seeds do not count.
        points: places at the start (n, 2) [m].
        rng: of the noise.
        step: of time [s].
        observer: takes time and places after every step, and says when to end; only without stages that end when parts
            have settled.

    Raises:
        InputError: a map of something else, a drive beyond it, or several modes that are driven at once.
    """
    scene = prepared.scene
    check_made(drift_map, prepared.scenario, scene.surface.thickness)
    if observer is not None and any(stage.until for stage in scene.times.stages):
        raise ValueError("parts of stages that end when they have settled have no time in common")
    modes: list[Mode] = []
    for key, excitation in zip((key for key, _ in prepared.scenario.excitations), scene.driven, strict=True):
        drive = excitation.drive
        fastest = 2.0 * math.pi * drive.drive_frequency * drive.steady_amplitude
        drift_map.check_covers(drive.drive_frequency, fastest * float(scene.surface.extremes[0, drive.shape]))
        modes.append(Mode.of(drift_map, scene.surface, drive.shape, drive.drive_frequency))
        if excitation.followers:
            raise InputError("moves other modes too, must be one mode with a drift map", key=f"{key}.modes")
    walkers = _Walkers(drift_map, scene, np.array(points, float), rng, step, observer)
    total, durations, before = np.zeros(len(points)), [], None
    for number, stage in enumerate(scene.times.stages):
        if len(stage.excitations) > 1:
            problem = f"drives {len(stage.excitations)} modes at once, must be one with a drift map"
            raise InputError(problem, key=stage.name or "drive")
        ring = _Ring.of(stage, modes, scene.drives, before)
        durations.append(walkers.driven(ring, number))
        walkers.pause(ring, stage.end - stage.stop)
        before = ring.after(stage.end - stage.stop)
        total += durations[-1] + stage.end - stage.stop
        if walkers.enough:
            break
    return Walked(walkers.points, np.array(durations), total)


@dataclass(frozen=True)
class _Ring:
    """The amplitude [m] of the mode that a stage drives, and that of the one before as it dies out."""

    mode: Mode | None
    drive: ModalDrive | None
    before: tuple[Mode, ModalDrive, float] | None  # with what is left of it

    @staticmethod
    def of(
        stage: TimedStage,
        modes: Sequence[Mode],
        drives: Sequence[ModalDrive],
        before: tuple[Mode, ModalDrive, float] | None,
    ) -> _Ring:
        if not stage.excitations:
            return _Ring(None, None, before)
        (index,) = stage.excitations
        return _Ring(modes[index], replace(drives[index], start=0.0, stop=math.inf), before)

    def after(self, pause: float) -> tuple[Mode, ModalDrive, float] | None:
        """What is left of it when the next stage begins."""
        if self.mode is None or self.drive is None:
            return None
        return self.mode, self.drive, self.drive.steady_amplitude * _remaining_share(self.drive, pause)

    def driven(self, times: Floats) -> Floats:
        """Amplitude of the driven mode (n,) [m]."""
        if self.drive is None:
            return np.zeros(len(times))
        return np.abs(modal_terms([replace(self.drive, shape=0)]).phasor(times, 1)[:, 0])

    def strongest(self, time: float, driven: float) -> tuple[Mode, float] | None:
        """The mode that moves parts at a time [s] after the begin of the stage, and its amplitude [m]."""
        moving_modes = [(self.mode, driven)] if self.mode is not None else []
        if self.before is not None:
            mode, drive, amplitude = self.before
            moving_modes.append((mode, amplitude * _remaining_share(drive, time)))
        return max(moving_modes, key=lambda pair: pair[0].frequency * pair[1], default=None)


def _remaining_share(drive: ModalDrive, time: float) -> float:
    """Share of the amplitude that is left so long [s] after the drive has stopped."""
    return math.exp(-time / drive.ring_up_time) if drive.ring_up_time else float(time <= 0.0)


class _Walkers:
    """Parts on their way; `points` (n, 2) [m] are changed, NaN for lost ones."""

    def __init__(
        self,
        drift_map: DriftMap,
        scene: Scene,
        points: Floats,
        rng: np.random.Generator,
        step: float,
        observer: Observer | None,
    ) -> None:
        self._map, self._scene, self._rng, self._step, self._observer = drift_map, scene, rng, step, observer
        self._lines = stage_lines(scene) if any(stage.until for stage in scene.times.stages) else None
        self.points, self.enough, self._clock = points, False, 0.0

    def driven(self, ring: _Ring, number: int) -> Floats:
        """Move parts while a stage is driven; how long it was for each (n,) [s]."""
        stage = self._scene.times.stages[number]
        longest = stage.stop - stage.start
        steps = max(1, math.ceil(longest / self._step - 1e-9))
        step = longest / steps
        amplitude = ring.driven(step * (np.arange(steps, dtype=float) + 0.5))
        lasted, settled_for = np.full(len(self.points), longest), np.zeros(len(self.points))
        going = ~np.isnan(self.points[:, 0])
        steps_per_check = max(1, round(CHECK_INTERVAL_S / step))
        for k in range(steps):
            self._move(ring.strongest((k + 0.5) * step, float(amplitude[k])), step, going)
            if self.enough:
                break
            if self._lines is not None and stage.until is not None and (k + 1) % steps_per_check == 0:
                going &= ~np.isnan(self.points[:, 0])
                now = np.flatnonzero(going)
                near = self._lines.near(number, self.points[now], 1e-3 * stage.until.within_mm)
                settled_for[now] = np.where(near, settled_for[now] + steps_per_check * step, 0.0)
                ended = now[settled_for[now] >= stage.until.for_s]
                lasted[ended], going[ended] = (k + 1) * step, False
                if not going.any():
                    break
        return lasted

    def pause(self, ring: _Ring, longest: float) -> None:
        """Move parts while the mode of a stage dies out."""
        steps = 0 if self.enough else math.ceil(longest / self._step - 1e-9)
        for k in range(steps):
            step = longest / steps
            remaining = ring.after((k + 0.5) * step)
            self._move((remaining[0], remaining[2]) if remaining else None, step, ~np.isnan(self.points[:, 0]))

    def _move(self, moved: tuple[Mode, float] | None, step: float, going: NDArray[np.bool_]) -> None:
        if moved is not None and moved[1] > 0.0:
            now = np.flatnonzero(going & ~np.isnan(self.points[:, 0]))
            places = advance(self._map, *moved, self.points[now], step, self._rng)
            self.points[now] = np.where(_on_plate(self._scene.surface, places)[:, None], places, np.nan)
        self._clock += step
        if self._observer is not None:
            self.enough = self._observer(self._clock, self.points)


def _on_plate(surface: Surface, points: Floats) -> NDArray[np.bool_]:
    if surface.outline is not None:
        return np.asarray(surface.outline.holds(points))
    return np.asarray((np.abs(points) < 0.5 * np.array([surface.length, surface.width])).all(axis=1))
