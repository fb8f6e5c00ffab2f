"""Tracks of a camera: read as a run, with its measures; what is wrong with a table is one line."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, refusal
from numpy.typing import NDArray

import feeder_sim as fs
from feeder_sim.measures.wander import headings, wander
from feeder_sim.records.seed import Seed, Status
from feeder_sim.records.tracks import Camera, read_tracks
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.tracked import tracked

SCENARIO = REPOSITORY / "scenarios/drift_8775hz.toml"
RATE, NOISE_MM = 30.0, 0.1
HEAD = "t_s,part,x_mm,y_mm\n"


def table(path: Path, seeds: list[Seed], noise_mm: float = 0.0) -> Path:
    """The first part of seeds as a camera sees it, frame by frame."""
    rng = np.random.default_rng(0)
    rows = []
    for number, seed in enumerate(seeds, 1):
        angle = np.degrees(headings(seed.frames.quaternion)[:, 0])
        place = 1e3 * seed.frames.position[:, 0, :2] + noise_mm * rng.normal(size=(len(angle), 2))
        rows += [(t, number, *xy, a) for t, xy, a in zip(seed.frames.time.tolist(), place.tolist(), angle, strict=True)]
    rows.sort()  # by time, as a camera sees them; paths cross
    lines = [f"{t:.6f},{number},{x:.4f},{y:.4f},{angle:.3f}" for t, number, x, y, angle in rows]
    path.write_text("\n".join(["t_s,part,x_mm,y_mm,angle_deg", *lines]) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def simulated() -> fs.Result:
    return fs.simulate(fs.load_scenario(SCENARIO).changed({"run.seeds": 4, "run.frames_per_second": RATE}))


def test_tracks_of_a_run_measure_what_the_run_does(simulated: fs.Result, tmp_path: Path) -> None:
    file = table(tmp_path / "tracks.csv", list(simulated.seeds))
    seen = fs.record_tracks(simulated.scenario, file, tmp_path / "run")
    assert seen.drift.transport_speed_mm_s.mean == pytest.approx(simulated.drift.transport_speed_mm_s.mean, rel=1e-3)
    assert seen.wander.wander_mm.mean == pytest.approx(simulated.wander.wander_mm.mean, rel=2e-3)
    assert seen.wander.turning_deg.mean == pytest.approx(simulated.wander.turning_deg.mean, rel=2e-2)
    assert seen.drift.highest_rise_mm.n == 0  # a camera from above sees none


def test_noise_of_a_camera_hardly_counts(simulated: fs.Result, tmp_path: Path) -> None:
    file = table(tmp_path / "tracks.csv", list(simulated.seeds), NOISE_MM)
    seen = fs.record_tracks(simulated.scenario, file, tmp_path / "run")
    assert seen.drift.transport_speed_mm_s.mean == pytest.approx(simulated.drift.transport_speed_mm_s.mean, rel=0.05)
    assert seen.wander.wander_mm.mean == pytest.approx(simulated.wander.wander_mm.mean, rel=0.05)


def test_commands_take_tracks_as_a_run(simulated: fs.Result, tmp_path: Path) -> None:
    file = table(tmp_path / "tracks.csv", list(simulated.seeds), NOISE_MM)
    seen, computed = tmp_path / "seen", tmp_path / "computed"
    facts = json.loads(feeder_sim("tracks", SCENARIO, file, "--out", seen, "--json").stdout)
    assert facts["engine"] == "tracks" and facts["seeds"] == 4
    feeder_sim("run", SCENARIO, "--seeds", 4, "--out", computed)
    comparison = json.loads(feeder_sim("compare", computed, seen, "--json").stdout)
    assert comparison["method"] == "Welch"  # the same numbers of seeds are other runs
    assert "highest_rise_mm" in comparison["only_first"]
    row = next(row for row in comparison["measures"] if row["name"] == "transport_speed_mm_s")
    assert row["low"] < 0.0 < row["high"]
    feeder_sim("report", seen, "--out", tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "seen by a camera" in page and "feeder-sim run" not in page
    assert "nothing to resume" in feeder_sim("resume", seen, "--seeds", 9).stderr


def test_other_programs_name_columns_otherwise(tmp_path: Path) -> None:
    ours, trackpy, script = (tmp_path / name for name in ("ours.csv", "trackpy.csv", "script.csv"))
    ours.write_text("t_s,part,x_mm,y_mm,angle_deg\n0,1,1,2,0\n0.1,1,1.5,2.5,90\n", encoding="utf-8")
    trackpy.write_text(",y,x,mass,frame,particle\n0,480,520,9,0,1\n1,470,530,9,1,1\n", encoding="utf-8")
    script.write_text("t_ms;id\n", encoding="utf-8")
    place = 1e-3 * np.array([[1.0, 2.0], [1.5, 2.5]])
    (track,) = read_tracks(ours)
    assert track.place == pytest.approx(place) and track.angle == pytest.approx([0.0, math.pi / 2])
    (track,) = read_tracks(trackpy, Camera(fps=10.0, mm_per_pixel=0.05, origin_px=(500.0, 520.0)))
    assert track.time == pytest.approx([0.0, 0.1])
    assert track.place == pytest.approx(place) and np.isnan(track.angle).all()  # y of an image points down
    assert "semicolons" in refusal(read_tracks, script)


def lines(path: list[tuple[float, float, float]], part: int = 1) -> str:
    return "".join(f"{t:.4f},{part},{x},{y}\n" for t, x, y in path)


STEADY = [(i / RATE, 1.0 + 0.1 * i, 0.0) for i in range(30)]
AWAY = [(i / RATE, 12.0 - 0.1 * i, 5.0) for i in range(30)]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("t_s,part,x_mm\n0,1,1\n", "y: is missing"),
        ("t_s,part,x_mm,y_m\n0,1,1,1\n", "another unit than x_mm"),
        ("part,x_mm,y_mm\n1,1,1\n", "time: is missing"),
        ("frame,part,x_mm,y_mm\n0,1,1,1\n", "fps: is needed"),
        ("t,id,x,y\n0,1,1,1\n", "mm_per_pixel: is needed"),
        (HEAD, "has no rows"),
        (HEAD + "0,1,1,1\n", "has one row, on line 2"),
        (HEAD + "0,1,1,1\n0.1,1,one,1\n", "line 3: is 'one', must be a number"),
        (HEAD + "0,1,1,1\n0.1,1,1\n", "line 3: has 3 values, must be 4"),
        (HEAD + lines(STEADY) + "0.5,1,9,9\n", "time goes back on line 32"),
        (HEAD + lines([STEADY[0], *STEADY]), "time is there twice on line 3"),
        (HEAD + lines(STEADY[:10] + STEADY[15:]), "has a gap of 0.2 s after 0.3 s, must be none longer than"),
        (HEAD + lines([(t, 1e3 * x, y) for t, x, y in STEADY]), "must be on the plate of"),
        (HEAD + lines([(t, 1e-3 * x, y) for t, x, y in STEADY]), "in metres?"),
        (HEAD + lines(STEADY[:15] + AWAY[15:]), "moves by"),
        (
            HEAD + lines(STEADY[:15] + AWAY[15:], 1) + lines(AWAY[:15] + STEADY[15:], 2),
            "part 1: moves by 9.52 mm between two frames at 0.4667 s, to where part 2 was: ids are swapped",
        ),
    ],
)
def test_what_is_wrong_with_a_table_is_one_line(text: str, problem: str, tmp_path: Path) -> None:
    file = tmp_path / "tracks.csv"
    file.write_text(text, encoding="utf-8")
    assert problem in refusal(tracked, fs.load_scenario(SCENARIO), file, Camera())


def test_gaps_that_are_allowed_are_straight_lines(tmp_path: Path) -> None:
    file = tmp_path / "tracks.csv"
    file.write_text(HEAD + lines(STEADY[:10] + STEADY[13:]), encoding="utf-8")
    (track,) = read_tracks(file, Camera(longest_gap_s=0.2))
    assert track.time == pytest.approx([t for t, _, _ in STEADY], abs=1e-4)
    assert 1e3 * track.place == pytest.approx(np.array(STEADY)[:, 1:])


@pytest.mark.parametrize(
    ("scenario", "tracks", "problem"),
    [
        ("separation_100", 2, "has 2 tracks, must be the 100 parts of the scenario"),
        ("ball_50hz", 1, "part.guide: must be a scenario without one"),
    ],
)
def test_scenarios_that_no_tracks_are_of_are_refused(scenario: str, tracks: int, problem: str, tmp_path: Path) -> None:
    file = tmp_path / "tracks.csv"
    file.write_text(HEAD + "".join(lines(STEADY, part) for part in range(tracks)), encoding="utf-8")
    loaded = fs.load_scenario(REPOSITORY / f"scenarios/{scenario}.toml")
    assert problem in refusal(tracked, loaded, file, Camera())


def test_many_parts_are_one_seed_and_come_and_go(tmp_path: Path) -> None:
    scattered = {"kind": "scattered", "size_mm": [40.0, 40.0]}
    few = fs.load_scenario(SCENARIO).changed({"part[0].count": 2, "part[0].start": scattered, "run.stop": "time"})
    file = tmp_path / "tracks.csv"
    file.write_text(HEAD + lines(STEADY, 1) + lines(AWAY[10:20], 2), encoding="utf-8")
    prepared, (seed,) = tracked(few, file, Camera())
    assert prepared.is_tracked and seed.status == Status.DONE
    assert seed.frames.present.sum(axis=0).tolist() == [30, 10]
    assert seed.frames.velocity[5, 0] == pytest.approx([3e-3, 0.0, 0.0], abs=1e-5)
    assert 1e3 * seed.frames.position[:, 0, 2].max() == pytest.approx(1.0, abs=0.5)  # lies on the plate


def test_a_track_that_leaves_the_plate_is_of_a_part_that_is_lost(tmp_path: Path) -> None:
    file = tmp_path / "tracks.csv"
    away = [(i / RATE, 1.0, 20.0 + i) for i in range(30)]  # the plate ends at 30 mm
    file.write_text(HEAD + lines(STEADY, 1) + lines(away, 2), encoding="utf-8")
    prepared, (stays, leaves) = tracked(fs.load_scenario(SCENARIO), file, Camera())
    assert (stays.status, leaves.status) == (Status.DONE, Status.LEFT_PLATE)
    assert leaves.frames.present[:, 0].sum() == 12 and leaves.removals.time == pytest.approx([11 / RATE], abs=1e-3)
    assert prepared.scenario.run.seeds == 2 and len(stays.removals) == 0


def straight(place: NDArray[np.float64], turn: NDArray[np.float64]) -> Frames:
    """Frames of one part at places (n, 2) that turns about z."""
    n = len(place)
    attitude = np.zeros((n, 1, 4))
    attitude[:, 0, 0], attitude[:, 0, 3] = np.cos(0.5 * turn), np.sin(0.5 * turn)
    position = np.zeros((n, 1, 3))
    position[:, 0, :2] = place
    none = np.zeros((n, 1, 3))
    return Frames(np.arange(n) / 100.0, position, attitude, none, none, np.ones((n, 1), bool))


def test_wander_is_what_is_left_of_the_steady_motion() -> None:
    time = np.arange(2000) / 100.0
    steady = np.column_stack([time, 0.0 * time])
    displacement, turn = wander(straight(steady, 8.0 * time))
    assert displacement == pytest.approx(0.0, abs=1e-9) and turn == pytest.approx(4.0)  # 8 rad/s, half a second
    steps = 1e-3 * np.random.default_rng(0).normal(size=(200_000, 2))
    walk = np.cumsum(steps, axis=0) + 5e-3 * np.arange(200_000)[:, None]
    displacement, _ = wander(straight(walk, np.zeros(200_000)))
    # Steps with standard deviation s per direction: 2 s^2 for each of the 50 between the middles of two blocks.
    assert displacement == pytest.approx(1e-3 * math.sqrt(2.0 * 50.0), rel=0.03)
    assert all(math.isnan(value) for value in wander(straight(walk[:50], np.zeros(50))))


def test_calibration_takes_tracks(simulated: fs.Result, tmp_path: Path) -> None:
    pytest.importorskip("sklearn")
    table(tmp_path / "tracks.csv", list(simulated.seeds), NOISE_MM)
    file = tmp_path / "mine.toml"
    text = f"""
points = 16
seeds = 2
[[experiment]]
scenario = "{SCENARIO}"
tracks = "tracks.csv"
[prior]
contact.restitution = {{ uniform = [0.1, 0.4], also = ["contact.part_restitution"] }}
contact.friction = {{ uniform = [0.1, 0.6] }}
"""
    file.write_text(text, encoding="utf-8")
    facts = json.loads(feeder_sim("calibrate", file, "--out", tmp_path / "out", "--json").stdout)
    measures = [row["measure"] for row in facts["experiments"]]
    assert measures == ["transport_speed_mm_s", "wander_mm", "turning_deg"]
    assert facts["posterior"]["contact.restitution"]["left_of_prior"] < 1.0
    file.write_text(text.replace('"tracks.csv"', '"no.csv"'), encoding="utf-8")
    check_refused(feeder_sim("calibrate", file, "--out", tmp_path / "other"), "no.csv: cannot be read")
    file.write_text(text.replace("tracks =", "measure = 'speed'\ntracks ="), encoding="utf-8")
    check_refused(feeder_sim("calibrate", file, "--out", tmp_path / "other"), "is 'speed'")
