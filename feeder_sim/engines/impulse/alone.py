"""The one part of a scene, which meets the plate and nothing else, in steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.frame_rows import write_row
from feeder_sim.engines.impulse.plate_contact import meet_plate
from feeder_sim.engines.impulse.rest import fall_asleep, wake
from feeder_sim.engines.impulse.scratch import Scratch
from feeder_sim.engines.impulse.state import ASLEEP, Kinds, fly_to, orthonormalise_parts
from feeder_sim.engines.impulse.surroundings import Plate
from feeder_sim.engines.impulse.window import acting_terms, bound_window
from feeder_sim.engines.protocol import ENDED, WHOLE
from feeder_sim.machine_code import borrow, compiled, entry_point, uncounted

ORIGIN, NUMBER, DUE = range(3)  # of the clock


class Alone(NamedTuple):
    """The part, as an array of one; its kind; and scratch space."""

    parts: NDArray[np.void]
    kinds: Kinds
    work: Scratch


@entry_point
def advance_alone(alone, drive, clock, frames):
    """Advance the part past the times of frames, and write its state at each.

    clock: time from which windows count, number of the window under way, and when the part is to be looked at next.
    """
    advance_part(alone, drive, clock, frames)


@compiled
def advance_part(alone, drive, clock, frames):
    """`advance_alone` for compiled functions."""
    part, kind, surface = alone.parts[0], alone.kinds.record[0], drive.surface
    start, end = clock[ORIGIN] + clock[NUMBER] * drive.window, clock[ORIGIN] + (clock[NUMBER] + 1.0) * drive.window
    acting = acting_terms(surface, start, end)
    bounds = bound_window(acting, drive, start, end)
    if not bounds.calm:  # the drive may have changed since
        wake(part)
    for frame in range(frames.time.shape[0]):
        while clock[DUE] < frames.time[frame]:
            if clock[DUE] >= end:
                clock[NUMBER] += 1.0
                start, end = end, clock[ORIGIN] + (clock[NUMBER] + 1.0) * drive.window
                acting = acting_terms(surface, start, end)
                bounds = bound_window(acting, drive, start, end)
                fly_to(part, kind, start)
                orthonormalise_parts(alone.parts, 1)
                if not bounds.calm:
                    wake(part)
                clock[DUE] = start
            plate = Plate(borrow(acting), borrow(bounds), None)
            clock[DUE] = _advance_until(min(end, frames.time[frame]), clock[DUE], alone, plate, frames)
            if frames.interrupt[ENDED] != 0:
                return
        write_row(alone.parts, 0, alone.kinds, frames.time[frame], frames.row[frame, 0])
        frames.interrupt[WHOLE] = frame + 1


@uncounted
def _advance_until(until, t, alone, plate, frames):
    """Look at the part again and again until a time [s]; returns when it is due after that."""
    part, kind = alone.parts[0], alone.kinds.record[0]
    while t < until and frames.interrupt[ENDED] == 0:
        if part.there == ASLEEP:
            return plate.bounds.end
        fly_to(part, kind, t)
        leap, hit = meet_plate(0, alone.parts, alone.kinds, plate.surface, plate.bounds, t, alone.work)
        t += leap
        if hit and plate.bounds.calm:
            fall_asleep(part, alone.kinds, plate.surface, alone.work)
    return t
