"""A folder to start from: a scenario, the files that it reads, the plate file, schemas for editors, and a notebook."""

from __future__ import annotations

import contextlib
import re
import tempfile
from pathlib import Path

from feeder_sim.errors import InputError, not_written, shortened
from feeder_sim.example_files import starter_folder
from feeder_sim.run.recorded_run import RESOLVED
from feeder_sim.run.run_folder import carried_names, scenario_toml
from feeder_sim.scenario import Scenario, input_files, load_plate_file, load_scenario, parse_scenario, with_files
from feeder_sim.scenario.schema import schema_text
from feeder_sim.scenario.tables import parse, read_text
from feeder_sim.whole_files import write_whole

SCENARIO, PLATE, NOTEBOOK, MODES = RESOLVED, "plate.toml", "notebook.ipynb", "modes.h5"
_SCHEMA_LINE = re.compile(r"\A#:schema [^\n]*\n")


def new_folder(folder: Path, source: Path | None = None) -> list[Path]:
    """Write a scenario to start from into a folder of its own, ready to run.

    Args:
        folder: made if missing; it must be empty.
        source: the scenario to copy, with the files that it reads; without it one nut on a plate of given dimensions,
            whose modes are computed.

    Returns:
        The files that were written.

    Raises:
        InputError: the folder is not empty or cannot be made, or the source cannot be used.
        RecordingFailed: a file cannot be written, as when the disk is full.
    """
    check_empty(folder)
    contents = _starter() if source is None else _copied(source, folder)
    for name, kind in ((SCENARIO, "scenario"), (PLATE, "plate")):
        schema = f"{kind}.schema.json"
        text, names_one = _SCHEMA_LINE.subn(f"#:schema {schema}\n", contents.get(name, b"").decode())
        if names_one:
            contents |= {name: text.encode(), schema: schema_text(kind).encode()}
    contents[NOTEBOOK] = Path(__file__).with_name(NOTEBOOK).read_bytes()
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise not_written(folder, error) from error
    try:
        for name, content in contents.items():
            write_whole(folder / name, content)
    except BaseException:
        for name in contents:
            (folder / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # somebody else has put something there
            folder.rmdir()
        raise
    return [folder / name for name in contents]


def check_empty(folder: Path) -> None:
    """Refuse a folder that holds anything, or a path of which no folder can be made.

    Raises:
        InputError: as said.
    """
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise InputError("is there already, must be a new or an empty folder", file=folder)
    if folder.exists():
        name = min((path.name for path in folder.iterdir()), default=None)
        if name is not None:
            raise InputError(f"is not empty ({shortened(name, 40)}), must be a new or an empty folder", file=folder)
    elif not folder.parent.is_dir():
        raise InputError("must be a new folder in one that exists", file=folder)


def _starter() -> dict[str, bytes]:
    """The plate and the drift of the tutorial; the modes are computed from the plate file."""
    from feeder_sim.plate.mode_file import write_mode_file
    from feeder_sim.scene.plate_modes import compute_modes

    source = starter_folder()
    if source is None:
        raise InputError("has been installed without its examples, must be --from with a scenario", key="feeder_sim")
    with tempfile.TemporaryDirectory() as place:
        modes = Path(place) / MODES
        write_mode_file(modes, compute_modes(load_plate_file(source / PLATE)))
        mode_file = modes.read_bytes()
    return {PLATE: (source / PLATE).read_bytes(), MODES: mode_file, SCENARIO: (source / "drift.toml").read_bytes()}


def _copied(source: Path, folder: Path) -> dict[str, bytes]:
    """A scenario with its own words, its files beside it, and the plate file that lies with its modes."""
    scenario = load_scenario(source)
    names = carried_names(scenario)
    contents = {name: path.read_bytes() for path, name in names.items()}
    mode_file = input_files(scenario).get("plate.mode_file")
    if mode_file is not None and (plate_file := mode_file.with_name(PLATE)).is_file():
        with contextlib.suppress(InputError):  # it is another kind of file
            load_plate_file(plate_file)
            contents[PLATE] = read_text(plate_file).encode()
    contents[SCENARIO] = _renamed(source, scenario, names, folder).encode()
    return contents


def _renamed(source: Path, scenario: Scenario, names: dict[Path, str], folder: Path) -> str:
    """The text of a scenario with the names of the copies; where that is not simple, the scenario with all defaults."""
    text = read_text(source)
    as_written = input_files(parse(text, Scenario, source))
    for key, path in input_files(scenario).items():
        for quote in "\"'":
            text = text.replace(f"{quote}{as_written[key]}{quote}", f"{quote}{names.get(path, as_written[key])}{quote}")
    there = folder.resolve()
    target = with_files(scenario, lambda path: there / names[path] if path in names else path)
    with contextlib.suppress(InputError):
        if parse_scenario(text, file=there / SCENARIO) == target:
            return text
    return scenario_toml(with_files(scenario, lambda path: Path(names.get(path, path))))
