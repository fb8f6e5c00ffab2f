"""Folders to start from: what is in them is ready to run, and nothing of others is written over."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import matplotlib
import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY

from feeder_sim.errors import RecordingFailed
from feeder_sim.example_files import examples
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.run.new_folder import new_folder
from feeder_sim.scenario import Drive, Scenario, input_files, load_plate_file, load_scenario, with_files
from feeder_sim.scenario.schema import json_schema
from feeder_sim.whole_files import write_whole


def code_of(folder: Path) -> list[str]:
    cells = json.loads((folder / "notebook.ipynb").read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


def without_places(scenario: Scenario) -> Scenario:
    return with_files(scenario, lambda path: Path(path.name))


def test_the_default_folder_is_the_plate_and_the_drift_of_the_tutorial(tmp_path: Path) -> None:
    done = feeder_sim("new", "my feeder", cwd=tmp_path)
    folder = tmp_path / "my feeder"
    assert done.stdout.splitlines()[1] == "next: cd 'my feeder' && feeder-sim run scenario.toml"
    assert {path.name for path in folder.iterdir()} == {"plate.toml", "modes.h5", "scenario.toml", "notebook.ipynb"}
    tutorial = REPOSITORY / "docs/tutorial"
    for name, source in (("plate.toml", "plate.toml"), ("scenario.toml", "drift.toml")):
        assert (folder / name).read_bytes() == (tutorial / source).read_bytes()
    body = load_plate_file(folder / "plate.toml").plate
    modes = read_mode_file(folder / "modes.h5").modes
    assert modes.plate.length == pytest.approx(1e-3 * (body.length_mm or 0.0))
    (drive,) = load_scenario(folder / "scenario.toml").drive
    assert isinstance(drive, Drive)
    assert modes.natural_frequency[drive.mode - 1 if drive.mode else 0] == pytest.approx(drive.frequency_hz, rel=1e-4)


@pytest.mark.parametrize("name", sorted(examples()))
def test_every_example_can_be_copied_with_its_words_and_files(name: str, tmp_path: Path) -> None:
    source = examples()[name]
    written = new_folder(tmp_path / "copy", source)
    assert sorted(tmp_path.glob("copy/*")) == sorted(written)
    copied, original = load_scenario(tmp_path / "copy/scenario.toml"), load_scenario(source)
    assert without_places(copied) == without_places(original)
    for key, file in input_files(copied).items():
        assert file.parent == tmp_path / "copy" and file.read_bytes() == input_files(original)[key].read_bytes()
    comment = source.read_text(encoding="utf-8").splitlines()[1]
    schema, copied_comment = (tmp_path / "copy/scenario.toml").read_text(encoding="utf-8").splitlines()[:2]
    assert copied_comment == comment and comment.startswith("# ") and schema == "#:schema scenario.schema.json"
    assert json.loads((tmp_path / "copy/scenario.schema.json").read_text(encoding="utf-8")) == json_schema("scenario")
    assert all(compile(code, name, "exec") for code in code_of(tmp_path / "copy"))


def test_the_plate_file_that_lies_with_the_modes_is_copied(tmp_path: Path) -> None:
    new_folder(tmp_path / "copy", examples()["separation_100"])
    assert len(load_plate_file(tmp_path / "copy/plate.toml").resonance) > 5
    schema = (tmp_path / "copy/plate.toml").read_text(encoding="utf-8").splitlines()[0]
    assert schema == "#:schema plate.schema.json" and (tmp_path / "copy/plate.schema.json").is_file()


def test_a_text_that_cannot_be_changed_simply_is_written_anew(tmp_path: Path) -> None:
    """The same file by two names, one of them with an escape."""
    text = examples()["tangle"].read_text(encoding="utf-8")
    text = text.replace('"../models/hook/hook.stl"', f'"{REPOSITORY}/models/plate_180/../hook/h\\u006fok.stl"')
    text = text.replace("../models/plate_180", f"{REPOSITORY}/models/plate_180")
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    new_folder(tmp_path / "copy", tmp_path / "mine.toml")
    copied, original = (load_scenario(tmp_path / name) for name in ("copy/scenario.toml", "mine.toml"))
    assert without_places(copied) == without_places(original)
    assert all(file.parent == tmp_path / "copy" for file in input_files(copied).values())
    assert not (tmp_path / "copy/scenario.schema.json").exists()  # the text names none


def test_nothing_is_written_over(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full/notes.txt").write_text("mine")
    (tmp_path / "file").write_text("mine")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    for name, said in (
        ("full", "is not empty (notes.txt), must be a new or an empty folder"),
        ("file", "is there already, must be a new or an empty folder"),
        ("link", "is there already, must be a new or an empty folder"),
        ("no/where", "must be a new folder in one that exists"),
    ):
        check_refused(feeder_sim("new", tmp_path / name), said)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "full", "link", "notes.txt"]


@pytest.mark.parametrize("source", ["drift_475hz", "plate.toml"])
def test_a_source_that_is_no_scenario_leaves_nothing_behind(source: str, tmp_path: Path) -> None:
    (tmp_path / "plate.toml").write_text("[plate]\nlength_mm = 3.0")
    check_refused(feeder_sim("new", "made", "--from", source, cwd=tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["plate.toml"]


def test_a_full_disk_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, content: bytes) -> None:
        if path.suffix == ".ipynb":
            raise RecordingFailed("the disk is full")
        write_whole(path, content)

    monkeypatch.setattr("feeder_sim.run.new_folder.write_whole", full)
    with pytest.raises(RecordingFailed):
        new_folder(tmp_path / "made", examples()["tangle"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")
@pytest.mark.parametrize("name", [None, "wave_gather", "ball_50hz"])
def test_the_notebook_runs(name: str | None, tmp_path: Path) -> None:
    matplotlib.use("Agg")
    new_folder(tmp_path / "made", examples()[name] if name else None)
    if name:  # shorter
        text = (tmp_path / "made/scenario.toml").read_text(encoding="utf-8")
        (tmp_path / "made/scenario.toml").write_text(text.replace("duration_s = ", "duration_s = 0.05 # "))
    held: dict[str, Any] = {}
    with contextlib.chdir(tmp_path / "made"):
        for code in code_of(tmp_path / "made"):
            exec(compile(code, "notebook", "exec"), held)
    assert len(held["result"].seeds) == min(4, held["scenario"].run.seeds)
    assert len(held["figure"].axes) == len({mode.drive.shape for mode in held["prepared"].scene.driven})
