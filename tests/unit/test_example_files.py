"""Examples are found from anywhere, by name, also in a wheel; what exists by that path comes first."""

from __future__ import annotations

import importlib.resources
import json
import os
import subprocess
import sys
import venv
from pathlib import Path
from zipfile import ZipFile

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
    check_refused(feeder_sim("new", tmp_path / "a"), "without its examples, must be --from")


def test_a_name_is_that_of_a_file_before_that_of_an_example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert scenario_path("drift_4750hz") == DRIFT
    for command in ("run", "check"):
        slow = feeder_sim(command, "drift_4750hz", "--engine", "slow")
        check_refused(slow, "drift_4750hz.toml: run.engine: is 'slow'")
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
        ("..", "is no file, must be a text file"),
        ("", "is no file, must be a text file"),
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
    (tmp_path / "project/scene.h5").write_bytes(b"")
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


LARGEST = 2_050_000  # [byte] packed, without machine code; the mode files of the examples are most of it
LARGEST_MACHINE_CODE = 3_000_000  # [byte] packed
MUJOCO = "3.17.0"  # that of .ci/constraints.txt, which holds here too in CI
ELSEWHERE = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
STATE_OF_PACKAGE = """
import feeder_sim, json, mujoco
from feeder_sim.example_files import examples
from feeder_sim.scenario import input_files, load_scenario
held = [file for path in examples().values() for file in input_files(load_scenario(path)).values()]
print(json.dumps([feeder_sim.__file__, mujoco.__version__, len(examples()), all(file.is_file() for file in held)]))
"""


@pytest.mark.skipif(not (REPOSITORY / ".git").exists(), reason="no git checkout")
def test_no_file_of_the_package_is_left_out_of_a_wheel() -> None:
    held = (REPOSITORY / "feeder_sim").rglob("*")
    files = [str(path.relative_to(REPOSITORY)) for path in held if path.suffix in (".py", ".typed", ".j2")]
    command = ["git", "check-ignore", "--no-index", "--stdin"]
    found = subprocess.run(command, input="\n".join(files), capture_output=True, text=True, cwd=REPOSITORY, check=False)
    assert len(files) > 100 and "feeder_sim/py.typed" in files and found.stderr == "" and found.stdout == ""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=REPOSITORY, check=True, capture_output=True, timeout=120)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def program(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command of an environment of its own with the wheel and what it depends on, from the package index."""
    place = tmp_path_factory.mktemp("environment")
    venv.create(place, with_pip=False)
    bin_folder = place / ("Scripts" if os.name == "nt" else "bin")
    pip = [sys.executable, "-m", "pip", "--python", str(bin_folder / "python")]
    install = [*pip, "install", str(wheel), f"mujoco=={MUJOCO}"]
    done = subprocess.run(install, env=ELSEWHERE, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    return bin_folder / "feeder-sim"


@pytest.mark.slow
def test_a_wheel_holds_the_examples_without_pictures_and_stays_small(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        names = [name.removeprefix("feeder_sim/examples/") for name in archive.namelist() if "/examples/" in name]
        machine_code = [entry for entry in archive.infolist() if "/linux_x86_64_v3/" in entry.filename]
    assert {path.name for path in REPOSITORY.glob("scenarios/*.toml")} == {
        name.removeprefix("scenarios/") for name in names if name.startswith("scenarios/")
    }
    assert {"models/plate_180/modes.h5", "tutorial/drift.toml", "schema/scenario.schema.json"} <= set(names)
    assert {Path(name).suffix for name in names} == {".csv", ".toml", ".h5", ".stl", ".obj", ".json", ".dxf", ".svg"}
    packed = sum(entry.compress_size for entry in machine_code)
    assert {Path(entry.filename).suffix for entry in machine_code} == {".so", ".json"}
    assert packed < LARGEST_MACHINE_CODE and wheel.stat().st_size - packed < LARGEST


@pytest.mark.slow(minutes=True)
def test_a_wheel_is_all_that_is_needed(program: Path, tmp_path: Path) -> None:
    """In an empty folder far from the repository, as a new user would."""

    def run(*words: str, cwd: Path = tmp_path) -> str:
        done = subprocess.run(
            [program, *words], cwd=cwd, env=ELSEWHERE, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
        return done.stdout

    python = program.with_name("python")
    done = subprocess.run(
        [python, "-I", "-c", STATE_OF_PACKAGE], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True
    )
    module, version, number, complete = json.loads(done.stdout)
    assert Path(module).is_relative_to(program.parents[1]), "the package of the repository was taken"
    assert version == MUJOCO and number == len(list(REPOSITORY.glob("scenarios/*.toml"))) and complete

    found = json.loads(run("list", "--json"))
    assert found["scenarios"] == {} and len(found["examples"]) == number
    described = [*found["examples"].values(), *found["mode files of examples"].values()]
    assert not [text for text in described if text.startswith("unusable")]
    assert json.loads(run("check", "drift_4750hz", "--json"))["title"] == found["examples"]["drift_4750hz"]
    assert json.loads(run("schema", "plate")) == json.loads((REPOSITORY / "schema/plate.schema.json").read_text())
    run("modes", next(iter(found["mode files of examples"])))
    run("run", "drift_4750hz", "--seeds", "1")
    for drift in ("drift_4750hz", "drift_8775hz"):
        run("run", drift, "--engine", "mujoco", "--seeds", "1", "--set", "run.duration_s=0.1")
    run("new", "my_feeder")
    run("run", "scenario.toml", "--seeds", "1", cwd=tmp_path / "my_feeder")
    run("new", "separation", "--from", "separation_100")
    mine = json.loads(run("list", "--json"))["scenarios"]
    assert mine["separation/scenario.toml"] == found["examples"]["separation_100"]
    assert {path.name for path in tmp_path.iterdir()} == {"runs", "my_feeder", "separation"}
    run("compare", "runs/drift_4750hz-001", "my_feeder/runs/scenario-001")
