"""What a quasi-travelling wave does to parts: whether they run round with it, and where they gather.

*Circulation*: mean speed, along the crest's track and counter-clockwise, of the parts within `ON_TRACK` of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.protocol import ended, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plate.wave import Track, Wave, crest_track, still_points
from feeder_sim.records.trajectory import Frames, SeedRecord
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.timetable import TimedStage

ON_TRACK = 10e-3  # [m]
AT_STILL_POINT = 8e-3  # [m]
FROM = 0.25  # of the stage: when its circulation begins to count, the ring-up and the drop of the parts behind it
ALONE = 1e-3  # of the largest modal amplitude: what a mode has to reach to take part
MANY = 1000  # crossings: the real and the imaginary part have whole lines in common, the wave stands


@dataclass(frozen=True)
class StageWave:
    """The wave of one stage.

    Attributes:
        number: of the stage.
        stage: when, if no stage before it ends early.
        wave: at its end.
        still: points, shape (n, 2) [m]; empty for a standing wave, which has whole lines of them.
        track: around the still point next to the middle; None without a crest all around it.
    """

    number: int
    stage: TimedStage
    wave: Wave
    still: NDArray[np.float64]
    track: Track | None


def stage_waves(scene: Scene) -> list[StageWave]:
    """The waves of the stages that drive several modes at one frequency, of all cycles."""
    found: list[StageWave] = []
    known: dict[tuple[int, ...], StageWave] = {}
    for number, stage in enumerate(scene.times.stages):
        wave = None if stage.excitations in known else wave_of(scene, stage)
        if wave is not None:
            known[stage.excitations] = _analysed(number, stage, wave)
        if stage.excitations in known:
            found.append(replace(known[stage.excitations], number=number, stage=stage))
    return found


def wave_of(scene: Scene, stage: TimedStage) -> Wave | None:
    """The wave at the end of a stage; None unless it drives several modes, all at one frequency."""
    drives = [scene.drives[i] for i in stage.excitations]
    if len({drive.shape for drive in drives}) < 2 or len({drive.drive_frequency for drive in drives}) > 1:
        return None
    omega = 2.0 * math.pi * drives[0].drive_frequency
    just_before = stage.stop - 1e-9 / drives[0].drive_frequency
    amplitude = scene.surface.terms.phasor(just_before, scene.surface.n_shapes)[0]
    amplitude = np.where([j in {drive.shape for drive in drives} for j in range(len(amplitude))], amplitude, 0.0)
    if (np.abs(amplitude) > ALONE * np.abs(amplitude).max()).sum() < 2:
        return None
    return Wave(scene.surface, amplitude * np.exp(-1j * omega * (just_before - stage.start)))


def _analysed(number: int, stage: TimedStage, wave: Wave) -> StageWave:
    still = still_points(wave)
    if not 0 < len(still) < MANY:
        return StageWave(number, stage, wave, np.empty((0, 2)), None)
    try:
        track = crest_track(wave, still[np.linalg.norm(still, axis=1).argmin()])
    except ValueError:
        track = None
    return StageWave(number, stage, wave, still, track)


def circulation(scene: Scene, track: Track, frames: Frames, start: float, stop: float) -> float:
    """Mean speed [m/s] of the parts near a track between two times [s]; NaN where there are none."""
    from scipy.spatial import cKDTree

    rows = np.flatnonzero((frames.time >= start) & (frames.time <= stop))
    if len(rows) < 2:
        return float("nan")
    before, after = frames.position[rows[:-1]], frames.position[rows[1:]]
    off, nearest = cKDTree(track.points).query(before[..., :2].reshape(-1, 2))
    on_plate = frames.on_plate(scene.surface)[rows[1:]]
    counted = (off.reshape(before.shape[:2]) < ON_TRACK) & on_plate
    along = ((after - before)[..., :2] * track.tangent[nearest].reshape(*before.shape[:2], 2)).sum(axis=-1)
    speed = along / np.diff(frames.time[rows])[:, None]
    return float(speed[counted].mean()) if counted.any() else float("nan")


@dataclass(frozen=True)
class WaveDescription:
    """A wave by itself; None where it has no track."""

    standing_share: float
    still_points: int
    track_mm: float | None
    amplitude_ratio: float | None
    phase_turns: int | None
    travelling_ratio: float | None


@dataclass(frozen=True)
class WaveFinding(WaveDescription):
    """The wave of a stage, and what it does to parts: circulation, and their share at still points at its end."""

    cycle: int
    stage: str
    circulation_mm_s: Statistic
    at_still_points: Statistic


@dataclass(frozen=True)
class WaveFindings:
    """One entry per stage that makes a wave."""

    waves: tuple[WaveFinding, ...]


class Circulation:
    """Whether parts run round with a quasi-travelling wave, and where they gather."""

    def applies(self, prepared: Prepared) -> bool:
        scene = prepared.scene
        if scene.scenario.schedule is None and len(scene.parts) == 1:
            return False
        different = {stage.excitations: stage for stage in scene.times.stages}
        return any(wave_of(scene, stage) is not None for stage in different.values())

    def compute(self, prepared: Prepared, seeds: Sequence[SeedRecord]) -> WaveFindings:
        counted = ended(seeds, left_plate=True)
        return WaveFindings(tuple(_finding(prepared.scene, wave, counted) for wave in stage_waves(prepared.scene)))

    def lines(self, prepared: Prepared, findings: WaveFindings) -> list[str]:
        lines = []
        for wave in findings.waves:
            speed, share = wave.circulation_mm_s, wave.at_still_points
            if speed.n:
                interval = f" +- {speed.se:.3f} (SE)" if speed.n > 1 else ""
                text = f"{speed.mean:+.3f} mm/s{interval}, counter-clockwise, n = {speed.n} seeds"
                lines.append(labelled("circulation", text))
            if share.n:
                lines.append(labelled("at still points", f"{100.0 * share.mean:.0f} % of the parts"))
        return lines


def described(wave: StageWave) -> WaveDescription:
    """The wave by itself, in numbers."""
    track = wave.track
    return WaveDescription(
        standing_share=wave.wave.standing_share,
        still_points=len(wave.still),
        track_mm=1e3 * track.length if track else None,
        amplitude_ratio=track.amplitude_ratio if track else None,
        phase_turns=track.turns if track else None,
        travelling_ratio=track.travelling_ratio if track else None,
    )


def _finding(scene: Scene, wave: StageWave, seeds: Sequence[SeedRecord]) -> WaveFinding:
    shares, speeds = [], []
    for seed in seeds:
        stage, frames = scene.stages(seed.stops.tolist())[wave.number], seed.frames
        if frames.time[-1] <= stage.stop - scene.frame_interval:
            continue  # it did not come that far
        shares.append(_share_at_still_points(scene, wave.still, frames, stage.stop))
        if wave.track is not None:
            start = stage.start + FROM * (stage.stop - stage.start)
            speeds.append(1e3 * circulation(scene, wave.track, frames, start, stage.stop))
    return WaveFinding(
        **vars(described(wave)),
        cycle=wave.stage.cycle,
        stage=wave.stage.name,
        circulation_mm_s=Statistic.of(speeds),
        at_still_points=Statistic.of(shares),
    )


def _share_at_still_points(scene: Scene, still: NDArray[np.float64], frames: Frames, time: float) -> float:
    """Share of the parts on the plate that lie near a still point at a time [s]; NaN without any."""
    from scipy.spatial import cKDTree

    row = frames.row_at(time)
    points = frames.position[row, frames[slice(row, row + 1)].on_plate(scene.surface)[0], :2]
    if not len(points) or not len(still):
        return float("nan")
    return float((cKDTree(still).query(points)[0] < AT_STILL_POINT).mean())
