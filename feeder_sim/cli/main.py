"""Command line: parse, call, print.

Data on stdout, progress and messages on stderr; exit 0 done, 1 the run failed, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from feeder_sim import __version__
from feeder_sim.cli.app import app as app_command
from feeder_sim.cli.commands import Commands
from feeder_sim.cli.compare import compare
from feeder_sim.cli.drift_map import drift_map
from feeder_sim.cli.files import (
    AsJson,
    Dask,
    EngineName,
    OptionalScenarioFile,
    ScenarioFile,
    Seed,
    Seeds,
    Set,
    StallAfter,
    ThreadCount,
    file_in_errors,
    options_in_errors,
    scenario_of,
    writable,
)
from feeder_sim.cli.import_modes import import_modes_command
from feeder_sim.cli.new import new
from feeder_sim.cli.part import part
from feeder_sim.cli.plate import modes, sequence, wave
from feeder_sim.cli.replay import replay
from feeder_sim.cli.report import as_lines, print_result
from feeder_sim.cli.report_page import report
from feeder_sim.cli.response import response
from feeder_sim.cli.schema import schema
from feeder_sim.cli.study import merge
from feeder_sim.cli.terminal import at_terminal
from feeder_sim.cli.uncertainty import (
    DRAWS,
    SEEDS,
    RunInputs,
    end_uncertain,
    go_on_uncertain,
    is_uncertainty_pending,
    record_inputs,
    recorded_inputs,
    run_uncertain,
    uncertain_lines,
)
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

if TYPE_CHECKING:
    from feeder_sim.run.simulation import Result
    from feeder_sim.scenario import Scenario


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


@app.command()
def run(
    scenario_file: OptionalScenarioFile = None,
    engine: EngineName = None,
    seeds: Seeds = None,
    seed: Seed = None,
    settings: Set = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the run [runs/NAME-001, -002, ...].")] = None,
    as_json: AsJson = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be done, as `check` does.")] = False,
    resume: Annotated[Path | None, typer.Option("--resume", help="Go on with the interrupted run in a folder.")] = None,
    inputs: RunInputs = None,
    stall_after: StallAfter = None,
    workers: ThreadCount = None,
    dask: Dask = None,
    replay_too: Annotated[
        bool, typer.Option("--replay", help="Build the replay at once; else when it is first looked at.")
    ] = False,
) -> None:
    """Simulate a scenario and record it, or go on with a run that was interrupted."""
    from feeder_sim.run.watchdog import STALL_AFTER_S
    from feeder_sim.run.work import Work

    with options_in_errors():
        given = Work(workers, stall_after=STALL_AFTER_S if stall_after is None else stall_after)
    if resume is not None:
        extra = {"a scenario": scenario_file, "--engine": engine, "--seeds": seeds, "--seed": seed, "--set": settings}
        extra |= {"--out": out}
        also = [name for name, value in extra.items() if value is not None]
        if also or dry_run:
            raise InputError(
                f"goes on with what is in the folder, {(also or ['--dry-run'])[0]} is not allowed with it",
                key="--resume",
            )
        from feeder_sim.run.run_folder import resume_run

        draws = recorded_inputs(resume, inputs)
        if is_uncertainty_pending(resume):
            go_on_uncertain(resume, draws, as_json)
            return
        with at_terminal(given, str(resume), dask) as work:
            result = resume_run(resume, replay=replay_too, work=work)
        _finish_run(result, resume, as_json, draws)
        return
    if scenario_file is None:
        raise InputError("a scenario file is needed, or --resume with the folder of a run", key="run")
    scenario = scenario_of(scenario_file, engine, seeds, seed, settings)
    with file_in_errors(scenario_file):
        from feeder_sim.run.run_folder import check_free, fresh_folder, record_run

        if out is not None:
            check_free(out)
        if dry_run:
            _print_plan(scenario, as_json, inputs or DRAWS)
            return
        folder = out or fresh_folder(scenario_file.stem)
        try:
            with at_terminal(given, scenario.title or scenario_file.stem, dask) as work:
                result = record_run(scenario, folder, replay=replay_too, work=work)
        except BaseException:
            if out is None:
                with contextlib.suppress(OSError):  # it holds something
                    folder.rmdir()
            raise
    _finish_run(result, folder, as_json, inputs or DRAWS)


def _finish_run(result: Result, folder: Path, as_json: bool, inputs: int) -> None:
    """Go on to the uncertain inputs, if there are any; print what came out; the exit code says how it ended."""
    from feeder_sim.run.prepare import ignored_uncertainty

    is_complete = not result.interrupted and not result.failures
    if not as_json:
        print_result(result, folder, as_json, {})
    uncertain = run_uncertain(result.prepared.scenario, folder, inputs) if is_complete else None
    if not is_complete:
        record_inputs(result.prepared.scenario, folder, inputs)
    if as_json:
        print_result(result, folder, as_json, {"uncertainty": uncertain.as_json()} if uncertain else {})
    elif uncertain:
        print(uncertain_lines(uncertain))
    if not (uncertain and uncertain.measure()):
        for warning in ignored_uncertainty(result.scenario):
            print(f"feeder-sim: warning: {printable(warning)}", file=sys.stderr)
    for failure in result.failures:
        print(f"feeder-sim: {failure}", file=sys.stderr)
    if result.interrupted:
        name = printable(str(folder))
        print(f"feeder-sim: interrupted; what was computed is in {name}, --resume {name} goes on", file=sys.stderr)
        raise typer.Exit(Interrupted.exit_code)
    if result.failures:
        raise typer.Exit(1)
    if uncertain:
        end_uncertain(uncertain, folder)


@app.command()
def check(
    scenario_file: ScenarioFile,
    engine: EngineName = None,
    seeds: Seeds = None,
    settings: Set = None,
    as_json: AsJson = False,
    full: Annotated[bool, typer.Option("--full", help="Print all values, by the keys that --json has.")] = False,
    mjcf: Annotated[Path | None, typer.Option("--mjcf", help="Also write the scene as MJCF.")] = None,
) -> None:
    """Validate a scenario; say what moves and how strongly, which engine runs it, and what it costs."""
    scenario = scenario_of(scenario_file, engine, seeds, None, settings)
    with file_in_errors(scenario_file):
        if mjcf is not None:
            from feeder_sim.run.run_folder import mjcf_text
            from feeder_sim.scene.scene import build_scene

            text = mjcf_text(build_scene(scenario))
            writable(mjcf).write_text(text, encoding="utf-8")
        _print_plan(scenario, as_json, DRAWS, full=full)


app.command()(modes)
app.command("modes import")(import_modes_command)
app.command("drift-map")(drift_map)
app.command("app")(app_command)
for command in (response, sequence, wave, part, merge, new, compare, schema):
    app.command()(command)


@app.command("list")
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


app.command()(replay)
app.command()(report)


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


def _print_plan(scenario: Scenario, as_json: bool, inputs: int, *, full: bool = False) -> None:
    from feeder_sim.cli.plan import plan_lines
    from feeder_sim.run.plan import plan_run
    from feeder_sim.run.prepare import prepare

    plan = plan_run(prepare(scenario), inputs * SEEDS)
    print(json.dumps(plan) if as_json else as_lines(plan) if full else plan_lines(plan))
