"""Parts at rest: what lies on a plate that hardly moves any more stays out of the run of events until it is disturbed.

A plate that is no longer driven and has come down to millimetres per second can throw parts up by a micrometre at
most; nothing comes of that but cost. A part that then lies on three corners or more around its centre of mass and is
about as slow itself falls asleep where it is, unless it slides; so does a cylinder that lies on its side. A part that
hits it or enters it wakes it, and so does a plate that moves again.
"""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.circles import QUARTERS, count_of, is_round
from feeder_sim.engines.impulse.plate_edge import points_on_edge
from feeder_sim.engines.impulse.state import ALONE, ASLEEP, AWAKE, point, top_speed
from feeder_sim.engines.surface_arrays import off_plate
from feeder_sim.machine_code import compiled

SLOW = 5e-3  # [m/s]; a hop of a micrometre
SLIDES = 1e-4  # [m/s]; along the plate: what is pushed harder than friction holds is faster than this after each look
CARRIES = 1e-6  # [m]; corners this close to the surface carry


@compiled
def fall_asleep(part, kinds, surface, work):
    """Put a part to sleep if it lies still on the plate, and say so; work holds the gaps of its corners."""
    kind = kinds.record[part.kind]
    corners = kinds.corners[kind.corner_from : kind.corner_to]
    if is_round(kind):
        corners = work.corners[: count_of(kind) + points_on_edge(part, kind, kinds, surface, 0.0, work)]
    sliding = math.sqrt(part.velocity[0] ** 2 + part.velocity[1] ** 2)
    sliding += kind.reach * abs(part.momentum[2]) / min(kind.inertia[0], kind.inertia[1], kind.inertia[2])
    if sliding > SLIDES or top_speed(part, kind) > SLOW:
        return False
    if not (is_round(kind) and _on_its_side(part, corners, surface, work)) and not _carried(
        part, corners, surface, work
    ):
        return False
    for k in range(3):
        part.velocity[k] = part.momentum[k] = 0.0
    part.there, part.asleep_with = ASLEEP, ALONE
    return True


@compiled
def wake(part):
    """A part moves again, from where it lies; nothing happens to one that is awake."""
    if part.there == ASLEEP:
        part.there = AWAKE


@compiled
def _carried(part, corners, surface, work):
    """Whether the corners on the plate surround the centre of mass: from each the next one is less than half a turn on.

    Seen from above; a part that stands on an edge lies on two corners, and neither follows the other in that sense.
    """
    n = corners.shape[0]
    on_plate = 0
    for i in range(n):
        if work.point[i].gap > CARRIES or _over_hole(part, corners, i, surface):
            continue
        on_plate += 1
        x, y = point(part, corners, i, 0) - part.position[0], point(part, corners, i, 1) - part.position[1]
        followed = False
        for j in range(n):
            if work.point[j].gap > CARRIES or _over_hole(part, corners, j, surface):
                continue
            u = point(part, corners, j, 0) - part.position[0]
            v = point(part, corners, j, 1) - part.position[1]
            if x * v - y * u > 0.0:
                followed = True
                break
        if not followed:
            return False
    return on_plate > 2


@compiled
def _on_its_side(part, points, surface, work):
    """Whether both circles of a cylinder are on the plate where they are lowest; nothing rolls it then."""
    for i in (0, QUARTERS):  # noqa: SIM110 - compiled
        if work.point[i].gap > CARRIES or _over_hole(part, points, i, surface):
            return False
    return True


@compiled
def _over_hole(part, corners, i, surface):
    """Whether a corner is off the outline of the plate, over which its gap may be that to the crest."""
    return off_plate(surface.outline, point(part, corners, i, 0), point(part, corners, i, 1))
