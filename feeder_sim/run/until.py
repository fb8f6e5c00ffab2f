"""A run of as many seeds as the standard error of one of its measures takes."""

from __future__ import annotations

import math
from pathlib import Path

from feeder_sim.errors import Unknown
from feeder_sim.measures.catalogue import names_of_measures, values_of_seed
from feeder_sim.measures.effort import Effort
from feeder_sim.pool.work import Work
from feeder_sim.replay.replay import REPLAY, build_replay
from feeder_sim.run.keep import StatisticsOnly
from feeder_sim.run.prepare import prepare
from feeder_sim.run.run_folder import record_run, resume_run
from feeder_sim.run.simulation import Result
from feeder_sim.scenario import Scenario


def record_until(scenario: Scenario, folder: Path, effort: Effort, *, replay: bool, work: Work) -> Result:
    """Record a run, and go on with more seeds in its folder; the result is that of a run with so many from the start.

    Args:
        scenario: what to run, with the seeds of the effort.
        folder: as for `record_run`.
        effort: says when there are enough.
        replay: as for `record_run`.
        work: as for `record_run`.

    Raises:
        InputError: there is no such measure (nothing is written), or as for `record_run`.
    """
    if effort.measure not in (names := names_of_measures(prepare(scenario))):
        raise Unknown(effort.measure, names, argument="measure")
    result = record_run(scenario, folder, replay=False, record=StatisticsOnly(), work=work)
    while not result.interrupted:
        values = [values_of_seed(result.prepared, seed).get(effort.measure, math.nan) for seed in result.seeds]
        required = effort.seeds_required(values)
        if required <= len(values):
            if effort.falls_short(values):
                work.notify(f"{len(values)} seeds, and not the standard error that is asked for")
            break
        result = resume_run(folder, seeds=required, replay=False, record=StatisticsOnly(), work=work)
    if replay and not result.interrupted:
        build_replay(folder, folder / REPLAY)
    return result
