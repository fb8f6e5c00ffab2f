"""Where compiled loops note the contacts of a guided part with the plate; rows as of `IMPACTS`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.machine_code import compiled
from feeder_sim.records.seed import Events, impacts_of


class ImpactLog(NamedTuple):
    """Finished contacts in rows (n, 4), their number, and the contact under way (its begin is NaN without one)."""

    rows: NDArray[np.float64]
    filled: NDArray[np.int64]
    current: NDArray[np.float64]


def new_log(capacity: int) -> ImpactLog:
    """An empty log; loops stop early when `capacity` rows are full."""
    return ImpactLog(np.empty((capacity, 4)), np.zeros(1, np.int64), np.full(2, np.nan))


def room_for(log: ImpactLog, n: int) -> ImpactLog:
    """The same log with room for n more rows."""
    free = len(log.rows) - int(log.filled[0])
    if free >= n:
        return log
    return log._replace(rows=np.concatenate([log.rows, np.empty((n - free, 4))]))


def take_impacts(log: ImpactLog, *, end: bool, over: tuple[float, float] | None = None) -> Events:
    """Empty the log; at the `end` of a run also of the contact under way.

    over: end [s] and departure velocity [m/s] of the contact under way, where it is known to have ended.
    """
    if over is not None and np.isfinite(log.current[0]):
        until, velocity = over
        log.rows[log.filled[0]] = log.current[0], until, log.current[1], velocity
        log.filled[0] += 1
        log.current[0] = np.nan
    rows = log.rows[: log.filled[0]]
    if end and np.isfinite(log.current[0]):
        rows = np.concatenate([rows, [[log.current[0], np.inf, log.current[1], np.nan]]])
    log.filled[0] = 0
    return impacts_of(rows)


@compiled
def is_full(log):
    return log.filled[0] >= log.rows.shape[0]


@compiled
def log_impact(log, time, until, approach_speed, departure_velocity):
    """Note a contact that is over."""
    row = log.rows[log.filled[0]]
    row[0], row[1], row[2], row[3] = time, until, approach_speed, departure_velocity
    log.filled[0] += 1


@compiled
def begin_contact(log, time, approach_speed):
    log.current[0], log.current[1] = time, approach_speed


@compiled
def in_contact(log):
    return not np.isnan(log.current[0])


@compiled
def end_contact(log, until, departure_velocity):
    """Finish the contact under way."""
    log_impact(log, log.current[0], until, log.current[1], departure_velocity)
    log.current[0] = np.nan
