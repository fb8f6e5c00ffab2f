"""Advance the part from look to look, window by window, and write its state at the times of frames."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.borrow import borrow
from feeder_sim.engines.impulse.frame_rows import write_state
from feeder_sim.engines.impulse.free_flight import orthonormalise
from feeder_sim.engines.impulse.lone.follow import bring
from feeder_sim.engines.impulse.lone.plate_contact import meet_plate
from feeder_sim.engines.impulse.lone.state import PART, Exactness, Plate, Scratch
from feeder_sim.engines.impulse.lone.window import bound
from feeder_sim.engines.impulse.state import ABSENT, ASLEEP, AWAKE, Kinds
from feeder_sim.engines.impulse.window import acting_terms
from feeder_sim.engines.surface_arrays import SurfaceArrays
from feeder_sim.machine_code import compiled, entry_point, uncounted

ORIGIN, NUMBER, DUE = range(3)  # of the clock


class Drive(NamedTuple):
    """The surface, the extremes of its shapes as in `Surface`, how exact contacts are, and a window's length [s]."""

    surface: SurfaceArrays
    extremes: NDArray[np.float64]
    exact: Exactness
    window: float


class Lone(NamedTuple):
    """The part, as an array of one; its kind; and scratch space."""

    parts: NDArray[np.void]
    kinds: Kinds
    work: Scratch


@entry_point
def advance(lone, drive, clock, frames):
    """Advance the part past the times of frames, and write its state at each.

    clock: time from which windows count, number of the window under way, and when the part is to be looked at next.
    """
    lone, frames = borrow(lone), borrow(frames)
    part, kind, surface = lone.parts[0], lone.kinds.record[0], drive.surface
    start, end = clock[ORIGIN] + clock[NUMBER] * drive.window, clock[ORIGIN] + (clock[NUMBER] + 1.0) * drive.window
    acting = acting_terms(surface, start, end)
    bounds = bound(acting, drive.extremes, start, end, drive.exact)
    plate, seen = Plate(borrow(acting), borrow(bounds)), np.empty(1, PART)
    _wake(part, bounds)  # the drive may have changed since
    for frame in range(frames.time.shape[0]):
        while clock[DUE] < frames.time[frame]:
            if clock[DUE] >= end:
                clock[NUMBER] += 1.0
                start, end = end, clock[ORIGIN] + (clock[NUMBER] + 1.0) * drive.window
                acting = acting_terms(surface, start, end)
                bounds = bound(acting, drive.extremes, start, end, drive.exact)
                plate = Plate(borrow(acting), borrow(bounds))
                bring(part, kind, start, acting)
                orthonormalise(part.attitude)
                _wake(part, bounds)
                clock[DUE] = start
            clock[DUE] = _advance_until(min(end, frames.time[frame]), clock[DUE], lone, plate, frames)
            if frames.interrupt[0] != 0:
                return
        seen[0] = part  # which itself is left as it is
        bring(seen[0], kind, frames.time[frame], acting)
        write_state(seen[0], kind, frames.row[frame, 0])


@compiled
def _wake(part, bounds):
    """A part that rests moves again with the plate."""
    if part.there == ASLEEP and not bounds.calm:
        part.there = AWAKE


@uncounted
def _advance_until(until, t, lone, plate, frames):
    """Look at the part again and again until a time [s]; returns when it is due after that."""
    part, kind = lone.parts[0], lone.kinds.record[0]
    while t < until and frames.interrupt[0] == 0:
        if part.there == ASLEEP or part.there == ABSENT:
            return plate.bounds.end
        bring(part, kind, t, plate.surface)
        t = meet_plate(part, lone.kinds, plate.surface, plate.bounds, t, until, lone.work)
    return min(t, max(plate.bounds.end, until))
