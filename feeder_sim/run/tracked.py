"""Tracks of parts as a run: what a camera has seen, in the record that a simulation has.

A scenario of one part makes a seed of every track, one of several parts has them all in one seed. Only x, y and the
turn about z are seen: heights and poses of the record are those of parts that lie on the plate at rest, and measures
that need more have no value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.measures.wander import up_to_passage
from feeder_sim.records.seed import REMOVALS, Cause, Seed, Status, joined, no_events, removed
from feeder_sim.records.tracks import Camera, Track, interval_of, read_tracks
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Scenario, with_run
from feeder_sim.scenario.engine_choice import TRACKED
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene

IN_METRES = 0.005  # of the plate's half: tracks in millimetres go further
SMOOTH_S = 0.1  # over which places are averaged, against the noise of a camera
SAME_PLACE = 0.5  # of a part's length: where another track goes on, ids are swapped


def tracked(scenario: Scenario, file: Path, camera: Camera) -> tuple[Prepared, list[Seed]]:
    """What a camera has seen of the parts of a scenario: the scenario with as many seeds, and these.

    Args:
        scenario: of one part, which every track is a run of, or of as many parts as there are tracks. Without a
            schedule time begins with each track, or with the first one of several parts; with one it is its time.
        file: table of tracks; see feeder_sim.records.tracks.
        camera: how it was taken.

    Raises:
        InputError: the scenario or the table cannot be used, or tracks cannot be those of such parts.
    """
    tracks = read_tracks(file, camera)
    _check_scenario(scenario, len(tracks), file)
    interval = interval_of(tracks)
    alone = scenario.n_parts == 1
    duration = scenario.run.duration_s
    if scenario.schedule is None:
        first = min(track.time[0] for track in tracks)
        tracks = tuple(replace(track, time=track.time - (track.time[0] if alone else first)) for track in tracks)
        duration = max(float(track.time[-1]) for track in tracks)
    seeds, rate = len(tracks) if alone else 1, 1.0 / interval
    scenario = with_run(scenario, seeds=seeds, frames_per_second=rate, duration_s=duration)
    prepared = replace(prepare(scenario), engine=TRACKED)
    scene = prepared.scene
    _check_tracks(scene, tracks, file)
    together = [(track,) for track in tracks] if alone else [tracks]
    return prepared, [_up_to_passage(prepared, _seed(scene, each, interval)) for each in together]


def _up_to_passage(prepared: Prepared, seed: Seed) -> Seed:
    """A seed up to where a run of its scenario would end."""
    if prepared.scenario.run.stop != "passage" or prepared.cell is None:
        return seed
    return replace(seed, frames=up_to_passage(seed.frames, prepared.cell))


def _check_scenario(scenario: Scenario, tracks: int, file: Path) -> None:
    if scenario.n_parts not in (1, tracks):
        allowed = f"must be the {scenario.n_parts} parts of the scenario, or a scenario of one"
        raise InputError(f"has {tracks} tracks, {allowed}", file=file)
    picks = bool(scenario.schedule and scenario.schedule.picks)
    takes = {"refill": scenario.refill is not None, "schedule.stage.pick": picks, "outlet": bool(scenario.outlets)}
    for key, is_there in takes.items():
        if is_there:
            raise InputError("says who took a part away, tracks do not; must be a scenario without it", key=key)
    if any(part.guide is not None for part in scenario.part):
        raise InputError("must be a scenario without one: tracks from above have no heights", key="part.guide")


def _check_tracks(scene: Scene, tracks: Sequence[Track], file: Path) -> None:
    """Refuse what parts on the plate cannot have done."""
    longest = max(kind.longest for kind in scene.kinds)
    half = 0.5 * np.array([scene.surface.length, scene.surface.width])
    largest = max(float(np.abs(track.place / half).max()) for track in tracks)
    if largest < IN_METRES:
        place = 1e3 * max(float(np.abs(track.place).max()) for track in tracks)
        raise InputError(f"are all within {place:.3g} mm of the middle of the plate: in metres?", file=file, key="x, y")
    for track in tracks:
        key = f"part {track.part}"
        if (np.abs(track.place[0]) > half).any():
            x, y = 1e3 * track.place[0]
            size = f"{2e3 * half[0]:.4g} x {2e3 * half[1]:.4g} mm"
            begins = f"begins at ({x:.4g}, {y:.4g}) mm, must be on the plate of {size}"
            raise InputError(f"{begins}: another unit, or another origin?", file=file, key=key)
        on_plate = np.all(np.abs(track.place) <= half, axis=1)  # what falls off may be fast
        steps = np.linalg.norm(np.diff(track.place, axis=0), axis=1) * on_plate[:-1]
        for row in np.flatnonzero(steps > longest):
            moved = f"moves by {1e3 * steps[row]:.3g} mm between two frames at {track.time[row]:.6g} s"
            if (other := _goes_on(tracks, track, int(row), SAME_PLACE * longest)) is not None:
                raise InputError(f"{moved}, to where part {other} was: ids are swapped", file=file, key=key)
            allowed = f"must be at most its length, {1e3 * longest:.3g} mm"
            raise InputError(f"{moved}, {allowed}: swapped ids, or another unit?", file=file, key=key)


def _goes_on(tracks: Sequence[Track], track: Track, row: int, within: float) -> str | None:
    """The part that was where a track jumps to."""
    for other in tracks:
        if other is track:
            continue
        before = int(np.abs(other.time - track.time[row]).argmin())
        if np.linalg.norm(other.place[before] - track.place[row + 1]) <= within:
            return other.part
    return None


def _seed(scene: Scene, tracks: Sequence[Track], interval: float) -> Seed:
    """The record of parts that were seen together."""
    ticks = [np.rint(track.time / interval).astype(int) for track in tracks]
    first, last = min(each[0] for each in ticks), max(each[-1] for each in ticks)
    time = interval * np.arange(first, last + 1)
    shape = len(time), len(tracks)
    place, present = np.zeros((*shape, 3)), np.zeros(shape, bool)
    turn = np.zeros(shape)
    for k, (track, rows) in enumerate(zip(tracks, ticks, strict=True)):
        place[:, k, 0], place[:, k, 1], turn[:, k] = (
            np.interp(time, track.time, values) for values in (*track.place.T, track.angle)
        )
        place[:, k, :2] = _smooth(place[:, k, :2], max(1, round(SMOOTH_S / interval)))
        present[rows[0] - first : rows[-1] - first + 1, k] = True
    level = [_lying(scene, int(kind)) for kind in scene.kind_of]
    points = place[..., :2].reshape(-1, 2)
    resting = scene.surface.resting_height(points).reshape(shape) if scene.surface.resting is not None else 0.0
    place[..., 2] = np.array([height for height, _ in level]) + resting
    velocity: NDArray[np.float64] = np.asarray(np.gradient(place, time, axis=0))
    spin = np.zeros_like(place)
    spin[..., 2] = np.gradient(turn, time, axis=0)  # NaN where no angle was seen
    attitude = _turned(np.nan_to_num(turn), np.array([quaternion for _, quaternion in level]))
    return _without_lost(scene, Frames(time, place, attitude, velocity, spin, present).as_stored())


def _without_lost(scene: Scene, frames: Frames) -> Seed:
    """A seed in which parts are lost where their tracks leave the plate."""
    left = frames.present & ~scene.on_plate(frames)
    lost = np.flatnonzero(left.any(axis=0))
    rows = left[:, lost].argmax(axis=0)
    for part, row in zip(lost, rows, strict=True):
        frames.present[row + 1 :, part] = False
    order = np.argsort(rows, kind="stable")
    leaving = (removed(lost[k : k + 1], frames.time[rows[k]], Cause.LOST) for k in order)
    removals = joined([no_events(REMOVALS), *leaving])
    status = Status.LEFT_PLATE if len(lost) == frames.present.shape[1] else Status.DONE
    return Seed(frames, removals=removals, status=status)


def _smooth(place: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    """Running means over an odd number of frames, of as many as there are at the ends, (n, 2)."""
    half = frames // 2
    if half == 0:
        return place
    total = np.concatenate([np.zeros((1, 2)), np.cumsum(place, axis=0)])
    rows = np.arange(len(place))
    reach = np.minimum(half, np.minimum(rows, rows[::-1]))
    return np.asarray((total[rows + reach + 1] - total[rows - reach]) / (2 * reach + 1)[:, None])


def _lying(scene: Scene, kind: int) -> tuple[float, NDArray[np.float64]]:
    """Height of the centre [m] and attitude of a part in its likeliest pose."""
    poses = scene.poses[kind].poses
    if poses:
        return poses[0].height, poses[0].attitude[0]
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    return -scene.kinds[kind].lowest(upright), upright


def _turned(angle: NDArray[np.float64], level: NDArray[np.float64]) -> NDArray[np.float64]:
    """Attitudes (n, parts, 4) of parts that lie as `level` (parts, 4) and are turned by angles (n, parts) about z."""
    from scipy.spatial.transform import Rotation

    parts = []
    for turn, attitude in zip(angle.T, level, strict=True):
        about_z = Rotation.from_rotvec(np.outer(turn, [0.0, 0.0, 1.0]))
        parts.append((about_z * Rotation.from_quat(attitude, scalar_first=True)).as_quat(scalar_first=True))
    return np.stack(parts, axis=1)
