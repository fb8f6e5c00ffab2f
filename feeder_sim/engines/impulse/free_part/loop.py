"""Advance the part from look to look, window by window, and write its state at the times of frames."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.frame_rows import write_state
from feeder_sim.engines.impulse.free_flight import orthonormalise
from feeder_sim.engines.impulse.free_part.notes import Notes
from feeder_sim.engines.impulse.free_part.ride import move_to
from feeder_sim.engines.impulse.free_part.step import step
from feeder_sim.engines.impulse.scratch import Scratch
from feeder_sim.engines.impulse.state import ABSENT, ASLEEP, AWAKE, PART, Kinds
from feeder_sim.engines.impulse.surroundings import Plate, Rim, Tube
from feeder_sim.engines.impulse.window import acting_terms, bound_window, next_change
from feeder_sim.engines.protocol import ENDED, WHOLE
from feeder_sim.machine_code import borrow, compiled, entry_point, uncounted

ORIGIN, NUMBER, DUE, BEGIN = range(4)  # of the clock


class FreePart(NamedTuple):
    """The part, as an array of one, and what its points bore last (points, 6): force [N] and moment [N m]; its kind;
    scratch space; the walls around it, or None, and what is noted in a tube.
    """

    parts: NDArray[np.void]
    loads: NDArray[np.float64]
    kinds: Kinds
    work: Scratch
    wall: Tube | Rim | None
    notes: Notes


@entry_point
def advance(free, drive, clock, frames):
    """Advance the part past the times of frames, and write its state at each.

    clock: time from which windows count, number of the window under way, when the part is to be looked at next, and
    when the stretch of the window under way began: windows are divided where the drive changes.
    """
    advance_free_part(free, drive, clock, frames)


@compiled
def advance_free_part(free, drive, clock, frames):
    """`advance` for compiled functions."""
    part, surface = free.parts[0], drive.surface
    seen, frame = np.empty(1, PART), 0
    while True:
        start, whole = clock[BEGIN], clock[ORIGIN] + (clock[NUMBER] + 1.0) * drive.window
        end = next_change(surface, start, whole)
        acting = acting_terms(surface, start, end)
        bounds = bound_window(acting, drive, start, end)
        if clock[DUE] == start:
            orthonormalise(part.attitude)
        _wake(part, bounds, start)  # the drive may have changed since
        frame = _through_window(frame, free, Plate(borrow(acting), borrow(bounds), free.wall), clock, frames, seen)
        if frame == frames.time.shape[0] or frames.interrupt[ENDED] != 0:
            return
        clock[NUMBER] += 1.0 if end == whole else 0.0
        clock[DUE] = clock[BEGIN] = end


@compiled
def _wake(part, bounds, t):
    """A part that rests moves again with the plate, from time t [s] on."""
    if part.there == ASLEEP and not bounds.calm:
        part.there, part.clock = AWAKE, t


@uncounted
def _through_window(frame, free, plate, clock, frames, seen):
    """Look at the part again and again until the window ends, and write its state at the times of frames from one on.

    Returns the next frame; seen: room for a part.
    """
    part, kind, end = free.parts[0], free.kinds.record[0], plate.bounds.end
    while frame < frames.time.shape[0] and frames.interrupt[ENDED] == 0:
        frame_time, t = frames.time[frame], clock[DUE]
        if t >= frame_time:
            seen[0] = part  # which itself is left as it is
            move_to(seen[0], kind, frame_time, plate.surface)
            write_state(seen[0], kind, frames.row[frame, 0])
            frame += 1
            frames.interrupt[WHOLE] = frame
        elif t >= end:
            break
        elif part.there == ASLEEP or part.there == ABSENT:
            clock[DUE] = end
        else:
            clock[DUE] = min(step(free, plate, t), end)
    return frame
