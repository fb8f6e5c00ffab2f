"""`feeder-sim uncertainty`: what a scenario comes to when inputs of it are uncertain."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from feeder_sim.cli.files import naming, naming_options, scenario_of
from feeder_sim.cli.options import AsJson, Dask, EngineName, Measure, ScenarioFile, Seed, Set, WorkerCount
from feeder_sim.cli.report_uncertainty import as_json_object, lines_of
from feeder_sim.cli.terminal import notify, progress_bar, stop_on_signal
from feeder_sim.errors import InputError, Interrupted, nearest, printable

if TYPE_CHECKING:
    from feeder_sim.jobs.folder import WorkFolder
    from feeder_sim.jobs.workers import Workers
    from feeder_sim.scenario import Scenario
    from feeder_sim.studies.uncertainty.propagate import Propagation
    from feeder_sim.studies.uncertainty.question import Question

OUT = Path("uncertainty")
SEEDS = 2  # of a draw: the fewest that tell inputs and seeds apart
DRAWS, MOST_DRAWS = 16, 4096  # of a run
RunInputs = Annotated[
    int | None,
    typer.Option("--inputs", min=2, max=MOST_DRAWS, help=f"Draws of inputs that are [uncertain] [{DRAWS}]."),
]


def uncertainty(
    scenario_file: ScenarioFile,
    settings: Set = None,
    inputs: Annotated[int, typer.Option("--inputs", min=2, max=65536, help="Draws of the uncertain inputs.")] = 32,
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Seeds of every draw.")] = SEEDS,
    seed: Seed = None,
    engine: EngineName = None,
    indices: Annotated[
        bool, typer.Option("--indices", help="Also Sobol indices; takes (number of inputs + 2) times the draws.")
    ] = False,
    measure: Measure = None,
    measured: Annotated[float | None, typer.Option("--measured", help="Value to mark in the picture.")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the tables [uncertainty/NAME].")] = None,
    workers: WorkerCount = None,
    dask: Dask = None,
    as_json: AsJson = False,
) -> None:
    """Run a scenario at many draws of its [uncertain] inputs; running the same again goes on."""
    scenario = scenario_of(scenario_file, engine, None, seed, settings)
    with naming(scenario_file):
        from feeder_sim.jobs.folder import usual_folder
        from feeder_sim.jobs.workers import workers_of
        from feeder_sim.studies.uncertainty.propagate import QUESTION, check_propagated
        from feeder_sim.studies.uncertainty.question import Question

        check_propagated(scenario, inputs, seeds, indices)
        mark = math.nan if measured is None else measured
        name, question = scenario_file.stem, Question(inputs, seeds, indices, measure or "", mark)
        folder = out or usual_folder(OUT, name, QUESTION, scenario, question.same)
        with stop_on_signal() as stop, progress_bar(name, stop) as progress, workers_of(workers, dask) as found:
            done = propagate_into(folder, scenario, found, question, stop=stop, progress=progress)
        shown = _measure(done, measure)
        _draw(done, shown, folder, measured)
    if as_json:
        print(json.dumps({"folder": str(folder), **as_json_object(done)}))
    else:
        for line in [*lines_of(done, shown, measured), f"{len(done.draws)} draws in {printable(str(folder))}"]:
            print(line)
    finish(done)


def propagate_into(
    path: Path,
    scenario: Scenario,
    workers: Workers,
    question: Question,
    *,
    stop: threading.Event,
    progress: Callable[[float], None],
) -> Propagation:
    """Run what is not done yet, and write the tables."""
    from feeder_sim.studies.uncertainty.propagate import propagate, write_propagation

    with naming_options(), _work_folder(path, scenario, question) as folder:
        done = propagate(
            scenario,
            inputs=question.inputs,
            seeds=question.seeds,
            indices=question.indices,
            workers=workers,
            measure=question.measure,
            journal=folder.journal,
            stop=stop,
            progress=progress,
        )
        write_propagation(folder, done)
    return done


def _work_folder(path: Path, scenario: Scenario, question: Question) -> WorkFolder:
    from feeder_sim.jobs.folder import WorkFolder
    from feeder_sim.studies.uncertainty.propagate import QUESTION

    return WorkFolder(path, QUESTION, question.as_toml(), scenario, same=question.same)


@dataclass(frozen=True)
class UncertainRun:
    """What the uncertain inputs of a run have come to; `folder` is that of the run."""

    done: Propagation
    folder: Path

    def as_json(self) -> dict[str, Any]:
        return as_json_object(self.done)

    def as_text(self) -> str:
        lines = [f"with uncertain inputs, {len(self.done.draws)} draws:", *lines_of(self.done, self.done.main())]
        return "\n".join(f"  {line}" for line in lines)

    def finish(self) -> None:
        finish(self.done, f"--resume {printable(str(self.folder))} goes on")


def run_uncertain(scenario: Scenario, run: Path, inputs: int) -> UncertainRun | None:
    """Run the scenario of a run at draws of its uncertain inputs; None where it has none."""
    if not scenario.uncertain:
        return None
    from feeder_sim.jobs.workers import local_workers
    from feeder_sim.studies.uncertainty.question import Question

    folder = run / OUT.name
    with stop_on_signal() as stop, progress_bar("uncertain inputs", stop) as progress, local_workers() as workers:
        done = propagate_into(folder, scenario, workers, Question(inputs, SEEDS), stop=stop, progress=progress)
    _draw(done, done.main(), folder, None)
    return UncertainRun(done, run)


def keep_asked(scenario: Scenario, run: Path, inputs: int) -> None:
    """Note how many draws were asked for in the folder of a run that has not come to them."""
    from feeder_sim.studies.uncertainty.question import Question

    if scenario.uncertain:
        with naming_options(), _work_folder(run / OUT.name, scenario, Question(inputs, SEEDS)):
            pass


def inputs_asked(run: Path, given: int | None) -> int:
    """How many draws a run goes on with: as many as its folder says, or else those that are given.

    Raises:
        InputError: another number is given than the folder says, or what it says cannot be read.
    """
    from feeder_sim.studies.uncertainty.propagate import asked_in

    asked = asked_in(run / OUT.name)
    if given is not None and asked not in (None, given):
        raise InputError(f"is {given}, allowed is {asked}, which the run was begun with", file=run, key="--inputs")
    return asked or given or DRAWS


def left_uncertain(run: Path) -> bool:
    """Whether a run has ended, but not its uncertain inputs."""
    from feeder_sim.run.run_folder import RESOLVED, SUMMARY

    try:
        interrupted = json.loads((run / SUMMARY).read_text(encoding="utf-8"))["interrupted"]
        uncertain = "[uncertain" in (run / RESOLVED).read_text(encoding="utf-8")
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return not interrupted and uncertain


def go_on_uncertain(run: Path, inputs: int, as_json: bool) -> None:
    """Go on with the uncertain inputs of a run that has ended itself."""
    from feeder_sim.run.run_folder import RESOLVED
    from feeder_sim.scenario import load_scenario

    found = run_uncertain(load_scenario(run / RESOLVED), run, inputs)
    if found is None:
        raise InputError("has ended, there is nothing to resume", file=run, key="--resume")
    print(json.dumps({"folder": str(run), "uncertainty": found.as_json()}) if as_json else found.as_text())
    found.finish()


def _draw(done: Propagation, measure: str, folder: Path, measured: float | None) -> None:
    from feeder_sim.plots.uncertainty import draw_uncertainty
    from feeder_sim.studies.uncertainty.propagate import PICTURE

    if measure:
        draw_uncertainty(done, measure, folder / PICTURE, measured)


def finish(done: Propagation, goes_on: str = "the same command goes on") -> None:
    """Say what misleads and what went wrong; the exit code tells the latter too."""
    from feeder_sim.jobs.cautions import cautions_over

    for caution in cautions_over(case.done.values() for case in done.swept.cases):
        notify(f"caution: {caution.in_words('draws')}")
    if done.swept.kept:
        notify("caution: draws keep the seeds that they had, which are more than asked for now")
    for failure in done.swept.failures[:3]:
        typer.echo(f"feeder-sim: failed: {printable(failure)}", err=True)
    if not done.swept.complete:
        typer.echo(f"feeder-sim: not complete; what was computed is kept, {goes_on}", err=True)
        raise typer.Exit(Interrupted.exit_code)
    if done.swept.failures:
        raise typer.Exit(1)


def _measure(done: Propagation, name: str | None) -> str:
    if name is None:
        return done.main()
    if name not in done.measures:
        allowed = ", ".join(done.measures) or "none, nothing has a value"
        raise InputError(f"is {name}{nearest(name, done.measures)}, allowed are {allowed}", key="--measure")
    return name
