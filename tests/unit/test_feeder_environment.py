"""A feeder behind Gymnasium's interface."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from test_feeder import scenario, with_refill

pytest.importorskip("gymnasium")

import feeder_sim
from feeder_sim.errors import InputError
from feeder_sim.feeder.environment import FeederEnvironment
from feeder_sim.scenario import BendingPlate, Excitation, HexNut, Pick, Placed, Schedule, Stage


def environment(**changes: Any) -> FeederEnvironment:
    return FeederEnvironment(scenario(), **{"most_steps": 3} | changes)


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


def test_picks_can_be_the_reward_with_their_time_beside_them() -> None:
    """So that a sum of rewards over a sum of seconds is what a feeder is worth: picks per time."""
    env = FeederEnvironment(with_refill(), pick=Pick(clearance_mm=1.0), reward="picks")
    assert env.reset(seed=4)[1]["seconds"] == 0.0
    _, reward, _, _, info = env.step(np.int64(0))
    assert reward == info["picked"] == 4
    assert info["seconds"] == pytest.approx(info["time_s"] + 1.0 + 4 * 0.5)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"most_steps": 0}, "most_steps: is 0, must be a whole number from 1 on"),
        ({"most_steps": 2.5}, "most_steps: is 2.5, must be"),
        ({"refill_below": 1000}, "refill_below: is 1000, must be a whole number from 0 to 4"),
        ({"refill_below": -1}, "refill_below: is -1, must be"),
        ({"reward": "money"}, "reward: is 'money', must be rate, picks"),
        ({"pick": 3}, "pick: is 3, must be a Pick"),
        ({"pick": Pick(part="bolt", clearance_mm=1.0)}, 'pick.part: is "bolt", must be'),
    ],
)
def test_arguments_are_checked_before_any_step(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        FeederEnvironment(with_refill(), **changes)


@pytest.mark.parametrize("action", ["x", 1.7, None, 99, -1])
def test_an_action_is_the_number_of_a_stage(action: Any) -> None:
    env = environment()
    env.reset(seed=1)
    with pytest.raises(InputError, match=r"^action: is .*, must be a whole number from 0 to"):
        env.step(action)
    assert env.feeder.time == 0.0


def test_a_step_after_the_end_is_refused_until_a_reset() -> None:
    env = environment(most_steps=1)
    env.reset(seed=1)
    assert env.step(np.int64(0))[3]
    with pytest.raises(InputError, match=r"^step: comes after the end of an episode, must be `reset` first"):
        env.step(np.int64(0))
    env.reset(seed=1)
    assert env.step(np.int64(0))[3]


def test_a_refill_needs_one_in_the_scenario() -> None:
    with pytest.raises(InputError, match=r"refill_below: is 2, must be 0 without a \[refill\]"):
        environment(refill_below=2)


def test_bounds_are_those_of_the_plate() -> None:
    """A plate of 3 m: what lies 1.2 m from its middle is seen there."""
    place = Placed(kind="placed", places_mm_deg=((1200.0, 0.0, 0.0),))
    plate = BendingPlate(kind="plate", length_mm=3000.0, width_mm=400.0, thickness_mm=20.0, material="aluminium")
    slow = Stage(drive=(Excitation(frequency_hz=11.4, amplitude_um=1.0),), duration_s=0.1)
    large = scenario(plate=plate, part=(HexNut(size="M2.5", start=place),), schedule=Schedule(stage=(slow,)))
    env = FeederEnvironment(large)
    seen, _ = env.reset(seed=1)
    assert seen["position"][0, 0] == pytest.approx(1.2)
    bounds: Any = env.observation_space
    assert bounds["position"].high[0] == pytest.approx([1.5, 0.2, 3.0])
    assert bounds.contains(seen)


def test_it_is_public_where_gymnasium_is(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "FeederEnvironment" in dir(feeder_sim) and feeder_sim.FeederEnvironment is FeederEnvironment
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "feeder_sim.feeder.environment")
    assert "FeederEnvironment" not in dir(feeder_sim)  # or `help` would end in the error below
    with pytest.raises(
        InputError, match=r"^FeederEnvironment: needs the extra `gym`: pip install 'feeder_sim\[gym\]'$"
    ):
        getattr(feeder_sim, "FeederEnvironment")  # noqa: B009
    exec("from feeder_sim import *", {})
