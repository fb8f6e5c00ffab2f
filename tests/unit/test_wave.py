"""Waves of two modes: still points, crest track and travelling ratio; circulation on motion made by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, ready, resting

from feeder_sim.measures.circulation import Circulation, StageWave, circulation, stage_waves
from feeder_sim.plate.wave import Track
from feeder_sim.records.seed import Seed, Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import load_scenario
from feeder_sim.scene.scene import Scene, build_scene

GATHER = REPOSITORY / "scenarios/wave_gather.toml"
SPLIT = REPOSITORY / "scenarios/wave_split.toml"


def wave(phase_deg: float, path: Path = GATHER) -> StageWave:
    (found,) = stage_waves(build_scene(load_scenario(path).changed({"stage[0].drive[1].phase_deg": phase_deg})))
    return found


@pytest.fixture(scope="module")
def quarter() -> StageWave:
    return wave(90.0)


@pytest.fixture(scope="module")
def gather() -> Scene:
    return build_scene(load_scenario(GATHER))


def track_of(of: StageWave) -> Track:
    assert of.track is not None
    return of.track


def test_nine_points_stay_still(quarter: StageWave) -> None:
    assert len(quarter.still) == 9
    assert np.linalg.norm(quarter.still, axis=1).min() < 1e-6  # the middle
    # The plate and the pair are the same after a quarter turn.
    for point in quarter.still @ np.array([[0.0, 1.0], [-1.0, 0.0]]):
        assert np.linalg.norm(quarter.still - point, axis=1).min() < 1e-5
    assert np.abs(quarter.wave.at(quarter.still)).max() < 1e-3 * np.abs(quarter.wave.amplitude).max()


def test_crest_runs_round_once_with_little_change_of_amplitude(quarter: StageWave) -> None:
    track = track_of(quarter)
    assert track.amplitude_ratio < 2.0
    assert np.ptp(track.phase_deg) == pytest.approx(360.0, abs=1e-6)
    assert (np.diff(track.phase_deg) < 0.0).all()  # the crest never turns back
    assert track.turns == -1 and track.travelling_ratio > 0.6
    assert quarter.wave.standing_share < 1e-6


def test_the_crest_is_the_first_one_out_from_the_middle(quarter: StageWave) -> None:
    track = track_of(quarter)
    for point in track.points[::45]:
        way = np.linspace(0.0, 1.0, 400)[:, None] * point
        size = np.abs(quarter.wave.at(way))
        assert (np.diff(size) > -1e-5 * size[-1]).all()
        assert np.abs(quarter.wave.at((1.02 * point)[None]))[0] < size[-1] * (1.0 + 1e-4)


def test_the_sense_follows_the_phase(quarter: StageWave) -> None:
    other = track_of(wave(-90.0))
    assert other.turns == 1
    assert other.travelling_ratio == pytest.approx(-track_of(quarter).travelling_ratio, abs=1e-9)
    assert other.points == pytest.approx(track_of(quarter).points, abs=1e-9)
    ratios = [track_of(wave(phase)).travelling_ratio for phase in (30.0, 60.0, 90.0)]
    assert 0.1 < ratios[0] < ratios[1] < ratios[2]


def test_modes_in_phase_stand() -> None:
    standing = wave(0.0)
    assert standing.wave.standing_share == pytest.approx(1.0)
    assert standing.track is None and len(standing.still) == 0
    done = feeder_sim("wave", REPOSITORY / "scenarios/separation_100.toml")
    check_refused(done, "no stage drives several modes at one frequency")


def test_split_resonances_need_another_phase_between_their_drives(quarter: StageWave) -> None:
    assert track_of(wave(-26.0, SPLIT)).amplitude_ratio == pytest.approx(track_of(quarter).amplitude_ratio, rel=0.02)
    assert wave(-26.0, SPLIT).wave.standing_share < 0.02
    assert wave(90.0, SPLIT).wave.standing_share > 0.85


def running_round(track: Track, speed: float, offset: float) -> Frames:
    """One part on a circle about the middle, counter-clockwise at a speed [m/s], and one that rests there."""
    time = np.arange(0.0, 2.0, 0.01)
    radius = float(np.linalg.norm(track.points, axis=1).mean()) + offset
    angle = speed / radius * time
    position = np.zeros((len(time), 2, 3))
    position[:, 0, :2] = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    position[..., 2] = 1e-3
    return resting(time, position)


def record(frames: Frames, *stops: float) -> Seed:
    return Seed(frames, stops=np.array(stops), status=Status.DONE)


@pytest.mark.parametrize("speed", [0.02, -0.2])
def test_circulation_is_the_speed_along_the_track(gather: Scene, quarter: StageWave, speed: float) -> None:
    track = track_of(quarter)
    found = circulation(gather, track, running_round(track, speed, 0.0), 0.0, 2.0)
    # The track is no circle: what runs round one is slower along it.
    assert 0.8 < found / speed < 1.0
    assert math.isnan(circulation(gather, track, running_round(track, speed, 0.03), 0.0, 2.0))
    assert math.isnan(circulation(gather, track, running_round(track, speed, 0.0), 5.0, 6.0))


def test_parts_at_still_points_are_counted(gather: Scene, quarter: StageWave) -> None:
    position = np.zeros((801, 4, 3))
    position[:, :2, :2] = quarter.still[:2] + np.array([0.0, 5e-3])
    position[:, 2, :2] = quarter.still[0] + np.array([9e-3, 0.0])
    position[:, 3, 2] = -0.03  # fallen past the edge
    position[:, :3, 2] = 1e-3
    (found,) = Circulation().compute(ready(gather), [record(resting(np.linspace(0.0, 24.0, 801), position))]).waves
    assert found.at_still_points.mean == pytest.approx(2.0 / 3.0)
    assert found.still_points == 9


def test_waves_are_measured_when_they_really_acted(quarter: StageWave) -> None:
    """A stage before the wave may end early; the wave then comes early in this seed."""
    raw = load_scenario(GATHER).model_dump(exclude_none=True)
    wave_stage = raw["schedule"]["stage"][0] | {"duration_s": 4.0}
    first = {"drive": [wave_stage["drive"][0]], "duration_s": 60.0, "until": {"within_mm": 1.0, "for_s": 0.5}}
    schedule = {"cycles": 2, "prepare": [first], "stage": [wave_stage]}
    scene = build_scene(load_scenario(GATHER).changed({"schedule": schedule}))
    waves = stage_waves(scene)
    assert [wave.number for wave in waves] == [1, 2] and waves[0].track is waves[1].track
    track, speed = track_of(quarter), 0.02
    frames = running_round(track, speed, 0.0)
    frames = resting(frames.time * 7.5, frames.position)  # 15 s, of which the waves have 5 to 9 and 9 to 13
    prepared = ready(scene)
    found = Circulation().compute(prepared, [record(frames, 5.0)]).waves
    assert [wave.cycle for wave in found] == [1, 2]
    for wave in found:
        assert 0.7 < wave.circulation_mm_s.mean / (1e3 * speed / 7.5) < 1.05
    late = Circulation().compute(prepared, [record(frames)]).waves
    assert late[0].circulation_mm_s.n == 0
