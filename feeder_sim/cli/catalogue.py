"""What a user can choose from: scenarios and mode files in a folder, engines, shapes of parts, materials."""

from __future__ import annotations

import tomllib
from pathlib import Path

from feeder_sim import extensions
from feeder_sim.errors import FeederSimError
from feeder_sim.example_files import examples, examples_folder
from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.records.files import SCENE
from feeder_sim.scenario import load_scenario
from feeder_sim.scenario.run import ENGINES, LAWS
from feeder_sim.scenario.shapes import SHAPES
from feeder_sim.scenario.tables import read_text

UNUSABLE = "unusable: "


def catalogue(folder: Path) -> dict[str, dict[str, str]]:
    """Names and one-line descriptions by kind; for a file that cannot be read the reason is its description.

    First come the files of a folder, by their paths from it, then those of the package that are not among them:
    scenarios by the names that commands know them by, mode files by their paths.
    """
    scenarios, mode_files = _scenarios_in(folder), _mode_files_in(folder)
    resolved = {path.resolve() for path in (*scenarios, *mode_files)}
    package = examples_folder()
    more = sorted(package.glob("models/*/*.h5")) if package else []
    return {
        "scenarios": {str(path.relative_to(folder)): title for path, title in scenarios.items()},
        "examples": {name: _title(path) for name, path in examples().items() if path.resolve() not in resolved},
        "mode files": {str(path.relative_to(folder)): text for path, text in mode_files.items()},
        "mode files of examples": {str(path): _modes(path) for path in more if path.resolve() not in resolved},
        "engines": {name: text for name, text in ENGINES.items() if name != "auto"} | _added("engines"),
        "laws of impact": LAWS | _added("laws"),
        "parts": {name: table.sizes for name, table in SHAPES.items()} | _added("parts"),
        "materials": {name: f"{m.density:g} kg/m3, {m.youngs_modulus / 1e9:g} GPa" for name, m in MATERIALS.items()},
    }


def _added(group: str) -> dict[str, str]:
    return dict.fromkeys(extensions.names_of(group), "of another package")


def _scenarios_in(folder: Path) -> dict[Path, str]:
    """Titles of all files in `scenarios`, and of what else in the folder and the folders in it is a scenario."""
    titles = {path: _title(path) for path in sorted(folder.glob("scenarios/*.toml"))}
    for path in sorted((*folder.glob("*.toml"), *folder.glob("*/*.toml"))):
        if path not in titles and _is_scenario(path):
            titles[path] = _title(path)
    return titles


def _is_scenario(path: Path) -> bool:
    """Whether a file has the tables that every scenario has."""
    try:
        tables = tomllib.loads(read_text(path))
    except (FeederSimError, ValueError, RecursionError):
        return False
    return {"plate", "part", "run"} <= tables.keys()


def _mode_files_in(folder: Path) -> dict[Path, str]:
    """What is in all files of the folders in `models`, and in those of the folder itself and the folders in it."""
    descriptions = {path: _modes(path) for path in sorted(folder.glob("models/*/*.h5"))}
    for path in sorted((*folder.glob("*.h5"), *folder.glob("*/*.h5"))):
        if path.name != SCENE and not (text := _modes(path)).startswith(UNUSABLE):  # another kind of file
            descriptions[path] = text
    return descriptions


def _title(path: Path) -> str:
    """Title of a scenario file."""
    try:
        return load_scenario(path).title
    except FeederSimError as error:
        return f"{UNUSABLE}{error}"


def _modes(path: Path) -> str:
    """Size of the plate of a mode file, and its numbers of modes and measured resonances."""
    try:
        mode_file = read_mode_file(path)
    except FeederSimError as error:
        return f"{UNUSABLE}{error}"
    plate, highest = mode_file.modes.plate, mode_file.modes.natural_frequency[-1]
    size = " x ".join(f"{1e3 * d:g}" for d in (plate.length, plate.width, plate.thickness))
    return f"{size} mm, {len(mode_file.modes)} modes up to {highest:.0f} Hz, {len(mode_file.resonances)} measured"
