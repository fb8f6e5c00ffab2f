"""The command `report`: a run, or a question asked of many runs, as one HTML page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.cli.files import writable
from feeder_sim.cli.terminal import notify, progress_bar
from feeder_sim.errors import InputError, printable, quoted

PAGE = "report.html"  # its name in a folder, unless another is asked for
SUFFIXES = (".html", ".htm")


def report(
    folder: Annotated[Path, typer.Argument(help="Folder of a run, or of a question of many runs.", show_default=False)],
    out: Annotated[Path | None, typer.Option("--out", help=f"File to write (.html) [{PAGE} in the folder].")] = None,
    screenshot: Annotated[
        bool, typer.Option("--screenshot", help="With a picture of the replay; needs a graphics driver, no screen.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing page.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Write a run, or a question asked of many runs, as one HTML page that opens anywhere, offline."""
    from feeder_sim.records.trajectory_file import TRAJECTORY
    from feeder_sim.records.whole_file import write_whole
    from feeder_sim.report.run_report import run_document
    from feeder_sim.report.study_report import study_document
    from feeder_sim.studies.kinds import KINDS, kind_of

    if not folder.exists():
        raise InputError("no such folder", file=folder)
    file = out or (folder if folder.is_dir() else folder.parent) / PAGE
    if file.suffix.lower() not in SUFFIXES:
        raise InputError(f"is {quoted(file.suffix)}, allowed is {' or '.join(SUFFIXES)}", file=file, key="--out")
    if file.is_file() and not force:
        raise InputError("exists already, --force replaces it", file=file, key="--out")
    kind = held.kind if (held := kind_of(folder)) else ""
    if kind and screenshot:
        raise InputError(
            f"is not allowed for the folder of {kind}, which keeps no recordings", file=folder, key="--screenshot"
        )
    if not kind and not (folder / TRAJECTORY).is_file() and not (folder.suffix == ".h5" and folder.is_file()):
        allowed = f"a folder that holds {', '.join((TRAJECTORY, *(held.file for held in KINDS.values())))}"
        raise InputError(f"is no run and no question of many runs, allowed is {allowed}", file=folder)
    with progress_bar(str(folder)) as progress:
        if kind:
            page = study_document(folder)
        else:
            page = run_document(folder, with_screenshot=screenshot, progress=progress, notify=notify)
        content = page.html().encode()
    write_whole(writable(file, force=force), content)
    if as_json:
        made = {"file": str(file), "bytes": len(content), "pictures": page.pictures}
        print(json.dumps({"kind": kind or "run", "title": page.title} | made))
        return
    print(printable(str(file)))
