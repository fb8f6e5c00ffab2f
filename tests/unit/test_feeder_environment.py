"""A feeder behind Gymnasium's interface."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_feeder import scenario, with_refill

pytest.importorskip("gymnasium")

from feeder_sim.feeder.environment import FeederEnvironment
from feeder_sim.scenario import Pick


def environment(**changes: Any) -> FeederEnvironment:
    return FeederEnvironment(scenario(), most_steps=3, **changes)


def test_gymnasium_finds_nothing_wrong() -> None:
    from gymnasium.utils.env_checker import check_env

    check_env(environment(), skip_render_check=True)  # warnings are errors here


def test_reward_is_picks_per_second_on_the_clock() -> None:
    env = FeederEnvironment(with_refill(), pick=Pick(clearance_mm=1.0), most_steps=2, refill_below=3)
    env.reset(seed=4)
    seen, reward, over, cut, info = env.step(np.int64(0))
    assert info["picked"] == 4
    assert reward == pytest.approx(4 / (env.feeder.time + 1.0 + 4 * 0.5))
    assert seen["present"].sum() == 4  # filled in anew
    assert not over
    assert not cut
    assert env.step(np.int64(0))[3]


def test_an_episode_ends_with_the_last_part() -> None:
    env = environment(pick=Pick(clearance_mm=1.0))
    env.reset(seed=4)
    seen, _, over, _, _ = env.step(np.int64(0))
    assert over
    assert not seen["present"].any()
    assert not seen["position"].any()


def test_a_seed_decides_the_start_and_numbers_of_gymnasium_those_after_it() -> None:
    one, other = environment(), environment()
    for seed in (7, None):
        first, second = one.reset(seed=seed)[0], other.reset(seed=seed)[0]
        assert np.array_equal(first["position"], second["position"])
    assert not np.array_equal(one.reset(seed=7)[0]["position"], first["position"])
