"""What a quasi-travelling wave does to parts: whether they run round with it, and where they gather.

*Circulation*: mean speed, along the crest's track and counter-clockwise, of the parts within `ON_TRACK` of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures import Statistic
from feeder_sim.scene import Scene
from feeder_sim.timetable import TimedStage, timetable
from feeder_sim.trajectory import Frames, Record
from feeder_sim.wave import Track, Wave, crest_track, still_points, wave_of

ON_TRACK = 10e-3  # [m]
AT_STILL_POINT = 8e-3  # [m]
FROM = 0.25  # of the stage: when its circulation begins to count, the ring-up and the drop of the parts behind it
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


def _analysed(number: int, stage: TimedStage, wave: Wave) -> StageWave:
    still = still_points(wave)
    if not 0 < len(still) < MANY:
        return StageWave(number, stage, wave, np.empty((0, 2)), None)
    try:
        track = crest_track(wave, still[np.linalg.norm(still, axis=1).argmin()])
    except ValueError:
        track = None
    return StageWave(number, stage, wave, still, track)


def circulation(track: Track, frames: Frames, start: float, stop: float) -> float:
    """Mean speed [m/s] of the parts near a track between two times [s]; NaN where there are none."""
    from scipy.spatial import cKDTree

    rows = np.flatnonzero((frames.time >= start) & (frames.time <= stop))
    if len(rows) < 2:
        return float("nan")
    before, after = frames.position[rows[:-1]], frames.position[rows[1:]]
    off, nearest = cKDTree(track.points).query(before[..., :2].reshape(-1, 2))
    counted = (off.reshape(before.shape[:2]) < ON_TRACK) & frames.present[rows[1:]] & (after[..., 2] > 0.0)
    along = ((after - before)[..., :2] * track.tangent[nearest].reshape(*before.shape[:2], 2)).sum(axis=-1)
    speed = along / np.diff(frames.time[rows])[:, None]
    return float(speed[counted].mean()) if counted.any() else float("nan")


def wave_measures(scene: Scene, waves: Sequence[StageWave], seeds: Sequence[Record]) -> dict[str, Any]:
    """Of every wave its own numbers, the circulation, and the share of the parts at still points at the stage's end."""
    timed = [(timetable(scene.scenario, seed.stops.tolist()).stages, seed.frames) for seed in seeds if len(seed.frames)]
    found = []
    for wave in waves:
        at = [(stages[wave.number], frames) for stages, frames in timed]
        reached = [(stage, frames) for stage, frames in at if frames.time[-1] > stage.stop - scene.frame_interval]
        found.append(_measured(wave, reached))
    return {"waves": found}


def described(wave: StageWave) -> dict[str, Any]:
    """The wave by itself, in numbers."""
    track = wave.track
    return {
        "standing_share": wave.wave.standing_share,
        "still_points": len(wave.still),
        "track_mm": 1e3 * track.length if track else None,
        "amplitude_ratio": track.amplitude_ratio if track else None,
        "phase_turns": track.turns if track else None,
        "travelling_ratio": track.travelling_ratio if track else None,
    }


def _measured(wave: StageWave, seeds: Sequence[tuple[TimedStage, Frames]]) -> dict[str, Any]:
    shares = [_at_still_points(wave.still, frames, stage.stop) for stage, frames in seeds]
    speeds = []
    for stage, frames in seeds if wave.track else ():
        assert wave.track is not None
        start = stage.start + FROM * (stage.stop - stage.start)
        speeds.append(1e3 * circulation(wave.track, frames, start, stage.stop))
    return {
        "cycle": wave.stage.cycle,
        "stage": wave.stage.name,
        **described(wave),
        "circulation_mm_s": Statistic.of(speeds).as_dict(),
        "at_still_points": Statistic.of(shares).as_dict(),
    }


def _at_still_points(still: NDArray[np.float64], frames: Frames, time: float) -> float:
    """Share of the parts on the plate that lie near a still point at a time [s]."""
    from scipy.spatial import cKDTree

    row = min(int(np.searchsorted(frames.time, time - 1e-9)), len(frames) - 1)
    points = frames.position[row][frames.present[row] & (frames.position[row, :, 2] > 0.0)][:, :2]
    if not len(points) or not len(still):
        return float("nan")
    return float((cKDTree(still).query(points)[0] < AT_STILL_POINT).mean())
