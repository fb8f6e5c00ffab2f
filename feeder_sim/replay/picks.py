"""Rings on the plate that blink around the parts about to be picked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.records.events import Cause, Events
from feeder_sim.records.recording import PartRecord
from feeder_sim.records.trajectory import Frames
from feeder_sim.replay.parts import radius_of
from feeder_sim.replay.plate import MM, NODE_HEIGHT_MM, TIMELINE

BLINK_S, BLINK_PERIOD_S = 0.4, 0.1  # [s]; how long, and with which period, rings blink before parts are picked
RING = (0, 140, 60)
RING_SIZE, RING_WIDTH = 1.35, 0.12  # over the radius of the part
RING_POINTS = 33


def log_picks(stream: Any, frames: Frames, removals: Events, parts: Sequence[PartRecord]) -> None:
    """Log a ring around each part about to be picked, as large as the part needs."""
    import rerun as rr

    picked = removals.cause == Cause.PICKED
    radius = np.array([radius_of(part) for part in parts])
    for time in np.unique(removals.time[picked]):
        members = removals.part[picked & (removals.time == time)]
        for row in np.flatnonzero((frames.time > time - BLINK_S) & (frames.time <= time + 1e-9)):
            lit = int((time - frames.time[row]) / (0.5 * BLINK_PERIOD_S)) % 2 == 0
            stream.set_time(TIMELINE, duration=float(frames.time[row]))
            around = members if lit else members[:0]
            rings = [ring(frames.position[row, part, :2] * MM, RING_SIZE * radius[part]) for part in around]
            stream.log("picked", rr.LineStrips3D(rings, radii=RING_WIDTH * radius[around], colors=[RING]))
        stream.set_time(TIMELINE, duration=float(time) + 0.5 * BLINK_PERIOD_S)
        stream.log("picked", rr.Clear(recursive=False))
    stream.reset_time()


def ring(centre: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """A circle (n, 3) around a centre (2,) just above the plate, all in one unit of length [mm]."""
    angle = np.linspace(0.0, 2.0 * np.pi, RING_POINTS)
    x, y = centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)
    return np.column_stack([x, y, np.full(RING_POINTS, 3.0 * NODE_HEIGHT_MM)])
