"""Error budgets: what is in them, what they add up to, and what they say."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY

from feeder_sim import open_study
from feeder_sim.scenario import load_scenario
from feeder_sim.studies.budget import BudgetQuestion

SCENARIO = REPOSITORY / "scenarios/drift_8775hz.toml"
INPUTS = (
    '[uncertain]\ncontact.restitution = { uniform = [0.1, 0.5] }\n"part[0].start.tilt_deg" = { choice = [0.0, 1.0] }\n'
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("budget")
    file = place / "mine.toml"
    file.write_text(SCENARIO.read_text(encoding="utf-8") + INPUTS, encoding="utf-8")
    done = feeder_sim("budget", file, "--seeds", 16, "--inputs", 24, "--out", place / "out", "--json")
    (place / "facts.json").write_text(done.stdout, encoding="utf-8")
    return place


def test_entries_and_what_they_add_up_to(folder: Path) -> None:
    facts = json.loads((folder / "facts.json").read_text(encoding="utf-8"))
    entries = {entry["name"]: entry for entry in facts["entries"]}
    kinds = [entry["kind"] for entry in facts["entries"]]
    assert kinds.count("seeds") == kinds.count("inputs") == 1 and kinds.count("model") >= 3
    assert [name for name, of in entries.items() if of["kind"] == "numerics"] == [
        "half the tolerance",
        "table twice as fine",
    ]
    lost = entries["no in-plane motion"]
    assert -0.85 < lost["change"] / facts["value"] < -0.6 and lost["uncertainty"] is None
    squares = sum(entry["uncertainty"] ** 2 for entry in facts["entries"] if entry["uncertainty"] is not None)
    assert facts["high"] - facts["value"] == pytest.approx(1.645 * math.sqrt(squares))
    assert "largest: inputs" in facts["verdict"] and facts["verdict"].endswith("measure contact.restitution")
    assert any("parts push the plate" in line for line in facts["left_out"])


def test_a_budget_is_opened_again(folder: Path) -> None:
    facts = json.loads((folder / "facts.json").read_text(encoding="utf-8"))
    study = open_study(folder / "out")
    assert study.as_json() == {key: value for key, value in facts.items() if key != "folder"}
    assert {path.name for path in (folder / "out").iterdir()} >= {"budget.csv", "budget.png", "budget.toml"}
    assert study.lines()[-1] == facts["verdict"]


def test_without_uncertain_inputs_it_says_so(tmp_path: Path) -> None:
    done = feeder_sim("budget", SCENARIO, "--seeds", 8, "--out", tmp_path / "out")
    assert "nothing is [uncertain]" in done.stderr
    assert "more seeds shrink it" in done.stdout or "a finer one shrinks it" in done.stdout


def test_modes_that_follow_a_voltage_are_entries() -> None:
    scenario = load_scenario(REPOSITORY / "scenarios/separation_piezos.toml")
    entries = {case[0].point["entry"] for case in BudgetQuestion().plan(scenario, Path("mine.toml")).cases.cases}
    assert {"more modes follow", "no modes follow"} <= entries


def test_a_measure_that_is_not_there_is_refused(tmp_path: Path) -> None:
    check_refused(feeder_sim("budget", SCENARIO, "--measure", "speed", "--out", tmp_path / "out"), "speed")
