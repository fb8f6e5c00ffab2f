"""A scenario at many points: the whole way from axes to a table."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError
from feeder_sim.jobs.workers import given_workers, local_workers
from feeder_sim.scenario import Scenario
from feeder_sim.studies.sweep.case import MOST_SEEDS
from feeder_sim.studies.sweep.cases import Cases, Sweep, run_cases, take_checked
from feeder_sim.studies.sweep.folder import sweep_folder, write_table
from feeder_sim.studies.sweep.question import Question, axis_texts


def sweep(
    scenario: Scenario,
    vary: Mapping[str, Any],
    *,
    zipped: bool = False,
    sobol: int = 0,
    seeds: int | None = None,
    measure: str | None = None,
    until_se: float | None = None,
    most_seeds: int = MOST_SEEDS,
    inputs: int = 16,
    workers: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
    stop: threading.Event | None = None,
) -> Sweep:
    """Run a scenario at every point of a design; see `feeder_sim.sweep`, which gives more to look at."""
    if seeds is not None and seeds < 1:
        raise InputError(f"is {seeds}, allowed is 1 or more", key="seeds")
    question = Question(
        axis_texts(vary),
        zipped,
        sobol,
        seeds=seeds or 0,
        measure=measure or "",
        until_se=until_se or 0.0,
        inputs=inputs,
        most_seeds=most_seeds,
    )
    cases = Cases.of(scenario, question, file=Path("scenario"))
    with given_workers(executor, workers) if executor else local_workers(workers) as found:
        if out is None:
            return run_cases(cases, found, stop=stop, progress=progress)
        folder = sweep_folder(Path(out), "", scenario, question)
        others = take_checked(cases, folder.journals)
        with folder:
            result = run_cases(cases, found, folder.journal, others=others, stop=stop, progress=progress)
            write_table(folder, result)
        return result
