"""The calls that run something, as a user of Python makes them."""

from __future__ import annotations

import threading
from pathlib import Path

from feeder_sim.api.progress import Progress, shown
from feeder_sim.api.result import Result
from feeder_sim.errors import check_whole, path_of_user
from feeder_sim.run import run_folder
from feeder_sim.run.keep import AllFrames, Keep
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import run_ensemble
from feeder_sim.scenario import Scenario, check_scenario
from feeder_sim.scene.prepared import Prepared


def simulate(
    scenario: Scenario | Prepared,
    *,
    workers: int | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
    record: Keep = AllFrames(),  # noqa: B008, it cannot be changed
) -> Result:
    """Run every seed of a scenario; the result does not depend on the number of workers.

    Args:
        scenario: what to run.
        workers: threads; the engines' inner loops run outside Python, so threads use all cores. Default: all cores.
        progress: True shows a bar on stderr; a function is called with the fraction done, a few times a second.
        stop: set it to end the run within a second, after the blocks under way if they are short.
        record: what to keep of each seed once it has been measured: `AllFrames()`, `EveryNth(n)`, `ImpactsOnly()` or
            `StatisticsOnly()`. Measures do not depend on it.

    Raises:
        InputError: the scenario cannot be built, its start does not suit its stop rule, or what is to be kept is not
            recorded in it.
    """
    if workers is not None:
        check_whole(workers, "workers")
    prepared = scenario if isinstance(scenario, Prepared) else prepare(scenario)
    with shown(progress, prepared.scenario.title) as (show, notify):
        found = run_ensemble(prepared, workers=workers, progress=show, stop=stop, notify=notify, record=record)
    return Result.of(found)


def record_run(
    scenario: Scenario,
    folder: str | Path,
    *,
    progress: Progress = None,
    stop: threading.Event | None = None,
    replay: bool = True,
    record: Keep = AllFrames(),  # noqa: B008
) -> Result:
    """Simulate a scenario and write everything about it into a folder.

    Args:
        scenario: what to run.
        folder: made if missing; it must be empty.
        progress: as for `simulate`.
        stop: as for `simulate`.
        replay: also build the .rrd from the finished trajectory file.
        record: what the result keeps in memory; the folder always holds all frames.

    Raises:
        InputError: the scenario cannot be built (nothing is written), or the folder is not empty or in use.
        RecordingFailed: a file cannot be written, as when the disk is full.
    """
    check_scenario(scenario)
    path = path_of_user(folder, "folder")
    with shown(progress, scenario.title) as (show, notify):
        found = run_folder.record_run(
            scenario, path, progress=show, stop=stop, replay=replay, record=record, notify=notify
        )
    return Result.of(found)
