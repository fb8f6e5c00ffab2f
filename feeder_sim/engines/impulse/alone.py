"""The one part of a scene, which meets the plate and perhaps the wall of a tube, and nothing else."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.borrow import borrow
from feeder_sim.engines.impact_log import ImpactLog, begin_contact, end_contact, in_contact
from feeder_sim.engines.impulse.follow import bring
from feeder_sim.engines.impulse.frame_rows import write_row
from feeder_sim.engines.impulse.plate_contact import meet_plate
from feeder_sim.engines.impulse.state import (
    ASLEEP,
    FREE,
    GAP,
    KNOWN,
    WITH,
    Exactness,
    Kinds,
    Plate,
    Scratch,
    Wall,
    orthonormalise_parts,
    wake,
)
from feeder_sim.engines.impulse.window import acting_terms, bound_window
from feeder_sim.engines.surface_arrays import SurfaceArrays
from feeder_sim.machine_code import compiled, entry_point, uncounted

TOUCHES = 1e-8  # [m]
ORIGIN, NUMBER, DUE = range(3)  # of the clock


class Drive(NamedTuple):
    """The surface, the extremes of its shapes as in `Surface`, how exact contacts are, and a window's length [s]."""

    surface: SurfaceArrays
    extremes: NDArray[np.float64]
    exact: Exactness
    window: float


class ContactNotes(NamedTuple):
    """Contacts of a part in a guide; last: end of the contact under way, and the part's vertical velocity then.

    same: impacts no farther apart than that [s] are one contact.
    """

    log: ImpactLog
    last: NDArray[np.float64]
    same: float


class Alone(NamedTuple):
    """The part, as an array of one; its kind; the wall of its tube, None without one; and scratch space."""

    parts: NDArray[np.void]
    kinds: Kinds
    wall: Wall | None
    work: Scratch


@entry_point
def advance_alone(alone, drive, notes, clock, frames):
    """Advance the part past the times of frames, and write its state at each.

    clock: time from which windows count, number of the window under way, and when the part is to be looked at next.
    """
    advance_part(alone, drive, notes, clock, frames)


@compiled
def advance_part(alone, drive, notes, clock, frames):
    """`advance_alone` for compiled functions."""
    alone, frames = borrow(alone), borrow(frames)
    part, kind, surface = alone.parts[0], alone.kinds.record[0], drive.surface
    start, end = clock[ORIGIN] + clock[NUMBER] * drive.window, clock[ORIGIN] + (clock[NUMBER] + 1.0) * drive.window
    acting = acting_terms(surface, start, end, 0)
    bounds = bound_window(acting, drive.extremes, start, end, drive.exact)
    if not bounds.calm:  # the drive may have changed since
        wake(part)
    for frame in range(frames.time.shape[0]):
        while clock[DUE] < frames.time[frame]:
            if clock[DUE] >= end:
                clock[NUMBER] += 1.0
                start, end = end, clock[ORIGIN] + (clock[NUMBER] + 1.0) * drive.window
                acting = acting_terms(surface, start, end, 0)
                bounds = bound_window(acting, drive.extremes, start, end, drive.exact)
                bring(part, kind, start, acting)
                orthonormalise_parts(alone.parts, 1)
                if not bounds.calm:
                    wake(part)
                clock[DUE] = start
            plate = Plate(borrow(acting), borrow(bounds))
            clock[DUE] = _advance_until(min(end, frames.time[frame]), clock[DUE], alone, plate, notes, frames)
            if frames.interrupt[0] != 0:
                return
        write_row(alone.parts, 0, alone.kinds, acting, frames.time[frame], frames.row[frame, 0])


@uncounted
def _advance_until(until, t, alone, plate, notes, frames):
    """Look at the part again and again until a time [s]; returns when it is due after that."""
    part, kind = alone.parts[0], alone.kinds.record[0]
    while t < until and frames.interrupt[0] == 0:
        if part.there == ASLEEP:
            return plate.bounds.end
        bring(part, kind, t, plate.surface)
        before = part.velocity[2]
        leap, hit = meet_plate(
            0, alone.parts, alone.kinds, alone.wall, plate.surface, plate.bounds, t, alone.work, None
        )
        if alone.wall is not None and (hit or part.phase != FREE):
            _note_contact(part, before, kind.corner_to - kind.corner_from, notes, t, leap, alone.work)
        t += leap
    return min(t, max(plate.bounds.end, until))


@compiled
def _note_contact(part, before, n_corners, notes, t, leap, work):
    """Note an impact on the plate of a part in a guide, or that it stays there; before: its vertical velocity then."""
    log, last = notes.log, notes.last
    if in_contact(log) and t - last[0] > notes.same:
        end_contact(log, last[0], last[1])
    if not in_contact(log):
        surface_rate = before
        for i in range(n_corners):
            row = work.point[i]
            if row[KNOWN] != 0.0 and row[GAP] <= TOUCHES:
                surface_rate = max(surface_rate, row[WITH + 2])
        begin_contact(log, t, surface_rate - before)
    last[0], last[1] = t + (leap if part.phase != FREE else 0.0), part.velocity[2]
