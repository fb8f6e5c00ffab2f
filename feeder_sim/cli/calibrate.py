"""The command `calibrate`: constants from measurements."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.cli.files import AsJson, Dask, WorkerCount, file_in_errors
from feeder_sim.cli.study import finish, print_study
from feeder_sim.cli.terminal import at_terminal


def calibrate(
    file: Annotated[Path, typer.Argument(help="TOML file of experiments and priors.", show_default=False)],
    points: Annotated[int | None, typer.Option("--points", min=16, help="Points of each of two rounds [32].")] = None,
    seeds: Annotated[int | None, typer.Option("--seeds", min=2, help="Seeds of every point [8].")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder of the answer [calibrations/NAME].")] = None,
    workers: WorkerCount = None,
    dask: Dask = None,
    as_json: AsJson = False,
) -> None:
    """What measurements say about constants, and what they cannot decide; running the same again goes on."""
    from feeder_sim.pool.work import Work
    from feeder_sim.studies.ask import ask, folder_of
    from feeder_sim.studies.calibration.calibrate import calibration_of

    with file_in_errors(file):
        question = calibration_of(file, points, seeds)
        scenario = question.experiment[0].scenario
        folder = folder_of(question, scenario, out, name=file.stem)
        with at_terminal(Work(workers), file.stem, dask) as work:
            study = ask(question, scenario, folder, file=file, work=work)
        print_study(study, folder.path, as_json)
    finish(study, goes_on="the same command goes on")
