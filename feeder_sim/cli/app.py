"""The command `app`: a page in the browser on which a scenario is designed."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.cli.files import AsJson
from feeder_sim.errors import MissingExtra
from feeder_sim.example_files import scenario_path

STARTS_FROM = "patch_place"  # where nobody says a scenario: a nut on a plate with one patch
LIBRARIES = ("nicegui", "tomlkit")


def app(
    scenario: Annotated[
        Path | None,
        typer.Argument(help="Scenario file, folder with one, or name of an example.", show_default="a nut on a plate"),
    ] = None,
    folder: Annotated[
        Path | None, typer.Option("--folder", help="For files that are dropped in, and for runs [that of the file].")
    ] = None,
    port: Annotated[int | None, typer.Option("--port", min=1024, max=65535, help="Of the page [a free one].")] = None,
    as_json: AsJson = False,
    show: Annotated[bool, typer.Option("--show/--no-show", help="Open it in the browser.")] = True,
) -> None:
    """Open a page in the browser: draw a plate, place piezos, see where parts drift, run, and watch."""
    for library in LIBRARIES:
        if importlib.util.find_spec(library) is None:
            raise MissingExtra("app")
    from feeder_sim.app.server import serve

    text, file = opened(scenario, folder)
    serve(text, file, port=port, show=show, as_json=as_json)


def opened(scenario: Path | None, folder: Path | None) -> tuple[str, Path]:
    """The text of a scenario, and its file in the folder to work in, to which an example is copied once."""
    from feeder_sim.run.new_folder import SCENARIO, new_folder
    from feeder_sim.scenario.tables import read_text

    source = scenario_path(scenario or STARTS_FROM)
    if source.is_dir():  # that of an example which was opened before, or of `feeder-sim new`
        return read_text(source / SCENARIO), source.absolute() / SCENARIO
    file = source.absolute()
    if source != scenario or folder is not None:
        file = (folder or Path(source.stem)).absolute() / SCENARIO
        if not file.is_file():
            new_folder(file.parent, source)
    return read_text(file), file
