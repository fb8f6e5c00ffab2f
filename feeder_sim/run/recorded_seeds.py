"""The seeds of a recording, as the results they were."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from feeder_sim.errors import Divergence, FeederSimError, SimulationDiverged
from feeder_sim.records.last_states import LastStates, read_failure
from feeder_sim.records.trajectory import Record, Recording, Status
from feeder_sim.run.seed_record import SeedResult


def seeds_of(recording: Recording) -> tuple[SeedResult, ...]:
    """The seeds that had begun."""
    seeds = []
    for index, (record, status) in enumerate(zip(recording.records, recording.status, strict=True)):
        if index > 0 and not len(record.frames):
            continue
        failure, last = _failure(recording, index) if status == Status.DIVERGED else (None, None)
        seeds.append(
            SeedResult(
                **{entry.name: getattr(record, entry.name) for entry in fields(Record)},
                status=status,
                wall_s=recording.wall_times[index].seed,
                failure=failure,
                last=last,
                counts=recording.counts[index],
            )
        )
    return tuple(seeds)


def _failure(recording: Recording, index: int) -> tuple[SimulationDiverged, LastStates | None]:
    """Why a seed diverged, from the file of its last states if that is there."""
    try:
        return read_failure(recording.path.parent, index)
    except FeederSimError:
        time = recording.seeds[index].time
        found = Divergence.UNKNOWN
        reached = float(time[-1]) if len(time) else float(np.nan)
        return SimulationDiverged(found, time_s=reached, part="a part", seed=index), None
