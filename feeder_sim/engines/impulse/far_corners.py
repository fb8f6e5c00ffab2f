"""Corners that cannot come to the plate soon: of a part with many, most are far above it, and left out of a look.

Corners within a share of the part's size of the lowest one, or of the crest of the surface, are looked at; the others
count as one, as low as the lowest of them and as fast as any. So a part is looked at again before one of them can be
below the crest.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.state import height_of, spin_of, turning_acceleration
from feeder_sim.machine_code import inlined

MANY = 16  # corners; with fewer it costs as much as it saves
SHARE = 0.08  # of the reach of the corners, over the lowest one
CLEAR = 1e-5  # [m] over the crest


@inlined
def gather_near(part, kind, corners, bounds, work):
    """Copy the corners near the plate into work.corners; returns their number, and the height of the lowest other one.

    The height is over the centre of mass [m].
    """
    lowest = np.inf
    for i in range(corners.shape[0]):
        height = height_of(part, corners, i)
        work.point[i].gap = height
        lowest = min(lowest, height)
    near = max(lowest + SHARE * kind.reach, bounds.crest + CLEAR + kind.radius - part.position[2])
    n, lowest_other = 0, np.inf
    for i in range(corners.shape[0]):
        height = work.point[i].gap
        if height > near:
            lowest_other = min(lowest_other, height)
            continue
        for k in range(3):
            work.corners[n, k] = corners[i, k]
        n += 1
    return n, lowest_other


@inlined
def far_leap(part, kind, lowest_other, bounds):
    """Flight within which none of the other corners comes down to the crest [s]; `others`: see `gather_near`."""
    if lowest_other == np.inf:
        return np.inf
    spin = spin_of(part, kind)
    rate = part.velocity[2] - kind.reach * math.sqrt(spin[0] * spin[0] + spin[1] * spin[1])
    gap = max(part.position[2] + lowest_other - kind.radius - bounds.crest, 0.0)
    own = GRAVITY + turning_acceleration(part, kind)
    return (rate + math.sqrt(rate * rate + 2.0 * own * gap)) / own
