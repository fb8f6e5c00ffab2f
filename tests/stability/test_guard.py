"""A run that leaves the range of valid states stops with time, part and cause, and keeps what it computed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import piston_scenario, strip_scenario

from feeder_sim.engines import mujoco as engine_module
from feeder_sim.guard import Guard
from feeder_sim.scenario import Contact, Start
from feeder_sim.scene import build_scene
from feeder_sim.simulation import simulate
from feeder_sim.trajectory import Frames, Status
from feeder_sim.trajectory_file import read_recording

TUNNELLING = """
[plate]
kind = "piston"
[[drive]]
frequency_hz = 50.0
amplitude_um = 1.0
[[part]]
shape = "hex_nut"
size = "M2.5"
[part.start]
drop_height_mm = 20000.0      # arrives at 20 m/s: 10 mm per step of 0.5 ms, through a plate of 3 mm
tilt_deg = 0.0
[run]
engine = "mujoco"
duration_s = 5.0
seeds = 2
"""


def test_tunnelling_part_stops_the_run_and_keeps_its_frames(tmp_path: Path) -> None:
    scenario, folder = tmp_path / "fast.toml", tmp_path / "run"
    scenario.write_text(TUNNELLING)
    command = [sys.executable, "-m", "feeder_sim", "run", str(scenario), "--out", str(folder), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    lines = done.stderr.splitlines()
    assert len(lines) == 2 and all("part_0 at 2.0" in line and "below the plate" in line for line in lines)
    recording = read_recording(folder / "trajectory.h5")
    assert recording.status == (Status.DIVERGED, Status.DIVERGED)
    for frames in recording.seeds:
        assert frames.time[-1] == pytest.approx(np.sqrt(2 * 20 / 9.81), abs=0.01)
        assert (frames.position[:, 0, 2] > 0).all()


def test_slow_part_on_the_same_plate_does_not_tunnel() -> None:
    scenario = piston_scenario(
        frequency_hz=50.0,
        amplitude_um=1.0,
        start=Start(drop_height_mm=(20.0, 20.0), tilt_deg=(0.0, 0.0)),
        duration_s=0.5,
    )
    assert simulate(scenario).seeds[0].status == Status.DONE


def test_non_finite_state_is_noticed_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    original = engine_module.MujocoEngine.advance

    def poisoned(self: engine_module.MujocoEngine, n_frames: int) -> object:
        if self.data.time > 0.3:
            self.data.qvel[3] = np.nan
        return original(self, n_frames)

    monkeypatch.setattr(engine_module.MujocoEngine, "advance", poisoned)
    result = simulate(strip_scenario(duration_s=2.0, engine="mujoco"))
    assert result.seeds[0].status == Status.DIVERGED
    (failure,) = result.failures
    assert "not finite" in failure.cause and failure.part == "part_0"
    assert 0.3 < failure.time_s < 0.7
    assert np.isfinite(result.trajectories[0].position).all()
    assert result.trajectories[0].time[-1] < failure.time_s


def test_part_that_falls_off_the_plate_is_counted_and_no_failure() -> None:
    result = simulate(piston_scenario(amplitude_um=0.0, start=Start(position_mm=(89.9, 0.0)), duration_s=1.0))
    assert result.failures == []
    assert result.seeds[0].status == Status.LEFT_PLATE
    assert result.summary()["left_plate"] == 1
    last = result.trajectories[0].position[-1, 0]
    assert last[2] < 0 and last[0] > 0.09


def test_earliest_violation_is_the_one_reported() -> None:
    scene = build_scene(strip_scenario())
    time = 0.002 * np.arange(100.0)
    position = np.tile([0.0, 0.0, 1e-3], (100, 1, 1))
    velocity = np.zeros((100, 1, 3))
    velocity[5:, 0, 2], position[50:] = 50.0, np.nan
    frames = Frames(
        time, position, np.tile([1.0, 0, 0, 0], (100, 1, 1)), velocity, velocity * 0, np.ones((100, 1), bool)
    )
    valid, failure = Guard(scene, frames[slice(1)]).check(frames, 0)
    assert failure is not None
    assert valid == 5 and "speed" in failure.cause and failure.time_s == pytest.approx(0.01)


@pytest.mark.parametrize("falls_at_mm", [0.0, 91.0])
def test_a_part_below_the_plate_is_lost_if_it_has_fallen_past_the_edge_else_a_failure(falls_at_mm: float) -> None:
    """Below the middle in the end, straight through it or from beside the plate; over two blocks of frames."""
    scene = build_scene(strip_scenario())
    time = 0.002 * np.arange(100.0)
    position, velocity = np.zeros((100, 1, 3)), np.zeros((100, 1, 3))
    position[:, 0, 0] = np.linspace(1e-3 * falls_at_mm, 0.0, 100)
    position[:, 0, 2] = 1e-3 - 0.5 * 9.81 * time**2
    velocity[:, 0, 2] = -9.81 * time
    frames = Frames(
        time, position, np.tile([1.0, 0.0, 0.0, 0.0], (100, 1, 1)), velocity, 0 * velocity, velocity[..., 0] == 0
    )
    guard = Guard(scene, frames[slice(1)])
    failures, lost = [], []
    for rows in (slice(0, 50), slice(50, 100)):
        failures.append(guard.check(frames[rows], 0)[1])
        lost += guard.lost(frames[rows])[:, 0].tolist()
        guard.remember(frames[rows])
    assert [failure is None for failure in failures] == [falls_at_mm > 0.0] * 2
    assert lost == [falls_at_mm > 0.0 and z < -0.05 for z in position[:, 0, 2]]


def test_a_part_that_dips_beside_the_edge_and_comes_back_is_watched_again() -> None:
    scene = build_scene(strip_scenario())
    position, still = np.zeros((3, 1, 3)), np.zeros((3, 1, 3))
    position[:, 0] = [[0.09, 0.0, -1e-3], [0.09, 0.0, 1e-3], [0.0, 0.0, -1e-3]]
    level = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1, 1))
    frames = Frames(0.002 * np.arange(3.0), position, level, still, still, np.ones((3, 1), bool))
    guard = Guard(scene, frames[slice(1)])
    assert guard.fallen(frames)[:, 0].tolist() == [True, False, False]
    assert guard.check(frames, 0)[0] == 2


def test_compliant_contact_of_five_steps_is_stable_and_hops_like_the_others() -> None:
    step_us = 1e6 / (4750 * 40)
    compliant = Contact(model="compliant", time_constant_us=5.0 * step_us)
    scenario = strip_scenario(duration_s=1.0, seeds=2).model_copy(update={"contact": compliant})
    result = simulate(scenario)
    assert [seed.status for seed in result.seeds] == [Status.DONE] * 2
    assert all(frames.position[100:, 0, 2].max() < 2e-3 for frames in result.trajectories)


@pytest.mark.parametrize("amplitude_um", [0.1, 1.0, 10.0, 90.0])
def test_strong_drives_stay_within_what_the_plate_can_give(amplitude_um: float) -> None:
    scenario = piston_scenario(frequency_hz=2797.0, amplitude_um=amplitude_um, duration_s=0.5, seeds=4)
    result = simulate(scenario)
    assert result.failures == []
    # At 90 um, 1.6 m/s, nuts hop 20 cm high, and some of them off the plate.
    allowed = {Status.DONE, Status.LEFT_PLATE} if amplitude_um > 10.0 else {Status.DONE}
    assert {seed.status for seed in result.seeds} <= allowed
