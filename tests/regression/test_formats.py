"""Files of another version of their format are refused in one line."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import h5py
import pytest
from command_line import check_refused, feeder_sim
from conftest import strip_scenario
from golden_commands import GOLDEN

import feeder_sim as package
from feeder_sim.records.trajectory_file import SCHEMA_VERSION
from feeder_sim.run.run_folder import scenario_toml
from feeder_sim.scenario import load_scenario


def test_a_scenario_without_a_version_is_of_the_first_one(tmp_path: Path) -> None:
    text = scenario_toml(strip_scenario())
    assert "format = 1\n" in text
    for name, content in (("now", text), ("before", text.replace("format = 1\n", ""))):
        (tmp_path / f"{name}.toml").write_text(content)
        assert load_scenario(tmp_path / f"{name}.toml") == strip_scenario()
    (tmp_path / "later.toml").write_text(text.replace("format = 1", "format = 2"))
    check_refused(feeder_sim("check", tmp_path / "later.toml"), "later.toml: format: is 2, must be 1")


def test_a_stored_run_is_opened_and_compared(tmp_path: Path) -> None:
    opened = package.open(GOLDEN / "run")
    assert [seed.status.name for seed in opened.seeds] == ["DONE"] * len(opened.seeds) and opened.measures()
    package.record_run(opened.scenario, tmp_path / "now", replay=False)
    assert json.loads((tmp_path / "now/run.json").read_text())["format"] == 1
    found = package.compare(GOLDEN / "run", tmp_path / "now")
    assert found.paired and not found.settings
    assert max(abs(each.difference) for each in found.differences) < 1e-6  # of round-off on another processor


@pytest.mark.parametrize("version", [1, SCHEMA_VERSION - 1, SCHEMA_VERSION + 1])
def test_a_recording_of_another_version_says_what_to_do(version: int, tmp_path: Path) -> None:
    shutil.copytree(GOLDEN / "run", tmp_path / "run")
    with h5py.File(tmp_path / "run/scene.h5", "r+", libver="latest") as file:
        file.attrs["schema_version"] = version
    said = (f"schema_version: is {version}, must be {SCHEMA_VERSION}", "its scenario has to be run again")
    check_refused(feeder_sim("report", tmp_path / "run"), *said)


def test_a_mode_file_of_another_version_says_what_to_do(repository: Path, tmp_path: Path) -> None:
    shutil.copy(repository / "models/strip_160/modes.h5", tmp_path)
    with h5py.File(tmp_path / "modes.h5", "r+", libver="latest") as file:
        file.attrs["schema_version"] = 2
    check_refused(feeder_sim("modes", tmp_path / "modes.h5"), "is 2, must be 4", "feeder-sim modes PLATE.toml --out")
