"""What the build takes for the package, and what a user has of it where there is no repository.

Hatch leaves out every file that .gitignore names, tracked or not.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
from pathlib import Path
from zipfile import ZipFile

import pytest
from conftest import REPOSITORY

LARGEST_WHEEL = 2_000_000  # [byte]; the mode files of the examples are most of it
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
    with ZipFile(wheel) as held:
        names = [name.removeprefix("feeder_sim/examples/") for name in held.namelist() if "/examples/" in name]
    assert {path.name for path in REPOSITORY.glob("scenarios/*.toml")} == {
        name.removeprefix("scenarios/") for name in names if name.startswith("scenarios/")
    }
    assert {"models/plate_180/modes.h5", "tutorial/drift.toml", "schema/scenario.schema.json"} <= set(names)
    assert {Path(name).suffix for name in names} == {".toml", ".h5", ".stl", ".obj", ".json"}
    assert wheel.stat().st_size < LARGEST_WHEEL


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
