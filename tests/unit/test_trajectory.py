from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from conftest import strip_scenario

from feeder_sim.errors import InputError
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.records.trajectory_file import TRAJECTORY, read_recording
from feeder_sim.run.run_folder import record_run
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import parse_scenario


def same(a: Frames, b: Frames) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in vars(a))


def test_file_holds_what_was_simulated(tmp_path: Path) -> None:
    scenario = strip_scenario(seeds=2, duration_s=0.5)
    result = record_run(scenario, tmp_path / "run", replay=False)
    recording = read_recording(tmp_path / "run" / TRAJECTORY)
    assert recording.status == (Status.DONE, Status.DONE)
    for written, computed in zip(recording.seeds, result.trajectories, strict=True):
        assert len(written) == result.scene.n_frames
        assert np.array_equal(written.time, computed.time)
        assert np.array_equal(written.position, computed.position)
        assert written.quaternion == pytest.approx(computed.quaternion, abs=1e-7)
        assert written.velocity == pytest.approx(computed.velocity, abs=1e-7)
    with h5py.File(tmp_path / "run" / TRAJECTORY) as file:
        for name, unit in (("time", b"s"), ("position", b"m"), ("velocity", b"m/s")):
            assert file[f"seeds/000/{name}"].attrs["unit"] == unit
        again = parse_scenario(file.attrs["scenario"].decode(), file=Path("resolved.toml"))
    assert again == scenario


def test_frames_lie_on_the_solver_steps(tmp_path: Path) -> None:
    result = simulate(strip_scenario(duration_s=0.3, frames_per_second=1000.0))
    time = result.trajectories[0].time
    assert time[0] == 0.0
    assert np.diff(time) == pytest.approx(result.scene.frame_interval, rel=1e-9)
    assert time[-1] == pytest.approx(0.3, abs=result.scene.frame_interval)


@pytest.mark.parametrize("engine", ["impulse", "mujoco"])
def test_same_seed_gives_the_same_bits_whatever_the_workers(engine: str) -> None:
    scenario = strip_scenario(seeds=3, duration_s=0.4, engine=engine)
    one, two = (simulate(scenario, workers=n).trajectories for n in (1, 3))
    assert all(same(a, b) for a, b in zip(one, two, strict=True))
    assert not same(one[0], one[1])


def test_first_seeds_do_not_depend_on_how_many_follow() -> None:
    few, many = (simulate(strip_scenario(seeds=n, duration_s=0.1)).trajectories for n in (1, 2))
    assert same(few[0], many[0])


@pytest.mark.slow
@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGINT])
def test_stopped_run_leaves_a_readable_file(tmp_path: Path, repository: Path, sent: signal.Signals) -> None:
    folder = tmp_path / "run"
    scenario = repository / "scenarios/separation_100.toml"
    command = [sys.executable, "-m", "feeder_sim", "run", str(scenario), "--seeds", "2", "--out", str(folder)]
    process = subprocess.Popen(command, env=os.environ, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 120
        while time.monotonic() < deadline and not _blocks_written(folder / TRAJECTORY):
            time.sleep(0.1)
        process.send_signal(sent)
        code = process.wait(timeout=60)
    finally:
        process.kill()
    recording = read_recording(folder / TRAJECTORY)
    assert all(len(frames) >= 200 for frames in recording.seeds)
    assert all(np.isfinite(frames.position).all() for frames in recording.seeds)
    assert set(recording.status) == {Status.UNFINISHED}
    if sent == signal.SIGINT:
        assert code == 130
        assert (folder / "summary.json").is_file()


def test_full_disk_ends_the_run_with_one_line(tmp_path: Path, repository: Path) -> None:
    scenario = repository / "scenarios/drift_4750hz.toml"
    command = [sys.executable, "-m", "feeder_sim", "run", str(scenario), "--seeds", "4", "--out", str(tmp_path / "run")]

    def small_files() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (150_000, 150_000))

    done = subprocess.run(command, preexec_fn=small_files, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1 and "disk full" in done.stderr, done.stderr


def _blocks_written(path: Path) -> bool:
    try:
        return all(len(frames) >= 200 for frames in read_recording(path).seeds)
    except InputError:
        return False


def test_truncated_and_foreign_files_are_refused(tmp_path: Path) -> None:
    record_run(strip_scenario(), tmp_path / "run", replay=False)
    whole = (tmp_path / "run" / TRAJECTORY).read_bytes()
    cut = tmp_path / "cut.h5"
    cut.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"cut\.h5: not a readable trajectory file"):
        read_recording(cut)
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = 1.0
    with pytest.raises(InputError, match=r"foreign\.h5: schema: is None"):
        read_recording(tmp_path / "foreign.h5")
