"""Many runs of one free part in one compiled call: the drift of each is measured on the way, and no frame is kept.

The same engine, frames and guard as for a run that is recorded, so that the same seed moves in the same way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from feeder_sim.engines.impulse import frame_rows
from feeder_sim.engines.impulse.alone import Alone, advance_part
from feeder_sim.engines.impulse.frame_rows import ROW, FrameRows, write_state
from feeder_sim.engines.impulse.lone.loop import Lone, advance_lone
from feeder_sim.machine_code import compiled, entry_point
from feeder_sim.run.energy import EnergyLimit
from feeder_sim.run.state_check import (
    CLEAR,
    DEPTH,
    END,
    FALLEN,
    LOST,
    POSITION,
    QUATERNION,
    SPEED,
    SPIN,
    VELOCITY,
    Held,
    Motion,
    States,
    check_frames,
    no_states,
)
from feeder_sim.scene.scene import GRAVITY

Floats = NDArray[np.float64]
BLOCK = 300  # frames between two looks of the guard
DONE, DIVERGED, LEFT_PLATE = range(1, 4)  # as in `Status`; 0 for a seed that was interrupted
NOT_PASSED = -1.0  # in place of a time
# First columns of the engine's rows:
ROW_VELOCITY, ROW_QUATERNION, ROW_SPIN = (
    columns.start for columns in (frame_rows.VELOCITY, frame_rows.QUATERNION, frame_rows.SPIN)
)


class Way(NamedTuple):
    """The way from the antinode to the nodal lines.

    lines: segments (m, 4), x and y of both ends [m]; reach: d0 [m]; levels: fractions of d0 between which the speed is
    measured; ends: a run ends when it has passed the second. Without segments no transport is measured.
    """

    lines: Floats
    reach: float
    levels: Floats
    ends: bool


class Recording(NamedTuple):
    """When frames are taken: their interval [s], and how many at most, with the one at the start."""

    interval: float
    frames: int


class Outcome(NamedTuple):
    """What is measured of each seed.

    status: how it ended; time: its last [s]; moved: in the plane until then (seeds, 2) [m]; rise: of its centre over
    its lowest place [m]; passed: when it passed the levels of the way (seeds, 2) [s].
    """

    status: NDArray[np.int64]
    time: Floats
    moved: Floats
    rise: Floats
    passed: Floats

    def some(self, seeds: slice) -> Outcome:
        """That of some seeds."""
        return Outcome(self.status[seeds], self.time[seeds], self.moved[seeds], self.rise[seeds], self.passed[seeds])


class Room(NamedTuple):
    """Room for a block of frames: rows of the engine, its clock, and what the guard takes and finds."""

    rows: Floats
    clock: Floats
    motion: Motion
    states: States


def new_room() -> Room:
    """Room that one thread at a time may use."""
    shape = (BLOCK, 1)
    motion = Motion(np.empty(BLOCK), np.empty((*shape, END)), np.ones(shape, bool))
    return Room(np.empty((*shape, ROW)), np.zeros(3), motion, no_states(BLOCK + 1, 1))


def new_outcome(seeds: int) -> Outcome:
    """Room for what is measured of a number of seeds."""
    return Outcome(
        np.zeros(seeds, np.int64), np.zeros(seeds), np.zeros((seeds, 2)), np.zeros(seeds), np.zeros((seeds, 2))
    )


@entry_point
def measure_drifts(alone, drive, notes, recording, held, way, interrupt, room, outcome):
    """Run every part of `alone`, one after the other and each by itself, and measure its drift.

    Args:
        alone: one part for each seed, at its start; kind, and scratch space; `Alone`, or `Lone` without a step.
        drive: as for `advance_alone`, or for `lone.loop.advance`.
        notes: as for `advance_alone`.
        recording: when frames are taken.
        held: what the states are held against.
        way: the way that is measured.
        interrupt: as for `FrameRows`; the seed under way and those after it keep the status 0.
        room: for a block of frames.
        outcome: is filled.
    """
    rows, clock, motion, states = room
    for seed in range(alone.parts.shape[0]):
        part = alone.parts[seed]
        clock[:] = 0.0
        motion.time[0] = 0.0
        write_state(part, alone.kinds.record[part.kind], rows[0, 0])
        _take_motion(rows, 1, motion)
        start = motion.state[0, 0]
        limits = _limits_of(start, held)
        _start(motion, limits, states)
        x, y, z = start[0], start[1], start[2]
        course = _begin_way(x, y, way, outcome.passed[seed])
        status, lowest, highest, done = DONE, z, z, 1
        last_x, last_y, last_time = x, y, 0.0
        while done < recording.frames and status == DONE and not (way.ends and outcome.passed[seed, 1] >= 0.0):
            n = min(BLOCK, recording.frames - done)
            for k in range(n):
                motion.time[k] = (done + k) * recording.interval
            _advance_seed(seed, alone, drive, notes, clock, FrameRows(motion.time[:n], rows[:n], interrupt))
            if interrupt[0] != 0:
                return
            _take_motion(rows, n, motion)
            valid = check_frames(_first(motion, n), limits, states, False)
            status = DONE if valid == n else DIVERGED
            for k in range(valid):
                here = motion.state[k, 0]
                here_x, here_y, height = here[0], here[1], here[2]
                lowest, highest, now = min(lowest, height), max(highest, height), motion.time[k]
                course = _follow(here_x, here_y, now, last_x, last_y, last_time, course, way, outcome.passed[seed])
                last_x, last_y, last_time = here_x, here_y, now
                if states.mark[k + 1, 0, LOST] != 0:
                    status = LEFT_PLATE
                    break
                if way.ends and outcome.passed[seed, 1] >= 0.0:
                    status = DONE  # whatever comes after
                    break
            _keep_last(states, valid)
            done += n
        outcome.time[seed], outcome.rise[seed] = last_time, highest - lowest
        outcome.moved[seed, 0], outcome.moved[seed, 1] = last_x - x, last_y - y
        outcome.status[seed] = status


def _advance_seed(seed, alone, drive, notes, clock, frames):
    """Advance the part of a seed past the times of frames."""
    raise NotImplementedError("for compiled code only")


@overload(_advance_seed)
def _advance_by_method(seed, alone, drive, notes, clock, frames):
    if alone.instance_class is Lone:
        return lambda seed, alone, drive, notes, clock, frames: advance_lone(
            Lone(alone.parts[seed : seed + 1], alone.kinds, alone.work), drive, clock, frames
        )
    return lambda seed, alone, drive, notes, clock, frames: advance_part(
        Alone(alone.parts[seed : seed + 1], alone.kinds, alone.wall, alone.work), drive, notes, clock, frames
    )


@compiled
def _limits_of(start, held):
    """What the states of one seed are held against: its energy is that of its own start."""
    v = start[VELOCITY : VELOCITY + 3]
    speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + math.sqrt(2.0 * GRAVITY * abs(start[POSITION + 2]))
    energy = EnergyLimit(held.energy.plate_speed, speed, held.energy.restitution, held.energy.factor)
    return Held(held.bodies, held.surface, held.antinode, held.edge, energy, held.depth)


@compiled
def _first(motion, n):
    """The first n frames."""
    return Motion(motion.time, motion.state, motion.present[:n])


@compiled
def _take_motion(rows, n, motion):
    """Take the motion out of the first n rows."""
    for k in range(n):
        row, state = rows[k, 0], motion.state[k, 0]
        for axis in range(3):
            state[POSITION + axis], state[VELOCITY + axis] = row[axis], row[ROW_VELOCITY + axis]
            state[SPIN + axis] = row[ROW_SPIN + axis]
        for axis in range(4):
            state[QUATERNION + axis] = row[ROW_QUATERNION + axis]


@compiled
def _start(motion, held, states):
    """The states at the start, from the first frame."""
    states.value[0, 0, SPEED] = 0.0
    states.mark[0, 0, CLEAR] = states.mark[0, 0, FALLEN] = 0
    check_frames(_first(motion, 1), held, states, True)
    _keep_last(states, 1)
    states.mark[0, 0, FALLEN] = 0
    if states.value[0, 0, DEPTH] > 0.0:
        states.mark[0, 0, CLEAR] = 1


@compiled
def _keep_last(states, row):
    """Make a row that of the frame before the next block."""
    for k in range(states.value.shape[2]):
        states.value[0, 0, k] = states.value[row, 0, k]
    for k in range(states.mark.shape[2]):
        states.mark[0, 0, k] = states.mark[row, 0, k]


@compiled
def _begin_way(x, y, way, passed):
    """How far the part may move before it can pass a level: a place [m], its distance to the lines there [m]."""
    passed[0] = passed[1] = NOT_PASSED
    if way.lines.shape[0] == 0:
        return x, y, np.inf
    distance = _distance(x, y, way.lines)
    if distance < way.levels[0] * way.reach:
        return x, y, np.inf  # it does not pass the start line
    if distance == way.levels[0] * way.reach:
        passed[0] = 0.0
    return x, y, distance


@compiled
def _follow(x, y, time, last_x, last_y, last_time, course, way, passed):
    """Note when the part passes a level between the last frame and this one, linearly in between.

    The distance to the lines is computed only where the part may have passed: it changes by no more than the part
    moves.
    """
    from_x, from_y, distance = course
    level = 0 if passed[0] == NOT_PASSED else 1
    if distance == np.inf or passed[1] != NOT_PASSED:
        return course
    if distance - math.hypot(x - from_x, y - from_y) > way.levels[level] * way.reach:
        return course
    distance = _distance(x, y, way.lines)
    for level in range(2):
        limit = way.levels[level] * way.reach
        if passed[level] == NOT_PASSED and distance <= limit:
            before = _distance(last_x, last_y, way.lines)
            share = 0.0 if before <= limit else (before - limit) / (before - distance)
            passed[level] = last_time + share * (time - last_time)
    return x, y, distance


@compiled
def _distance(x, y, lines):
    """Distance [m] of a place to the nearest of some segments."""
    nearest = np.inf
    for k in range(lines.shape[0]):
        ax, ay = lines[k, 0], lines[k, 1]
        ex, ey = lines[k, 2] - ax, lines[k, 3] - ay
        length = ex * ex + ey * ey
        along = 0.0
        if length > 0.0:
            along = min(max(((x - ax) * ex + (y - ay) * ey) / length, 0.0), 1.0)
        nearest = min(nearest, (x - ax - along * ex) ** 2 + (y - ay - along * ey) ** 2)
    return math.sqrt(nearest)
