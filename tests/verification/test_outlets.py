"""Outlets against closed forms, books of parts that must balance, and the same runs without outlets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from feeder_sim import Result, simulate
from feeder_sim.records.seed import Cause, Seed
from feeder_sim.scenario import Scenario

G = 9.81
BLOCK = {"shape": "box", "size_mm": [10.0, 10.0, 5.0]}
STILL = {"kind": "still", "length_mm": 400.0, "width_mm": 200.0}
TRAY = {"kind": "tray", "length_mm": 200.0, "width_mm": 100.0}
CONVEYS = [{"frequency_hz": 50.0, "stroke_um": 800.0, "angle_deg": 25.0}]
CONTACT = {"restitution": 0.2, "friction": 0.4}
# 14 blocks that are conveyed over the end of the tray.
CROWD: dict[str, Any] = BLOCK | {"count": 14, "start": {"kind": "scattered", "size_mm": [90.0, 80.0]}}
BESIDE = {"name": "beside", "outline_mm": [[100.0, -80.0], [160.0, -80.0], [160.0, 80.0], [100.0, 80.0]]}
AT_RIGHT = {"name": "right", "outline_mm": [[50.0, -60.0], [200.0, -60.0], [200.0, 60.0], [50.0, 60.0]]}


def computed(seeds: int = 1, duration_s: float = 1.0, **tables: Any) -> Result:
    run = {"duration_s": duration_s, "seeds": seeds, "frames_per_second": 100.0}
    return simulate(Scenario.model_validate({"contact": CONTACT, "run": run} | tables))


def thrown(x_mm: float, speed_mm_s: float) -> dict[str, Any]:
    start = {"kind": "state", "position_mm": [x_mm, 0.0, 2.5], "velocity_mm_s": [speed_mm_s, 0.0, 0.0]}
    return BLOCK | {"start": start}


def through(seed: Seed) -> Any:
    return seed.removals[seed.removals.cause == Cause.OUTLET]


def over(outlet: dict[str, Any], position: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which places (..., 3) [m] are over the outline of an outlet that is a rectangle."""
    corners = 1e-3 * np.array(outlet["outline_mm"])
    inside = (position[..., :2] >= corners.min(axis=0)) & (position[..., :2] <= corners.max(axis=0))
    return np.asarray(inside.all(axis=-1))


@pytest.mark.parametrize("outlet", [BESIDE, AT_RIGHT])
def test_parts_gone_and_present_add_up_to_those_started_and_arrived_at_every_frame(outlet: dict[str, Any]) -> None:
    refill = {"every_s": 0.25, "to": 8}
    result = computed(3, 2.0, plate=TRAY, drive=CONVEYS, part=[CROWD], outlet=[outlet], refill=refill)
    assert all(len(through(seed)) for seed in result.seeds)
    for seed in result.seeds:
        frames, half = seed.frames, 0.5 * result.scene.frame_interval
        removed = np.searchsorted(seed.removals.time, frames.time - half)
        came = np.searchsorted(seed.arrivals.time, frames.time - half)
        assert np.array_equal(removed + frames.present.sum(axis=1), 8 + came)
        entered = over(outlet, frames.position) & frames.present
        rows, parts = np.nonzero(entered)
        assert len(rows) == len(through(seed))  # each for one frame only
        passed = through(seed)
        assert set(zip(frames.time[rows], parts, strict=True)) == set(zip(passed.time, passed.part, strict=True))


def test_a_refill_keeps_the_number_up() -> None:
    tables = {"plate": TRAY, "drive": CONVEYS, "part": [CROWD], "outlet": [AT_RIGHT]}
    result = computed(2, 2.0, **tables, refill={"every_s": 0.25, "to": 8})
    for seed in result.seeds:
        assert len(through(seed)) > 14  # numbers of parts that have left come again
        looks = [seed.frames.row_at(time) + 1 for time in np.arange(0.25, 1.9, 0.25)]
        there = result.scene.on_plate(seed.frames)
        assert (there[looks].sum(axis=1) == 8).all()


def test_a_run_is_the_same_to_the_bit_until_the_first_part_has_entered() -> None:
    tables = {"plate": TRAY, "drive": CONVEYS, "part": [CROWD]}
    without = computed(2, 1.0, **tables)
    for seed, free in zip(computed(2, 1.0, **tables, outlet=[AT_RIGHT]).seeds, without.seeds, strict=True):
        first = int(np.argmax(over(AT_RIGHT, free.frames.position).any(axis=1)))
        assert seed.frames.time[first] == through(seed).time[0]
        assert np.array_equal(seed.frames.position[: first + 1], free.frames.position[: first + 1])
        assert np.array_equal(seed.frames.velocity[: first + 1], free.frames.velocity[: first + 1])
        removed = through(seed).part[through(seed).time == seed.frames.time[first]]
        assert seed.frames.present[first, removed].all()
        assert not seed.frames.present[first + 1, removed].any()


@pytest.mark.parametrize("engine", ["impulse", "mujoco"])
def test_a_block_that_slides_enters_when_friction_says(engine: str) -> None:
    mu, speed, distance = 0.02, 0.2, 0.02
    outlet = {"name": "out", "box_mm": [[0.0, -10.0, 0.0], [30.0, 10.0, 20.0]]}
    run = {"duration_s": 1.0, "seeds": 1, "frames_per_second": 1000.0, "engine": engine}
    contact = {"restitution": 0.2, "friction": mu}
    result = computed(plate=STILL, part=[thrown(-20.0, 1e3 * speed)], outlet=[outlet], contact=contact, run=run)
    expected = (speed - np.sqrt(speed**2 - 2.0 * mu * G * distance)) / (mu * G)
    [time] = through(result.seeds[0]).time
    assert 0.0 <= time - expected <= result.scene.frame_interval * (1.0 if engine == "impulse" else 2.0)
    assert result.seeds[0].status.name == "DONE"
    assert result.seeds[0].frames.time[-1] == time
    assert result.outlets.throughput_per_min.mean == pytest.approx(60.0 / time)


def test_a_part_that_starts_in_an_outlet_is_gone_after_the_first_frame() -> None:
    start = {"kind": "placed", "places_mm_deg": [[0.0, 0.0, 0.0], [60.0, 0.0, 0.0]]}
    part = BLOCK | {"count": 2, "start": start}
    seed = computed(plate=STILL, part=[part], outlet=[AT_RIGHT], duration_s=0.1).seeds[0]
    assert through(seed).tolist() == [(0.0, 1, Cause.OUTLET, 0)]
    assert seed.frames.present[:, 1].tolist() == [True] + [False] * 10
    assert seed.frames.present[:, 0].all()


def test_blocks_down_an_inclined_tray_pass_as_their_speed_says() -> None:
    tilt, mu, start = np.radians(10.0), 0.1, [-80.0, -50.0, -20.0, 10.0]
    places = [[x, 0.0, 0.0] for x in start]
    part = BLOCK | {"count": 4, "start": {"kind": "placed", "places_mm_deg": places, "drop_height_mm": 0.0}}
    tray = {"kind": "tray", "length_mm": 200.0, "width_mm": 100.0, "tilt_deg": -10.0}
    still = [{"frequency_hz": 50.0, "stroke_um": 1e-6, "angle_deg": 0.0}]
    run = {"duration_s": 1.0, "seeds": 1, "frames_per_second": 1000.0}
    outlet = {"name": "low", "outline_mm": [[50.0, -50.0], [90.0, -50.0], [90.0, 50.0], [50.0, 50.0]]}
    contact = {"restitution": 0.0, "friction": mu}
    result = computed(plate=tray, drive=still, part=[part], outlet=[outlet], contact=contact, run=run)
    passed, frames = through(result.seeds[0]), result.seeds[0].frames
    acceleration = G * (np.sin(tilt) - mu * np.cos(tilt))
    distance = (0.05 - frames.position[0, passed.part, 0]) / np.cos(tilt)
    expected = np.sqrt(2.0 * distance / acceleration)
    assert passed.part.tolist() == [3, 2, 1, 0]
    assert passed.time == pytest.approx(expected + 0.5 * result.scene.frame_interval, abs=result.scene.frame_interval)
