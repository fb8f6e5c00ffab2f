"""`feeder-sim optimise`: the best recipe over some keys of a scenario."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from feeder_sim.cli.files import naming, naming_options, scenario_of
from feeder_sim.cli.options import AsJson, Dask, EngineName, ScenarioFile, Seed, Set, WorkerCount
from feeder_sim.cli.terminal import notify, progress_bar, stop_on_signal
from feeder_sim.errors import InputError, Interrupted, printable

if TYPE_CHECKING:
    from feeder_sim.studies.search.search import Search

OUT = Path("optimise")
_TIME = re.compile(r"(\d+(?:\.\d+)?)(s|min|h)")
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}


def optimise(
    scenario_file: ScenarioFile,
    over: Annotated[
        list[str],
        typer.Option(
            "--over", help="KEY=LOW:HIGH, LOW:HIGH:log or A,B,C; .mode takes its frequency along.", show_default=False
        ),
    ],
    maximise: Annotated[str | None, typer.Option("--maximise", help="Measure that is to be large.")] = None,
    minimise: Annotated[str | None, typer.Option("--minimise", help="Measure that is to be small.")] = None,
    settings: Set = None,
    trials: Annotated[int, typer.Option("--trials", min=1, max=100_000, help="Recipes to try, at most.")] = 200,
    budget: Annotated[
        str | None, typer.Option("--budget", help="Time for the trials, such as 90s, 30min or 1h.")
    ] = None,
    seeds: Annotated[
        int | None, typer.Option("--seeds", min=2, max=1000, help="Seeds of a recipe [the scenario's, up to 8].")
    ] = None,
    check_seeds: Annotated[
        int, typer.Option("--check-seeds", min=2, max=10_000, help="Fresh seeds of the best recipe.")
    ] = 16,
    screen: Annotated[
        Path | None,
        typer.Option("--screen", help="Drift map that screens recipes to begin with, for --minimise arrival_time_s."),
    ] = None,
    recipes: Annotated[int, typer.Option("--recipes", min=2, max=65536, help="Recipes that --screen walks.")] = 256,
    sampler: Annotated[str, typer.Option("--sampler", help="tpe, or cmaes for numbers only.")] = "tpe",
    seed: Seed = None,
    engine: EngineName = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder of the search [optimise/NAME].")] = None,
    workers: WorkerCount = None,
    dask: Dask = None,
    as_json: AsJson = False,
) -> None:
    """Search for the recipe that makes a measure largest or smallest; running the same again goes on."""
    scenario = scenario_of(scenario_file, engine, None, seed, settings)
    from feeder_sim.studies.search.trials import Aim

    with naming_options():
        aim = Aim.of(scenario, maximise, minimise, seeds)
    seconds, checked = _seconds(budget), _sampler(sampler)
    with naming(scenario_file):
        from feeder_sim.jobs.folder import usual_folder
        from feeder_sim.jobs.workers import workers_of
        from feeder_sim.plots.search import draw_search
        from feeder_sim.studies.search.results import (
            PICTURE,
            QUESTION,
            Question,
            as_json_object,
            search_folder,
            write_search,
        )
        from feeder_sim.studies.search.screening import first_recipes
        from feeder_sim.studies.search.search import Budget, search
        from feeder_sim.studies.search.space import Space

        space = Space.of(scenario, over, scenario_file)
        asked = Question.of(over, aim, sampler, screen, recipes)
        path = out or usual_folder(OUT, scenario_file.stem, QUESTION, scenario, asked.same)
        home = search_folder(path, asked, scenario)
        starts = []
        if screen is not None:
            with progress_bar("screening") as progress:
                starts = first_recipes(home.path, space, aim, screen, recipes, progress)
        if starts:
            notify(f"{len(starts)} recipes of {recipes} begin the search")
        with home, stop_on_signal() as stop, progress_bar(scenario_file.stem, stop) as progress:
            with workers_of(workers, dask) as found_workers:
                done = search(
                    space,
                    aim,
                    found_workers,
                    home.path,
                    home.journal,
                    budget=Budget(trials, seconds),
                    check_seeds=check_seeds,
                    sampler=checked,
                    starts=starts,
                    stop=stop,
                    progress=progress,
                    notify=notify,
                )
            write_search(home, done)
            if done.trials:
                draw_search(done, home.path / PICTURE)
    if as_json:
        print(json.dumps({"folder": str(home.path), **as_json_object(done)}))
    else:
        _print(done, home.path)
    _end(done)


def _end(done: Search) -> None:
    """End with the exit code of what was found, and a line where it is not what was asked for."""
    measure = done.aim.measure
    for caution in done.cautions:
        notify(f"caution: {caution.in_words('recipes')}")
    for line in done.best.cautions if done.best else ():
        notify(f"caution: the best recipe: {line}")
    if not done.complete:
        typer.echo("feeder-sim: not complete; what was computed is kept, the same command goes on", err=True)
        raise typer.Exit(Interrupted.exit_code)
    if done.best is None:
        typer.echo(f"feeder-sim: no recipe has {measure} in all its seeds", err=True)
        raise typer.Exit(1)
    if done.best.without_value:
        seeds = f"{done.best.without_value} of {len(done.best.values)} fresh seeds"
        typer.echo(f"feeder-sim: the best recipe has no {measure} in {seeds}, its mean is of the others", err=True)
        raise typer.Exit(1)


def _print(done: Search, folder: Path) -> None:
    """What was found, in words."""
    from feeder_sim.jobs.cautions import most_frequent
    from feeder_sim.measures.protocol import labelled

    stopped = sum(trial.stopped for trial in done.trials)
    print(labelled("trials", f"{len(done.trials)}, {stopped} of them stopped early"))
    if done.without_value:
        print(labelled("without a value", f"{len(done.without_value)}, mostly: {most_frequent(done.without_value)}"))
    for label, checked in (("as it is", done.present), ("best", done.best)):
        if checked is not None:
            found = checked.found
            value = f"{found.mean:.4g} +- {found.se:.2g}" if found.n > 1 else "in one seed at most"
            print(labelled(label, f"{done.aim.measure} {value}, {found.n} of {len(checked.values)} fresh seeds"))
    if done.gain.n > 1:
        low, high = done.gain.interval
        pairs = f"{done.gain.n} pairs of seeds"
        print(labelled("difference", f"{done.gain.mean:+.4g}, 95 % interval {low:+.4g} to {high:+.4g}, {pairs}"))
    if done.best and done.best.point:
        for key, value in done.best.point.items():
            print(labelled("", f"{key} = {value:.4g}" if isinstance(value, float) else f"{key} = {value}"))
    print(labelled("in", printable(str(folder))))


def _sampler(name: str) -> Literal["tpe", "cmaes"]:
    if name == "tpe":
        return "tpe"
    if name == "cmaes":
        return "cmaes"
    raise InputError(f"is {name!r}, allowed is tpe or cmaes", key="--sampler")


def _seconds(text: str | None) -> float:
    """A time [s]; without one there is no limit.

    Raises:
        InputError: it is no time above 0.
    """
    if text is None:
        return math.inf
    match = _TIME.fullmatch(text)
    if match is None or float(match[1]) == 0.0:
        raise InputError(f"is {text!r}, allowed is a time such as 90s, 30min or 1h", key="--budget")
    return float(match[1]) * _SECONDS[match[2]]
