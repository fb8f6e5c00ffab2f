"""The separation experiment: gathering on nodal lines, picks, dead positions, and nuts that do not enter each other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import hull_distances
from pinned import LOST, PICKED

from feeder_sim.records.seed import Cause
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.scenario.tables import validated

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def shortened(name: str, *, count: int = 100, **run: Any) -> Scenario:
    """One cycle of a scenario."""
    path = SCENARIOS / name
    raw = load_scenario(path).model_dump(exclude_none=True)
    raw["schedule"]["cycles"] = 1
    raw["part"] = [{**raw["part"][0], "count": count}]
    raw["run"] |= run
    return validated(raw, Scenario, path)


@pytest.fixture(scope="module", params=[30, pytest.param(100, marks=pytest.mark.slow)])
def third_mode(request: pytest.FixtureRequest) -> Result:
    """Gather, separate, pick, free."""
    count = int(request.param)
    return simulate(shortened("separation_third_mode.toml", count=count, seeds=PICKED[count].seeds))


def stage(result: Result, name: str) -> dict[str, Any]:
    (found,) = (counts for counts in result.measures()["stages"] if counts["stage"] == name)
    return dict(found)


def test_nuts_gather_on_nodal_lines(third_mode: Result) -> None:
    gathered = stage(third_mode, "gather")
    assert gathered["on_plate"]["mean"] > 0.8 * len(third_mode.scene.parts)
    assert gathered["on_nodal_line"]["mean"] >= 0.8 * gathered["on_plate"]["mean"]


def test_picks_of_the_first_cycle(third_mode: Result) -> None:
    """Those that are lost fall over the edge while the nuts gather."""
    count, found = len(third_mode.scene.parts), third_mode.measures()
    assert PICKED[count].holds(found["picked"]["mean"])
    assert stage(third_mode, "separate")["picked"]["mean"] == found["picked"]["mean"]
    assert LOST[count].holds(found["lost"]["mean"])


def test_a_third_mode_frees_dead_positions(third_mode: Result) -> None:
    assert stage(third_mode, "separate")["dead"]["mean"] > 0.1 * len(third_mode.scene.parts)
    assert stage(third_mode, "free")["dead"]["mean"] <= 0.5 * stage(third_mode, "separate")["dead"]["mean"]


def test_no_nut_is_in_another_at_any_frame(third_mode: Result) -> None:
    for frames in third_mode.trajectories:
        assert np.isfinite(frames.position).all()
        assert hull_distances(third_mode.scene, frames).min() > -50e-6


@pytest.mark.slow
def test_engines_agree_on_picks() -> None:
    """Few enough nuts that MuJoCo takes a minute; the benchmark has more of everything."""
    picked = {}
    for engine in ("impulse", "mujoco"):
        result = simulate(shortened("separation_100.toml", count=10, engine=engine, seeds=4))
        assert not result.failures
        picked[engine] = [int((seed.removals.cause == Cause.PICKED).sum()) for seed in result.seeds]
    means = [np.mean(numbers) for numbers in picked.values()]
    spread = np.sqrt(sum(np.var(numbers, ddof=1) / len(numbers) for numbers in picked.values()))
    assert min(means) > 3.0
    assert abs(means[0] - means[1]) < 3.0 * max(spread, 0.5)
