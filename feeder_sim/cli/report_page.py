"""The command `report`: a run, or a question asked of many runs, as one HTML page, or as text."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.cli.files import options_in_errors, writable
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
    replay: Annotated[
        bool, typer.Option("--replay/--no-replay", help="The page of a run plays its replay, in one or two megabytes.")
    ] = True,
    text: Annotated[bool, typer.Option("--text", help="Print it without pictures, and write nothing.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing page.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Write a run, or a question asked of many runs, as one HTML page that opens anywhere, offline."""
    from feeder_sim.report.document_of import document_of
    from feeder_sim.studies.ask import kind_of
    from feeder_sim.whole_files import write_whole

    file = out or (folder if folder.is_dir() else folder.parent) / PAGE
    if file.suffix.lower() not in SUFFIXES:
        raise InputError(f"is {quoted(file.suffix)}, must be {' or '.join(SUFFIXES)}", file=file, key="--out")
    if file.is_file() and not force and not text:
        raise InputError("exists already, --force replaces it", file=file, key="--out")
    with progress_bar(str(folder)) as progress, options_in_errors():
        document = document_of(folder, screenshot=screenshot, replay=replay, progress=progress, notify=notify)
        if text:
            print(document.text())
            return
        content = document.html().encode()
    write_whole(writable(file, force=force), content)
    if as_json:
        kind = study_kind.kind if (study_kind := kind_of(folder)) else "run"
        facts = {"file": str(file), "bytes": len(content), "pictures": document.pictures}
        print(json.dumps({"kind": kind, "title": document.title} | facts))
        return
    print(printable(str(file)))
