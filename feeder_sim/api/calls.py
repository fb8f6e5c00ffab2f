"""The calls that run something, as a user of Python makes them."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

from feeder_sim.api.progress import Progress, displayed
from feeder_sim.api.result import Result
from feeder_sim.errors import path_of_user
from feeder_sim.measures.function import Function, as_measures
from feeder_sim.measures.protocol import Measure
from feeder_sim.pool.work import STALL_AFTER_S, Work
from feeder_sim.records.tracks import Camera
from feeder_sim.run import run_folder, simulation
from feeder_sim.run.batch import measure_drift as measure_drift
from feeder_sim.run.keep import AllFrames, Retention
from feeder_sim.run.prepare import prepare
from feeder_sim.run.tracked import tracked
from feeder_sim.scenario import Scenario, check_scenario
from feeder_sim.scene.prepared import Prepared
from feeder_sim.studies.compare import Comparison, measured_run

# Two recorded runs against each other, as a user of Python asks for it.


def compare(first: str | Path, second: str | Path, *, progress: Progress = None) -> Comparison:
    """Compare two recorded runs: the differences of all measures with intervals, of settings and of versions.

    Nothing is run. With the same seeds in both runs they are compared seed by seed, else by Welch's interval.

    Args:
        first: folder of a run, or a file that `feeder-sim export` made of it.
        second: the other one; differences are second less first.
        progress: True shows a bar on stderr; a function is called with the share of the seeds that are measured.

    Raises:
        InputError: a run cannot be read, or a file that its scenario reads is missing or no longer the same.
    """
    paths = path_of_user(first, "first"), path_of_user(second, "second")
    with displayed(Work(), progress, "compare") as work:
        return Comparison(
            measured_run(paths[0], lambda share: work.progress(0.5 * share)),
            measured_run(paths[1], lambda share: work.progress(0.5 + 0.5 * share)),
        )


def simulate(
    scenario: Scenario | Prepared,
    *,
    workers: int | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
    record: Retention = AllFrames(),  # noqa: B008, it cannot be changed
    stall_after: float = STALL_AFTER_S,
    executor: Executor | None = None,
    measures: Iterable[Function | Measure[Any, Any]] = (),
) -> Result:
    """Run every seed of a scenario; the result does not depend on the number of workers.

    Inputs that are `[uncertain]` have the values of the scenario; `feeder_sim.uncertainty` draws others.

    Args:
        scenario: what to run.
        workers: threads; the engines' inner loops run outside Python, so threads use all cores. Default: all cores.
        progress: True shows a bar on stderr; a function is called with the fraction done, a few times a second.
        stop: set it to end the run within a second, after the blocks under way if they are short.
        record: what to keep of each seed once it has been measured: `AllFrames()`, `EveryNth(n)`, `ImpactsOnly()` or
            `StatisticsOnly()`. Measures do not depend on it.
        stall_after: wall time [s] after which a seed that has not advanced by a frame ends as failed.
        executor: runs the seeds in place of threads of this process, `workers` of them at once, as that of a Dask
            client; each comes back whole.
        measures: of one's own, besides those of the package: functions of a prepared scenario and a seed that make a
            number, NaN for none. Their names are those of the results, and have the unit.

    Raises:
        FeederSimError: workers of the executor end before their seed has.
        InputError: the scenario cannot be built, its start does not suit its stop rule, what is to be kept is not
            recorded in it, or a measure fails.
    """
    given = Work(workers, executor, stop=stop or threading.Event(), stall_after=stall_after)
    prepared = scenario if isinstance(scenario, Prepared) else prepare(scenario)
    prepared = replace(prepared, measures=as_measures(measures)) if measures else prepared
    with displayed(given, progress, prepared.scenario.title) as work:
        return Result.of(simulation.simulate(prepared, record=record, work=work))


def record_run(
    scenario: Scenario,
    folder: str | Path,
    *,
    workers: int | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
    replay: bool = True,
    record: Retention = AllFrames(),  # noqa: B008
    stall_after: float = STALL_AFTER_S,
    executor: Executor | None = None,
) -> Result:
    """Simulate a scenario and write everything about it into a folder.

    Inputs that are `[uncertain]` have the values of the scenario; `feeder_sim.uncertainty` draws others.

    Args:
        scenario: what to run.
        folder: made if missing; it must be empty.
        workers: as for `simulate`.
        progress: as for `simulate`.
        stop: as for `simulate`.
        replay: also build the .rrd at the end.
        record: what the result keeps in memory; the folder always holds all frames.
        stall_after: as for `simulate`.
        executor: as for `simulate`.

    Raises:
        FeederSimError: as for `simulate`.
        InputError: the scenario cannot be built (nothing is written), or the folder is not empty or in use.
        RecordingFailed: a file cannot be written, as when the disk is full.
    """
    check_scenario(scenario)
    path = path_of_user(folder, "folder")
    given = Work(workers, executor, stop=stop or threading.Event(), stall_after=stall_after)
    with displayed(given, progress, scenario.title) as work:
        return Result.of(run_folder.record_run(scenario, path, replay=replay, record=record, work=work))


def record_tracks(
    scenario: Scenario,
    file: str | Path,
    folder: str | Path,
    *,
    fps: float | None = None,
    mm_per_pixel: float | None = None,
    origin_px: tuple[float, float] = (0.0, 0.0),
    longest_gap_s: float = 0.0,
) -> Result:
    """Record what a camera has seen of the parts of a scenario as a run, for `compare`, `document_of` and `open`.

    Args:
        scenario: of one part, which every track is a run of, or of as many parts as there are tracks. Without a
            schedule time begins with each track, or with the first one of several parts; with one it is its time.
        file: table of time, part, x, y and perhaps an angle; see feeder_sim.records.tracks for its columns.
        folder: made if missing; it must be empty.
        fps: frames per second, where the table has frames in place of times.
        mm_per_pixel: where places are pixels, whose y points down.
        origin_px: pixel over the middle of the plate.
        longest_gap_s: for which a part may be missing; straight lines fill such gaps.

    Raises:
        InputError: the scenario or the table cannot be used, or tracks cannot be those of such parts.
        RecordingFailed: a file cannot be written, as when the disk is full.
    """
    check_scenario(scenario)
    camera = Camera(fps, mm_per_pixel, origin_px, longest_gap_s)
    prepared, seeds = tracked(scenario, path_of_user(file, "file"), camera)
    return Result.of(run_folder.record_ended(prepared, path_of_user(folder, "folder"), seeds, replay=False))
