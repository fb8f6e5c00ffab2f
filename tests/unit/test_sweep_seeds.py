"""How many seeds a point of a sweep gets: those asked for, or until the standard error is small enough."""

from __future__ import annotations

import math
from typing import Any

import pytest
from conftest import strip_scenario
from swept import AMPLITUDE, Pretended, over, plan_of, speed_of

from feeder_sim.errors import InputError
from feeder_sim.jobs.task import SeedValues
from feeder_sim.studies.sweep.case import Case, Effort


def test_more_seeds_where_the_interval_is_wide_fewer_where_nothing_happens() -> None:
    plan = plan_of(over(f"{AMPLITUDE}=0.5,1,4", seeds=8, until_se=0.03, measure="speed"), Pretended())
    rows = {rows[0].point[AMPLITUDE]: rows[0] for rows in plan.cases.rows}
    assert rows[0.5].found.n == 0
    counts = [len(case.done) for case in plan.cases]
    assert counts[0] == 4  # nothing happens
    assert counts[1] == 8
    assert counts[2] > 30
    assert rows[4].found.se <= 0.03 * rows[4].found.mean
    assert rows[4].found.se > 0.01 * rows[4].found.mean  # and not many more than it takes


def test_the_order_in_which_seeds_come_back_does_not_matter() -> None:
    effort = Effort(8, 0.02, 1000, "speed")
    wanted = []
    for order in (range(200), reversed(range(200))):
        case = Case(strip_scenario(), "")
        for seed in order:
            case.take((SeedValues(seed, {"speed": speed_of(4.0, seed)}, 0.1),))
        wanted.append(case.wanted(effort))
    assert wanted[0] == wanted[1] > 8


def test_a_single_arrival_does_not_end_a_sweep() -> None:
    """Of which no standard error is known."""
    effort, case = Effort(4, 0.03, 1000, "speed"), Case(strip_scenario(), "")
    case.take(tuple(SeedValues(seed, {"speed": math.nan if seed else 1.0}, 0.1) for seed in range(4)))
    assert case.wanted(effort) == 8
    case.take(tuple(SeedValues(seed, {"speed": (-1.0) ** seed}, 0.1) for seed in range(8)))  # mean 0
    assert case.wanted(effort) == 16


def done_with(values: list[float]) -> Case:
    """A case whose first seeds have come back."""
    case = Case(strip_scenario(), "")
    case.take(tuple(SeedValues(seed, {"speed": value}, 0.1) for seed, value in enumerate(values)))
    return case


@pytest.mark.parametrize("seeds", [1, 2, 5])
def test_few_values_that_happen_to_lie_together_do_not_end_a_point(seeds: int) -> None:
    effort = Effort(seeds, 0.03, 1000, "speed")
    assert done_with([10.0, 10.001]).wanted(effort) == 4  # the first look
    assert done_with([10.0, 10.001, 10.0, 10.001]).wanted(effort) == 8
    assert done_with([10.0, 10.001] * 4).wanted(effort) == 8
    few = [10.0, 10.001, *[math.nan] * 6]
    assert done_with(few).wanted(effort) == 16  # two values are not eight, whatever their standard error
    assert done_with([10.0, 10.0, math.nan, math.nan]).wanted(effort) == 8  # two of the same value are not all


def test_points_that_do_not_get_there_are_counted() -> None:
    asked: dict[str, Any] = {"until_se": 0.01, "measure": "speed", "most_seeds": 40}
    plan = plan_of(over(f"{AMPLITUDE}=0.5,1,4", **asked), Pretended())
    assert plan.all_done and plan.cases.short == 1
    nothing, sure, scattered = (len(case.done) for case in plan.cases)
    assert nothing == 4 and 8 < sure < 40 and scattered == 40
    assert over(f"{AMPLITUDE}=1,2", **asked, seeds=60).effort(strip_scenario()).most_seeds == 60
    for wrong in ({"seeds": -1}, {"inputs": 1}, {"most_seeds": 7}):
        with pytest.raises(InputError, match=f"{next(iter(wrong))}: is .*, allowed is greater than or equal to"):
            over(f"{AMPLITUDE}=1,2", **asked | wrong)
