"""Runs with refills: who is on the plate when, and picks per minute as counted by hand."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import hull_distances

from feeder_sim.engines.protocol import engine_class
from feeder_sim.errors import Divergence
from feeder_sim.measures.picking import picks_of
from feeder_sim.part.stable_poses import stable_poses
from feeder_sim.pool.work import Work
from feeder_sim.records.seed import ARRIVALS, Cause, Status, no_events, parts_removed
from feeder_sim.run.guard import Guard
from feeder_sim.run.prepare import prepare
from feeder_sim.run.run_folder import record_run
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.refill import refill, refill_frames
from feeder_sim.scene.start import generator

SPREAD = {"kind": "scattered"}
HEAP = {"kind": "heap", "diameter_mm": 12.0, "drop_height_mm": 1.0}
TO, BELOW, CYCLES = 6, 5, 5
PICK_S, LOOK_S = 0.8, 0.25
NUTS = {"shape": "hex_nut", "size": "M2.5", "count": 6, "start": SPREAD}
PEARLS = {"shape": "ball", "diameter_mm": 4.0, "count": 3, "start": SPREAD, "name": "pearl"}
STRONG = {"frequency_hz": 500.0, "amplitude_um": 20.0}
SHAKE = {"drive": [STRONG], "duration_s": 0.15, "pause_s": 0.05}
PICKING: dict[str, Any] = SHAKE | {"pick": {"clearance_mm": 7.0}}
RUN: dict[str, Any] = {"seeds": 3, "frames_per_second": 200.0}
DOCUMENT: dict[str, Any] = {
    "plate": {"kind": "piston", "length_mm": 32.0, "width_mm": 32.0},
    "schedule": {"cycles": CYCLES, "prepare": [SHAKE], "stage": [PICKING]},
    "part": [NUTS, PEARLS],
    "refill": {"to": TO, "below": BELOW, "start": HEAP},
    "robot": {"pick_s": PICK_S, "camera_s": LOOK_S},
    "run": RUN,
}


def scenario(**changes: Any) -> Scenario:
    """Nuts and balls on a piston from which some fall; the picks leave those that lie near each other."""
    return validated(DOCUMENT | changes, Scenario, Path("refilled"))


@pytest.fixture(scope="module")
def result() -> Result:
    return simulate(scenario())


def test_every_part_comes_and_goes_as_recorded(result: Result) -> None:
    """Frames, removals and arrivals say the same, and the refills bring what they are to bring."""
    came = 0
    for seed in result.seeds:
        assert seed.status == Status.DONE and len(seed.frames) == result.scene.n_frames
        present = seed.frames.present.copy()
        assert present[0].sum() == TO
        for frame in range(1, len(present)):
            expected = present[frame - 1].copy()
            time = seed.frames.time[frame - 1]
            expected[seed.removals.part[np.abs(seed.removals.time - time) < 1e-9]] = False
            expected[seed.arrivals.part[np.abs(seed.arrivals.time - time) < 1e-9]] = True
            assert (present[frame] == expected).all()
        for frame, cycle in refill_frames(result.scene).items():
            there = result.scene.on_plate(seed.frames[slice(frame, frame + 1)])[0]
            picked = parts_removed(
                seed.removals, Cause.PICKED, start=seed.frames.time[frame - 1], end=seed.frames.time[frame]
            )
            there[picked] = False
            arrived = seed.arrivals.part[seed.arrivals.cycle == cycle]
            assert len(arrived) == (TO - there.sum() if there.sum() < BELOW else 0)
            came += len(arrived)
    assert came > 10
    assert result.measures()["refilled"]["mean"] == pytest.approx(came / 3)
    assert result.measures()["not_refilled"]["mean"] == 0.0


def test_picks_per_minute_as_counted_by_hand(result: Result) -> None:
    """From the second cycle on, over simulated time and that of robot and camera."""
    found, rates, clocks = result.measures(), [], []
    for seed in result.seeds:
        late = (seed.removals.cause == Cause.PICKED) & (seed.removals.time > 0.2 + 0.2 + 0.02)
        clocks.append((CYCLES - 1) * (0.15 + 0.05 + LOOK_S) + PICK_S * late.sum())
        rates.append(60.0 * late.sum() / clocks[-1])
    assert found["counted_from_cycle"] == 2
    assert found["counted_s"]["mean"] == pytest.approx(np.mean(clocks))
    assert found["picks_per_minute"]["mean"] == pytest.approx(np.mean(rates)) and np.mean(rates) > 10.0
    assert found["picks_per_minute"]["sd"] == pytest.approx(np.std(rates, ddof=1))
    nuts, pearls = found["picks_per_minute_of_kind"]
    assert (nuts["kind"], pearls["kind"]) == ("hex_nut", "pearl") and pearls["poses"] == []
    total = sum(kind["picks_per_minute"]["mean"] for kind in (nuts, pearls))
    assert total == pytest.approx(np.mean(rates))
    in_poses = sum(pose["picks_per_minute"]["mean"] for pose in nuts["poses"])
    assert in_poses == pytest.approx(nuts["picks_per_minute"]["mean"])
    shares = {name: share["mean"] for name, share in found["time_shares"].items()}
    assert sum(shares.values()) == pytest.approx(1.0)
    assert shares["driving"] == pytest.approx(np.mean([(CYCLES - 1) * 0.15 / clock for clock in clocks]))
    assert shares["looks"] == pytest.approx(np.mean([(CYCLES - 1) * 0.25 / clock for clock in clocks]))


def test_threads_and_a_run_folder_change_nothing(result: Result, tmp_path: Path) -> None:
    recorded = record_run(scenario(), tmp_path / "run", replay=False)
    other = simulate(scenario(), work=Work(6))  # two threads for each seed
    for one, same, threaded in zip(result.seeds, recorded.seeds, other.seeds, strict=True):
        assert one.frames.position.tobytes() == same.frames.position.tobytes() == threaded.frames.position.tobytes()
        assert one.arrivals.height.tobytes() == same.arrivals.height.tobytes() == threaded.arrivals.height.tobytes()
    with (tmp_path / "run/picks.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(int((seed.removals.cause == Cause.PICKED).sum()) for seed in result.seeds)
    last: dict[str, int] = {}
    nut = stable_poses(result.scene.kinds[0])
    for row in rows:
        seed = result.seeds[int(row["seed"])]
        last[row["seed"]] = last.get(row["seed"], 0) + 1
        looks = int(row["cycle"])  # the stage that prepares has none
        clock = float(row["time_s"]) + looks * LOOK_S + last[row["seed"]] * PICK_S
        assert float(row["clock_s"]) == pytest.approx(clock, abs=1e-3)
        assert float(row["time_s"]) == pytest.approx(0.2 + 0.2 * looks, abs=0.006)
        frame = seed.frames.row_at(float(row["time_s"]) - 1e-4)
        away = 1e3 * seed.frames.position[frame, :, :2] - [float(row["x_mm"]), float(row["y_mm"])]
        part = int(np.abs(away).sum(axis=1).argmin())
        assert row["kind"] == ("hex_nut" if part < 6 else "pearl")
        attitude = seed.frames.quaternion[frame, part]
        if part >= 6:
            assert row["pose"] == ""
        else:
            number = int(nut.number(attitude))
            assert row["pose"] == ("none" if number < 0 else nut.names[number])
            assert float(row["yaw_deg"]) == pytest.approx(np.degrees(nut.yaw(attitude[None])[0]), abs=0.06)
    assert {row["kind"] for row in rows} == {"hex_nut", "pearl"}


@pytest.mark.parametrize(
    ("engine", "reaction"),
    [("impulse", False), ("mujoco", False), pytest.param("impulse", True, marks=pytest.mark.slow)],
)
def test_parts_that_are_added_move_as_parts_do(engine: str, reaction: bool) -> None:
    """They fall from where they were let go onto others and the plate, into which nothing sinks; none is in another."""
    plate = {"kind": "plate", "length_mm": 60.0, "width_mm": 60.0, "thickness_mm": 3.0}
    stage = PICKING | {"drive": [{"frequency_hz": 5000.0, "amplitude_um": 2.0}], "duration_s": 0.04, "pause_s": 0.02}
    schedule = {"cycles": 3, "stage": [stage | {"pick": {"clearance_mm": 8.0}}]}
    run = {"engine": engine, "seeds": 1, "frames_per_second": 1000.0, "reaction": reaction}
    varied = scenario(plate=plate, schedule=schedule, refill={"start": HEAP}, run=run)
    (seed,) = simulate(varied).seeds
    scene = prepare(varied).scene
    assert seed.status == Status.DONE and len(seed.arrivals) > 2
    assert hull_distances(scene, seed.frames).min() > -1.5e-4
    for time, part, height in zip(seed.arrivals.time, seed.arrivals.part, seed.arrivals.height, strict=True):
        after = seed.frames.row_at(time) + 1
        fallen = np.array([0.5 * 9.81 * (k * scene.frame_interval) ** 2 for k in (1, 2, 3)])
        assert seed.frames.position[after : after + 3, part, 2] == pytest.approx(height - fallen, abs=1e-5)


@pytest.mark.parametrize("engine", ["impulse", "mujoco"])
@pytest.mark.parametrize("count", [1, 3])
def test_a_plate_that_has_been_emptied_is_filled_again(engine: str, count: int) -> None:
    """Everything is picked in the first stage of a cycle; nothing is there in the second; then all parts are back."""
    alone = PICKING | {"duration_s": 0.03, "pick": {"clearance_mm": 0.001}}
    rest = {"drive": [STRONG], "duration_s": 0.03}
    varied = scenario(
        part=[NUTS | {"count": count}],
        schedule={"cycles": 3, "stage": [alone, rest]},
        refill={"start": SPREAD},
        run={"engine": engine, "seeds": 1, "frames_per_second": 500.0},
    )
    found = simulate(varied)
    (seed,) = found.seeds
    assert seed.status == Status.DONE
    middle = [seed.frames.row_at(t) for t in (0.05, 0.10, 0.16, 0.21, 0.27, 0.32)]
    assert seed.frames.present[middle].sum(axis=1).tolist() == [count, 0, count, 0, count, 0]
    per_minute = 60 * 2 * count / (2 * (0.11 + 0.25) + 1.6 * count)
    assert found.measures()["picks_per_minute"]["mean"] == pytest.approx(per_minute)


def test_what_is_added_at_once_is_added_in_an_engine_of_another_state() -> None:
    """An engine that restores the state after `add` goes on as the one it is of."""
    prepared = prepare(scenario())
    start, scene = engine_class(prepared.engine), prepared.scene
    one = start(scene, np.random.default_rng(0))
    one.advance(7)
    gone = np.flatnonzero(one.current().present[0])[:4]
    one.remove(gone)
    parts, poses = refill(scene, one.current(), generator(scene, 0, 1))
    one.add(parts, poses)
    assert len(parts) == 4
    now = one.current()
    assert now.present[0].sum() == TO
    for part, pose in zip(parts, poses, strict=True):
        assert now.position[0, part] == pytest.approx(pose.position, abs=1e-12)
        sign = np.sign(pose.quaternion @ now.quaternion[0, part])
        assert now.quaternion[0, part] == pytest.approx(sign * pose.quaternion)


def test_the_guard_knows_how_high_new_parts_start() -> None:
    """Without the arrivals it finds energy from nowhere."""
    still = PICKING | {"drive": [STRONG | {"amplitude_um": 0.01}]}
    high = {"kind": "scattered", "drop_height_mm": 100.0}
    varied = scenario(schedule={"cycles": 2, "stage": [still]}, refill={"start": high}, run=RUN | {"seeds": 1})
    (seed,) = simulate(varied).seeds
    assert seed.status == Status.DONE and len(seed.arrivals) > 0
    prepared = prepare(varied)
    engine = engine_class(prepared.engine)(prepared.scene, np.random.default_rng(0))
    frame = seed.frames.row_at(seed.arrivals.time[0])
    now = engine.current()
    now.time[:] = seed.frames.time[frame]
    now.position[0, seed.arrivals.part, 2] = seed.arrivals.height
    for arrivals, cause in ((seed.arrivals, None), (no_events(ARRIVALS), Divergence.TOO_MUCH_ENERGY)):
        guard = Guard(prepared, seed.frames[slice(0, 1)])
        guard.check(seed.frames[slice(1, frame + 1)], 0)
        guard.remember(frame)
        guard.arrive(arrivals, now)
        failure = guard.check(seed.frames[slice(frame + 1, None)], 0)[1]
        assert (failure.divergence if failure else None) == cause


def test_picks_without_a_robot_are_on_the_simulated_clock() -> None:
    found = simulate(scenario(robot=None, refill=None))
    for seed in found.seeds:
        picks = picks_of(found.scene, seed)
        assert (picks.clock == picks.time).all()
    assert found.measures()["counted_from_cycle"] == 1
    assert found.measures()["time_shares"]["picks"]["mean"] == 0.0
