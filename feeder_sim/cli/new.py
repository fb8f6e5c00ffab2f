"""The command `new`: a folder to start from."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.errors import printable
from feeder_sim.example_files import scenario_path


def new(
    folder: Annotated[Path, typer.Argument(help="Folder to make.", show_default=False)],
    source: Annotated[
        Path | None, typer.Option("--from", help="Example, or scenario file, to copy [one nut on a plate].")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Make a folder with a scenario, the files that it reads, the plate file and a notebook, ready to run."""
    from feeder_sim.run.new_folder import SCENARIO, new_folder

    written = new_folder(folder, None if source is None else scenario_path(source))
    if as_json:
        print(json.dumps({"folder": str(folder), "files": [path.name for path in written]}))
        return
    print(printable(f"{folder}: {', '.join(path.name for path in written)}"))
    print(printable(f"next: cd {shlex.quote(str(folder))} && feeder-sim run {SCENARIO}"))
