"""Rows of numbers that the state of each part is written to at the time of a frame."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.state import PART, fly_to, spin_of
from feeder_sim.machine_code import compiled, inlined

# Columns of a row, the numbers per part and frame.
POSITION, VELOCITY, ATTITUDE, MOMENTUM, QUATERNION, SPIN = (
    slice(0, 3),
    slice(3, 6),
    slice(6, 15),
    slice(15, 18),
    slice(18, 22),
    slice(22, 25),
)
ROW = 25


class FrameRows(NamedTuple):
    """Times of frames (m,) [s], and the rows (m, parts, ROW) that the states then are written to.

    interrupt: (2,), see `new_interrupt`.
    """

    time: NDArray[np.float64]
    row: NDArray[np.float64]
    interrupt: NDArray[np.int64]


@compiled
def write_row(parts, i, kinds, t, row):
    """Write the state of a part at time t [s], as it flies until then, into row (ROW,): see POSITION to SPIN.

    The part itself is left as it is.
    """
    seen = np.empty(1, PART)
    seen[0] = parts[i]
    part = seen[0]
    kind = kinds.record[part.kind]
    fly_to(part, kind, t)
    write_state(part, kind, row)
    return seen.shape[0]  # a record holds no reference to its array, which must live until here


@inlined
def write_state(part, kind, row):
    """Write the state of a part into row (ROW,)."""
    spin = spin_of(part, kind)
    row[22], row[23], row[24] = spin
    row[18], row[19], row[20], row[21] = _quaternion(part.attitude)
    for k in range(3):
        row[k], row[3 + k], row[15 + k] = part.position[k], part.velocity[k], part.momentum[k]
        for axis in range(3):
            row[6 + 3 * k + axis] = part.attitude[k, axis]


@inlined
def _quaternion(r):
    """Unit quaternion of a rotation matrix (3, 3), w first; its largest component is positive.

    Shepperd, J. Guidance and Control 1 (1978) 223.
    """
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    if trace >= max(r[0, 0], r[1, 1], r[2, 2]):
        q = 1.0 + trace, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    elif r[0, 0] >= r[1, 1] and r[0, 0] >= r[2, 2]:
        q = r[2, 1] - r[1, 2], 1.0 - trace + 2.0 * r[0, 0], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]
    elif r[1, 1] >= r[2, 2]:
        q = r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1.0 - trace + 2.0 * r[1, 1], r[1, 2] + r[2, 1]
    else:
        q = r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1.0 - trace + 2.0 * r[2, 2]
    size = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] / size, q[1] / size, q[2] / size, q[3] / size
