"""A run folder holds what its scenario reads: taken elsewhere it runs again, goes on and is replayed."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, StopsAfter, toml_of

from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.plate.mode_file import ModeFile, read_mode_file, write_mode_file
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.replay.replay import build_replay
from feeder_sim.run import carried_files
from feeder_sim.run.carried_files import carry_files
from feeder_sim.run.run_folder import record_run, resume_run
from feeder_sim.scenario import MeshPart, Rectangle, Scenario, load_scenario

SCENARIO = {
    "plate": {"kind": "rectangle", "mode_file": "a plate/modes.h5"},
    "drive": [{"frequency_hz": 2797.0, "amplitude_um": 2.0}],
    "part": [{"shape": "mesh", "file": "../box.stl"}],
    "run": {"duration_s": 1.0, "seeds": 2},
}


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """A scenario whose files lie beside and above it."""
    here = tmp_path / "mine"
    (here / "a plate").mkdir(parents=True)
    shutil.copy(REPOSITORY / "models/plate_180/modes.h5", here / "a plate")
    trimesh.creation.box((2.0, 3.0, 4.0)).export(tmp_path / "box.stl")
    (here / "box.toml").write_text(toml_of(SCENARIO))
    return here / "box.toml"


def bits(run: Path) -> list[bytes]:
    recording = read_recording(run / "trajectory.h5")
    return [frames.position.tobytes() + frames.quaternion.tobytes() for frames in recording.seeds]


def test_a_run_folder_taken_elsewhere_runs_again_and_goes_on_to_the_same_bits(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ImpulseEngine, "frames_per_block", 100)
    record_run(load_scenario(scenario), tmp_path / "whole", replay=False)
    record_run(load_scenario(scenario), tmp_path / "cut", replay=False, stop=StopsAfter(4))
    elsewhere = tmp_path / "another machine"
    for name in ("whole", "cut"):
        shutil.move(tmp_path / name, elsewhere / name)
    wanted = bits(elsewhere / "whole")
    shutil.rmtree(scenario.parent)
    (tmp_path / "box.stl").unlink()

    resume_run(elsewhere / "cut", replay=False)
    assert bits(elsewhere / "cut") == wanted
    record_run(load_scenario(elsewhere / "whole/scenario.toml"), elsewhere / "again", replay=False)
    assert bits(elsewhere / "again") == wanted
    build_replay(elsewhere / "whole/trajectory.h5", tmp_path / "replay.rrd")
    texts = {name: read_recording(elsewhere / name / "trajectory.h5").scenario_text for name in ("whole", "again")}
    assert texts["whole"] == texts["again"] and str(tmp_path) not in texts["whole"]


def of_files(mode_file: Path, meshes: list[Path], fingers: Path) -> Scenario:
    stage = {"drive": [{"frequency_hz": 2797.0, "amplitude_um": 1.0}], "duration_s": 1.0, "pick": {"shape": fingers}}
    start = {"kind": "scattered"}
    parts = [{"shape": "mesh", "name": f"m{i}", "file": mesh, "start": start} for i, mesh in enumerate(meshes)]
    plate = {"kind": "rectangle", "mode_file": mode_file}
    return Scenario.model_validate({"plate": plate, "schedule": {"stage": [stage]}, "part": parts, "run": {}})


def test_equal_files_are_stored_once_and_names_that_clash_are_numbered(tmp_path: Path) -> None:
    for number, name in enumerate(["a/part.stl", "b/part.stl", "c/PART.stl", "d/copy of b.stl", "e/.teil für b.stl"]):
        path = tmp_path / name
        path.parent.mkdir()
        path.write_bytes(b"b" if number == 3 else bytes([number + ord("a")]))
    (tmp_path / "modes").write_bytes(b"b")
    meshes = [tmp_path / name for name in ("a/part.stl", "b/part.stl", "c/PART.stl", "d/copy of b.stl")]
    scenario = of_files(tmp_path / "modes", meshes, tmp_path / "e/.teil für b.stl")
    run = tmp_path / "run"
    run.mkdir()
    carried = carry_files(scenario, run)
    assert {path.name: path.read_bytes() for path in (run / "inputs").iterdir()} == {
        "modes": b"b",  # another kind of file than the next one
        "part.stl": b"a",
        "part_2.stl": b"b",
        "PART_3.stl": b"c",
        "_teil_f_r_b.stl": b"e",
    }
    named = [part.file for part in carried.part if isinstance(part, MeshPart)]
    assert list(map(str, named)) == [f"inputs/{name}.stl" for name in ("part", "part_2", "PART_3", "part_2")]
    assert carried.schedule and str(carried.schedule.picks[0][1].shape) == "inputs/_teil_f_r_b.stl"


def test_a_large_file_stays_where_it_is_and_the_user_hears_of_it(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(carried_files, "LARGEST_CARRIED", 10_000)
    said: list[str] = []
    loaded = load_scenario(scenario)
    (tmp_path / "run").mkdir()
    carried = carry_files(loaded, tmp_path / "run", said.append)
    assert carried.plate.kind == "rectangle" and carried.plate.mode_file == scenario.parent / "a plate/modes.h5"
    assert [path.name for path in (tmp_path / "run/inputs").iterdir()] == ["box.stl"]
    (line,) = said
    assert "modes.h5 is too large to be copied into" in line


def test_a_scenario_without_files_makes_no_folder(tmp_path: Path) -> None:
    strip = load_scenario(REPOSITORY / "scenarios/drift_4750hz.toml")
    assert carry_files(strip, tmp_path) == strip and list(tmp_path.iterdir()) == []


def other_box(path: Path) -> None:
    trimesh.creation.box((2.0, 3.0, 5.0)).export(path)


def unmeasured(path: Path) -> None:
    write_mode_file(path, ModeFile(read_mode_file(path).modes))


@pytest.mark.parametrize(
    ("name", "spoil", "said"),
    [
        ("box.stl", Path.unlink, "inputs/box.stl: cannot be read: No such file"),
        ("box.stl", other_box, "--resume: was begun with another content of part[0].file"),
        ("modes.h5", unmeasured, "--resume: was begun with another content of plate.mode_file"),
    ],
)
def test_a_run_does_not_go_on_without_its_inputs_or_with_others(
    name: str, spoil: Callable[[Path], None], said: str, scenario: Path, tmp_path: Path
) -> None:
    record_run(load_scenario(scenario), tmp_path / "run", replay=False)
    (tmp_path / "run/summary.json").unlink()  # as if it had been killed just before its end
    spoil(tmp_path / "run/inputs" / name)
    check_refused(feeder_sim("run", "--resume", tmp_path / "run"), said)


def test_pieces_beside_a_mesh_are_copied_with_it(tmp_path: Path) -> None:
    tangle = load_scenario(REPOSITORY / "scenarios/tangle.toml")
    carried = carry_files(tangle, tmp_path)
    assert {path.name for path in (tmp_path / "inputs").iterdir()} == {"modes.h5", "hook.stl", "hook_pieces.obj"}
    (hook,) = carried.part
    assert isinstance(hook, MeshPart) and hook.pieces == Path("inputs/hook_pieces.obj")


def test_relative_names_of_a_scenario_built_in_code_start_from_the_current_folder(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(scenario.parent)
    plate = Rectangle(kind="rectangle", mode_file=Path("a plate/modes.h5"))
    built = load_scenario(scenario).model_copy(update={"plate": plate, "part": ()})
    carried = carry_files(built, tmp_path)
    assert carried.plate.kind == "rectangle" and carried.plate.mode_file == Path("inputs/modes.h5")
    assert (tmp_path / "inputs/modes.h5").read_bytes() == (scenario.parent / "a plate/modes.h5").read_bytes()
