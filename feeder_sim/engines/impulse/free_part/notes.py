"""Contacts of a part in a tube with the plate, as bounces are counted: what follows soon after belongs to the same."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impact_log import ImpactLog, begin_contact, end_contact, in_contact
from feeder_sim.engines.impulse.scratch import ON_PLATE
from feeder_sim.machine_code import uncounted


class Notes(NamedTuple):
    """What is noted; last: end of the contact under way, and the part's vertical velocity then; apart: in time [s]."""

    log: ImpactLog
    last: NDArray[np.float64]
    apart: float


@uncounted
def note_contact(notes, t, ends, approach, part):
    """Note that a part touches the plate from a time t [s] until it ends, or if that is NaN that it does not.

    approach: its speed towards the plate before [m/s].
    """
    log, last = notes.log, notes.last
    if in_contact(log) and t <= last[0]:
        last[1] = part.velocity[2]  # it lay there until now
    if np.isnan(ends):
        return
    if in_contact(log) and t - last[0] > notes.apart:
        end_contact(log, last[0], last[1])
    if not in_contact(log):
        begin_contact(log, t, max(approach, 0.0))
    last[0], last[1] = ends, part.velocity[2]


@uncounted
def speed_of_touched_plate(n, touch, work):
    """Vertical velocity of the plate where the first of n points touches it [m/s]; NaN if none does."""
    for i in range(n):
        point = work.point[i]
        if point.sort == ON_PLATE and point.gap <= touch:
            return point.surface_velocity[2]
    return np.nan
