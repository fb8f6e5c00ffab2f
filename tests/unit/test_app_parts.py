"""What the page is made of, without a browser: the draft, the motion, who is let in, and what may be put in."""

from __future__ import annotations

import base64
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY

from feeder_sim.app.draft import Draft
from feeder_sim.app.guarded import put_in
from feeder_sim.app.motion import DRIFT, Motion, displayed_modes
from feeder_sim.app.runs import Runs
from feeder_sim.cli.app import opened
from feeder_sim.errors import InputError
from feeder_sim.plate.response import rank_modes
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import load_scenario

EXAMPLE = REPOSITORY / "scenarios/patch_place.toml"


@pytest.fixture
def draft() -> Draft:
    return Draft(EXAMPLE.read_text(encoding="utf-8"), EXAMPLE)


def test_changes_keep_the_comments_and_can_be_taken_back(draft: Draft) -> None:
    before = draft.text
    draft.change("plate.actuator[0].at_mm", [31.5, 20.0])
    draft.change("run.seeds", 3)
    draft.add("plate.support", {"at_mm": [0.0, 0.0], "stiffness_n_per_mm": 20.0})
    plate = draft.scenario().plate
    assert plate.actuator[0].at_mm == (31.5, 20.0) and len(plate.support) == 1  # type: ignore[union-attr]
    assert draft.text.startswith(before[:200])  # with its comments
    draft.change("plate.support[0]", None)
    assert not draft.scenario().plate.support  # type: ignore[union-attr]
    for _ in range(4):
        draft.undo()
    assert draft.text == before
    draft.undo()
    for _ in range(2):
        draft.redo()
    assert draft.value("run.seeds") == 3 and draft.value("plate.support") is None


def test_stages_are_added_to_a_schedule_of_either_kind() -> None:
    for text in ("[schedule]\ncycles = 2\n", "[schedule]\nstage = [{ name = 'a', duration_s = 1.0 }]\n"):
        draft = Draft(text, Path("s.toml"))
        draft.add("schedule.stage", {"name": "b", "drive": [{"frequency_hz": 100.0}], "duration_s": 2.0})
        assert draft.value("schedule.stage")[-1]["drive"] == [{"frequency_hz": 100.0}]


@pytest.mark.parametrize(("text", "key"), [("a = ", "a"), ("a = 1", "b[3].c")])
def test_what_cannot_be_changed_is_said(text: str, key: str) -> None:
    with pytest.raises(InputError, match=r"s\.toml"):
        Draft(text, Path("s.toml")).change(key, 1)


def test_the_motion_is_that_of_the_modes_and_drifts_to_where_it_is_small() -> None:
    motion = Motion(displayed_modes(load_scenario(EXAMPLE)))
    best = rank_modes(motion.mode_file, 30.0, None)[0]
    q = motion.driven(best.frequency, 60.0, ["a"])
    assert abs(q[best.mode]) == pytest.approx(best.antinode, rel=1e-9)
    field = motion.field(motion.of_mode(best.mode, 1e-5), best.frequency)
    arrays = {key: np.frombuffer(base64.b64decode(field[key]), "<f4").reshape(61, 61) for key in ("re", "vx", "vy")}
    slope = np.gradient(np.abs(arrays["re"].astype(float)) * 1e-5, motion.x, motion.y)
    law = -1e3 * DRIFT * 2.0 * np.pi * best.frequency * 0.5 * motion.mode_file.modes.plate.thickness * np.array(slope)
    moves = np.hypot(arrays["vx"], arrays["vy"]) > 0.0
    assert moves.mean() > 0.5
    assert np.allclose(arrays["vx"][moves], law[0][moves], atol=1e-3)
    assert np.abs(arrays["re"]).max() == pytest.approx(1.0, abs=1e-6) and len(field["lines"]) > 0


@pytest.mark.parametrize(
    "at", [(-20.0, 35.0), *(pytest.param(place, marks=pytest.mark.slow) for place in ((0.0, 0.0), (60.0, -40.0)))]
)
def test_a_dragged_patch_drives_about_as_one_that_is_put_there(at: tuple[float, float]) -> None:
    scenario = load_scenario(EXAMPLE)
    motion = Motion(displayed_modes(scenario))
    motion.learn(scenario)
    there = Motion(displayed_modes(scenario.changed({"plate.actuator[0].at_mm": list(at)})))
    followed, put = np.abs(motion.moved(0, (1e-3 * at[0], 1e-3 * at[1]))[:, 0]), np.abs(there.forces[:, 0])
    assert np.linalg.norm(followed) == pytest.approx(np.linalg.norm(put), rel=0.1)
    most = put.argsort()[-10:]
    assert np.median(followed[most] / put[most]) == pytest.approx(1.0, abs=0.15)


def test_a_measured_gain_gives_the_amplitude_of_the_run() -> None:
    scenario = load_scenario(REPOSITORY / "scenarios/separation_100.toml")
    motion = Motion(displayed_modes(scenario))
    for drive in prepare(scenario).scene.drives:
        mode = int(np.abs(motion.oscillators.natural_frequency - drive.drive_frequency).argmin())
        assert motion.measured(mode, 120.0) == pytest.approx(drive.steady_amplitude, rel=0.02)
    assert motion.measured(0, 120.0) is None


def test_plates_without_modes_are_said_to_have_none() -> None:
    with pytest.raises(InputError, match=r"plate\.kind"):
        displayed_modes(load_scenario(REPOSITORY / "scenarios/linear_feeder.toml"))


def test_files_that_are_put_in_have_names_of_their_own(tmp_path: Path) -> None:
    assert put_in(tmp_path, "../../my part.STL", b"one").name == "my_part.stl"
    assert put_in(tmp_path, "my part.stl", b"one").name == "my_part.stl"
    assert put_in(tmp_path, "..\\my part.stl", b"two").name == "my_part_2.stl"
    assert put_in(tmp_path, "<b>.dxf", b"").name == "b.dxf"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b.dxf", "my_part.stl", "my_part_2.stl"]
    for name in ("evil.py", "evil", ".stl.exe"):
        with pytest.raises(InputError, match="must be a file that ends in"):
            put_in(tmp_path, name, b"")
    with pytest.raises(InputError, match="MB"):
        put_in(tmp_path, "large.stl", bytes(60_000_001))


@pytest.mark.slow
def test_a_run_that_fails_says_why_and_one_that_is_stopped_keeps_its_folder(tmp_path: Path) -> None:
    runs = Runs()
    failed = runs.start("[plate]\n", tmp_path / "s.toml", tmp_path / "failed")
    failed.process.join(60.0)
    assert failed.poll().ended == "failed" and "plate" in failed.words
    text = EXAMPLE.read_text(encoding="utf-8").replace("seeds = 16", "seeds = 2000")
    long = runs.start(text, EXAMPLE, tmp_path / "long")
    while long.poll().done == 0.0 and not long.ended:
        long.process.join(0.1)
    runs.stop_all()
    assert long.poll().ended == "stopped" and (tmp_path / "long/seeds/000.h5").is_file()


def test_a_run_whose_process_is_killed_has_ended(tmp_path: Path) -> None:
    run = Runs().start(EXAMPLE.read_text(encoding="utf-8"), EXAMPLE, tmp_path / "killed")
    run.process.kill()
    run.process.join(60.0)
    assert run.poll().ended == "failed" and "ended by itself" in run.words


def test_an_example_is_copied_once_and_a_file_of_ones_own_is_taken_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text, file = opened(Path("patch_place"), None)
    assert file == tmp_path / "patch_place/scenario.toml" and "[plate]" in text
    file.write_text(text + "# mine\n")
    assert opened(Path("patch_place"), None) == (text + "# mine\n", file)
    (tmp_path / "own.toml").write_text(text)
    assert opened(Path("own.toml"), None) == (text, tmp_path / "own.toml")
    assert opened(Path("own.toml"), Path("there"))[1] == tmp_path / "there/scenario.toml"
    with pytest.raises(InputError, match="no such file"):
        opened(Path("none.toml"), None)


def test_without_the_extra_the_command_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nicegui", None)
    check_refused(feeder_sim("app", "--no-show"), "feeder_sim[app]")
