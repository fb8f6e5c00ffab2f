"""A scenario with uncertain inputs, run from the command line."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY

INPUTS = 8
UNCERTAIN = """
[uncertain]
contact.restitution = { uniform = [0.1, 0.5] }
"drive[0].amplitude_um" = { normal = [1.0, 0.1] }
"""


@pytest.mark.slow
def test_a_run_goes_on_to_its_uncertain_inputs(tmp_path: Path) -> None:
    text = (REPOSITORY / "scenarios/drift_8775hz.toml").read_text(encoding="utf-8")
    (tmp_path / "u.toml").write_text(text + UNCERTAIN, encoding="utf-8")
    out = tmp_path / "run"
    done = feeder_sim("run", tmp_path / "u.toml", "--seeds", 3, "--inputs", INPUTS, "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    assert "uncertain inputs, which have the values of the scenario here" in done.stderr
    told = json.loads(done.stdout)
    speed = told["uncertainty"]["measures"]["transport_speed_mm_s"]
    assert told["transport_speed_mm_s"]["n"] == 3 and speed["draws"] == INPUTS
    assert speed["low"] < speed["median"] < speed["high"] and speed["sd_seeds"] > 0.0
    with (out / "uncertainty/draws.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert sorted(int(row["seed"]) for row in rows) == list(range(2 * INPUTS))  # each draw has seeds of its own
    assert (out / "uncertainty/uncertainty.png").is_file()
    shutil.rmtree(out / "uncertainty")
    again = feeder_sim("run", "--resume", out, "--inputs", INPUTS, "--json")
    assert again.returncode == 0, again.stderr
    assert json.loads(again.stdout)["uncertainty"] == told["uncertainty"]


def test_what_is_not_uncertain_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    scenario = REPOSITORY / "scenarios/drift_8775hz.toml"
    check_refused(feeder_sim("uncertainty", scenario, "--out", tmp_path / "u"), "[uncertain]: is missing")
    (tmp_path / "u.toml").write_text(scenario.read_text() + UNCERTAIN, encoding="utf-8")
    wrong = feeder_sim("uncertainty", tmp_path / "u.toml", "--indices", "--inputs", 6, "--out", tmp_path / "u")
    check_refused(wrong, "--inputs: is 6, allowed is a power of two")
    assert not (tmp_path / "u").exists()
