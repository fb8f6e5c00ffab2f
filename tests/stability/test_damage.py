"""Runs that were killed, exchanged or out of date, carried on with or refused in one line."""

from __future__ import annotations

import errno
import json
import os
import random
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command_line import check_refused, feeder_sim, in_new_process, limited
from conftest import REPOSITORY, StopsAfter, ball_on_slide

import feeder_sim.cli.main as command_line
from feeder_sim.errors import InputError, RecordingFailed
from feeder_sim.part.stable_poses import PoseTable
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.plate.mode_file import ModeFile, read_mode_file, write_mode_file
from feeder_sim.pool.work import Work
from feeder_sim.records.files import LOCK, RUN, SCENE, SEEDS
from feeder_sim.records.recording import PartRecord, PlateRecord, Recording
from feeder_sim.records.seed import Seed, Status, impacts_of
from feeder_sim.records.trajectory import FRAME_FIELDS, Frames
from feeder_sim.records.trajectory_file import export_recording, no_seed, read_recording, write_seed_file
from feeder_sim.replay.replay import REPLAY, build_replay, timeline_ends
from feeder_sim.replay.viewer import displayed_time, replay_file
from feeder_sim.run import provenance, run_folder
from feeder_sim.run.provenance import library_versions
from feeder_sim.run.run_folder import SUMMARY, record_run, resume_run, scenario_toml
from feeder_sim.scenario import Scenario

BLOCK = 130  # frames
# Reads every recording in a folder; a reader that waits is seen by the test's time limit.
READ_ALL = """
import json, sys
from pathlib import Path
from feeder_sim.errors import InputError
from feeder_sim.records.trajectory_file import read_recording
for path in sorted(Path(sys.argv[1]).iterdir()):
    try:
        seeds = read_recording(path).records
        found = repr([(len(r.frames), len(r.impacts), r.frames.position.sum(), r.impacts.time.sum()) for r in seeds])
    except InputError as error:
        found = str(error).replace(path.name, "")
    print(json.dumps(found))
"""


def block(number: int, n_parts: int = 1) -> Seed:
    rng = np.random.default_rng(number)
    tail = {name: (BLOCK, n_parts, *shape) for name, (_, _, shape) in FRAME_FIELDS.items() if name != "time"}
    values: dict[str, Any] = {name: rng.random(shape) for name, shape in tail.items()}
    values["present"] = np.ones((BLOCK, n_parts), bool)
    frames = Frames(time=number + np.arange(BLOCK) / BLOCK, **values)
    return Seed(frames, impacts_of(rng.random((7, 4))))


def write_run(path: Path, scenario: Scenario, *seeds: Seed) -> None:
    """A file as one that was exported from a run of the scenario."""
    grid = np.linspace(-0.05, 0.05, 30)
    drives = [ModalDrive(0, d.frequency_hz, d.frequency_hz, 1e-6, 0.0, None) for _, d in scenario.excitations]
    parts = [
        PartRecord(f"part_{i}", np.eye(3), np.array([[0, 1, 2]]), np.zeros(3), np.eye(4)[0], PoseTable(()))
        for i in range(scenario.n_parts)
    ]
    plate = PlateRecord(0.1, 0.1, 3e-3, grid, grid, np.ones((1, 30, 30)), (), np.full(2, np.nan), tuple(drives))
    text, wall_s = scenario_toml(scenario), 3.0
    export_recording(Recording(path, "impulse", text, {}, {}, plate, tuple(parts), seeds, wall_s), path)


@pytest.fixture(scope="module")
def ended(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of two seeds."""
    path = tmp_path_factory.mktemp("ended") / "ended.h5"
    two = (Seed.joined([block(n) for n in range(blocks)]) for blocks in (4, 3))
    write_run(path, ball_on_slide(), *(replace(seed, status=Status.DONE, wall_s=2.0) for seed in two))
    return path


def test_what_was_written_is_read(ended: Path) -> None:
    recording = read_recording(ended)
    assert [len(record.frames) for record in recording.records] == [4 * BLOCK, 3 * BLOCK]
    assert recording.status == (Status.DONE,) * 2 and [len(r.impacts) for r in recording.records] == [28, 21]
    assert (recording.records[1].wall_s, recording.wall_s) == (2.0, 3.0)
    assert np.array_equal(recording.seeds[0].position[:BLOCK], block(0).frames.position)


def test_damaged_recording_is_read_unchanged_or_refused_and_never_waited_for(ended: Path, tmp_path: Path) -> None:
    whole, rng = ended.read_bytes(), random.Random(7)
    (tmp_path / "a.h5").write_bytes(whole)
    for i in range(200):
        damaged = bytearray(whole)
        damaged[rng.randrange(4096)] ^= 1 << rng.randrange(8)
        (tmp_path / f"bit_{i:03d}.h5").write_bytes(damaged)
    for i in range(20):
        (tmp_path / f"cut_{i:03d}.h5").write_bytes(whole[: rng.randrange(len(whole))])
    command = [sys.executable, "-c", READ_ALL, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
    good, *others = (json.loads(line) for line in done.stdout.splitlines())
    assert len(others) == 220 and good.startswith("[(")
    refused = [text for text in others if "not a readable recording" in text]
    assert set(others) - set(refused) <= {good} and len(refused) > 100


def test_every_dataset_is_under_a_checksum(ended: Path) -> None:
    def check(name: str, item: Any) -> None:
        assert not isinstance(item, h5py.Dataset) or item.fletcher32 or (not item.chunks and not item.size), name

    with h5py.File(ended) as file:
        file.visititems(check)


@pytest.mark.slow
def test_commands_refuse_a_damaged_seed_at_once(tmp_path: Path) -> None:
    record_run(ball_on_slide(), tmp_path / "run", replay=False)
    path = tmp_path / "run/seeds/000.h5"
    whole = bytearray(path.read_bytes())
    whole[whole.index(b"OHDR", 1000) + 8] ^= 1
    path.write_bytes(whole)
    for command in (["replay"], ["report", "--out", tmp_path / "r.html"], ["resume"]):
        check_refused(feeder_sim(*command, tmp_path / "run"), "000.h5: not a readable recording")


@pytest.mark.parametrize("changed", ["feeder_sim", "numpy"])
def test_run_does_not_go_on_with_another_version(changed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the package the sources count, not only the number of the version."""
    versions = library_versions()
    record_run(ball_on_slide(), tmp_path, replay=False)
    (tmp_path / SUMMARY).unlink()
    other = versions | {changed: versions[changed] + "0"}
    monkeypatch.setattr(provenance, "library_versions", lambda: other)
    with pytest.raises(InputError, match=f"was begun with another version of {changed}, must be the same"):
        resume_run(tmp_path, replay=False)


def test_cost_of_a_run_that_goes_on_counts_all_stretches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = ball_on_slide(seeds=1, duration_s=60.0)
    with monkeypatch.context() as patch:  # as if the first stretch had taken hours
        write = write_seed_file
        patch.setattr(run_folder, "write_seed_file", lambda f, n, seed, wall_s: write(f, n, seed, wall_s + 5000.0))
        first = record_run(scenario, tmp_path, work=Work(stop=StopsAfter(3)), replay=False)
    assert first.interrupted and first.wall_s < 1000.0
    stored = read_recording(tmp_path).wall_s
    second = resume_run(tmp_path, work=Work(stop=StopsAfter(3)), replay=False)
    assert second.interrupted and second.wall_s > stored > 5000.0
    result = resume_run(tmp_path, replay=False)
    summary = json.loads((tmp_path / SUMMARY).read_text())
    assert not result.interrupted and summary["wall_s"] == result.wall_s > second.wall_s
    one_core = summary["wall_s_per_simulated_s_one_core"] * summary["simulated_s"]
    assert one_core == pytest.approx(sum(seed.wall_s for seed in result.seeds))


@pytest.mark.parametrize(
    ("name", "scenario"),
    [(name, ball_on_slide()) for name in ("scenario.toml", "scene.xml", SUMMARY)]
    + [("seeds/000.h5", ball_on_slide()), ("scene.h5", ball_on_slide())],
)
def test_full_disk_leaves_no_part_of_a_file(
    name: str, scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sync = os.fsync

    def full(number: int) -> None:
        if name in str(Path(f"/proc/self/fd/{number}").readlink()):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(number)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(RecordingFailed, match=f"{name}: cannot be written, is the disk full"):
        record_run(scenario, tmp_path, replay=False)
    assert not list(tmp_path.glob(f"{name}*"))


def test_full_disk_leaves_no_part_of_a_mode_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    held = read_mode_file(REPOSITORY / "models/plate_180/modes.h5")
    write_mode_file(tmp_path / "modes.h5", ModeFile(held.modes))
    before = (tmp_path / "modes.h5").read_bytes()
    monkeypatch.setattr(os, "fsync", fails)
    with pytest.raises(RecordingFailed, match=r"modes\.h5: cannot be written, is the disk full"):
        write_mode_file(tmp_path / "modes.h5", ModeFile(held.modes))
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [before]


@pytest.mark.slow
def test_full_disk_leaves_no_cut_replay(tmp_path: Path) -> None:
    """rerun went on without a word, and the cut file took the replay's place."""
    scenario = tmp_path / "ball.toml"
    scenario.write_text(scenario_toml(ball_on_slide(duration_s=1.0)))
    run = tmp_path / "run"
    done = in_new_process("run", scenario, "--replay", "--out", run, largest_file=165_000)  # the replay is longer
    assert done.returncode == 1 and "Traceback" not in done.stderr, done.stderr
    assert "replay.rrd: cannot be written, is the disk full?" in done.stderr.splitlines()[-1]  # after notes, if any
    assert sorted(path.name for path in run.iterdir()) == [
        LOCK,
        RUN,
        "scenario.toml",
        SCENE,
        "scene.xml",
        SEEDS,
        SUMMARY,
    ]
    build_replay(run, run / REPLAY)
    size = (run / REPLAY).stat().st_size
    for largest in (1000, size // 2, size - 2000):  # from one writing to the next it differs by some hundred bytes
        program = f"from pathlib import Path; from feeder_sim.replay.replay import *; p = Path({str(run)!r})"
        command = [sys.executable, "-c", f"{program}; build_replay(p, p / 'replay.rrd')"]
        done = limited(command, largest_file=largest)
        assert done.returncode == 1 and "is the disk full?" in done.stderr.splitlines()[-1], done.stderr
        assert (run / REPLAY).stat().st_size == size and not list(run.glob("*.partial"))


@pytest.mark.parametrize(
    ("number", "code"),
    [(n, 2) for n in (errno.ENOENT, errno.EACCES, errno.EISDIR, errno.ENOTDIR)]
    + [(n, 1) for n in (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG)],
)
def test_system_errors_are_bad_input_only_where_another_name_helps(
    number: int, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails() -> None:
        raise OSError(number, os.strerror(number), "there\x1b[2J")

    monkeypatch.setattr(command_line, "app", fails)
    monkeypatch.setattr(os, "_exit", sys.exit)
    with pytest.raises(SystemExit) as ended:
        command_line.main()
    assert ended.value.code == code
    assert capsys.readouterr().err == f"feeder-sim: there\\x1b[2J: {os.strerror(number)}\n"


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (
            OSError("libmujoco.so.3.17.0: cannot open shared object file: No such file or directory"),
            "a library is missing or damaged (libmujoco.so.3.17.0: cannot open",
        ),
        (OSError("dlopen(/lib/mujoco.dylib, 0x0006): tried: no such file"), "a library is missing or damaged (dlopen("),
        (FileNotFoundError("Could not find module 'mujoco.dll' (or one of its dependencies)"), "a library is missing"),
        (
            ImportError("/mujoco/libmujoco.so: file too short", name="_specs", path="/mujoco/_specs.cpython-311.so"),
            "a library is missing or damaged (/mujoco/libmujoco.so: file too short)",
        ),
        (ModuleNotFoundError("No module named 'h5py'", name="h5py"), "the package h5py is missing, install"),
        (ModuleNotFoundError("No module named 'scipy.x'", name="scipy.x"), "the package scipy is missing, install"),
        (OSError("no name and no number"), "standard output or a file: no name and no number"),
    ],
)
def test_a_library_that_cannot_be_loaded_is_said_to_be(
    error: Exception, expected: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails() -> None:
        raise error

    monkeypatch.setattr(command_line, "app", fails)
    monkeypatch.setattr(os, "_exit", sys.exit)
    with pytest.raises(SystemExit) as ended:
        command_line.main()
    assert ended.value.code == 1
    line = capsys.readouterr().err
    assert line.startswith(f"feeder-sim: {expected}") and line.count("\n") == 1


@pytest.mark.parametrize(
    "error", [ImportError("cannot import name 'x'"), ModuleNotFoundError("no module", name="feeder_sim.x")]
)
def test_a_fault_of_the_package_itself_keeps_its_traceback(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails() -> None:
        raise error

    monkeypatch.setattr(command_line, "app", fails)
    with pytest.raises(ImportError):
        command_line.main()


def test_full_disk_under_the_output_is_a_failure(tmp_path: Path) -> None:
    command = f"{sys.executable} -m feeder_sim list {tmp_path} > /dev/full"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 1 and done.stderr.count("\n") == 1 and "No space left on device" in done.stderr


def test_replays_of_a_run_that_goes_on_are_removed(tmp_path: Path) -> None:
    record_run(ball_on_slide(duration_s=20.0), tmp_path, work=Work(stop=StopsAfter(3)), replay=False)
    shutil.copy(replay_file(tmp_path), tmp_path / "replay_seed_001.rrd")  # whether the second seed had begun is chance
    (tmp_path / "replay_of_mine.rrd").write_text("mine")
    resume_run(tmp_path, replay=False)
    assert [path.name for path in tmp_path.glob("*.rrd")] == ["replay_of_mine.rrd"]


def test_replay_older_than_a_seed_is_built_again(tmp_path: Path) -> None:
    record_run(ball_on_slide(duration_s=0.5), tmp_path)
    replay, seeds = tmp_path / REPLAY, tmp_path / SEEDS
    replay.write_bytes(b"as it was")
    assert replay_file(tmp_path) == replay and replay.read_bytes() == b"as it was"
    later = replay.stat().st_mtime_ns + 10**9
    os.utime(seeds, ns=(later, later))
    assert replay_file(tmp_path).read_bytes().startswith(b"RRF2")


def times_in(replay: Path, timeline: str) -> list[float]:
    from rerun.chunk import RrdReader

    batches = [chunk.to_record_batch() for chunk in RrdReader(replay).stream()]
    held = [batch.column(timeline) for batch in batches if timeline in batch.schema.names]
    return [time / 1e9 for column in held for time in column.cast("int64").to_pylist()]


def test_no_time_beyond_the_record_is_shown(tmp_path: Path) -> None:
    """Of two balls and three stages, two of them alike."""
    stages = [{"drive": [{"frequency_hz": f, "amplitude_um": 5.0}], "duration_s": 1.0} for f in (500.0, 600.0, 500.0)]
    balls = {"shape": "ball", "diameter_mm": 3.0, "count": 2, "start": {"kind": "scattered"}}
    changes = {"drive": [], "schedule": {"stage": stages}, "part": [balls], "run.duration_s": None}
    crowd = ball_on_slide().changed(changes)
    for scenario, name in ((crowd, "crowd"), (ball_on_slide(), "ball")):
        first = Seed.joined([block(number, scenario.n_parts) for number in range(3)])
        write_run(tmp_path / f"{name}.h5", scenario, first, block(0, scenario.n_parts), no_seed(scenario.n_parts))
    ends = timeline_ends(read_recording(tmp_path / "crowd.h5"), 0)
    build_replay(tmp_path / "crowd.h5", tmp_path / "crowd.rrd")
    assert ends == {name: pytest.approx(max(times_in(tmp_path / "crowd.rrd", name))) for name in ends}
    assert ends["slow_motion"] == pytest.approx(7.9) and ends["sim_time"] == pytest.approx(2.992, abs=1e-3)
    shown = [("crowd", 5.0, False), ("crowd", 9.0, True), ("ball", 0.5, True), ("ball", float("nan"), False)]
    for name, at, slow in shown:
        with pytest.raises(InputError, match="--slow-motion" if (name, slow) == ("ball", True) else "--at: is"):
            displayed_time(tmp_path / f"{name}.h5", at, slow=slow)
    assert displayed_time(tmp_path / "crowd.h5", 5.0, slow=True) == 5.0
    assert (
        displayed_time(tmp_path / "crowd.h5", None) == 1.0 and displayed_time(tmp_path / "crowd.h5", None, seed=1) < 1.0
    )
    refused = feeder_sim("replay", tmp_path / "ball.h5", "--screenshot", tmp_path / "s.png", "--at", 4)
    check_refused(refused, "--at: is 4, must be 0 to 2.99", "seed 0 is recorded for 2.99")
