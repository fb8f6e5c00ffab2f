"""The one part of a scene, which meets the plate and perhaps the wall of a tube, and nothing else."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impact_log import ImpactLog, begin_contact, end_contact, in_contact
from feeder_sim.engines.impulse.borrow import borrow
from feeder_sim.engines.impulse.plate_contact import TOUCH, meet_plate
from feeder_sim.engines.impulse.state import GAP, SURFACE_RATE, fly_to, orthonormalise_parts, write_row
from feeder_sim.engines.impulse.window import acting_terms, bound_window, fastest_rate
from feeder_sim.engines.surface_arrays import SurfaceArrays
from feeder_sim.machine_code import compiled, entry_point

SAME_CONTACT = 1.5  # steps between two impacts that count as one contact
ORIGIN, NUMBER, DUE = range(3)  # of the clock


class Drive(NamedTuple):
    """The surface, the largest deflection of every mode shape, the step and the length of a window [s]."""

    surface: SurfaceArrays
    antinode: NDArray[np.float64]
    step: float
    window: float


class ContactNotes(NamedTuple):
    """Contacts of a part in a guide; last: end of the contact under way, and the part's vertical velocity then."""

    log: ImpactLog
    last: NDArray[np.float64]


@entry_point
def advance_alone(parts, kinds, wall, drive, notes, clock, frames, work):
    """Advance the part past the times of frames, and write its state at each.

    clock: time from which windows count, number of the window under way, and when the part is to be looked at next.
    The wall is None without a tube.
    """
    kinds, wall, work, frames = borrow(kinds), borrow(wall), borrow(work), borrow(frames)
    part, kind, surface = parts[0], kinds.record[0], drive.surface
    top = 0.0  # in a tube, contacts are told apart by the usual step
    if wall is None:
        top = fastest_rate(surface)
    start, end = clock[ORIGIN] + clock[NUMBER] * drive.window, clock[ORIGIN] + (clock[NUMBER] + 1.0) * drive.window
    acting = acting_terms(surface, start, end)
    bounds = bound_window(acting, drive.antinode, start, end, drive.step, top)
    for frame in range(frames.time.shape[0]):
        while clock[DUE] < frames.time[frame]:
            if frames.interrupt[0] != 0:
                return
            if clock[DUE] >= end:
                clock[NUMBER] += 1.0
                start, end = end, clock[ORIGIN] + (clock[NUMBER] + 1.0) * drive.window
                acting = acting_terms(surface, start, end)
                bounds = bound_window(acting, drive.antinode, start, end, drive.step, top)
                fly_to(part, kind, start)
                orthonormalise_parts(parts, 1)
                clock[DUE] = start
                continue
            t = clock[DUE]
            fly_to(part, kind, t)
            before = part.velocity[2]
            leap, hit = meet_plate(part, kinds, wall, acting, bounds, t, work)
            if wall is not None:  # noqa: SIM102 - numba leaves out what follows a plain test of None only
                if hit:
                    _note_contact(part, before, kind.corner_to - kind.corner_from, notes, t, drive.step, work)
            clock[DUE] = t + leap
        write_row(parts, 0, kinds, frames.time[frame], frames.row[frame, 0])


@compiled
def _note_contact(part, before, n_corners, notes, t, step, work):
    """Note an impact on the plate of a part in a guide; what follows within a step is the same contact.

    before: its vertical velocity before it.
    """
    log, last = notes.log, notes.last
    if in_contact(log) and t - last[0] > SAME_CONTACT * step:
        end_contact(log, last[0], last[1])
    if not in_contact(log):
        surface_rate = 0.0
        for i in range(n_corners):
            if work.corner[i, GAP] <= TOUCH:
                surface_rate = work.corner[i, SURFACE_RATE]
        begin_contact(log, t, max(surface_rate - before, 0.0))
    last[0], last[1] = t, part.velocity[2]
