"""Several parts without a step (`run.tolerance_nm`): heaps, stacks and trays, and the same bits with any threads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import judged_crowds
import numpy as np
import pytest
from conftest import REPOSITORY
from invariants import growth, recorded
from tray_theory import CASES, INCLINED, QUICK, Case, speed_in_engine, speed_of_point

from feeder_sim import load_scenario, simulate
from feeder_sim.engines.impulse.free_part.engine import FreePartEngine
from feeder_sim.engines.impulse.joint.engine import JointEngine
from feeder_sim.records.seed import Counts
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.scene import build_scene

WITHIN = 2e-4  # of the speed of the point, which has converged to that
BLOCK = {"shape": "box", "size_mm": [6.0, 5.0, 2.0]}


def stacked(count: int, **contact: float) -> Scenario:
    """Blocks above each other, a little apart, each turned a little further."""
    parts = []
    for i in range(count):
        half = 0.05 * i
        start = {"kind": "state", "position_mm": [0.1 * i, 0.0, 1.2 + 2.2 * i]}
        parts.append(BLOCK | {"start": start | {"quaternion": [float(np.cos(half)), 0.0, 0.0, float(np.sin(half))]}})
    raw = {
        "plate": {"kind": "still", "length_mm": 80.0, "width_mm": 80.0},
        "part": parts,
        "contact": {"restitution": 0.3, "friction": 0.4, "part_restitution": 0.3, "part_friction": 0.4} | contact,
        "run": {"duration_s": 0.4, "seeds": 1, "frames_per_second": 500.0, "tolerance_nm": 10.0},
    }
    return Scenario.model_validate(raw)


def test_a_stack_comes_to_rest_and_gains_no_energy() -> None:
    scene, (frames,) = recorded(stacked(4))
    assert growth(scene, frames) < 1e-7
    assert not frames.velocity[-20:].any()
    np.testing.assert_allclose(frames.position[-1, :, 2], 1e-3 * (1.0 + 2.0 * np.arange(4)), atol=4e-6)


@pytest.mark.parametrize("seed", [5024, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (5003, 5009, 5015))])
def test_random_heaps_rest_out_of_each_other(seed: int) -> None:
    """A cylinder and a bracket; a ball that bounces by nanometres; parts that turn while they press each other."""
    raw: dict[str, Any] = judged_crowds.scene("heap", seed)
    made, (frames,) = recorded(validated(raw, Scenario, Path("heap.toml")))
    assert judged_crowds.broken("heap", raw, made, frames) == []


@pytest.mark.parametrize("case", [pytest.param(QUICK[0], marks=pytest.mark.slow), INCLINED[0]], ids=str)
def test_two_blocks_travel_as_points_do(case: Case) -> None:
    speed = speed_in_engine(case, count=2, duration=3.0, seeds=1, tolerance_nm=0.1).speed.mean()
    assert abs(float(speed) / speed_of_point(case) - 1.0) < WITHIN


@pytest.mark.slow
def test_blocks_travel_as_points_do_in_every_gait() -> None:
    off = {
        str(case): float(speed_in_engine(case, count=2, duration=3.0, seeds=1, tolerance_nm=0.1).speed.mean())
        / speed_of_point(case)
        - 1.0
        for case in (*CASES, *INCLINED)
    }
    assert max(map(abs, off.values())) < WITHIN, off


def test_one_part_moves_as_in_the_engine_of_one() -> None:
    scenario = stacked(1)
    one, several = (
        engine(build_scene(scenario), np.random.default_rng(0)).advance(60) for engine in (FreePartEngine, JointEngine)
    )
    np.testing.assert_allclose(several.position, one.position, atol=1e-7)


def test_threads_change_nothing() -> None:
    scenario = load_scenario(REPOSITORY / "scenarios/refill_nuts.toml")
    changed = scenario.changed({"run.tolerance_nm": 100.0, "run.seeds": 1})
    positions = []
    for threads in (1, 3):
        engine = JointEngine(build_scene(changed), np.random.default_rng(0), threads=threads)
        positions.append(engine.advance(30).position)
    np.testing.assert_array_equal(positions[0], positions[1])


def test_counts_are_of_all_windows() -> None:
    engine = JointEngine(build_scene(stacked(2)), np.random.default_rng(0))
    engine.advance(1)
    for work in (engine._joint_tools[0].work, engine._joint_tools[0].together.work):
        work.counts[:] += 1
    engine.advance(10)
    assert min(engine.counts) >= 2


def test_parts_above_one_that_is_removed_fall() -> None:
    engine = JointEngine(build_scene(stacked(3)), np.random.default_rng(0))
    engine.advance(150)
    engine.remove(np.array([0]))
    frames = engine.advance(50)
    np.testing.assert_allclose(frames.position[-1, 1:, 2], [1e-3, 3e-3], atol=4e-6)
    assert not frames.present[-1, 0]


def test_a_cycle_of_refill_runs_through() -> None:
    scenario = load_scenario(REPOSITORY / "scenarios/refill_nuts.toml").changed(
        {"run.tolerance_nm": 100.0, "run.seeds": 1, "schedule.cycles": 1}
    )
    result = simulate(scenario, workers=1)
    assert not result.failures
    assert result.seeds[0].counts == Counts() or result.seeds[0].counts.late_contacts < 50
