"""Examples are found from anywhere, by name; what exists by that path comes first."""

from __future__ import annotations

import importlib.resources
import json
from pathlib import Path

import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, refusal

from feeder_sim.cli.files import complete_scenario
from feeder_sim.example_files import example_file, examples, examples_folder, scenario_path, starter_folder
from feeder_sim.scenario import input_files, load_scenario

DRIFT = REPOSITORY / "scenarios/drift_4750hz.toml"


def test_every_example_has_its_name_and_its_files() -> None:
    found = examples()
    assert len(found) == len(list(REPOSITORY.glob("scenarios/*.toml"))) > 20
    assert list(found) == sorted(found) and found["drift_4750hz"] == DRIFT
    for path in found.values():
        assert all(file.is_file() for file in input_files(load_scenario(path)).values())


def test_examples_of_a_wheel_lie_in_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where somebody else has put folders of these names beside the package."""
    package = tmp_path / "site-packages/feeder_sim"
    for folder in (package / "examples", package.parent):
        (folder / "scenarios").mkdir(parents=True)
    (package / "examples/scenarios/mine.toml").touch()
    monkeypatch.setattr(importlib.resources, "files", lambda _: package)
    assert examples() == {"mine": package / "examples/scenarios/mine.toml"} and starter_folder() is None


def test_without_examples_there_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.resources, "files", lambda _: tmp_path / "feeder_sim")
    assert examples_folder() is None and examples() == {} and starter_folder() is None
    assert "drift_4750hz: no such file" in refusal(scenario_path, "drift_4750hz")
    assert "modes.h5: no such file" in refusal(example_file, "models/plate_180/modes.h5")
    check_refused(feeder_sim("new", tmp_path / "a"), "without its examples, allowed is --from")


def test_a_name_is_that_of_a_file_before_that_of_an_example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert scenario_path("drift_4750hz") == DRIFT
    for command in ("run", "check"):
        slow = feeder_sim(command, "drift_4750hz", "--engine", "slow")
        check_refused(slow, "drift_4750hz.toml: run.engine: is 'slow'")
    check_refused(feeder_sim("bifurcation", "drift_4750hz", "--from", 5, "--to", 1), "allowed is 0 < --from < --to")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "drift_4750hz").mkdir()
    assert scenario_path("drift_4750hz") == Path("drift_4750hz")
    check_refused(feeder_sim("check", "drift_4750hz"), "drift_4750hz: is no file")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("drift_4570hz", "no such file, and no such example (did you mean 'drift_4750hz'?); feeder-sim list shows all"),
        ("drift_4750hz.toml", "no such file (did you mean 'drift_4750hz'?)"),
        ("scenarios/drift_4750hz", "no such file (did you mean 'drift_4750hz'?)"),
        ("mine/separate.toml", "no such file (did you mean 'mine/seperate.toml'?)"),
        ("seperat", "no such file, and no such example (did you mean 'seperate.toml'?)"),
        ("zzz", "no such file, and no such example; feeder-sim list shows all"),
        ("..", "is no file, allowed is a text file"),
        ("", "is no file, allowed is a text file"),
    ],
)
def test_a_mistyped_name_gets_the_nearest_one(
    name: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine").mkdir()
    for place in ("mine/seperate.toml", "seperate.toml"):
        (tmp_path / place).touch()
    monkeypatch.chdir(tmp_path)
    for command in ("run", "check", "wave"):
        check_refused(feeder_sim(command, name), said)


def test_list_begins_with_the_files_of_the_folder(tmp_path: Path) -> None:
    text = DRIFT.read_text()
    for name in ("mine.toml", "project/scenario.toml", "scenarios/other.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "project/plate.toml").write_text("[plate]")
    (tmp_path / "scenarios/bad.toml").write_text("[plate]")
    (tmp_path / "project/modes.h5").write_bytes((REPOSITORY / "models/strip_160/modes.h5").read_bytes())
    (tmp_path / "project/trajectory.h5").write_bytes(b"")
    (tmp_path / "project/data.h5").write_bytes(b"of another program")
    found = json.loads(feeder_sim("list", "--json", cwd=tmp_path).stdout)
    names = ["scenarios/bad.toml", "scenarios/other.toml", "mine.toml", "project/scenario.toml"]
    assert list(found["scenarios"]) == names
    assert found["scenarios"]["scenarios/bad.toml"].startswith("unusable: ")
    assert list(found["mode files"]) == ["project/modes.h5"]
    assert found["examples"]["drift_4750hz"] == "Drift of an M2.5 nut at 4750 Hz"
    assert str(REPOSITORY / "models/plate_180/modes.h5") in found["mode files of examples"]
    lines = feeder_sim("list", cwd=tmp_path).stdout.splitlines()
    assert lines.index("scenarios:") < lines.index("examples:") < lines.index("engines:")
    found = json.loads(feeder_sim("list", REPOSITORY, "--json").stdout)  # no file twice
    assert "scenarios/drift_4750hz.toml" in found["scenarios"] and found["examples"] == {}
    assert found["mode files"] and found["mode files of examples"] == {}


def test_a_shell_is_offered_examples_and_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drifts").mkdir()
    for name in ("drift.toml", "drift.csv", "drifts/mine.toml"):
        (tmp_path / name).touch()
    examples_offered = ["drift_2797hz_plate", "drift_4750hz", "drift_8775hz"]
    assert complete_scenario("dri") == [*examples_offered, "drift.toml", "drifts/"]
    assert complete_scenario("drifts/") == ["drifts/mine.toml"]
    assert complete_scenario("nowhere/x") == []
