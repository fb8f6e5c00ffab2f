"""Loops that look do better than those that do not, and a nut follows a letter."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY, StopsAfter
from greedy_picks import compare
from letter import letter_path, letter_scenario, steer
from prediction import GradientDrift

import feeder_sim
from feeder_sim.pool.work import Work
from feeder_sim.run.run_folder import record_run, resume_run
from feeder_sim.scenario import Scenario

MODES = REPOSITORY / "models" / "plate_180" / "modes.h5"


@pytest.mark.slow
def test_a_nut_follows_a_letter() -> None:
    """0.2 mm off on average, and 1.5 mm at most, in six runs of the N; a nut is 5 mm wide."""
    feeder = feeder_sim.Feeder(letter_scenario(MODES, "L"))
    way = steer(feeder, letter_path("L"), prediction=GradientDrift(feeder.scene))
    assert way.arrived
    assert way.length_mm == pytest.approx(52.0)
    assert np.linalg.norm(way.places[-1] - letter_path("L")[-1]) < 1.5e-3
    assert way.mean_deviation_mm < 0.5
    assert way.largest_deviation_mm < 2.5
    assert way.missed_mm < 2.5


@pytest.mark.slow
def test_who_looks_picks_faster_than_the_fixed_schedule() -> None:
    scenario = feeder_sim.load_scenario(REPOSITORY / "scenarios" / "separation_100.toml")
    part = scenario.part[0].model_copy(update={"count": 40})
    found = compare(scenario.model_copy(update={"part": (part,)}), range(3), share=0.5, seconds=6.0)
    difference = found.difference(-1, 0)
    assert difference.mean - 2.0 * difference.se > 0.0


@pytest.mark.slow
def test_a_sequence_goes_on_after_a_break(tmp_path: Path) -> None:
    """A run that is stopped again and again, each time later in its sequence, ends with the same bits."""
    made = _with_sequence()
    whole = record_run(made, tmp_path / "whole", replay=False)

    looks = 2
    result = record_run(made, tmp_path / "run", replay=False, work=Work(stop=StopsAfter(looks)))
    breaks = 0
    while result.interrupted:
        breaks, looks = breaks + 1, looks + 3  # its seed begins anew: with as many looks as before it would never end
        result = resume_run(tmp_path / "run", replay=False, work=Work(stop=StopsAfter(looks)))
    assert breaks > 1
    for name in ("time", "position", "present"):
        assert np.array_equal(getattr(result.trajectories[0], name), getattr(whole.trajectories[0], name))
    assert result.measures() == whole.measures()


def _with_sequence() -> Scenario:
    scenario = feeder_sim.load_scenario(REPOSITORY / "scenarios" / "separation_100.toml")
    raw: dict[str, Any] = scenario.model_dump(mode="json", exclude_none=True)
    raw["part"][0]["count"], raw["run"]["seeds"] = 8, 1
    raw["schedule"] |= {"cycles": 2, "sequence": ["gather", "separate", "separate"]}
    raw["schedule"]["stage"][0]["duration_s"] = 0.3
    raw["schedule"]["stage"][1]["pick"] = {"clearance_mm": 60.0}
    return Scenario.model_validate(raw)
