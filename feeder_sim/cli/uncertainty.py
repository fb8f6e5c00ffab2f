"""Uncertain inputs of a run: `run` goes on to them once all its seeds have ended."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from feeder_sim.cli.files import options_in_errors
from feeder_sim.cli.study import finish
from feeder_sim.cli.terminal import at_terminal
from feeder_sim.errors import InputError, NotAllowed, printable

if TYPE_CHECKING:
    from feeder_sim.scenario import Scenario
    from feeder_sim.studies.study import Study

FOLDER = "uncertainty"
SEEDS = 2  # of a draw: the fewest that tell inputs and seeds apart
DRAWS, MOST_DRAWS = 16, 4096  # of a run
RunInputs = Annotated[
    int | None,
    typer.Option("--inputs", min=2, max=MOST_DRAWS, help=f"Draws of inputs that are [uncertain] [{DRAWS}]."),
]


def run_uncertain(scenario: Scenario, run: Path, inputs: int) -> Study | None:
    """Run the scenario of a run at draws of its uncertain inputs; None where it has none."""
    if not scenario.uncertain:
        return None
    from feeder_sim.run.work import Work
    from feeder_sim.studies.ask import ask, folder_of
    from feeder_sim.studies.uncertainty.uncertainty import UncertaintyQuestion

    question = UncertaintyQuestion(inputs=inputs, seeds=SEEDS)
    with options_in_errors(), at_terminal(Work(), "uncertain inputs") as work:
        folder = folder_of(question, scenario, run / FOLDER)
        return ask(question, scenario, folder, work=work)


def uncertain_lines(study: Study) -> str:
    """What they have come to, below what the run has."""
    lines = [f"with uncertain inputs, {study.size}:", *study.lines()]
    return "\n".join(f"  {line}" for line in lines)


def record_inputs(scenario: Scenario, run: Path, inputs: int) -> None:
    """Note how many draws were asked for in the folder of a run that has not come to them."""
    from feeder_sim.studies.ask import folder_of
    from feeder_sim.studies.uncertainty.uncertainty import UncertaintyQuestion

    if scenario.uncertain:
        question = UncertaintyQuestion(inputs=inputs, seeds=SEEDS)
        with options_in_errors(), folder_of(question, scenario, run / FOLDER):
            pass


def recorded_inputs(run: Path, request: int | None) -> int:
    """How many draws a run goes on with: as many as its folder says, or else those that are requested.

    Raises:
        InputError: another number is requested than the folder says, or what it says cannot be read.
    """
    file = run / FOLDER / f"{FOLDER}.toml"
    try:
        recorded = tomllib.loads(file.read_text(encoding="utf-8"))["inputs"]
    except (FileNotFoundError, NotADirectoryError):
        return request or DRAWS
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"does not say what was asked: {error}", file=file) from error
    if type(recorded) is not int or recorded < SEEDS:
        raise NotAllowed(recorded, "a whole number of at least 2", file=file, key="inputs")
    if request not in (None, recorded):
        raise InputError(f"is {request}, must be {recorded}, which the run was begun with", file=run, key="--inputs")
    return recorded


def is_uncertainty_pending(run: Path) -> bool:
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

    study = run_uncertain(load_scenario(run / RESOLVED), run, inputs)
    if study is None:
        raise InputError("has ended, there is nothing to resume", file=run, key="--resume")
    print(json.dumps({"folder": str(run), "uncertainty": study.as_json()}) if as_json else uncertain_lines(study))
    end_uncertain(study, run)


def end_uncertain(study: Study, run: Path) -> None:
    """Say what misleads and what went wrong; the exit code tells the latter too."""
    finish(study, goes_on=f"--resume {printable(str(run))} goes on")
