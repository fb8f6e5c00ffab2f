from __future__ import annotations

import resource
import signal
import subprocess
import sys
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
    (alone,) = simulate(scenario.changed({"run.seeds": 1})).trajectories  # whatever seeds follow
    assert same(alone, one[0])


def test_full_disk_ends_the_run_with_one_line(tmp_path: Path, repository: Path) -> None:
    scenario = repository / "scenarios/drift_4750hz.toml"
    command = [sys.executable, "-m", "feeder_sim", "run", str(scenario), "--seeds", "4", "--out", str(tmp_path / "run")]

    def small_files() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (150_000, 150_000))

    done = subprocess.run(command, preexec_fn=small_files, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1 and "disk full" in done.stderr, done.stderr


def test_foreign_file_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = 1.0
    with pytest.raises(InputError, match=r"foreign\.h5: schema: is None"):
        read_recording(tmp_path / "foreign.h5")
