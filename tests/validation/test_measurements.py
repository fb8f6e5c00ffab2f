"""Predictions against what was measured (D. Shi, EPFL thesis TH7124, 2016), and what the model's parts are worth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import piston_scenario, strip_scenario

from feeder_sim.measures.drift import drift_velocity, transport_speed
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import load_plate_file
from feeder_sim.scene.cell import transport_cell
from feeder_sim.scene.plate_modes import compute_modes

ENGINES = ["impulse", pytest.param("mujoco", marks=pytest.mark.slow)]
MEASURED_WITH_AMPLITUDE = [558.0, 1420.0, 2646.0, 2797.0, 6199.0, 6788.0]


def test_frequencies_of_the_180_mm_plate(repository: Path) -> None:
    computed = compute_modes(load_plate_file(repository / "models/plate_180/plate.toml"))
    found = {r.frequency: computed.modes.natural_frequency[r.mode] for r in computed.resonances}
    for measured in MEASURED_WITH_AMPLITUDE:
        assert found[measured] == pytest.approx(measured, rel=0.01)
    assert found[12314.0] == pytest.approx(12314.0, rel=0.005)


def test_stored_modes_are_the_computed_ones(repository: Path) -> None:
    stored = read_mode_file(repository / "models/plate_180/modes.h5")
    computed = compute_modes(load_plate_file(repository / "models/plate_180/plate.toml"))
    assert stored.modes.natural_frequency == pytest.approx(computed.modes.natural_frequency, rel=1e-6)
    assert [r.mode for r in stored.resonances] == [r.mode for r in computed.resonances]


def mid_path_speed(result: Result) -> Statistic:
    """Speed half way to the node [mm/s]; a seed that does not cross 0.6 - 0.4 counts with what it covered."""
    cell = transport_cell(result.scene)
    assert cell is not None
    speeds = []
    for frames in result.trajectories:
        speed = transport_speed(frames, cell, start=0.6, end=0.4)
        if not np.isfinite(speed):
            way = cell.distance_to_node(frames)
            speed = (way[0] - way[-1]) * cell.reach / frames.time[-1]
        speeds.append(speed * 1e3)
    return Statistic.of(speeds)


@pytest.mark.parametrize("engine", ENGINES)
def test_drift_is_carried_by_the_in_plane_velocity(engine: str) -> None:
    """Without it the mid-path speed at 4750 Hz falls to less than half."""
    x_mm = 0.38 * 19.49  # just before 0.6 of the way
    with_it, without = (
        mid_path_speed(
            simulate(strip_scenario(x_mm=x_mm, duration_s=6.0, seeds=8, in_plane_velocity=in_plane, engine=engine))
        )
        for in_plane in (True, False)
    )
    print(f"{engine}: mid-path speed {with_it.mean:.2f} +- {with_it.se:.2f} mm/s, ", end="")
    print(f"without in-plane velocity {without.mean:.2f} +- {without.se:.2f} mm/s")
    difference_se = np.hypot(without.se, 0.5 * with_it.se)
    assert without.mean + 2 * difference_se < 0.5 * with_it.mean


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("amplitude_um", [pytest.param(0.25, marks=pytest.mark.slow), 1.0])
def test_nothing_drifts_on_a_piston_plate(amplitude_um: float, engine: str) -> None:
    seeds = {"impulse": 96, "mujoco": 24}[engine]
    result = simulate(piston_scenario(amplitude_um=amplitude_um, duration_s=5.0, seeds=seeds, engine=engine))
    velocities = np.array([drift_velocity(frames) * 1e3 for frames in result.trajectories])
    for axis in (0, 1):
        drift = Statistic.of(velocities[:, axis])
        assert drift.se < 0.1
        assert abs(drift.mean) < 3 * drift.se
