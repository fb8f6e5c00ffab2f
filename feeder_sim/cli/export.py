"""The command `export`: a recorded run as one HDF5 file, for other programs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.cli.files import writable

NAME = "trajectory.h5"  # in the run folder, unless another file is named


def export(
    folder: Annotated[Path, typer.Argument(help="Run folder.", show_default=False)],
    out: Annotated[Path | None, typer.Option("--out", help=f"File to write [FOLDER/{NAME}].")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Put all that a run has recorded into one HDF5 file, for other programs."""
    from feeder_sim.records.trajectory_file import export_recording, read_recording

    recording = read_recording(folder)
    file = writable(out or recording.path.parent / NAME, force=force)
    export_recording(recording, file)
    ended = sum(len(seed.frames) > 0 for seed in recording.records)
    print(json.dumps({"file": str(file), "seeds": ended}) if as_json else f"{ended} seeds in {file}")
