"""Effects of a quasi-travelling wave on parts: circulation along the track of its crest, gathering at still points.

*Circulation*: mean speed of the parts within `ON_TRACK` of the crest's track, along it, counter-clockwise positive.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.protocol import FindingsBase, Measure, labelled
from feeder_sim.measures.stage_lines import once_for_scene
from feeder_sim.measures.statistic import Statistic
from feeder_sim.notebook import counted
from feeder_sim.plate.wave import Track, Wave, crest_track, still_points
from feeder_sim.records.seed import Seed, Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.timetable import TimedStage

ON_TRACK = 10e-3  # [m]; largest distance from the track of the parts that count
AT_STILL_POINT = 8e-3  # [m]; largest distance of a part that counts as gathered at a still point
COUNTED_FROM = 0.25  # of the stage; before that the plate rings up and the parts may still fall
LEAST_AMPLITUDE = 1e-3  # of the largest modal amplitude; a mode below it has no part in the wave
MOST_STILL_POINTS = 1000  # with more, the real and imaginary part vanish along common lines: a standing wave


@dataclass(frozen=True)
class StageWave:
    """The wave of one stage.

    Attributes:
        number: of the stage, over the whole timetable.
        stage: its times, if no stage before it ends early.
        wave: at the end of the stage.
        still: still points, shape (n, 2) [m]; empty for a standing wave, which has nodal lines instead.
        track: of the crest around the still point nearest to the centre; None if no crest surrounds it.
    """

    number: int
    stage: TimedStage
    wave: Wave
    still: NDArray[np.float64]
    track: Track | None


@once_for_scene
def stage_waves(scene: Scene) -> list[StageWave]:
    """The waves of all stages that drive several modes at one frequency, in all cycles."""
    waves: list[StageWave] = []
    by_excitations: dict[tuple[int, ...], StageWave] = {}
    for number, stage in enumerate(scene.times.stages):
        wave = None if stage.excitations in by_excitations else wave_of(scene, stage)
        if wave is not None:
            by_excitations[stage.excitations] = _analysed(number, stage, wave)
        if stage.excitations in by_excitations:
            waves.append(replace(by_excitations[stage.excitations], number=number, stage=stage))
    return waves


def wave_of(scene: Scene, stage: TimedStage) -> Wave | None:
    """The wave at the end of a stage; None unless the stage drives several modes, all at one frequency."""
    drives = [scene.drives[i] for i in stage.excitations]
    if len({drive.shape for drive in drives}) < 2 or len({drive.drive_frequency for drive in drives}) > 1:
        return None
    omega = 2.0 * math.pi * drives[0].drive_frequency
    just_before = stage.stop - 1e-9 / drives[0].drive_frequency
    amplitude = scene.surface.terms.phasor(just_before, scene.surface.n_shapes)[0]
    amplitude = np.where([j in {drive.shape for drive in drives} for j in range(len(amplitude))], amplitude, 0.0)
    if (np.abs(amplitude) > LEAST_AMPLITUDE * np.abs(amplitude).max()).sum() < 2:
        return None
    return Wave(scene.surface, amplitude * np.exp(-1j * omega * (just_before - stage.start)))


def _analysed(number: int, stage: TimedStage, wave: Wave) -> StageWave:
    """A wave with its still points and the track of its crest."""
    still = still_points(wave)
    if not 0 < len(still) < MOST_STILL_POINTS:
        return StageWave(number, stage, wave, np.empty((0, 2)), None)
    try:
        track = crest_track(wave, still[np.linalg.norm(still, axis=1).argmin()])
    except ValueError:
        track = None
    return StageWave(number, stage, wave, still, track)


def circulation(scene: Scene, track: Track, frames: Frames, start: float, stop: float) -> float:
    """Mean speed [m/s] of the parts near a track between two times [s], counter-clockwise; NaN without such parts."""
    from scipy.spatial import cKDTree

    rows = np.flatnonzero((frames.time >= start) & (frames.time <= stop))
    if len(rows) < 2:
        return float("nan")
    before, after = frames.position[rows[:-1]], frames.position[rows[1:]]
    distance, nearest = cKDTree(track.points).query(before[..., :2].reshape(-1, 2))
    on_plate = scene.on_plate(frames)[rows[1:]]
    is_on_track = (distance.reshape(before.shape[:2]) < ON_TRACK) & on_plate
    along = ((after - before)[..., :2] * track.tangent[nearest].reshape(*before.shape[:2], 2)).sum(axis=-1)
    speed = along / np.diff(frames.time[rows])[:, None]
    return float(speed[is_on_track].mean()) if is_on_track.any() else float("nan")


@dataclass(frozen=True, repr=False)
class WaveDescription(FindingsBase):
    """A wave without parts, in numbers; what belongs to the track is None where there is none.

    Attributes:
        standing_share: 1 for a standing wave, 0 for a travelling one.
        still_points: their number.
        track_mm: length of the track.
        amplitude_ratio: largest over smallest amplitude along the track.
        phase_turns: change of the phase once around the track [360 degrees].
        travelling_ratio: 1 counter-clockwise, -1 clockwise, 0 standing; see `Track.travelling_ratio`.
    """

    standing_share: float
    still_points: int
    track_mm: float | None
    amplitude_ratio: float | None
    phase_turns: int | None
    travelling_ratio: float | None


@dataclass(frozen=True, repr=False)
class WaveFinding(WaveDescription):
    """The wave of a stage and its effect on parts.

    Attributes:
        cycle, stage: number of the cycle and name of the stage.
        circulation_mm_s: over the seeds with parts near the track.
        at_still_points: share of the parts at still points at the end of the stage.
    """

    cycle: int
    stage: str
    circulation_mm_s: Statistic
    at_still_points: Statistic


@dataclass(frozen=True, repr=False)
class WaveFindings(FindingsBase):
    """One entry per stage that makes a wave."""

    waves: tuple[WaveFinding, ...]


@dataclass(frozen=True)
class OnWave:
    """The parts of one seed on one wave: share at its still points [1], circulation [mm/s]; NaN without any."""

    at_still_points: float
    circulation: float


SeedWaves = tuple[OnWave | None, ...]  # what is read of a seed: for each wave, None if it ended before the stage


class Circulation(Measure[WaveFindings, SeedWaves]):
    """Circulation of parts with a quasi-travelling wave, and their share at its still points."""

    headline = ("circulation_mm_s",)

    counts = (Status.DONE, Status.LEFT_PLATE)

    def applies(self, prepared: Prepared) -> bool:
        scene = prepared.scene
        if scene.scenario.schedule is None and len(scene.parts) == 1:
            return False
        stages = {stage.excitations: stage for stage in scene.times.stages}  # each set of excitations once
        return any(wave_of(scene, stage) is not None for stage in stages.values())

    def reader(self, prepared: Prepared) -> Callable[[Seed], SeedWaves]:
        waves = stage_waves(prepared.scene)
        return lambda seed: tuple(_on_wave(prepared.scene, wave, seed) for wave in waves)

    def findings(self, prepared: Prepared, readings: Sequence[SeedWaves]) -> WaveFindings:
        waves = stage_waves(prepared.scene)
        return WaveFindings(tuple(_finding(wave, [seed[k] for seed in readings]) for k, wave in enumerate(waves)))

    def without_value(self, prepared: Prepared, findings: WaveFindings) -> dict[str, str]:
        reason = "no part was on the track of the wave"
        return {
            f"waves[{k}].circulation_mm_s": reason
            for k, wave in enumerate(findings.waves)
            if wave.track_mm is not None and not wave.circulation_mm_s.n
        }

    def lines(self, prepared: Prepared, findings: WaveFindings) -> list[str]:
        lines = []
        for wave in findings.waves:
            speed, share = wave.circulation_mm_s, wave.at_still_points
            if speed.n:
                interval = f" +- {speed.se:.3f} (SE)" if speed.n > 1 else ""
                text = f"{speed.mean:+.3f} mm/s{interval}, counter-clockwise, n = {counted(speed.n, 'seed')}"
                lines.append(labelled("circulation", text))
            if share.n:
                lines.append(labelled("at still points", f"{100.0 * share.mean:.0f} % of the parts"))
        return lines


def describe(wave: StageWave) -> WaveDescription:
    """The wave of a stage without parts, in numbers."""
    track = wave.track
    return WaveDescription(
        standing_share=wave.wave.standing_share,
        still_points=len(wave.still),
        track_mm=1e3 * track.length if track else None,
        amplitude_ratio=track.amplitude_ratio if track else None,
        phase_turns=track.turns if track else None,
        travelling_ratio=track.travelling_ratio if track else None,
    )


def _on_wave(scene: Scene, wave: StageWave, seed: Seed) -> OnWave | None:
    """The parts of one seed on the wave of a stage; None if the seed ended before the stage."""
    stage, frames = scene.stages(seed.stops.tolist())[wave.number], seed.frames
    if frames.time[-1] <= stage.stop - scene.frame_interval:
        return None
    share, speed = _share_at_still_points(scene, wave.still, frames, stage.stop), math.nan
    if wave.track is not None:
        start = stage.start + COUNTED_FROM * (stage.stop - stage.start)
        speed = 1e3 * circulation(scene, wave.track, frames, start, stage.stop)
    return OnWave(share, speed)


def _finding(wave: StageWave, seeds: Sequence[OnWave | None]) -> WaveFinding:
    """The wave of a stage and its effect on the parts, over the seeds that reached the end of the stage."""
    return WaveFinding(
        **vars(describe(wave)),
        cycle=wave.stage.cycle,
        stage=wave.stage.name,
        circulation_mm_s=Statistic.of(seed.circulation for seed in seeds if seed is not None),
        at_still_points=Statistic.of(seed.at_still_points for seed in seeds if seed is not None),
    )


def _share_at_still_points(scene: Scene, still: NDArray[np.float64], frames: Frames, time: float) -> float:
    """Share of the parts on the plate that are near a still point at a time [s]; NaN without parts or still points."""
    from scipy.spatial import cKDTree

    row = frames.row_at(time)
    points = frames.position[row, scene.on_plate(frames[slice(row, row + 1)])[0], :2]
    if not len(points) or not len(still):
        return float("nan")
    return float((cKDTree(still).query(points)[0] < AT_STILL_POINT).mean())
