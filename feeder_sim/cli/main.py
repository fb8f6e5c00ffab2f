"""Command line: parse, call, print.

Data on stdout, progress and messages on stderr; exit 0 done, 1 the run failed, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from feeder_sim import __version__
from feeder_sim.cli.app import app as app_command
from feeder_sim.cli.calibrate import calibrate
from feeder_sim.cli.commands import Commands
from feeder_sim.cli.compare import compare
from feeder_sim.cli.drift_map import drift_map
from feeder_sim.cli.export import export
from feeder_sim.cli.files import AsJson
from feeder_sim.cli.import_modes import import_modes_command
from feeder_sim.cli.new import new
from feeder_sim.cli.part import part
from feeder_sim.cli.plate import modes, sequence, wave
from feeder_sim.cli.replay import replay
from feeder_sim.cli.report_page import report
from feeder_sim.cli.response import response
from feeder_sim.cli.run import check, resume, run
from feeder_sim.cli.schema import schema
from feeder_sim.cli.study import merge
from feeder_sim.cli.tracks import tracks
from feeder_sim.errors import (
    LONGEST_MESSAGE,
    FeederSimError,
    InputError,
    Interrupted,
    RecordingFailed,
    cause_of,
    library_failure,
    of_a_name,
    printable,
    shortened,
)

app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Simulate rigid parts on vibrating plates.",
)


def _print_version(requested: bool) -> None:
    if requested:
        print(f"feeder-sim {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and end.")
    ] = False,
) -> None:
    pass


def list_(
    folder: Annotated[Path, typer.Argument(help="Folder with scenarios/ and models/.")] = Path(),
    as_json: AsJson = False,
) -> None:
    """List scenarios and mode files, those of the package too, engines, part shapes and materials."""
    from feeder_sim.cli.catalogue import catalogue

    if not folder.is_dir():
        raise InputError("no such folder", file=folder)
    listing = catalogue(folder)
    if as_json:
        print(json.dumps(listing))
        return
    for kind, entries in listing.items():
        if entries:
            print(f"{kind}:")
        for name, text in entries.items():
            print(f"  {printable(name):<32} {shortened(printable(text), LONGEST_MESSAGE)}")


COMMANDS: tuple[Callable[..., None], ...] = (
    *(run, resume, check, replay, report, compare, export, modes, import_modes_command, response, sequence, wave, part),
    *(tracks, drift_map, calibrate, merge, new, list_, schema, app_command),
)
NAMES = {import_modes_command: "modes import", list_: "list"}  # those that are not of their functions
for _command in COMMANDS:
    app.command(NAMES.get(_command))(_command)


def main() -> NoReturn:
    """Entry point: every error a user can act on becomes one line on stderr and an exit code."""
    sys.unraisablehook = _silent_interrupt
    try:
        try:
            app()
        finally:
            sys.stdout.flush()  # here, where a full disk can still be told
    except FeederSimError as error:
        print(f"feeder-sim: {error}", file=sys.stderr, flush=True)
        # HDF5 would crash in its own clean-up of a file it could not write, and so would Python's of threads that still
        # compile when a run is interrupted.
        if isinstance(error, RecordingFailed | Interrupted):
            os._exit(error.exit_code)
        sys.exit(error.exit_code)
    except (OSError, ImportError) as error:  # a file or folder that cannot be read, made or written; a library
        if failure := library_failure(error):
            print(f"feeder-sim: {failure}", file=sys.stderr, flush=True)
            sys.exit(failure.exit_code)
        if isinstance(error, ImportError):
            raise
        name = error.filename or "standard output or a file"
        print(f"feeder-sim: {printable(f'{name}: {cause_of(error)}')}", file=sys.stderr, flush=True)
        if of_a_name(error):
            sys.exit(InputError.exit_code)
        os._exit(FeederSimError.exit_code)  # Python would try once more to write what it could not
    except KeyboardInterrupt:
        print("feeder-sim: interrupted", file=sys.stderr, flush=True)
        os._exit(Interrupted.exit_code)
    sys.exit(0)


def _silent_interrupt(failure: sys.UnraisableHookArgs) -> None:
    """Ctrl-C just as objects are cleaned up, when everything is done, is no failure."""
    if failure.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(failure)
