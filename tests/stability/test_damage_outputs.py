"""Full disks, and replays that are cut, out of date or too short: never without a word."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import REPOSITORY, StopsAfter
from test_damage import ball, block, check_one_line, feeder_sim, limited, writer

import feeder_sim.cli.main as command_line
from feeder_sim.errors import InputError, RecordingFailed
from feeder_sim.plate.mode_file import ModeFile, read_mode_file, write_mode_file
from feeder_sim.records.own_files import LOCK, RUN
from feeder_sim.records.trajectory_file import TRAJECTORY, read_recording
from feeder_sim.replay.replay import REPLAY, build_replay, timeline_ends
from feeder_sim.replay.viewer import replay_file, time_shown
from feeder_sim.run.run_folder import SUMMARY, record_run, resume_run, scenario_toml
from feeder_sim.scenario import Ball, Excitation, PistonPlate, Run, Scattered, Scenario
from feeder_sim.scenario.schedule import Schedule, Stage


def crowd() -> Scenario:
    """Two balls and three stages, two of them alike."""
    drives = [Excitation(frequency_hz=f, amplitude_um=5.0) for f in (500.0, 600.0, 500.0)]
    return Scenario(
        plate=PistonPlate(kind="piston"),
        schedule=Schedule(stage=tuple(Stage(drive=(drive,), duration_s=1.0) for drive in drives)),
        part=(Ball(shape="ball", diameter_mm=3.0, count=2, start=Scattered(kind="scattered")),),
        run=Run(seeds=2),
    )


def full(*names: str) -> Callable[[int], None]:
    """What `os.fsync` does where the disk is full for these files."""
    sync = os.fsync

    def fails(number: int) -> None:
        if any(name in str(Path(f"/proc/self/fd/{number}").readlink()) for name in names):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(number)

    return fails


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
    write_mode_file(tmp_path / "modes.h5", ModeFile(held.modes))
    before = (tmp_path / "modes.h5").read_bytes()
    monkeypatch.setattr(Path, "write_bytes", fails)
    with pytest.raises(RecordingFailed, match=r"modes\.h5: cannot be written, is the disk full"):
        write_mode_file(tmp_path / "modes.h5", ModeFile(held.modes))
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [before]


@pytest.mark.slow
def test_full_disk_leaves_no_cut_replay(tmp_path: Path) -> None:
    """rerun went on without a word, and the cut file took the replay's place."""
    scenario = tmp_path / "ball.toml"
    scenario.write_text(scenario_toml(ball(duration_s=1.0)))
    run = tmp_path / "run"
    done = feeder_sim("run", scenario, "--out", run, largest_file=165_000)  # the replay is longer
    assert done.returncode == 1 and "Traceback" not in done.stderr, done.stderr
    assert "replay.rrd: cannot be written, is the disk full?" in done.stderr.splitlines()[-1]  # after notes, if any
    assert sorted(path.name for path in run.iterdir()) == [LOCK, RUN, "scenario.toml", "scene.xml", SUMMARY, TRAJECTORY]
    build_replay(run / TRAJECTORY, run / REPLAY)
    size = (run / REPLAY).stat().st_size
    for largest in (1000, size // 2, size - 2000):  # from one writing to the next it differs by some hundred bytes
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
    first = replay_file(tmp_path)
    second = first.with_name("replay_seed_001.rrd")
    shutil.copy(first, second)  # whether the second seed had begun is chance
    replays = [first, second]
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
