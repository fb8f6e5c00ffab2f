from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import piston_scenario
from numpy.typing import ArrayLike, NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.bounces import (
    LAST_IMPACTS,
    PERIODS,
    batched,
    expected_interval,
    flights,
    motion,
    settling_time,
)
from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.seed import IMPACTS, Events, impacts_of, no_events
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.run.run_folder import SUMMARY, record_run
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Ball, Contact, Drive, Scenario, Slide, Start
from feeder_sim.scene.scene import build_scene

PERIOD = 0.02
TOLERANCE = 1e-3


def contacts(
    time: ArrayLike, lasting: ArrayLike = 0.0, approach: ArrayLike = 1.0, departure: ArrayLike = 0.2
) -> Events:
    """Impacts from times and durations; what is one number holds for all."""
    time, lasting, approach, departure = np.broadcast_arrays(time, lasting, approach, departure)
    return impacts_of(np.column_stack([time, np.add(time, lasting), approach, departure]).astype(float))


def every_period(n: int, *, lasting: ArrayLike = 0.0, approach: ArrayLike = 1.0) -> Events:
    return contacts(PERIOD * np.arange(n), lasting, approach)


def named(impacts: Events, *, end: float | None = None) -> str:
    return motion(impacts, PERIOD, TOLERANCE, end=float(impacts.time[-1]) + PERIOD if end is None else end)


def slide_scenario(*drives: Drive, drop_mm: tuple[float, float] = (0.05, 0.05), e: float = 0.5, **run: Any) -> Scenario:
    ball = Ball(shape="ball", diameter_mm=3.0, guide=Slide(kind="slide"), start=Start(drop_height_mm=drop_mm))
    return piston_scenario(drive=drives, part=ball, contact=Contact(restitution=e), **({"duration_s": 0.5} | run))


def test_flights_count_from_a_plate_period_on_and_from_the_end_of_a_contact() -> None:
    # Intervals in plate periods: 1.2, 0.995, 0.985 (chatter), 1.5 after a ride of 0.7, 0.3 (chatter), 3.
    time = PERIOD * np.array([0.0, 1.2, 2.195, 3.18, 5.38, 5.68, 8.68])
    lasting = PERIOD * np.array([0.0, 0.0, 0.0, 0.7, 0.0, 0.0, np.inf])
    approach, departure = np.arange(1.0, 8.0), 0.1 * np.arange(1.0, 8.0)
    found = flights(contacts(time, lasting, approach, departure), PERIOD, 5.0)
    assert found.interval == pytest.approx(PERIOD * np.array([1.2, 0.995, 1.5, 3.0]), rel=1e-9)
    assert found.height == pytest.approx(np.array([0.1, 0.2, 0.4, 0.6]) ** 2 / 10.0)
    assert found.impact_speed == pytest.approx([2.0, 3.0, 5.0, 7.0])


def test_flights_that_begin_before_the_plate_has_settled_do_not_count() -> None:
    impacts = contacts(PERIOD * np.array([0.0, 2.0, 5.0, 9.0, 14.0]))
    for after, expected in [(0.0, [2.0, 3.0, 4.0, 5.0]), (2.0, [3.0, 4.0, 5.0]), (2.1, [4.0, 5.0]), (9.1, [])]:
        found = flights(impacts, PERIOD, GRAVITY, after=after * PERIOD)
        assert found.interval == pytest.approx(PERIOD * np.array(expected))


CHAOS = np.random.default_rng(0).uniform(0.5, 1.0, 200)
HALF, THIRD = (np.resize(0.3 * PERIOD * (np.arange(n) == 0), 200) for n in (2, 3))  # of the contacts last


@pytest.mark.parametrize(
    ("approach", "lasting", "expected"),
    [
        *((np.resize(1.0 + 0.01 * np.arange(n), 200), 0.0, str(n)) for n in PERIODS),
        (np.resize([1.0, 1.0 + 0.9 * TOLERANCE], 200), 0.0, "1"),
        (np.resize([1.0, 1.0 + 1.1 * TOLERANCE], 200), 0.0, "2"),
        (CHAOS, 0.0, "chaotic"),
        (CHAOS, HALF, "sticking"),
        (CHAOS, THIRD, "chaotic"),
        (CHAOS, 0.5 * TOLERANCE * PERIOD, "chaotic"),  # as long as a contact takes in MuJoCo
        (np.ones(LAST_IMPACTS), 0.0, "undecided"),
        (np.ones(LAST_IMPACTS + 1), 0.0, "1"),
    ],
)
def test_motion_is_named_by_its_impacts(approach: NDArray[np.float64], lasting: ArrayLike, expected: str) -> None:
    """By the number of them after which speeds repeat, and by how many flights end in rest."""
    assert named(every_period(len(approach), lasting=lasting, approach=approach)) == expected


def test_without_impacts_there_are_no_flights() -> None:
    assert len(flights(no_events(IMPACTS), PERIOD, GRAVITY).interval) == 0
    assert motion(no_events(IMPACTS), PERIOD, TOLERANCE, end=1.0) == "undecided"


def test_only_the_last_impacts_are_looked_at() -> None:
    rng = np.random.default_rng(0)
    speeds = np.concatenate([rng.uniform(0.5, 1.0, 100), np.resize([1.0, 0.8], LAST_IMPACTS + 1)])
    assert named(every_period(len(speeds), approach=speeds)) == "2"
    speeds[-LAST_IMPACTS // 2] = 0.7
    assert named(every_period(len(speeds), approach=speeds)) == "chaotic"


def test_chatter_before_a_rest_is_no_flight() -> None:
    """One flight per plate period, then ten short hops and rest."""
    hops = np.concatenate([[0.0], 0.5 + 0.02 * np.arange(10.0)])
    time = PERIOD * (np.arange(30.0)[:, None] + hops).ravel()
    lasting = np.resize(np.concatenate([np.zeros(10), [0.2 * PERIOD]]), len(time))
    speeds = np.random.default_rng(0).uniform(0.5, 1.0, len(time))
    assert named(contacts(time, lasting, speeds)) == "sticking"


def test_a_part_that_stays_on_the_plate_to_the_end_is_resting() -> None:
    impacts = every_period(200, lasting=np.concatenate([np.zeros(199), [np.inf]]))
    last = float(impacts.time[-1])
    assert named(impacts, end=last + 3.0 * PERIOD) == "resting"
    assert named(impacts, end=last + PERIOD) == "1"  # it may lift off yet
    only = impacts[slice(-1, None)]
    assert named(only, end=last + 3.0 * PERIOD) == "resting"


def autoregressive(n: int, memory: float, seed: int) -> NDArray[np.float64]:
    values, noise = np.zeros(n), np.random.default_rng(seed).normal(size=n)
    for i in range(1, n):
        values[i] = memory * values[i - 1] + noise[i]
    return values


def test_standard_error_allows_for_correlation_of_neighbours() -> None:
    """Of values x' = 0.95 x + noise the mean is sqrt(1.95 / 0.05) = 6.2 times as uncertain as of independent ones."""
    seeds = [autoregressive(5000, 0.95, seed) for seed in range(4)]
    found, naive = batched(seeds), Statistic.of(np.concatenate(seeds))
    assert (found.mean, found.sd, found.n) == (naive.mean, naive.sd, 20_000)
    assert 4.0 < found.se / naive.se < 9.0
    independent = np.random.default_rng(0).normal(size=20_000)
    assert batched([independent]).se == pytest.approx(independent.std() / math.sqrt(20_000), rel=0.4)
    few = independent[:30]
    assert batched([few[:10], few[10:10], few[10:]]) == Statistic.of(few)
    assert batched([]).as_dict() == {"mean": None, "sd": None, "se": None, "n": 0}


def test_the_plate_has_settled_five_time_constants_after_its_last_drive_began() -> None:
    ringing = Drive(frequency_hz=100.0, amplitude_um=10.0, damping_ratio=0.01, start_s=0.3)
    late = Drive(frequency_hz=300.0, amplitude_um=10.0, ring_up=False, start_s=2.0)
    settled = 0.3 + 5.0 / (0.01 * 2.0 * math.pi * 100.0)
    assert settling_time(build_scene(slide_scenario(ringing))) == pytest.approx(settled)
    assert settling_time(build_scene(slide_scenario(late))) == 2.0
    assert settling_time(build_scene(slide_scenario(ringing, late))) == 2.0
    assert settling_time(build_scene(slide_scenario(late.model_copy(update={"start_s": 0.0}), ringing))) == settled


def test_expected_interval_of_the_bouncing_ball() -> None:
    assert expected_interval(558.0, 90e-6, 0.2, GRAVITY) == pytest.approx(0.07720, abs=5e-6)


def test_measures_of_period_one_motion() -> None:
    """One flight of g T^2 / 8 per period, that ends at g T / (1 + e) relative to the plate."""
    plate = Drive(frequency_hz=50.0, amplitude_um=230.0, ring_up=False)
    scenario = slide_scenario(plate, drop_mm=(1.7, 1.7), e=0.2, duration_s=6.0, seeds=2)
    measures: dict[str, Any] = simulate(scenario).measures()
    assert measures["motion"] == {"1": 2}
    interval, height, speed = (measures[n] for n in ("bounce_interval_ms", "flight_height_mm", "impact_speed_mm_s"))
    assert interval["mean"] == pytest.approx(1e3 * PERIOD, rel=1e-3)
    assert height["mean"] == pytest.approx(1e3 * GRAVITY * PERIOD**2 / 8.0, rel=2e-3)
    assert speed["mean"] == pytest.approx(1e3 * GRAVITY * PERIOD / 1.2, rel=1e-3)
    assert 590 < interval["n"] == height["n"] == speed["n"] < 600


def test_recording_gives_the_same_impacts_and_the_summary_their_measures(tmp_path: Path) -> None:
    # Many contacts over several blocks, the last of them still open; each seed has a drop height of its own.
    plate = Drive(frequency_hz=558.0, amplitude_um=3.0, damping_ratio=0.02, duration_s=0.6)
    scenario = slide_scenario(plate, drop_mm=(0.01, 0.05), duration_s=0.8, seeds=2, frames_per_second=5000.0)
    result = record_run(scenario, tmp_path / "run", replay=False)
    recording = read_recording(tmp_path / "run")
    impacts = [record.impacts for record in recording.records]
    assert len(impacts) == 2
    for read, seed in zip(impacts, result.seeds, strict=True):
        assert len(read) > 200
        assert np.isinf(read.until[-1]) and np.isnan(read.departure_velocity[-1])
        for name, values in vars(seed.impacts).items():
            assert getattr(read, name).tobytes() == values.tobytes()
    assert impacts[0].time[0] != impacts[1].time[0]
    summary = json.loads((tmp_path / "run" / SUMMARY).read_text())
    after = settling_time(result.scene)
    intervals = np.concatenate([flights(i, 1.0 / 558.0, GRAVITY, after=after).interval for i in impacts])
    assert summary["bounce_interval_ms"]["n"] == len(intervals) > 50
    assert summary["bounce_interval_ms"]["mean"] == pytest.approx(1e3 * intervals.mean())
    assert summary["motion"] == {"resting": 2}
