"""A folder to start from: a scenario, the files that it reads, the plate file, schemas for editors, and a notebook."""

from __future__ import annotations

import contextlib
import json
import re
import tempfile
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError, not_written, shortened
from feeder_sim.example_files import starter_folder
from feeder_sim.records.files import write_whole
from feeder_sim.run.run_folder import RESOLVED, carried_names, scenario_toml
from feeder_sim.scenario import (
    Scenario,
    input_files,
    load_plate_file,
    load_scenario,
    parse_scenario,
    with_files,
)
from feeder_sim.scenario.schema import schema_text
from feeder_sim.scenario.tables import parse, read_text

# A small Jupyter notebook about the scenario beside it: load, check, simulate, measure, draw the modes.

_LOAD = """\
import feeder_sim

scenario = feeder_sim.load_scenario("scenario.toml")
prepared = feeder_sim.prepare(scenario)
print(scenario.title)
print("engine:", prepared.engine.name, "-", prepared.engine.reason)
print("warnings:", *(prepared.warnings or ["none"]), sep="\\n  ")"""
_SIMULATE = """\
result = feeder_sim.simulate(scenario.changed({{"run.seeds": {seeds}}}))
print(*result.lines(), sep="\\n")"""
_MEASURES = """\
from IPython.display import display

display(*(found for _, found in result.findings))"""
_DRAW = """\
import matplotlib.pyplot as plt
import numpy as np

surface = prepared.scene.surface
x, y = (np.linspace(-0.5 * side, 0.5 * side, 121) for side in (surface.length, surface.width))
points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
labels = {mode.drive.shape: mode.label for mode in prepared.scene.driven}
figure, grid = plt.subplots(1, max(1, len(labels)), squeeze=False, figsize=(4 * max(1, len(labels)), 3.5))
for axes, (shape, label) in zip(grid[0], labels.items()):
    deflection = surface.deflection(shape, points).reshape(len(x), len(y))
    largest = abs(deflection).max()
    axes.pcolormesh(1e3 * x, 1e3 * y, deflection.T, cmap="RdBu", vmin=-largest, vmax=largest)
    if deflection.min() < 0.0 < deflection.max():
        axes.contour(1e3 * x, 1e3 * y, deflection.T, levels=[0.0], colors="black")  # nodal lines
    axes.set(title=label, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")"""
FEW_SEEDS = 4


def notebook(scenario: Scenario) -> dict[str, Any]:
    """The notebook as JSON takes it (nbformat 4.5)."""
    seeds = min(FEW_SEEDS, scenario.run.seeds)
    has_modes = "plate.mode_file" in input_files(scenario)
    hint = " After a change of `plate.toml`: `feeder-sim modes plate.toml --out modes.h5 --force`." if has_modes else ""
    cells = [
        _words("intro", f"# {scenario.title or 'A scenario'}\n\nIn `scenario.toml` is what is simulated.{hint}"),
        _code("load", _LOAD),
        _words("simulate-words", "A few seeds: starts differ, and hops are chaotic. Ask for more when it matters."),
        _code("simulate", _SIMULATE.format(seeds=seeds)),
        _words("measures-words", "All measures, with mean, standard deviation, standard error and number of values:"),
        _code("measures", _MEASURES),
        _words(
            "modes-words", "The modes that are driven. Parts hop where the colour is strong, and drift to the lines."
        ),
        _code("modes", _DRAW),
    ]
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}


def _words(name: str, text: str) -> dict[str, Any]:
    return {"cell_type": "markdown", "id": name, "metadata": {}, "source": _lines(text)}


def _code(name: str, text: str) -> dict[str, Any]:
    more: dict[str, Any] = {"execution_count": None, "outputs": []}
    return {"cell_type": "code", "id": name, "metadata": {}, "source": _lines(text)} | more


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


SCENARIO, PLATE, NOTEBOOK, MODES = RESOLVED, "plate.toml", "notebook.ipynb", "modes.h5"
SCHEMAS = {SCENARIO: "scenario", PLATE: "plate"}  # kinds of files that can name one
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
    for name, kind in SCHEMAS.items():
        if _SCHEMA_LINE.match(contents.get(name, b"").decode()):
            contents[_schema_file(kind)] = schema_text(kind).encode()
    scenario = contents[SCENARIO].decode()
    contents[NOTEBOOK] = f"{json.dumps(notebook(parse(scenario, Scenario, folder / SCENARIO)), indent=1)}\n".encode()
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise not_written(folder, error) from error
    written: list[Path] = []
    try:
        for name, content in contents.items():
            write_whole(folder / name, content)
            written.append(folder / name)
    except BaseException:
        for path in written:
            path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # somebody else has put something there
            folder.rmdir()
        raise
    return written


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
    plate_file = mode_file.with_name(PLATE) if mode_file else None
    if plate_file is not None and plate_file.is_file():
        with contextlib.suppress(InputError):  # it is another kind of file
            load_plate_file(plate_file)
            contents[PLATE] = _with_schema(plate_file, SCHEMAS[PLATE])
    contents[SCENARIO] = _renamed(source, scenario, names, folder).encode()
    return contents


def _renamed(source: Path, scenario: Scenario, names: dict[Path, str], folder: Path) -> str:
    """The text of a scenario with the names of the copies; where that is not simple, the scenario with all defaults."""
    text = _with_schema(source, SCHEMAS[SCENARIO]).decode()
    as_written = input_files(parse(text, Scenario, source))
    for key, path in input_files(scenario).items():
        if path in names:
            for quote in "\"'":
                text = text.replace(f"{quote}{as_written[key]}{quote}", f"{quote}{names[path]}{quote}")
    there = folder.resolve()
    target = with_files(scenario, lambda path: there / names[path] if path in names else path)
    with contextlib.suppress(InputError):
        if parse_scenario(text, file=there / SCENARIO) == target:
            return text
    return scenario_toml(with_files(scenario, lambda path: Path(names.get(path, path))))


def _with_schema(path: Path, kind: str) -> bytes:
    """A text whose first line, where it names a schema, names the copy that will lie beside it."""
    return _SCHEMA_LINE.sub(f"#:schema {_schema_file(kind)}\n", read_text(path)).encode()


def _schema_file(kind: str) -> str:
    return f"{kind}.schema.json"
