"""What the engine of one part without a step works on: the part, bounds on the plate, and scratch space."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.lone.contact_problem import Bodies, Contacts, new_room
from feeder_sim.engines.impulse.lone.edge_piece import EDGE_POINT
from feeder_sim.engines.impulse.state import AWAKE, PART_FIELDS, Kinds, flies, rotate
from feeder_sim.engines.surface_arrays import SurfaceArrays
from feeder_sim.machine_code import inlined

FREE, PRESSED, FOLLOWING = range(3)  # in PART, phase
# Columns of Scratch.point, a point that can touch: its gap [m] and how fast that grows [m/s]; how fast both sides are
# accelerated together [m/s^2], and how that changes [m/s^3]; the largest acceleration of the surface there, and of the
# point by itself [m/s^2]; how it falls by itself, with its part [m/s^2]; friction; KNOWN: 0 where the columns after it
# are not filled, AT_EDGE on the edge of the plate; CARRY: 1 where constant forces see to it (contact.py).
GAP, RATE, PUSH, JERK, MOVES, OWN, FALL, MU, KNOWN, CARRY = range(10)
AT_EDGE = 2.0
# Arm from the centre of mass, normal of what it can touch and how that moves, three columns each.
AT, TOWARDS, WITH = 10, 13, 16
# Of a point on the edge of the plate: how its normal turns [1/s], three columns, and its row in Scratch.edge.
SWING, EDGE = 19, 22
# Of a point while leaps are made (leap.py): its sideways velocity [m/s], two columns; until when it does not touch [s].
GOES, SAFE = 23, 25
POINT_COLUMNS = 26
# Of Scratch.under: what each mode shape does under a point: deflection, its slopes, and rotations.
HEIGHT, SLOPE_X, SLOPE_Y, TURN_X, TURN_Y = range(5)
NOW, SPEED, ACCELERATION, CHANGE = range(4)  # of Scratch.now and Scratch.then
EDGE_POINTS = 32  # room for points on the edge of the plate
UNRESOLVED, LATE, SPENT = range(3)  # of Scratch.counts

# State of the part: that of `impulse.state.PART`, and before it, as numba needs it, what it does (docs/contact.md).
# phase: FREE; PRESSED by a mean force [N] and moment [N m] until it is looked at next; FOLLOWING the surface, whose
# frame at a place it has a seat and a facing in. The force changes with the push of the plate, by a jerk [m/s^3] of the
# part, from less than its mean to more; it has its mean after the time lead [s]. held: looks for which it has not
# slipped. draws: state of its random numbers. depth: of its deepest point after its last look [m]. beside: it has come
# under the sheet of the plate from beside it, and falls past. looks: at it, beyond those that pass, until budget [s].
OWN_FIELDS: list[Any] = [
    ("phase", "i8"),
    ("held", "i8"),
    ("beside", "i8"),
    ("looks", "f8"),
    ("budget", "f8"),
    ("depth", "f8"),
    ("draws", "u8"),
    ("force", "f8", 3),
    ("moment", "f8", 3),
    ("jerk", "f8", 3),
    ("lead", "f8"),
    ("place", "f8", 2),
    ("seat", "f8", 3),
    ("facing", "f8", (3, 3)),
]
PART = np.dtype([*OWN_FIELDS, *PART_FIELDS], align=True)


class Exactness(NamedTuple):
    """How far contacts may be off [m], from which gap on points touch [m], and the random speed of impacts [m/s]."""

    tolerance: float
    touch: float
    noise: float


class Bounds(NamedTuple):
    """What the surface can do at most within a window of time.

    end: of the window [s]; crest: height [m]; slope: steepest [1]; acceleration: of every mode shape at its antinode
    [m/s^2]; speed: of any point [m/s]; fastest: rate of any term [rad/s]; brief: a time in which it moves as a
    polynomial of third degree in time says, to a share of the touch [s]; calm: the part may come to rest.
    """

    end: float
    crest: float
    slope: float
    acceleration: NDArray[np.float64]
    speed: float
    fastest: float
    brief: float
    calm: bool
    exact: Exactness


class Plate(NamedTuple):
    """The plate in a window: the terms that act, and what they can do at most."""

    surface: SurfaceArrays
    bounds: Bounds


class Scratch(NamedTuple):
    """Few arrays, since every one of them makes each call of a compiled function dearer.

    point: (n, POINT_COLUMNS), see GAP. under: (n, n_shapes, 5), see HEIGHT. row_of: of every contact, its row in
    `point`. now, then: (4, n_shapes), the modal coordinates and three derivatives at two times, see NOW. edge: points
    on the edge of the plate. counts: (3,), impacts and forces that were not solved, contacts found late, budgets
    of looks spent. before: (1,), the part as it was after its last look.
    """

    point: NDArray[np.float64]
    under: NDArray[np.float64]
    bodies: Bodies
    contacts: Contacts
    row_of: NDArray[np.int64]
    now: NDArray[np.float64]
    then: NDArray[np.float64]
    edge: NDArray[np.void]
    counts: NDArray[np.int64]
    before: NDArray[np.void]


def new_scratch(kinds: Kinds, n_shapes: int) -> Scratch:
    """Room for the part: its corners, and the points on the edge of the plate."""
    rows = int((kinds.record["corner_to"] - kinds.record["corner_from"]).max()) + EDGE_POINTS
    bodies, contacts, _ = new_room(1, rows)
    return Scratch(
        point=np.zeros((rows + 1, POINT_COLUMNS)),
        under=np.zeros((rows + 1, n_shapes, 5)),
        bodies=bodies,
        contacts=contacts,
        row_of=np.zeros(rows, np.int64),
        now=np.zeros((4, n_shapes)),
        then=np.zeros((4, n_shapes)),
        edge=np.zeros(EDGE_POINTS, EDGE_POINT),
        counts=np.zeros(3, np.int64),
        before=np.zeros(1, PART),
    )


def new_part(like: NDArray[np.void], draws: NDArray[np.uint64]) -> NDArray[np.void]:
    """The part (1,) in the state of one of `impulse.state.PART`; draws (1,): state of its random numbers."""
    part = np.zeros(1, PART)
    for name in like.dtype.names or ():
        part[name] = like[name]
    part["draws"], part["there"] = draws, AWAKE
    return part


@inlined
def fly_to(part, kind, t):
    """Bring a part that is not FOLLOWING to time t [s], under gravity and the force that presses it."""
    duration = t - part.clock
    part.clock = t
    if duration <= 0.0 or not flies(part, kind):
        return
    if part.phase == FREE:
        for k in range(3):
            part.position[k] += part.velocity[k] * duration
        part.position[2] -= 0.5 * GRAVITY * duration * duration
        part.velocity[2] -= GRAVITY * duration
        rotate(part.attitude, part.momentum, kind, duration)
        return
    bent = (duration / 3.0 - part.lead) * 0.5 * duration * duration
    turned = (0.5 * duration - part.lead) * duration
    part.lead -= duration
    for k in range(3):
        gained = part.force[k] / kind.mass * duration
        part.position[k] += (part.velocity[k] + 0.5 * gained) * duration + part.jerk[k] * bent
        part.velocity[k] += gained + part.jerk[k] * turned
        part.momentum[k] += 0.5 * part.moment[k] * duration
    part.position[2] -= 0.5 * GRAVITY * duration * duration
    part.velocity[2] -= GRAVITY * duration
    rotate(part.attitude, part.momentum, kind, duration)  # at the mean of its momentum, to second order
    for k in range(3):
        part.momentum[k] += 0.5 * part.moment[k] * duration
