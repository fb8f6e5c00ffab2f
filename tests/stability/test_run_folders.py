"""Run folders: nothing of others is deleted, overwritten or followed, one process writes at a time, and taken elsewhere
they run again, go on and are replayed, since they hold what their scenario reads.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import trimesh
from command_line import check_refused, feeder_sim, in_new_process
from conftest import BALL_ON_SLIDE, REPOSITORY, StopsAfter, ball_on_slide, toml_of

from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.errors import InputError
from feeder_sim.plate.mode_file import ModeFile, read_mode_file, write_mode_file
from feeder_sim.pool.work import Work
from feeder_sim.records.files import LOCK, locked
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory_file import export_recording, read_recording
from feeder_sim.replay import viewer
from feeder_sim.replay.replay import build_replay
from feeder_sim.run import run_folder
from feeder_sim.run.run_folder import carry_files, record_run, resume_run
from feeder_sim.scenario import MeshPart, ModePlate, Scenario, load_scenario, with_run
from feeder_sim.whole_files import write_whole

MODES = REPOSITORY / "models/plate_180/modes.h5"

# Takes a lock until its input ends.
HOLD = """
import sys
from pathlib import Path
from feeder_sim.records.files import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def contents(folder: Path) -> dict[str, bytes]:
    """Of all files in a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def with_inputs(**run: Any) -> Scenario:
    """A nut on a plate of a mode file."""
    return with_run(load_scenario(REPOSITORY / "scenarios/drift_2797hz_plate.toml"), **({"seeds": 2} | run))


def cut_short(run: Path, scenario: Scenario | None = None) -> dict[str, bytes]:
    """A run as if it had been killed just before its end: what its folder holds."""
    record_run(scenario or ball_on_slide(), run, replay=False)
    (run / "summary.json").unlink()
    return contents(run)


@pytest.mark.parametrize(
    "name",
    ["checkpoints/notes.txt", "scenario.toml", "replay.rrd.bak", "a.txt"]
    + [f"inputs/{name}" for name in ("notes.txt", "modes.h5", "modes.h5.partial", "a folder/modes.h5")],
)
def test_a_folder_with_files_of_the_user_is_refused_and_left_alone(name: str, tmp_path: Path) -> None:
    """Also where a run would have files of that name."""
    mine = tmp_path / "proj" / name
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    check_refused(feeder_sim("run", "drift_2797hz_plate", "--out", tmp_path / "proj"), "--out: is not empty")
    assert contents(tmp_path / "proj") == {name: b"mine"}


def test_files_of_the_user_in_a_run_folder_stay(tmp_path: Path) -> None:
    """Also those that lie where runs once kept what they went on from."""
    cut_short(tmp_path, with_inputs(duration_s=0.05))
    mine = {"checkpoints/notes.txt": b"a", "checkpoints/seed_007.npz": b"b", "checkpoints/seed_000.npz": b"c"}
    mine |= {"replay_mine.rrd": b"RRF2 of mine", "replay_seed_001.rrd": b"no replay", "inputs/notes.md": b"d"}
    for name, content in mine.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    resume_run(tmp_path)
    held = contents(tmp_path)
    assert {name: held[name] for name in mine} == mine and {"summary.json", "replay.rrd"} <= {*held}


def test_a_run_under_way_is_not_resumed_beside_itself(tmp_path: Path) -> None:
    before = cut_short(tmp_path)
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdin and other.stdout and other.stdout.readline() == "held\n"
        check_refused(feeder_sim("resume", tmp_path), "is in use", "one process")
        after = contents(tmp_path)
        other.stdin.close()
    assert {name: after[name] for name in before} == before
    with locked(tmp_path):  # a process that has ended holds nothing
        pass


@pytest.mark.slow
def test_of_runs_that_begin_at_once_in_one_folder_one_is_recorded(tmp_path: Path) -> None:
    scenario = tmp_path / "ball.toml"
    scenario.write_text(toml_of(BALL_ON_SLIDE, {"run.duration_s": 2.0}))
    for attempt in range(3):
        out = tmp_path / f"run_{attempt}"
        command = [sys.executable, "-m", "feeder_sim", "run", str(scenario), "--out", str(out), "--seed"]
        both = [subprocess.Popen([*command, str(s)], stdout=subprocess.PIPE, stderr=subprocess.PIPE) for s in (1, 2)]
        said = [process.communicate(timeout=300)[1].decode() for process in both]
        codes = [process.returncode for process in both]
        assert sorted(codes) == [0, 2], said
        winner = codes.index(0) + 1
        assert json.loads((out / "summary.json").read_text())["seed"] == winner
        assert f"seed = {winner}\n" in (out / "scenario.toml").read_text()
        assert read_recording(out).status == (Status.DONE,) * 2


@pytest.mark.parametrize("killed_in", ["carry_files", "_write_mjcf", "write_scene_file", "simulate"])
def test_a_run_that_was_killed_before_its_first_block_begins_anew(
    killed_in: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From its own copies of its inputs, as soon as it has them."""
    mode_file, whole, run = tmp_path / "mine.h5", tmp_path / "whole", tmp_path / "run"
    mode_file.write_bytes(MODES.read_bytes())
    scenario = with_inputs(duration_s=0.05).changed({"plate.mode_file": mode_file})
    record_run(scenario, whole, replay=False)

    def killed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(run_folder, killed_in, killed)
        record_run(scenario, run, replay=False)
    check_refused(feeder_sim("run", "drift_4750hz", "--out", run), "already holds a run")
    if killed_in != "carry_files":
        mode_file.unlink()
    resume_run(run, replay=False)
    one, other = (read_recording(folder) for folder in (whole, run))
    for a, b in zip(one.seeds, other.seeds, strict=True):
        assert np.array_equal(a.position, b.position)
    assert one.scenario_text == other.scenario_text and one.inputs == other.inputs


@pytest.mark.parametrize("content", ["{", "[]", '{"format": 2, "scenario": ""}'])
def test_a_begin_that_cannot_be_read_is_refused(content: str, tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text(content)
    check_refused(feeder_sim("resume", tmp_path), "run.json")


@pytest.mark.parametrize(
    ("beside", "problem"),
    [
        ([], ": no run here, must be a folder that holds"),
        (["plate.toml", "notebook.ipynb"], ": no run here, must be a folder that holds"),
        ([LOCK, "sweep.toml", "journal.jsonl"], "sweep.toml: drive: unknown key"),
        ([LOCK, "uncertainty.toml", "inputs"], "uncertainty.toml: drive: unknown key"),
    ],
)
def test_a_scenario_in_a_folder_of_the_user_or_of_no_question_is_not_resumed(
    beside: list[str], problem: str, tmp_path: Path
) -> None:
    for name in ("scenario.toml", *beside):
        (tmp_path / name).write_text(toml_of(BALL_ON_SLIDE))
    before = contents(tmp_path)
    check_refused(feeder_sim("resume", tmp_path), problem)
    assert contents(tmp_path) == before


def test_what_a_kill_before_the_first_file_leaves_is_as_good_as_empty(tmp_path: Path) -> None:
    (tmp_path / LOCK).touch()
    (tmp_path / "run.json.partial").write_text('{"for')
    record_run(ball_on_slide(), tmp_path, replay=False)


@pytest.mark.parametrize(
    "name", ["scene.h5", "seeds/000.h5", "run.json", "scenario.toml", "replay.rrd", "inputs/modes.h5", LOCK]
)
@pytest.mark.parametrize("command", ["resume --replay run", "replay run --screenshot a.png"])
def test_links_in_a_run_folder_are_not_followed(name: str, command: str, tmp_path: Path) -> None:
    cut_short(tmp_path / "run", with_inputs(duration_s=0.05))
    linked, mine = tmp_path / "run" / name, tmp_path / "mine"
    mine.write_bytes(linked.read_bytes() if linked.exists() else b"mine")
    linked.unlink(missing_ok=True)
    held = mine.read_bytes()
    linked.symlink_to(mine)
    check_refused(feeder_sim(*command.split(), cwd=tmp_path), Path(name).name if "/" in name else "")
    assert mine.read_bytes() == held


@pytest.mark.parametrize("make", [os.symlink, os.link, lambda mine, name: os.mkfifo(name)])
def test_what_has_the_name_of_a_file_under_way_is_not_written_to(make: Any, tmp_path: Path) -> None:
    """Neither is a pipe waited for."""
    mine = tmp_path / "mine"
    mine.write_text("mine")
    make(mine, tmp_path / "summary.json.partial")
    write_whole(tmp_path / "summary.json", b"{}")
    assert mine.read_text() == "mine" and (tmp_path / "summary.json").read_text() == "{}"
    assert not (tmp_path / "summary.json").is_symlink()


def test_a_file_system_without_locks_is_worked_on_without_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def none(*_: object) -> None:
        asked.append("a lock")
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", none)
    with locked(tmp_path):
        assert asked


def put(file: h5py.File, name: str, value: Any = None, **made: Any) -> None:
    """Something else in the place of a dataset."""
    del file[name]
    file.create_dataset(name, dtype="f8", **made) if made else file.__setitem__(name, value)


def many_names(file: h5py.File, mine: Path) -> None:
    """Read as often as it is named."""
    file.create_dataset("bomb", data=np.zeros(3 * 10**6), chunks=(10**5,), compression="gzip")
    for number in range(10, 10_000):
        file[f"parts/part_{number}/vertices"] = file["bomb"]


HUGE: dict[str, Any] = {"shape": (10**9, 1, 3), "chunks": (10**5, 1, 3), "compression": "gzip"}
SPOILT: dict[str, Callable[[h5py.File, Path], None]] = {
    "another file": lambda file, mine: put(file, "seeds/000/time", h5py.ExternalLink(str(mine / "secret.h5"), "/a")),
    "another name": lambda file, mine: put(file, "seeds/000/time", h5py.SoftLink("/seeds/001/time")),
    "a storage": lambda file, mine: put(file, "plate/x", shape=(10,), external=[(str(mine / "secret.h5"), 0, 80)]),
    # Nobody writes to it: reading it waits for ever.
    "a pipe": lambda file, mine: put(file, "plate/x", shape=(10,), external=[(str(mine / "pipe"), 0, 80)]),
    "a bomb": lambda file, mine: put(file, "seeds/000/position", **HUGE),
    # Without a limit of the depth, a walk through a group in itself never ends.
    "itself": lambda file, mine: file.__setitem__("seeds/000/again", file["/"]),
    "many names": many_names,
    "frames of two lengths": lambda file, mine: put(file, "seeds/000/position", np.zeros((3, 1, 3))),
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded") / "run"
    record_run(ball_on_slide(), folder, replay=False)
    export_recording(read_recording(folder), folder / "trajectory.h5")
    return folder / "trajectory.h5"


@pytest.mark.parametrize("name", SPOILT)
def test_a_recording_that_points_elsewhere_or_claims_too_much_is_refused(
    name: str, recorded: Path, tmp_path: Path
) -> None:
    path = tmp_path / "trajectory.h5"
    path.write_bytes(recorded.read_bytes())
    os.mkfifo(tmp_path / "pipe")
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["a"] = np.zeros(10)
    with h5py.File(path, "r+", libver="latest") as file:
        SPOILT[name](file, tmp_path)
    done = in_new_process("report", path, "--out", tmp_path / "a.html")
    check_refused(done, "trajectory.h5")


def test_a_mode_file_that_claims_too_much_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "modes.h5"
    path.write_bytes(MODES.read_bytes())
    with h5py.File(path, "r+") as file:
        put(file, "modes/coefficients", shape=(10**6, 3, 30, 30), chunks=(10, 3, 30, 30), compression="gzip")
    with pytest.raises(InputError, match="claims to hold"):
        read_mode_file(path)


def test_what_a_terminal_acts_on_is_not_printed(tmp_path: Path) -> None:
    """Colours, the bell, the title of the window: from the title of a scenario and the name of its folder."""
    file, folder = tmp_path / "ball.toml", tmp_path / "run\x1b[31m"
    file.write_text(toml_of({"title": "\u001b[2Jgone\u0007 \u202e"} | BALL_ON_SLIDE))
    for command in (("check", file), ("run", file, "--out", folder)):
        done = feeder_sim(*command)
        assert done.returncode == 0
        printed = (done.stdout + done.stderr).replace("\n", "")
        assert "gone" in printed and printed.isprintable()


def test_a_replay_of_a_run_under_way_or_read_only_is_built_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    record_run(ball_on_slide(), run, replay=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with locked(run):
        built = viewer.replay_file(run)
    assert built.parent != run and built.stat().st_size > 1000 and not (run / "replay.rrd").exists()
    assert viewer.replay_file(run) == run / "replay.rrd"


def test_an_interrupt_before_the_first_block_ends_at_once_and_the_folder_goes_on(tmp_path: Path) -> None:
    """Ten thousand seeds of ten parts are placed, and their file is made, for minutes."""
    file, run = tmp_path / "many.toml", tmp_path / "run"
    many = {"shape": "ball", "diameter_mm": 3.0, "count": 10, "start": {"kind": "scattered"}}
    file.write_text(toml_of(BALL_ON_SLIDE, {"part": [many], "run.seeds": 10_000}))
    command = [sys.executable, "-m", "feeder_sim", "run", str(file), "--out", str(run)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr and "looking for places" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        asked = time.monotonic()
        said = process.stderr.read()
    assert process.returncode == 130 and said == "feeder-sim: interrupted\n"
    assert time.monotonic() - asked < 20.0  # of minutes
    assert not run.exists()


@pytest.mark.slow
def test_an_interrupt_in_mid_run_keeps_what_was_computed(tmp_path: Path) -> None:
    run = tmp_path / "run"
    words = ("run", "separation_100", "--seeds", "2", "--out", str(run))
    with subprocess.Popen([sys.executable, "-m", "feeder_sim", *words], stdout=subprocess.DEVNULL) as process:
        until = time.monotonic() + 120.0
        while time.monotonic() < until and not (run / "scene.h5").exists():
            time.sleep(0.1)
        time.sleep(5.0)
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 130
    recording = read_recording(run)
    assert set(recording.status) == {Status.UNFINISHED} and (run / "summary.json").is_file()
    assert all(len(frames) > 100 and np.isfinite(frames.position).all() for frames in recording.seeds)


def test_a_run_that_ends_writes_no_summary_of_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run in a folder that a faster process has taken between two looks is refused, with nothing written."""
    looks, check_free = [], run_folder.check_free

    def free_at_first(folder: Path) -> None:
        looks.append(folder)
        if len(looks) == 2:
            (folder / "scene.h5").write_text("of another process")
        check_free(folder)

    monkeypatch.setattr(run_folder, "check_free", free_at_first)
    with pytest.raises(InputError, match="already holds a run"):
        record_run(ball_on_slide(), tmp_path)
    assert set(contents(tmp_path)) <= {LOCK, "scene.h5"}


SCENARIO = {
    "plate": {"kind": "modes", "mode_file": "a plate/modes.h5"},
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
    recording = read_recording(run)
    return [frames.position.tobytes() + frames.quaternion.tobytes() for frames in recording.seeds]


def test_a_run_folder_taken_elsewhere_runs_again_and_goes_on_to_the_same_bits(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ImpulseEngine, "frames_per_block", 100)
    record_run(load_scenario(scenario), tmp_path / "whole", replay=False)
    record_run(load_scenario(scenario), tmp_path / "cut", replay=False, work=Work(stop=StopsAfter(2)))
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
    build_replay(elsewhere / "whole", tmp_path / "replay.rrd")
    texts = {name: read_recording(elsewhere / name).scenario_text for name in ("whole", "again")}
    assert texts["whole"] == texts["again"] and str(tmp_path) not in texts["whole"]


def of_files(mode_file: Path, meshes: list[Path], fingers: Path) -> Scenario:
    stage = {"drive": [{"frequency_hz": 2797.0, "amplitude_um": 1.0}], "duration_s": 1.0, "pick": {"shape": fingers}}
    start = {"kind": "scattered"}
    parts = [{"shape": "mesh", "name": f"m{i}", "file": mesh, "start": start} for i, mesh in enumerate(meshes)]
    plate = {"kind": "modes", "mode_file": mode_file}
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
    monkeypatch.setattr(run_folder, "LARGEST_CARRIED", 10_000)
    said: list[str] = []
    loaded = load_scenario(scenario)
    (tmp_path / "run").mkdir()
    carried = carry_files(loaded, tmp_path / "run", said.append)
    assert carried.plate.kind == "modes" and carried.plate.mode_file == scenario.parent / "a plate/modes.h5"
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
        ("box.stl", other_box, "was begun with another content of part[0].file"),
        ("modes.h5", unmeasured, "was begun with another content of plate.mode_file"),
    ],
)
def test_a_run_does_not_go_on_without_its_inputs_or_with_others(
    name: str, spoil: Callable[[Path], None], said: str, scenario: Path, tmp_path: Path
) -> None:
    record_run(load_scenario(scenario), tmp_path / "run", replay=False)
    (tmp_path / "run/summary.json").unlink()  # as if it had been killed just before its end
    spoil(tmp_path / "run/inputs" / name)
    check_refused(feeder_sim("resume", tmp_path / "run"), said)


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
    plate = ModePlate(kind="modes", mode_file=Path("a plate/modes.h5"))
    built = load_scenario(scenario).model_copy(update={"plate": plate, "part": ()})
    carried = carry_files(built, tmp_path)
    assert carried.plate.kind == "modes" and carried.plate.mode_file == Path("inputs/modes.h5")
    assert (tmp_path / "inputs/modes.h5").read_bytes() == (scenario.parent / "a plate/modes.h5").read_bytes()
