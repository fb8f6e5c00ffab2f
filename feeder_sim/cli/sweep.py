"""`feeder-sim sweep` and `feeder-sim merge`: a scenario at many points, and the table of it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from feeder_sim.cli.files import naming, naming_options, scenario_of
from feeder_sim.cli.options import AsJson, Dask, EngineName, Measure, ScenarioFile, Seed, Seeds, Set, WorkerCount
from feeder_sim.cli.terminal import notify, progress_bar, stop_on_signal
from feeder_sim.errors import FeederSimError, InputError, Interrupted, printable

if TYPE_CHECKING:
    from feeder_sim.jobs.folder import WorkFolder
    from feeder_sim.studies.sweep.cases import Sweep

MOST_LINES = 60  # of a table on the terminal
_TASK = re.compile(r"(\d{1,6})/(\d{1,6})")

Vary = Annotated[
    list[str],
    typer.Option(
        "--vary", help="KEY=LOW:HIGH:COUNT, LOW:HIGH:logCOUNT or A,B,C; for --sobol also LOW:HIGH.", show_default=False
    ),
]
Inputs = Annotated[int, typer.Option("--inputs", min=2, max=4096, help="Draws of inputs that are [uncertain].")]


def sweep(
    scenario_file: ScenarioFile,
    vary: Vary,
    settings: Set = None,
    zipped: Annotated[bool, typer.Option("--zip", help="Take the axes side by side, not crossed.")] = False,
    sobol: Annotated[int, typer.Option("--sobol", min=0, help="Points of a Sobol sample over the axes.")] = 0,
    seeds: Seeds = None,
    seed: Seed = None,
    engine: EngineName = None,
    measure: Measure = None,
    until_se: Annotated[
        str | None, typer.Option("--until-se", help="More seeds until the standard error is below, such as 3%.")
    ] = None,
    most_seeds: Annotated[
        int, typer.Option("--most-seeds", min=8, max=1_000_000, help="Of a point, whatever --until-se asks for.")
    ] = 1000,
    inputs: Inputs = 16,
    out: Annotated[Path | None, typer.Option("--out", help="Folder of the sweep [sweeps/NAME].")] = None,
    workers: WorkerCount = None,
    dask: Dask = None,
    task: Annotated[
        str | None, typer.Option("--task", help="I/N: only every N-th point from the I-th on, for job arrays.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Run a scenario at many points; running the same again goes on with what is not done."""
    scenario = scenario_of(scenario_file, engine, seeds, seed, settings)
    share = _task_of(task)
    with naming(scenario_file):
        from feeder_sim.jobs.workers import workers_of
        from feeder_sim.studies.sweep.cases import Cases, run_cases, take_checked
        from feeder_sim.studies.sweep.folder import not_counted, sweep_folder
        from feeder_sim.studies.sweep.question import Question

        wanted = 0.0 if until_se is None else _share_of(until_se)
        question = Question(tuple(vary), zipped, sobol, seeds or 0, measure or "", wanted, inputs, most_seeds)
        whole = Cases.of(scenario, question, file=scenario_file)
        cases = whole.part(*share) if share else whole
        title = f"{scenario_file.stem}: {len(cases.points)} points"
        folder = sweep_folder(out, scenario_file.stem, scenario, question, share)
        others = take_checked(whole, folder.journals)  # what other tasks have done is not of others
        if others and not cases.all_done:
            notify(not_counted(others))
        with (
            stop_on_signal() as stop,
            progress_bar(title, stop) as progress,
            workers_of(workers, dask) as found,
            folder,  # last: a command that is refused leaves the question in it as it was
        ):
            done = run_cases(cases, found, folder.journal, others=others, stop=stop, progress=progress)
        _finish(done, folder, measure, as_json, table=share is None)


def merge(
    folder: Annotated[Path, typer.Argument(help="Folder of a sweep, as job arrays leave it.", show_default=False)],
    measure: Measure = None,
    as_json: AsJson = False,
) -> None:
    """Make the table of a sweep out of what the tasks of a job array have done."""
    from feeder_sim.studies.sweep.folder import merged

    done, home = merged(folder)
    with naming_options(), home:
        _finish(done, home, measure, as_json, table=True, goes_on=False)


def _finish(
    done: Sweep, folder: WorkFolder, measure: str | None, as_json: bool, *, table: bool, goes_on: bool = True
) -> None:
    """Write and print what there is; the exit code says how it ended."""
    from feeder_sim.studies.sweep.folder import PICTURE, not_counted, state_of, write_table

    name = done.measure(measure)
    if table:
        from feeder_sim.plots.sweep import draw_sweep

        write_table(folder, done)
        draw_sweep(done, name, folder.path / PICTURE)
    if as_json:
        rows = [row.as_dict() for row in done.rows]
        print(json.dumps({"folder": str(folder.path), "measure": name, "rows": rows} | state_of(done)))
    else:
        print_table(done, name)
        print(f"{len(done.cases.points)} points in {printable(str(folder.path))}")
    for line in _remarks(done, name):
        notify(line)
    for failure in done.failures[:3]:
        typer.echo(f"feeder-sim: failed: {printable(failure)}", err=True)
    if not done.complete:
        if done.others and not goes_on:  # a sweep has said so before it began
            notify(not_counted(done.others))
        more = "the same command goes on" if goes_on else "the tasks that are missing can be run again"
        typer.echo(f"feeder-sim: not complete; what was computed is kept, {more}", err=True)
        raise typer.Exit(Interrupted.exit_code if goes_on else FeederSimError.exit_code)
    if done.failures:
        raise typer.Exit(1)


def _remarks(done: Sweep, measure: str) -> Iterator[str]:
    """What is to be known about the table, a line each."""
    from feeder_sim.studies.sweep.table import means_of_some

    for caution in done.cautions:
        yield f"caution: {caution.in_words()}"
    some = means_of_some(done.of(measure))
    if some:
        yield f"caution: {measure}: {some}"
    effort = done.cases.effort
    if done.short and effort.until_se:
        yield (
            f"caution: {done.short} of {len(done.cases.points)} points have not reached --until-se "
            f"{100.0 * effort.until_se:g}% with as many seeds as --most-seeds allows, {effort.most_seeds}"
        )
    if done.kept:
        yield f"{done.kept} points keep the seeds that they had, which are more than asked for now"


def print_table(done: Sweep, measure: str) -> None:
    """One measure over the points."""
    keys, rows = done.keys, done.at_every_point(measure)
    more = ("low", "high") if done.uncertain else ()
    counts = ("n", "seeds", "failed")
    head = [*keys, measure or "measure", "+-", *more, *counts]
    lines = [[_text(row.as_dict().get(column)) for column in (*keys, "mean", "se", *more, *counts)] for row in rows]
    shown = lines[:MOST_LINES]
    widths = [max(len(row[i]) for row in [head, *shown]) for i in range(len(head))]
    for line in [head, *shown]:
        print("  ".join(printable(text).rjust(width) for text, width in zip(line, widths, strict=True)))
    if len(lines) > len(shown):
        print(f"and {len(lines) - len(shown)} more points, in the table of the folder")


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _share_of(text: str) -> float:
    """A share, written as 3% or as 0.03.

    Raises:
        InputError: it is neither.
    """
    try:
        share = float(text[:-1]) / 100.0 if text.endswith("%") else float(text)
        if not 0.0 < share < 1.0:
            raise ValueError
    except ValueError:
        raise InputError(f"is {text!r}, allowed is a share such as 3% or 0.03", key="--until-se") from None
    return share


def _task_of(text: str | None) -> tuple[int, int] | None:
    """Number and how many, of a task of a job array.

    Raises:
        InputError: it is not I/N with I from 1 to N.
    """
    if text is None:
        return None
    match = _TASK.fullmatch(text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise InputError(f"is {text!r}, allowed is I/N with I from 1 to N", key="--task")
    return int(match[1]), int(match[2])
