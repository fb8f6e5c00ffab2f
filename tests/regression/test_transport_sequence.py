"""Sequences of modes carry a nut over 75 mm: on a strip by the five modes of the source, on a rectangle by its own."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import REPOSITORY
from pinned import ARRIVAL_TIME, STATIONS

from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import load_scenario, with_run

MEASURED_S = 34.0  # D. Shi, EPFL thesis TH7124 (2016); with amplitudes it does not give


def ran(name: str, seeds: int) -> Result:
    return simulate(with_run(load_scenario(REPOSITORY / f"scenarios/{name}.toml"), seeds=seeds))


def check_arrived(result: Result, seeds: int) -> None:
    found = result.measures()
    assert found["at_goal"] == found["at_goal_of"] == seeds
    for frames in result.trajectories:
        assert 0.073 <= np.hypot(*(frames.position[-1, 0, :2] - frames.position[0, 0, :2])) <= 0.077
        assert abs(frames.position[-1, 0, 0]) <= 2e-3
    assert [stage["settled"] for stage in found["transport_stages"]] == [seeds] * len(found["transport_stages"])


def test_five_modes_of_a_strip_carry_every_nut() -> None:
    seeds = ARRIVAL_TIME.seeds
    result = ran("transport_strip", seeds)
    check_arrived(result, seeds)
    time = result.measures()["arrival_time_s"]
    print(f"\nstrip: {time['mean']:.1f} +- {time['sd']:.1f} s (SD), measured {MEASURED_S} s")
    assert abs(time["mean"] - MEASURED_S) < 3.0
    assert ARRIVAL_TIME.holds(time["mean"])
    stations = [stage["x_mm"]["mean"] for stage in result.measures()["transport_stages"]]
    assert np.abs(np.array(stations) - [-44.1, -35.7, -23.1, -14.5, 0.0]).max() < 1.1
    assert all(pinned.holds(station) for pinned, station in zip(STATIONS, stations, strict=True)), stations


@pytest.mark.slow
def test_six_modes_of_a_rectangle_carry_every_nut() -> None:
    result = ran("transport_rectangle", 2)
    check_arrived(result, 2)
    assert max(abs(frames.position[:, 0, 1]).max() for frames in result.trajectories) < 6e-3  # it keeps to the line
