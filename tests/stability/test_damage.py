"""Runs that were killed, exchanged or out of date, full disks: carried on with, or one line."""

from __future__ import annotations

import errno
import json
import os
import random
import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from conftest import REPOSITORY

import feeder_sim.cli.main as command_line
import feeder_sim.run.recorder as recorder
from feeder_sim.errors import InputError, RecordingFailed
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.plate.mode_file import read_mode_file, write_mode_file
from feeder_sim.records.impacts import Impacts
from feeder_sim.records.removals import Removals
from feeder_sim.records.trajectory import FRAME_FIELDS, Frames, PartRecord, PlateRecord, Record, Status, WallTime
from feeder_sim.records.trajectory_file import TRAJECTORY, TrajectoryWriter, read_recording
from feeder_sim.records.unclosed_file import closed_head, lookup3
from feeder_sim.replay.replay import REPLAY, build_replay, timeline_ends
from feeder_sim.replay.viewer import replay_file, time_shown
from feeder_sim.run import run_folder
from feeder_sim.run.run_folder import SUMMARY, record_run, resume_run, scenario_toml
from feeder_sim.scenario import (
    Ball,
    Drive,
    Excitation,
    MeshPart,
    PistonPlate,
    Run,
    Scattered,
    Scenario,
    Slide,
    load_scenario,
)
from feeder_sim.scenario.schedule import Schedule, Stage

BLOCK = 130  # frames
# Reads every trajectory in a folder; a reader that waits is seen by the test's time limit.
READ_ALL = """
import hashlib, json, sys
from pathlib import Path
from feeder_sim.errors import InputError
from feeder_sim.records.trajectory_file import read_recording
for path in sorted(Path(sys.argv[1]).iterdir()):
    try:
        found = repr([(r.sizes, r.frames.position.sum(), r.impacts.time.sum()) for r in read_recording(path).records])
    except InputError as error:
        found = str(error).replace(path.name, "")
    print(json.dumps(found))
"""


def ball(**run: Any) -> Scenario:
    """A ball on a slide, which is simulated in no time."""
    return Scenario(
        plate=PistonPlate(kind="piston"),
        drive=(Drive(frequency_hz=50.0, amplitude_um=150.0),),
        part=(Ball(shape="ball", diameter_mm=3.0, guide=Slide(kind="slide")),),
        run=Run(**({"duration_s": 20.0, "seeds": 2} | run)),
    )


def crowd() -> Scenario:
    """Two balls and three stages, two of them alike."""
    drives = [Excitation(frequency_hz=f, amplitude_um=5.0) for f in (500.0, 600.0, 500.0)]
    return Scenario(
        plate=PistonPlate(kind="piston"),
        schedule=Schedule(stage=tuple(Stage(drive=(drive,), duration_s=1.0) for drive in drives)),
        part=(Ball(shape="ball", diameter_mm=3.0, count=2, start=Scattered(kind="scattered")),),
        run=Run(seeds=2),
    )


class StopsAfter(threading.Event):
    """Is set once it has been looked at so many times."""

    def __init__(self, looks: int) -> None:
        super().__init__()
        self._left = looks

    def is_set(self) -> bool:
        self._left -= 1
        return self._left < 0 or super().is_set()


def block(number: int, n_parts: int = 1) -> Record:
    rng = np.random.default_rng(number)
    tail = {name: (BLOCK, n_parts, *shape) for name, (_, _, shape) in FRAME_FIELDS.items() if name != "time"}
    values = {name: rng.random(shape) for name, shape in tail.items()} | {"present": np.ones((BLOCK, n_parts), bool)}
    frames = Frames(time=number + np.arange(BLOCK) / BLOCK, **values)
    return Record(frames, Impacts.of_rows(rng.random((7, 4))), Removals.none(), np.empty(0))


def writer(path: Path, scenario: Scenario) -> TrajectoryWriter:
    """Of a file as a run of the scenario writes it."""
    grid = np.linspace(-0.05, 0.05, 30)
    drives = [ModalDrive(0, d.frequency_hz, d.frequency_hz, 1e-6, 0.0, None) for _, d in scenario.excitations]
    return TrajectoryWriter(
        path,
        engine="impulse",
        seed=0,
        n_seeds=2,
        scenario_text=scenario_toml(scenario),
        libraries={},
        inputs={},
        plate=PlateRecord(0.1, 0.1, 3e-3, grid, grid, np.ones((1, 30, 30)), (), np.full(2, np.nan), tuple(drives)),
        parts=[PartRecord(f"part_{i}", np.eye(3), np.array([[0, 1, 2]])) for i in range(scenario.n_parts)],
    )


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a run that was killed after three blocks, and of the same run when it had ended."""
    folder = tmp_path_factory.mktemp("killed")
    file = writer(folder / "closed.h5", ball())
    for number in range(3):
        for seed in range(2):
            file.append(seed, block(number))
    file.note_wall_time(1, WallTime(2.0, 3.0))
    (folder / "killed.h5").write_bytes((folder / "closed.h5").read_bytes())
    file.append(0, block(3))
    file.finish(0, Status.DONE)
    file.close()
    return folder


def test_killed_run_is_read(killed: Path) -> None:
    recording = read_recording(killed / "killed.h5")
    assert [record.sizes for record in recording.records] == [(3 * BLOCK, 21, 0, 0)] * 2
    assert recording.status == (Status.UNFINISHED,) * 2 and recording.wall_times[1] == WallTime(2.0, 3.0)
    assert np.array_equal(recording.seeds[0].position[:BLOCK], block(0).frames.position)
    assert [len(frames) for frames in read_recording(killed / "closed.h5").seeds] == [4 * BLOCK, 3 * BLOCK]


def test_head_of_a_killed_run_is_made_that_of_a_closed_file(killed: Path) -> None:
    assert lookup3(b"Four score and seven years ago") == 0x17770551  # from the author's own test
    for name, flags in (("closed.h5", 0), ("killed.h5", 5)):
        head = (killed / name).read_bytes()[:48]
        assert head[11] == flags and lookup3(head[:44]) == int.from_bytes(head[44:], "little")
        mended = closed_head(head, 10**6)
        assert mended[:11] == head[:11] and mended[11] == 0 and mended[36:44] == head[36:44]
        assert lookup3(mended[:44]) == int.from_bytes(mended[44:], "little")


@pytest.mark.parametrize("name", ["killed.h5", "closed.h5"])
def test_damaged_trajectory_is_read_unchanged_or_refused_and_never_waited_for(
    name: str, killed: Path, tmp_path: Path
) -> None:
    """HDF5's reader beside a living writer waited for damage to mend itself: minutes, then hours."""
    whole, rng = (killed / name).read_bytes(), random.Random(7)
    (tmp_path / "a").write_bytes(whole)
    for i in range(200):
        damaged = bytearray(whole)
        damaged[rng.randrange(4096)] ^= 1 << rng.randrange(8)
        (tmp_path / f"bit_{i:03d}").write_bytes(damaged)
    for i in range(20):
        (tmp_path / f"cut_{i:03d}").write_bytes(whole[: rng.randrange(len(whole))])
    command = [sys.executable, "-c", READ_ALL, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
    good, *others = (json.loads(line) for line in done.stdout.splitlines())
    assert len(others) == 220 and good.startswith("[((")
    refused = [text for text in others if "not a readable trajectory file" in text]
    assert set(others) - set(refused) <= {good} and len(refused) > 100


def test_every_dataset_is_under_a_checksum(killed: Path) -> None:
    def check(name: str, item: Any) -> None:
        assert not isinstance(item, h5py.Dataset) or item.fletcher32 or (not item.chunks and not item.size), name

    with h5py.File(killed / "closed.h5") as file:
        file.visititems(check)


def limited(command: list[str], largest_file: int | None) -> subprocess.CompletedProcess[str]:
    """Run on a disk that is full for what is beyond a size in a file."""

    def small_files() -> None:
        if largest_file is not None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))

    return subprocess.run(command, preexec_fn=small_files, capture_output=True, text=True, timeout=100, check=False)


def feeder_sim(*arguments: object, largest_file: int | None = None) -> subprocess.CompletedProcess[str]:
    return limited([sys.executable, "-m", "feeder_sim", *map(str, arguments)], largest_file)


def check_one_line(done: subprocess.CompletedProcess[str], code: int, *expected: str) -> None:
    assert done.returncode == code and done.stderr.count("\n") == 1 and "Traceback" not in done.stderr, done.stderr
    for text in expected:
        assert text in done.stderr


def test_commands_refuse_a_damaged_trajectory_at_once(killed: Path, tmp_path: Path) -> None:
    whole = bytearray((killed / "killed.h5").read_bytes())
    at = whole.index(b"OHDR", 1000)
    whole[at + 8] ^= 1
    (tmp_path / TRAJECTORY).write_bytes(whole)
    for command in (["replay"], ["vibrometer", "--picture", tmp_path / "v.png"], ["run", "--resume"]):
        check_one_line(feeder_sim(command[0], *command[1:], tmp_path), 2, "not a readable trajectory file")


def full(*names: str) -> Callable[[int], None]:
    """What `os.fsync` does where the disk is full for these files."""
    sync = os.fsync

    def fails(number: int) -> None:
        if any(name in str(Path(f"/proc/self/fd/{number}").readlink()) for name in names):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(number)

    return fails


def test_full_disk_at_a_checkpoint_ends_the_run_as_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In one line that names the checkpoint; the one before stays, and the run goes on from there."""
    run = tmp_path / "run"
    record_run(ball(), run, stop=StopsAfter(3), replay=False)
    before = {path: path.read_bytes() for path in run.glob("checkpoints/*")}
    assert len(before) == 2
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full("checkpoints"))
        with pytest.raises(RecordingFailed, match=r"seed_00\d\.npz: cannot be written, is the disk full\? \(No space"):
            resume_run(run, stop=StopsAfter(1), replay=False)
    assert {path: path.read_bytes() for path in run.glob("checkpoints/*")} == before
    assert not resume_run(run, replay=False).interrupted


@pytest.mark.parametrize("name", ["scenario.toml", "scene.xml", SUMMARY])
def test_full_disk_leaves_no_part_of_a_file(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fsync", full(name))
    with pytest.raises(RecordingFailed, match=f"{name}: cannot be written, is the disk full"):
        record_run(ball(duration_s=1.0), tmp_path, replay=False)
    assert not list(tmp_path.glob(f"{name}*"))


def test_full_disk_leaves_no_part_of_a_mode_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(self: Path, data: bytes) -> int:
        self.touch()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    held = read_mode_file(REPOSITORY / "models/plate_180/modes.h5")
    write_mode_file(tmp_path / "modes.h5", held.modes)
    before = (tmp_path / "modes.h5").read_bytes()
    monkeypatch.setattr(Path, "write_bytes", fails)
    with pytest.raises(RecordingFailed, match=r"modes\.h5: cannot be written, is the disk full"):
        write_mode_file(tmp_path / "modes.h5", held.modes)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [before]


def test_full_disk_leaves_no_cut_replay(tmp_path: Path) -> None:
    """rerun went on without a word, and the cut file took the replay's place."""
    scenario = tmp_path / "ball.toml"
    scenario.write_text(scenario_toml(ball(duration_s=1.0)))
    run = tmp_path / "run"
    done = feeder_sim("run", scenario, "--out", run, largest_file=100_000)  # the replay is longer
    check_one_line(done, 1, "replay.rrd: cannot be written, is the disk full?")
    assert sorted(path.name for path in run.iterdir()) == ["scenario.toml", "scene.xml", SUMMARY, TRAJECTORY]
    build_replay(run / TRAJECTORY, run / REPLAY)
    size = (run / REPLAY).stat().st_size
    for largest in (1000, size // 2, size - 100):
        program = f"from pathlib import Path; from feeder_sim.replay.replay import *; p = Path({str(run)!r})"
        command = [sys.executable, "-c", f"{program}; build_replay(p / 'trajectory.h5', p / 'replay.rrd')"]
        done = limited(command, largest)
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


def test_full_disk_under_the_output_is_a_failure(tmp_path: Path) -> None:
    command = f"{sys.executable} -m feeder_sim list {tmp_path} > /dev/full"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=100, check=False)
    check_one_line(done, 1, "No space left on device")


def test_replays_of_a_run_that_goes_on_are_removed(tmp_path: Path) -> None:
    record_run(ball(), tmp_path, stop=StopsAfter(3), replay=False)
    replays = [replay_file(tmp_path, seed=seed) for seed in range(2)]
    (tmp_path / "replay_of_mine.rrd").write_text("mine")
    assert all(path.is_file() for path in replays)
    resume_run(tmp_path, replay=False)
    assert [path.name for path in tmp_path.glob("*.rrd")] == ["replay_of_mine.rrd"]


def test_replay_older_than_its_trajectory_is_built_again(tmp_path: Path) -> None:
    record_run(ball(duration_s=0.5), tmp_path)
    replay, trajectory = tmp_path / REPLAY, tmp_path / TRAJECTORY
    replay.write_bytes(b"as it was")
    assert replay_file(tmp_path) == replay and replay.read_bytes() == b"as it was"
    later = replay.stat().st_mtime_ns + 10**9
    os.utime(trajectory, ns=(later, later))
    assert replay_file(tmp_path).read_bytes().startswith(b"RRF2")


def times_in(replay: Path, timeline: str) -> list[float]:
    from rerun.chunk import RrdReader

    batches = [chunk.to_record_batch() for chunk in RrdReader(replay).stream()]
    held = [batch.column(timeline) for batch in batches if timeline in batch.schema.names]
    return [time / 1e9 for column in held for time in column.cast("int64").to_pylist()]


def test_no_time_beyond_the_record_is_shown(tmp_path: Path) -> None:
    for scenario, name in ((crowd(), "crowd"), (ball(), "ball")):
        (tmp_path / name).mkdir()
        file = writer(tmp_path / name / TRAJECTORY, scenario)
        for number in range(3):
            file.append(0, block(number, scenario.n_parts))
        file.append(1, block(0, scenario.n_parts))
        file.close()
    ends = timeline_ends(read_recording(tmp_path / "crowd" / TRAJECTORY), 0)
    build_replay(tmp_path / "crowd" / TRAJECTORY, tmp_path / "crowd.rrd")
    assert ends == {name: pytest.approx(max(times_in(tmp_path / "crowd.rrd", name))) for name in ends}
    assert ends["slow_motion"] == pytest.approx(7.9) and ends["sim_time"] == pytest.approx(2.992, abs=1e-3)
    with pytest.raises(InputError, match=r"--at: is 5, allowed is 0 to 2\.99\d+: seed 0 is .* s, 7\.9 s in slow"):
        time_shown(tmp_path / "crowd", 5.0)
    assert time_shown(tmp_path / "crowd", 5.0, slow=True) == 5.0
    with pytest.raises(InputError, match=r"--at: is 9, allowed is 0 to 7\.9: seed 0 is recorded for 2\.99\d+ s, 7\.9"):
        time_shown(tmp_path / "crowd", 9.0, slow=True)
    assert time_shown(tmp_path / "crowd", None) == 1.0 and time_shown(tmp_path / "crowd", None, seed=1) < 1.0
    with pytest.raises(InputError, match="--slow-motion"):
        time_shown(tmp_path / "ball", 0.5, slow=True)
    with pytest.raises(InputError, match="--at: is nan"):
        time_shown(tmp_path / "ball", float("nan"))
    refused = feeder_sim("replay", tmp_path / "ball", "--screenshot", tmp_path / "s.png", "--at", 4)
    check_one_line(refused, 2, "--at: is 4, allowed is 0 to 2.99", "seed 0 is recorded for 2.99")


def interrupted(scenario: Scenario, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that was stopped before its first step."""

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(run_folder, "simulate", stop)
        with pytest.raises(KeyboardInterrupt):
            record_run(scenario, folder, replay=False)


def test_run_does_not_go_on_with_other_input_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import trimesh

    mode_file, mesh = tmp_path / "modes.h5", tmp_path / "box.stl"
    held = read_mode_file(REPOSITORY / "models/plate_180/modes.h5")
    plate = load_scenario(REPOSITORY / "scenarios/drift_2797hz_plate.toml")
    on_plate = plate.model_copy(update={"plate": plate.plate.model_copy(update={"mode_file": mode_file})})
    of_mesh = ball().model_copy(update={"part": (MeshPart(shape="mesh", file=mesh, guide=Slide(kind="slide")),)})
    write_mode_file(mode_file, held.modes, held.resonances)
    trimesh.creation.box((2.0, 3.0, 4.0)).export(mesh)
    for scenario, name in ((on_plate, "plate"), (of_mesh, "mesh")):
        interrupted(scenario, tmp_path / name, monkeypatch)
    write_mode_file(mode_file, held.modes)  # without what was measured
    trimesh.creation.box((2.0, 3.0, 5.0)).export(mesh)
    for name, key in (("plate", r"plate\.mode_file"), ("mesh", r"part\[0\]\.file")):
        with pytest.raises(InputError, match=f"{name}: --resume: was begun with another content of {key}, allowed"):
            resume_run(tmp_path / name, replay=False)


@pytest.mark.parametrize("changed", ["feeder_sim", "numpy"])
def test_run_does_not_go_on_with_another_version(changed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the package the sources count, not only the number of the version."""
    versions = run_folder.library_versions()
    interrupted(ball(), tmp_path, monkeypatch)
    other = versions | {changed: versions[changed] + "0"}
    monkeypatch.setattr(run_folder, "library_versions", lambda: other)
    with pytest.raises(InputError, match=f"--resume: was begun with another version of {changed}, allowed is the same"):
        resume_run(tmp_path, replay=False)


def test_cost_of_a_run_that_goes_on_counts_all_stretches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:  # as if the first stretch had taken hours
        patch.setattr(recorder, "WallTime", lambda seed, ensemble: WallTime(seed + 1000.0, ensemble + 5000.0))
        first = record_run(ball(), tmp_path, stop=StopsAfter(3), replay=False)
    assert first.interrupted and all(seed.wall_s < 1000.0 for seed in first.seeds)
    stored = read_recording(tmp_path / TRAJECTORY).wall_times
    assert all(time.seed > 1000.0 and time.ensemble > 5000.0 for time in stored)
    second = resume_run(tmp_path, stop=StopsAfter(3), replay=False)
    assert second.interrupted and second.wall_s > max(time.ensemble for time in stored)
    again = read_recording(tmp_path / TRAJECTORY).wall_times
    assert all(later.seed > time.seed for later, time in zip(again, stored, strict=True))
    result = resume_run(tmp_path, replay=False)
    summary = json.loads((tmp_path / SUMMARY).read_text())
    assert not result.interrupted and summary["wall_s"] == result.wall_s > second.wall_s
    assert sum(seed.wall_s for seed in result.seeds) > sum(seed.wall_s for seed in second.seeds) > 2000.0
    one_core = summary["wall_s_per_simulated_s_one_core"] * summary["simulated_s"]
    assert one_core == pytest.approx(sum(seed.wall_s for seed in result.seeds))
