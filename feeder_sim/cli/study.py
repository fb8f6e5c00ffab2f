"""Commands that ask a question of many runs, made from its fields: sweep, uncertainty, optimise, map; and merge."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_origin

import typer

from feeder_sim.cli.files import (
    AsJson,
    Dask,
    EngineName,
    Measure,
    ScenarioFile,
    Seed,
    Set,
    WorkerCount,
    file_in_errors,
    options_in_errors,
    scenario_of,
)
from feeder_sim.cli.terminal import at_terminal, notify
from feeder_sim.errors import FeederSimError, InputError, Interrupted, escaped, option_of, printable

if TYPE_CHECKING:
    from feeder_sim.studies.question import Question
    from feeder_sim.studies.study import Study

_TASK = re.compile(r"(\d{1,6})/(\d{1,6})")
_TIME = re.compile(r"(\d+(?:\.\d+)?)(s|min|h)")
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}


def share_of(text: str) -> float:
    """A share, written as 3% or as 0.03.

    Raises:
        InputError: it is neither.
    """
    try:
        share = float(text[:-1]) / 100.0 if text.endswith("%") else float(text)
        if not 0.0 < share < 1.0:
            raise ValueError
    except ValueError:
        raise InputError(f"is {text!r}, must be a share such as 3% or 0.03", key="--until-se") from None
    return share


def seconds_of(text: str) -> float:
    """A time [s].

    Raises:
        InputError: it is no time above 0.
    """
    match = _TIME.fullmatch(text)
    if match is None or float(match[1]) == 0.0:
        raise InputError(f"is {text!r}, must be a time such as 90s, 30min or 1h", key="--budget")
    return float(match[1]) * _SECONDS[match[2]]


READERS: dict[str, Callable[[str], float]] = {
    "until_se": share_of,
    "budget_s": seconds_of,
}  # of what is written as text


def options_of(question: type[Question]) -> list[inspect.Parameter]:
    """The fields of a question as options, with their limits and descriptions."""
    options = []
    for name, field in question.model_fields.items():
        kind: Any = field.annotation
        as_text, default = name in READERS, field.get_default()
        if as_text:
            kind = str | None
        elif get_origin(kind) is tuple:
            kind, default = (list[str], inspect.Parameter.empty) if field.is_required() else (list[str] | None, None)
        limits = {"min": "ge", "max": "le"}
        span = {name: getattr(part, of) for name, of in limits.items() for part in field.metadata if hasattr(part, of)}
        option = typer.Option(option_of(name), help=field.description, **({} if as_text else span))
        annotation: Any = Annotated[kind, option]
        options.append(inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation))
    return options


def study_command(name: str, title: str) -> Any:
    """The command that asks a question, for the group of commands.

    Its options are the fields of the question, which takes long to import: so it is made when it is called.
    """
    from feeder_sim.studies.ask import KINDS

    kind = KINDS[name]

    def asks(
        *,
        scenario_file: ScenarioFile,
        settings: Set = None,
        seed: Seed = None,
        engine: EngineName = None,
        out: Path | None = None,
        workers: WorkerCount = None,
        dask: Dask = None,
        task: Annotated[
            str | None, typer.Option("--task", help="I/N: only every N-th point from the I-th on, for job arrays.")
        ] = None,
        as_json: AsJson = False,
        **options: Any,
    ) -> None:
        scenario, share = scenario_of(scenario_file, engine, None, seed, settings), _task_of(task)
        with file_in_errors(scenario_file):
            from feeder_sim.pool.work import Work
            from feeder_sim.studies.ask import ask, folder_of

            read = {name: READERS[name](v) if name in READERS and v is not None else v for name, v in options.items()}
            question = kind.of(**read)
            folder = folder_of(question, scenario, out, name=scenario_file.stem, share=share)
            with at_terminal(Work(workers), scenario_file.stem, dask) as work:
                study = ask(question, scenario, folder, file=scenario_file, share=share, work=work)
            print_study(study, folder.path, as_json)
        finish(study, goes_on="the same command goes on")

    place = typer.Option("--out", help=f"Folder of the answer [{kind.base}/NAME].")
    parameters = {name: p for name, p in inspect.signature(asks, eval_str=True).parameters.items() if name != "options"}
    parameters["out"] = parameters["out"].replace(annotation=Annotated[Path | None, place])
    order = [parameters.pop("scenario_file"), *options_of(kind), *parameters.values()]
    asks.__signature__ = inspect.Signature(order)  # type: ignore[attr-defined]
    asks.__annotations__ = {parameter.name: parameter.annotation for parameter in order}
    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(name, help=title)(asks)
    return typer.main.get_command(alone)


def merge(
    folder: Annotated[Path, typer.Argument(help="Folder of a study, as job arrays leave it.", show_default=False)],
    measure: Measure = None,
    as_json: AsJson = False,
) -> None:
    """Make the table of a study out of what the tasks of a job array have done."""
    from feeder_sim.studies.ask import merged

    with options_in_errors():
        study = merged(folder, measure)
    print_study(study, folder, as_json, measure)
    finish(study, measure, goes_on="the tasks that are missing can be run again", code=FeederSimError.exit_code)


def print_study(study: Study, folder: Path, as_json: bool, measure: str | None = None) -> None:
    """Print what there is; measure: to show."""
    if as_json:
        print(json.dumps({"folder": str(folder), **study.as_json(measure)}))
        return
    for line in [*study.lines(measure), f"{study.size} in {folder}"]:
        print(escaped(line))


def finish(study: Study, measure: str | None = None, *, goes_on: str, code: int = Interrupted.exit_code) -> None:
    """Say what misleads and what went wrong; the exit code tells the latter too.

    Args:
        study: what was found.
        measure: that is shown.
        goes_on: what goes on with it where it is not complete.
        code: of a study that is not complete.
    """
    for remark in study.remarks(measure):
        if remark.tone != "note":
            notify(f"warning: {remark.text}" if remark.tone == "warning" else remark.text)
    for failure in study.failures[:3]:
        typer.echo(f"feeder-sim: failed: {printable(failure)}", err=True)
    if not study.complete:
        typer.echo(f"feeder-sim: not complete; what was computed is kept, {goes_on}", err=True)
        raise typer.Exit(code)
    if study.failures:
        raise typer.Exit(1)


def _task_of(text: str | None) -> tuple[int, int] | None:
    """Number and how many, of a task of a job array.

    Raises:
        InputError: it is not I/N with I from 1 to N.
    """
    if text is None:
        return None
    match = _TASK.fullmatch(text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise InputError(f"is {text!r}, must be I/N with I from 1 to N", key="--task")
    return int(match[1]), int(match[2])
