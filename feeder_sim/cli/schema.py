"""The command `schema`: what a scenario or a plate file may hold, for editors and linters."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.cli.files import writable
from feeder_sim.errors import Unknown

KINDS = ("scenario", "plate")


def schema(
    kind: Annotated[str, typer.Argument(help=f"Kind of file: {' or '.join(KINDS)}.")] = KINDS[0],
    out: Annotated[Path | None, typer.Option("--out", help="Write it to this file instead of stdout.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing --out file.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object on stdout: the schema and where it was written.")
    ] = False,
) -> None:
    """Print the JSON Schema of scenarios or of plate files, by which editors complete and check them."""
    if kind not in KINDS:
        raise Unknown(kind, KINDS, key="KIND")
    if out is not None:
        writable(out, force=force)
    from feeder_sim.scenario.schema import schema_text

    text = schema_text(kind)
    if out is not None:
        out.write_text(text, encoding="utf-8")
    if as_json:
        print(json.dumps({"kind": kind, "file": None if out is None else str(out), "schema": json.loads(text)}))
    elif out is None:
        print(text, end="")
