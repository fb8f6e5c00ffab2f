"""Run folders: nothing of others is deleted, overwritten or followed, and one process writes at a time."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command_line import Done, check_refused, feeder_sim, in_new_process

from feeder_sim.errors import InputError
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.records.own_files import LOCK, locked
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.records.whole_file import write_whole
from feeder_sim.replay import viewer
from feeder_sim.run import run_folder
from feeder_sim.run.run_folder import record_run, resume_run
from feeder_sim.scenario import load_scenario, with_run

BALL = """
title = "a ball"
[plate]
kind = "piston"
[[drive]]
frequency_hz = 50.0
amplitude_um = 150.0
[[part]]
shape = "ball"
diameter_mm = 3.0
guide = {{ kind = "slide" }}
[run]
seeds = 2
duration_s = {duration_s}
"""
# Takes a lock until its input ends.
HOLD = """
import sys
from pathlib import Path
from feeder_sim.records.own_files import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    file = tmp_path / "ball.toml"
    file.write_text(BALL.format(duration_s=2.0))
    return file


def contents(folder: Path) -> dict[str, bytes]:
    """Of all files in a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "name", ["checkpoints/notes.txt", "inputs/modes.h5", "scenario.toml", "replay.rrd.bak", "a.txt"]
)
def test_a_folder_with_files_of_the_user_is_refused_and_left_alone(name: str, scenario: Path, tmp_path: Path) -> None:
    mine = tmp_path / "proj"
    (mine / name).parent.mkdir(parents=True)
    (mine / name).write_text("mine")
    check_refused(feeder_sim("run", scenario, "--out", mine), "--out: is not empty", "allowed is a new or an empty")
    assert contents(mine) == {name: b"mine"}


def test_files_of_the_user_in_a_run_folder_stay(scenario: Path, tmp_path: Path) -> None:
    """Also those that lie where runs once kept what they went on from."""
    run = tmp_path / "run"
    record_run(load_scenario(scenario), run)
    recording = (run / "trajectory.h5").read_bytes()
    mine = {"checkpoints/notes.txt": b"a", "checkpoints/seed_007.npz": b"b", "checkpoints/seed_000.npz": b"c"}
    mine |= {"replay_mine.rrd": b"RRF2 of mine", "replay_seed_001.rrd": b"no replay", "notes.md": b"d"}
    for name, content in mine.items():
        (run / name).parent.mkdir(exist_ok=True)
        (run / name).write_bytes(content)
    (run / "summary.json").unlink()  # as if it had been killed just before its end
    resume_run(run)
    held = contents(run)
    assert {name: held[name] for name in mine} == mine
    assert (run / "summary.json").exists() and len(recording) > 0


def test_a_run_under_way_is_not_resumed_beside_itself(scenario: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    record_run(load_scenario(scenario), run)
    (run / "summary.json").unlink()
    before = contents(run)
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(run)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdin and other.stdout and other.stdout.readline() == "held\n"
        check_refused(feeder_sim("run", "--resume", run), "is in use", "one process")
        after = contents(run)
        other.stdin.close()
    assert {name: after[name] for name in before} == before
    with locked(run):  # a process that has ended holds nothing
        pass


@pytest.mark.slow
def test_of_runs_that_begin_at_once_in_one_folder_one_is_recorded(scenario: Path, tmp_path: Path) -> None:
    for attempt in range(3):
        out = tmp_path / f"run_{attempt}"
        command = [sys.executable, "-m", "feeder_sim", "run", str(scenario), "--out", str(out), "--seed"]
        both = [subprocess.Popen([*command, str(s)], stdout=subprocess.PIPE, stderr=subprocess.PIPE) for s in (1, 2)]
        said = [process.communicate(timeout=300)[1].decode() for process in both]
        codes = [process.returncode for process in both]
        assert sorted(codes) == [0, 2], said
        winner = codes.index(0) + 1
        assert json.loads((out / "summary.json").read_text())["seed"] == winner
        assert f"seed = {winner}\n" in (out / "scenario.toml").read_text()
        assert read_recording(out / "trajectory.h5").status == (Status.DONE,) * 2


@pytest.mark.parametrize("killed_in", ["carry_files", "_write_mjcf", "TrajectoryWriter", "run_ensemble"])
def test_a_run_that_was_killed_before_its_first_block_begins_anew(
    killed_in: str, repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = with_run(load_scenario(repository / "scenarios/drift_2797hz_plate.toml"), seeds=2, duration_s=0.05)
    whole, run = tmp_path / "whole", tmp_path / "run"
    record_run(scenario, whole, replay=False)

    def killed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(run_folder, killed_in, killed)
        record_run(scenario, run, replay=False)
    check_refused(feeder_sim("run", "drift_4750hz", "--out", run), "already holds a run")
    resume_run(run, replay=False)
    one, other = (read_recording(folder / "trajectory.h5") for folder in (whole, run))
    for a, b in zip(one.seeds, other.seeds, strict=True):
        assert np.array_equal(a.position, b.position)
    assert one.scenario_text == other.scenario_text and one.inputs == other.inputs


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "is not the readable begin of a run"),
        ("[]", "is not the readable"),
        ('{"format": 2, "scenario": ""}', "is 2"),
    ],
)
def test_a_begin_that_cannot_be_read_is_refused(content: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text(content)
    check_refused(feeder_sim("run", "--resume", tmp_path), "run.json", said)


@pytest.mark.parametrize(
    "beside",
    [[], ["plate.toml", "notebook.ipynb"], [LOCK, "sweep.toml", "journal.jsonl"], [LOCK, "uncertainty.toml", "inputs"]],
)
def test_a_scenario_in_a_folder_of_the_user_or_of_a_question_is_no_run(
    beside: list[str], scenario: Path, tmp_path: Path
) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    scenario.rename(mine / "scenario.toml")
    for name in beside:
        (mine / name).write_text("mine")
    before = contents(mine)
    with pytest.raises(InputError, match="mine: --resume: no run here, allowed is a folder that holds"):
        resume_run(mine)
    assert contents(mine) == before


def test_what_a_kill_before_the_first_file_leaves_is_as_good_as_empty(scenario: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / LOCK).touch()
    (run / "run.json.partial").write_text('{"for')
    assert feeder_sim("run", scenario, "--out", run).returncode == 0


@pytest.mark.parametrize("name", ["trajectory.h5", "run.json", "scenario.toml", "replay.rrd", LOCK])
@pytest.mark.parametrize("command", [["run", "--resume"], ["replay", "--screenshot", "a.png"]])
def test_links_in_a_run_folder_are_not_followed(
    name: str, command: list[str], scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, mine = tmp_path / "run", tmp_path / "mine"
    record_run(load_scenario(scenario), run, replay=False)
    (run / "summary.json").unlink()
    mine.write_bytes((run / name).read_bytes() if (run / name).exists() else b"mine")
    (run / name).unlink(missing_ok=True)
    held = mine.read_bytes()
    (run / name).symlink_to(mine)
    monkeypatch.chdir(tmp_path)
    check_refused(feeder_sim(*command[:1], run, *command[1:]) if command[0] == "replay" else feeder_sim(*command, run))
    assert mine.read_bytes() == held


@pytest.mark.parametrize("make", [os.symlink, os.link, lambda mine, name: os.mkfifo(name)])
def test_what_has_the_name_of_a_file_under_way_is_not_written_to(make: Any, tmp_path: Path) -> None:
    """Neither is a pipe waited for."""
    mine = tmp_path / "mine"
    mine.write_text("mine")
    make(mine, tmp_path / "summary.json.partial")
    write_whole(tmp_path / "summary.json", b"{}")
    assert mine.read_text() == "mine" and (tmp_path / "summary.json").read_text() == "{}"
    assert not (tmp_path / "summary.json").is_symlink()


def test_a_file_system_without_locks_is_worked_on_without_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def none(*_: object) -> None:
        asked.append("a lock")
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", none)
    with locked(tmp_path):
        assert asked


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "ball.toml").write_text(BALL.format(duration_s=0.5))
    record_run(load_scenario(folder / "ball.toml"), folder / "run", replay=False)
    return folder / "run" / "trajectory.h5"


def another_file(file: h5py.File, secret: Path) -> None:
    del file["seeds/000/time"]
    file["seeds/000/time"] = h5py.ExternalLink(str(secret), "/a")


def another_name(file: h5py.File, secret: Path) -> None:
    del file["seeds/000/time"]
    file["seeds/000/time"] = h5py.SoftLink("/seeds/001/time")


def another_storage(file: h5py.File, secret: Path) -> None:
    del file["plate/x"]
    file.create_dataset("plate/x", (10,), "f8", external=[(str(secret), 0, 80)])


def a_pipe(file: h5py.File, secret: Path) -> None:
    """Nobody writes to it: reading it waits for ever."""
    pipe = secret.with_name("pipe")
    os.mkfifo(pipe)
    del file["plate/x"]
    file.create_dataset("plate/x", (10,), "f8", external=[(str(pipe), 0, 80)])


def a_bomb(file: h5py.File, secret: Path) -> None:
    del file["seeds/000/position"]
    file.create_dataset("seeds/000/position", (10**9, 1, 3), "f8", chunks=(10**5, 1, 3), compression="gzip")


def itself(file: h5py.File, secret: Path) -> None:
    """Without a limit of the depth, a walk through a group in itself never ends."""
    file["seeds/000/again"] = file["/"]


def many_names(file: h5py.File, secret: Path) -> None:
    """Read as often as it is named."""
    file.create_dataset("bomb", data=np.zeros(3 * 10**6), chunks=(10**5,), compression="gzip")
    for number in range(10, 10_000):
        file[f"parts/part_{number}/vertices"] = file["bomb"]


@pytest.mark.parametrize("spoil", [another_file, another_name, another_storage, a_pipe, a_bomb, itself, many_names])
def test_a_recording_that_points_elsewhere_or_claims_too_much_is_refused(
    spoil: object, recorded: Path, tmp_path: Path
) -> None:
    assert callable(spoil)
    path, secret = tmp_path / "trajectory.h5", tmp_path / "secret.h5"
    path.write_bytes(recorded.read_bytes())
    with h5py.File(secret, "w") as file:
        file["a"] = np.zeros(10)
    with h5py.File(path, "r+", libver="latest") as file:
        spoil(file, secret)
    done = in_new_process("vibrometer", path, "--picture", tmp_path / "a.png")
    check_refused(done, "trajectory.h5")


def test_a_mode_file_that_points_elsewhere_is_refused(repository: Path, tmp_path: Path) -> None:
    path = tmp_path / "modes.h5"
    path.write_bytes((repository / "models/plate_180/modes.h5").read_bytes())
    with h5py.File(path, "r+") as file:
        del file["modes/coefficients"]
        file.create_dataset("modes/coefficients", (10**6, 3, 30, 30), "f8", chunks=(10, 3, 30, 30), compression="gzip")
    with pytest.raises(InputError, match="claims to hold"):
        read_mode_file(path)


def test_what_a_terminal_acts_on_is_not_printed(tmp_path: Path) -> None:
    """Colours, the bell, the title of the window: from the title of a scenario and the name of its folder."""
    text = BALL.format(duration_s=0.5).replace('"a ball"', '"\\u001b[2Jgone\\u0007 \\u202e"')
    file, folder = tmp_path / "ball.toml", tmp_path / "run\x1b[31m"
    file.write_text(text)
    for command in (("check", file), ("run", file, "--out", folder)):
        done: Done = feeder_sim(*command)
        assert done.returncode == 0
        printed = (done.stdout + done.stderr).replace("\n", "")
        assert "gone" in printed and printed.isprintable()


def test_a_replay_of_a_run_under_way_or_read_only_is_built_elsewhere(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    record_run(load_scenario(scenario), run, replay=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with locked(run):
        built = viewer.replay_file(run)
    assert built.parent != run and built.stat().st_size > 1000 and not (run / "replay.rrd").exists()
    assert viewer.replay_file(run) == run / "replay.rrd"


def test_an_interrupt_before_the_first_block_ends_at_once_and_the_folder_goes_on(tmp_path: Path) -> None:
    """Ten thousand seeds of ten parts are placed, and their file is made, for minutes."""
    file, run = tmp_path / "many.toml", tmp_path / "run"
    text = BALL.format(duration_s=0.1).replace("seeds = 2", "seeds = 10000")
    start = 'count = 10\nstart = { kind = "scattered" }'
    file.write_text(text.replace('guide = { kind = "slide" }', start))
    command = [sys.executable, "-m", "feeder_sim", "run", str(file), "--out", str(run)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr and "looking for places" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        asked = time.monotonic()
        said = process.stderr.read()
    assert process.returncode == 130 and said == "feeder-sim: interrupted\n"
    assert time.monotonic() - asked < 20.0  # of minutes
    assert not run.exists()


def test_a_run_that_ends_writes_no_summary_of_another(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run in a folder that a faster process has taken between two looks is refused, with nothing written."""
    run = tmp_path / "run"
    looks = []

    def free_at_first(folder: Path) -> None:
        looks.append(folder)
        if len(looks) == 2:
            (folder / "trajectory.h5").write_text("of another process")
        check_free(folder)

    check_free = run_folder.check_free
    monkeypatch.setattr(run_folder, "check_free", free_at_first)
    with pytest.raises(InputError, match="already holds a run"):
        record_run(load_scenario(scenario), run)
    assert set(contents(run)) <= {LOCK, "trajectory.h5"}
