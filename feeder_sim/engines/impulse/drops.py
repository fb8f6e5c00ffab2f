"""Many parts one after the other, each by itself on a plate at rest, until it lies still."""

from __future__ import annotations

import numpy as np

from feeder_sim.engines.impulse.alone import Alone, advance_part
from feeder_sim.engines.impulse.frame_rows import ROW, FrameRows
from feeder_sim.engines.impulse.state import ASLEEP
from feeder_sim.engines.protocol import ENDED
from feeder_sim.machine_code import entry_point


@entry_point
def advance_to_rest(alone, drive, interval, longest, interrupt, rested):
    """Advance each part of `alone` until it has fallen asleep; parts are left where they are then.

    Args:
        alone: one part for each drop, at its start; kind, and scratch space.
        drive: as for `advance_alone`, of a plate that nothing moves.
        interval: after which a part is looked at [s].
        longest: time [s] after which a part is given up.
        interrupt: as for `FrameRows`.
        rested: (parts,), is filled with the time [s] at which each lay still; NaN for one that was given up.
    """
    times, rows, clock = np.zeros(1), np.zeros((1, 1, ROW)), np.zeros(3)
    for k in range(alone.parts.shape[0]):
        part = Alone(alone.parts[k : k + 1], alone.kinds, alone.work)
        clock[:] = 0.0
        times[0], rested[k] = 0.0, np.nan
        while times[0] < longest:
            times[0] += interval
            advance_part(part, drive, clock, FrameRows(times, rows, interrupt))
            if interrupt[ENDED] != 0:
                return
            if part.parts[0].there == ASLEEP:
                rested[k] = times[0]
                break
