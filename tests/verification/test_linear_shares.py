"""Linear shares of sums whose shares are known, with seeds that scatter, and of what is no such sum."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import strip_scenario

from feeder_sim.scenario import Scenario, Uncertain
from feeder_sim.scenario.changes import labels
from feeder_sim.studies.uncertainty.indices import saltelli_draws
from feeder_sim.studies.uncertainty.linear_shares import LinearShares, linear_shares
from feeder_sim.studies.uncertainty.spread import Draw, draws_of

AMPLITUDE, FRICTION, MATERIAL = "drive[0].amplitude_um", "contact.friction", "part[0].material"
INPUTS: dict[str, Any] = {
    AMPLITUDE: {"log_uniform": [1.0, 4.0]},
    FRICTION: {"uniform": [0.2, 0.5]},
    MATERIAL: {"choice": ["steel", "aluminium"]},
}
SCATTER = 0.5  # standard deviation of seeds


def scenario_of(inputs: dict[str, Any], seed: int = 0) -> Scenario:
    return strip_scenario(seed=seed).changed({"uncertain": inputs})


def with_seeds(exact: list[float], seeds: int = 2) -> list[list[float]]:
    random = np.random.default_rng(1)
    return [(value + random.normal(0.0, SCATTER, seeds)).tolist() for value in exact]


def summed(draw: Draw) -> float:
    """Variances by hand: 2.4^2 (ln 4)^2 / 12 = 0.9225, 4^2 0.3^2 / 12 = 0.12, 1 / 4."""
    return 2.4 * float(np.log(draw[AMPLITUDE])) + 4.0 * draw[FRICTION] + (1.0 if draw[MATERIAL] == "aluminium" else 0.0)


def check(found: LinearShares | None, *, widest: float) -> None:
    assert found
    total = 0.9225 + 0.12 + 0.25
    for input_, wanted in zip(found.inputs, (0.9225 / total, 0.12 / total, 0.25 / total), strict=True):
        assert input_.share == pytest.approx(wanted, abs=input_.interval) and input_.interval < widest
    assert found.explained == pytest.approx(1.0, abs=found.explained_interval) and found.explained_interval < widest


def test_shares_of_a_sum_of_straight_lines() -> None:
    scenario = scenario_of(INPUTS)
    draws = draws_of(scenario, 64)
    found = linear_shares(scenario, draws, with_seeds([summed(draw) for draw in draws]))
    assert found and [share.key for share in found.inputs] == list(INPUTS)
    check(found, widest=0.25)


@pytest.mark.filterwarnings("default")  # of SALib
def test_draws_for_sobol_indices_give_them_too() -> None:
    """16 base draws, whose Sobol indices would have intervals of +- 0.5 and more."""
    scenario = scenario_of(INPUTS)
    draws = saltelli_draws(scenario, 16)
    check(linear_shares(scenario, draws, with_seeds([summed(draw) for draw in draws]), group=5), widest=0.35)


def test_what_is_no_straight_line_is_not_explained() -> None:
    scenario = scenario_of({FRICTION: INPUTS[FRICTION]})
    draws = draws_of(scenario, 64)
    found = linear_shares(scenario, draws, with_seeds([300.0 * (draw[FRICTION] - 0.35) ** 2 for draw in draws]))
    assert found and abs(found.explained) < 0.1 and abs(found.inputs[0].share) < 0.1


def test_draws_without_a_value_do_not_count_and_too_few_tell_nothing() -> None:
    scenario = scenario_of(INPUTS)
    draws = draws_of(scenario, 64)
    values = with_seeds([summed(draw) for draw in draws])
    gaps = [*draws[:40], *({} for _ in draws[40:])], [*values[:40], *([] for _ in values[40:])]
    some, first = linear_shares(scenario, *gaps), linear_shares(scenario, draws[:40], values[:40])
    assert some and first and some.explained == first.explained
    assert linear_shares(scenario, draws[:7], values[:7]) is None
    assert linear_shares(scenario, draws, [row[:1] for row in values]) is None  # nobody knows how far seeds scatter
    assert linear_shares(scenario, draws, [[1.0, 2.0] for _ in draws]) is None  # not told apart from the seeds


def test_choices_from_a_table_are_those_of_the_scenario() -> None:
    """A table of draws gives numbers as decimals, and true and false as texts."""
    choices = {"part[0].count": Uncertain(choice=(1, 2, 3)), "plate.rim": Uncertain(choice=(False, True))}
    scenario = strip_scenario().model_copy(update={"uncertain": choices})
    draws = draws_of(scenario, 32)
    values = with_seeds([(draw["part[0].count"] == 2) + 2.0 * draw["plate.rim"] for draw in draws])
    read = [{key: float(v) if type(v) is int else str(v) for key, v in labels(draw).items()} for draw in draws]
    assert linear_shares(scenario, read, values) == linear_shares(scenario, draws, values)
