"""Parts, measures and engines of others: a package with entry points, and a measure that is a function."""

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from conftest import strip_scenario

import feeder_sim
from feeder_sim import InputError
from feeder_sim.measures.bounces import Bounces
from feeder_sim.records.seed import Seed
from feeder_sim.scene.prepared import Prepared

PACKAGE = {
    "pyproject.toml": """\
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "planks"
version = "1.0"

[project.entry-points]
"feeder_sim.parts" = { plank = "planks:Plank", broken = "planks:Missing" }
"feeder_sim.measures" = { highest_mm = "planks:highest" }
"feeder_sim.engines" = { slow = "planks:Slow" }
"feeder_sim.laws" = { smooth = "planks:smooth", wrong = "planks:wrong", short = "planks:short", none = "planks:none" }
""",
    "planks.py": '''\
from typing import Literal
from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.part.solids import box
from feeder_sim.scenario.part import PartTable

class Plank(PartTable):
    """A long block."""
    shape: Literal["plank"]
    length_mm: float

    def solid(self, density, name):
        return box((1e-3 * self.length_mm, 2e-3, 1e-3), density, name)

def highest(prepared, seed):
    return 1e3 * seed.frames.position[:, :, 2].max()

def no_rim(scenario):
    if scenario.run.planar:
        yield "run.planar", "false in this engine"

class Slow(ImpulseEngine):
    rules = {"refused": (no_rim,)}

def smooth(k, u, e, mu):
    return 0.0, 0.0, -(1.0 + e) * u[2] / k[5]

def wrong(k, u, e, mu):
    return u.normal

def short(k, u, e, mu):
    return e

none = None
''',
}
SCENARIO = """\
plate = { kind = "strip", thickness_mm = 3.0 }
drive = [{ frequency_hz = 4750.0, amplitude_um = 1.0 }]
part = [{ shape = "plank", length_mm = 6.0 }]
run = { duration_s = 0.02, seeds = 2, engine = "slow" }
"""


@pytest.fixture(scope="module")
def planks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which a package of somebody else is installed."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("installed")
    for name, text in PACKAGE.items():
        (source / name).write_text(text)
    install = ("pip", "install", "-q", "--no-deps", "--no-index", "--no-build-isolation", "--target", target, source)
    subprocess.run([sys.executable, "-m", *map(str, install)], check=True, timeout=120)
    return target


def feeder_sim_with(planks: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(planks), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-m", "feeder_sim", *words]
    held = {"env": os.environ | {"PYTHONPATH": path}, "cwd": folder, "timeout": 300}
    return subprocess.run(command, capture_output=True, text=True, **held)  # type: ignore[call-overload]


@pytest.mark.slow  # starts processes that start processes
def test_a_package_adds_a_part_a_measure_and_an_engine(planks: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(SCENARIO)
    words = ("sweep", "mine.toml", "--vary", "part[0].length_mm=4,8", "--measure", "highest_mm", "--json")
    swept = feeder_sim_with(planks, tmp_path, *words)
    assert swept.returncode == 0, swept.stderr
    rows = [row for row in json.loads(swept.stdout)["rows"] if row["measure"] == "highest_mm"]
    assert [row["part[0].length_mm"] for row in rows] == [4, 8]
    assert all(row["n"] == 2 and 0.5 < row["mean"] < 20.0 for row in rows)
    listed = json.loads(feeder_sim_with(planks, tmp_path, "list", "--json").stdout)
    assert "slow" in listed["engines"]


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("length_mm = 6.0", 'length_mm = "long"', "length_mm"),
        ("length_mm = 6.0", "width_mm = 6.0", "width_mm"),
        ('"plank"', '"broken"', "planks:Missing"),
        ('"slow"', '"slow", planar = true', "run.planar"),
        ('"slow"', '"fast"', "run.engine"),
    ],
)
def test_what_is_wrong_with_it_is_one_line(planks: Path, tmp_path: Path, old: str, new: str, key: str) -> None:
    (tmp_path / "mine.toml").write_text(SCENARIO.replace(old, new))
    checked = feeder_sim_with(planks, tmp_path, "check", "mine.toml")
    assert (checked.returncode, checked.stderr.count("\n")) == (2, 1)
    assert key in checked.stderr


THROWN = """\
plate = { kind = "still" }
part = [{ shape = "box", size_mm = [4.0, 3.0, 2.0], start = { kind = "state", position_mm = [0.0, 0.0, 6.0], \
velocity_mm_s = [50.0, 0.0, 0.0], quaternion = [0.9, 0.3, 0.3, 0.1] } }]
contact = { restitution = 0.5, friction = 0.4, law = "smooth" }
run = { duration_s = 0.06, seeds = 1 }
"""


@pytest.mark.slow  # compiles the engine
def test_a_package_adds_a_law_of_impact(planks: Path, tmp_path: Path) -> None:
    """Without friction nothing acts along the plate."""
    (tmp_path / "mine.toml").write_text(THROWN)
    run = feeder_sim_with(planks, tmp_path, "run", "mine.toml", "--out", "thrown")
    assert run.returncode == 0, run.stderr
    frames = feeder_sim.open(tmp_path / "thrown").seeds[0].frames
    assert frames.position[-1, 0, 2] < 3e-3
    assert frames.velocity[:, 0, 0] == pytest.approx(0.05, rel=1e-7)  # recorded in single precision


@pytest.mark.parametrize(
    ("law", "problem"),
    [
        ("wrong", "feeder_sim.laws: wrong: cannot be compiled: Unknown attribute 'normal'"),
        ("short", "feeder_sim.laws: short: returns something else, must be an impulse: a tuple of three floats"),
        ("none", "feeder_sim.laws: none: is NoneType, must be a function of k, u, e, mu"),
        ("rough", "must be 'newton', 'poisson', 'none', 'short', 'smooth' or 'wrong'"),
    ],
)
def test_what_is_wrong_with_a_law_is_one_line(planks: Path, tmp_path: Path, law: str, problem: str) -> None:
    (tmp_path / "mine.toml").write_text(THROWN.replace("smooth", law))
    run = feeder_sim_with(planks, tmp_path, "run", "mine.toml", "--out", "thrown")
    assert run.returncode == 2
    assert problem in run.stderr.splitlines()[-1]  # before it that there is no scene.xml of MuJoCo's


def highest_mm(prepared: Prepared, seed: Seed) -> float:
    return 1e3 * float(seed.frames.position[:, 0, 2].max())


def no_number(prepared: Prepared, seed: Seed) -> float:
    return "high"  # type: ignore[return-value]


def divides(prepared: Prepared, seed: Seed) -> float:
    return 1 / 0


def test_a_function_is_a_measure_of_runs_and_sweeps(tmp_path: Path) -> None:
    scenario = strip_scenario(seeds=3, duration_s=0.02)
    result = feeder_sim.simulate(scenario, measures=[highest_mm])
    heights = [highest_mm(result.prepared, seed) for seed in result.seeds]
    assert result.measures()["highest_mm"]["mean"] == pytest.approx(sum(heights) / 3)
    assert any(line.startswith("highest_mm") for line in result.lines())
    thin = feeder_sim.simulate(scenario, measures=[highest_mm], record=feeder_sim.StatisticsOnly())
    assert thin.measures() == result.measures()
    with ThreadPoolExecutor(2) as executor:
        ask: dict[str, Any] = {
            "vary": {"drive[0].amplitude_um": [0.5, 1.0]},
            "executor": executor,
            "out": tmp_path / "sweep",
        }
        swept = feeder_sim.sweep(scenario, measures=[highest_mm], **ask)
        again = feeder_sim.sweep(scenario, measures=[no_number_but_one], **ask)
    means = {row["drive[0].amplitude_um"]: row["mean"] for row in swept.table() if row["measure"] == "highest_mm"}
    assert means[1.0] == pytest.approx(sum(heights) / 3)
    assert "no_number_but_one" in {row["measure"] for row in again.table()}


def no_number_but_one(prepared: Prepared, seed: Seed) -> float:
    return 1.0


def unnamed() -> object:
    return lambda prepared, seed: 1.0


@pytest.mark.parametrize("measures", [[no_number], [divides], [unnamed()], [3], [Bounces(), Bounces()]])
def test_what_is_no_measure_is_refused(measures: list[object]) -> None:
    with pytest.raises(InputError, match="measures"):
        feeder_sim.simulate(strip_scenario(seeds=1, duration_s=0.02), measures=measures).measures()  # type: ignore[arg-type]
