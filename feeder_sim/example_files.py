"""The example scenarios and the mode files, meshes and plate files that they need, wherever the package lies.

A wheel holds them in feeder_sim/examples. A checkout, also one that is installed as it is, has them in its root.
"""

from __future__ import annotations

import importlib.resources
from pathlib import Path

from feeder_sim.errors import InputError, nearest


def examples_folder() -> Path | None:
    """The folder that holds `scenarios` and `models`; None where neither a wheel nor a checkout is at hand."""
    package = Path(str(importlib.resources.files("feeder_sim")))
    folders = (folder for folder in (package / "examples", package.parent) if (folder / "scenarios").is_dir())
    return next(folders, None)


def starter_folder() -> Path | None:
    """The folder with the files of the tutorial; None as for `examples_folder`."""
    folder = examples_folder()
    folders = (folder / place for place in ("tutorial", "docs/tutorial")) if folder else ()
    return next((place for place in folders if place.is_dir()), None)


def examples() -> dict[str, Path]:
    """Scenario files by the names that commands know them by, in alphabetical order."""
    folder = examples_folder()
    return {path.stem: path for path in sorted(folder.glob("scenarios/*.toml"))} if folder else {}


def example_file(place: str) -> Path:
    """A file of the examples by its place among them, such as "scenarios/transport_strip.toml".

    Raises:
        InputError: it is not at hand.
    """
    folder = examples_folder()
    if folder is None or not (folder / place).is_file():
        raise InputError("no such file, the package is here without its examples", file=Path(place))
    return folder / place


def scenario_path(name: str | Path) -> Path:
    """What a command means by a scenario: the file of this path, or else the example of this name.

    Whatever exists by the path is taken, and an example only for a name without folder and suffix.

    Raises:
        InputError: there is neither; the message names what is nearest.
    """
    path = Path(name)
    if path.exists() or path.is_symlink():
        return path
    known = examples()
    if str(name) in known:
        return known[str(name)]
    parent = path.parent
    beside = [str(parent / file.name) for file in parent.glob("*.toml")] if parent.is_dir() else []
    hint = nearest(str(name), beside) or nearest(path.stem, known)
    if path.suffix == ".toml" or path.parent != Path():
        raise InputError(f"no such file{hint}", file=path)
    raise InputError(f"no such file, and no such example{hint}; feeder-sim list shows all", file=path)
