"""What the impulse engine works on: parts, their motion, walls and scratch space as compiled code takes them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import ArrayLike, NDArray

from feeder_sim.engines.impulse.free_flight import orthonormalise, rotate_freely, rotate_symmetric
from feeder_sim.machine_code import compiled, inlined
from feeder_sim.scene.guide import Guide
from feeder_sim.scene.scene import GRAVITY

GAP, RATE, SURFACE_RATE, SURFACE_ACCELERATION, WALL_GAP, WALL_RATE = range(6)  # columns of Scratch.corner
ARM, NORMAL, VELOCITY = range(3)  # of Scratch.contact
RESTITUTION, FRICTION = range(2)  # of Scratch.law
ROW = 18  # numbers per part and frame: position, velocity, attitude, momentum
ABSENT, AWAKE, ASLEEP = range(3)  # in PART, there


# State of one part in world axes at a time of its own, `clock` [s]: columns of the attitude are the body axes; momentum
# is the angular momentum about the centre of mass; there: ABSENT once it has been taken out, ASLEEP while it lies still
# (rest.py), else AWAKE.
PART = np.dtype(
    [
        ("position", "f8", 3),
        ("velocity", "f8", 3),
        ("attitude", "f8", (3, 3)),
        ("momentum", "f8", 3),
        ("clock", "f8"),
        ("kind", "i8"),
        ("there", "i8"),
    ],
    align=True,
)
# What parts of one kind have in common: mass [kg], infinite for what stands still, and principal inertia; axis of
# symmetry or -1; radius [m] around its corners, their reach from the centre of mass; restitution and friction on the
# plate (0) and between parts (1), the same for all kinds; where its corners, edges and planes are in `Kinds`.
KIND_FIELDS: list[Any] = [
    ("mass", "f8"),
    ("inertia", "f8", 3),
    ("axis", "i8"),
    ("radius", "f8"),
    ("reach", "f8"),
    ("restitution", "f8", 2),
    ("friction", "f8", 2),
    ("corner_from", "i8"),
    ("corner_to", "i8"),
    ("edge_from", "i8"),
    ("edge_to", "i8"),
    ("plane_from", "i8"),
    ("plane_to", "i8"),
]
KIND = np.dtype(KIND_FIELDS, align=True)
# The same in a scene with a general top; the further field is a mark that compilation goes by. It comes first: numba
# takes a record with more fields at its end for one of the shorter kind.
GENERAL = "general"
GENERAL_KIND = np.dtype([(GENERAL, "i8"), *KIND_FIELDS], align=True)


class Kinds(NamedTuple):
    """All kinds of parts: one record `KIND` each, and their hulls one behind the other.

    corners: (n, 3) [m]; edges: pairs of corners, counted from the first of their kind, (m, 2); planes of the faces:
    (outward unit normal, offset) with normal . x + offset <= 0 inside, (f, 4).
    """

    record: NDArray[np.void]
    corners: NDArray[np.float64]
    edges: NDArray[np.int64]
    planes: NDArray[np.float64]


class Wall(NamedTuple):
    """The wall of a tube: a point of its axis [m], unit vector along it, inner radius [m]."""

    foot: NDArray[np.float64]
    axis: NDArray[np.float64]
    radius: float
    restitution: float
    friction: float


class Bounds(NamedTuple):
    """What the surface can do at most within a window of time.

    crest: height [m]; acceleration: of every mode shape at its antinode [m/s^2]; speed: of any point [m/s]; step: the
    shortest flight [s] that is followed, and rest_step that of a part that hardly moves; calm: parts may fall asleep.
    """

    crest: float
    acceleration: NDArray[np.float64]
    speed: float
    step: float
    rest_step: float
    calm: bool


class FrameRows(NamedTuple):
    """Times of frames (m,) [s], and the rows (m, parts, ROW) that the states then are written to.

    interrupt: (1,), not 0 as soon as another thread wants the computation to end where it is.
    """

    time: NDArray[np.float64]
    row: NDArray[np.float64]
    interrupt: NDArray[np.int64]


class Scratch(NamedTuple):
    """Few arrays, since every one of them makes each call of a compiled function dearer.

    corner: (n, 6), columns GAP over what it can touch, RATE of approach, what the surface adds to rate and acceleration
    bound, WALL_GAP, WALL_RATE. contact: (3, 2 n, 3), ARM, NORMAL and surface VELOCITY of each contact of an impact.
    law: (2, 2 n), RESTITUTION and FRICTION of each. modal: (2, n_shapes), q and dq/dt. modes: (n_shapes, 3). weight:
    (2, 4) of the interpolation in x and y. points: (n, 3), corners and crossings of hull edges with the plate's edge.
    unresolved: (1,), impacts whose sweeps did not settle.
    """

    corner: NDArray[np.float64]
    contact: NDArray[np.float64]
    law: NDArray[np.float64]
    modal: NDArray[np.float64]
    modes: NDArray[np.float64]
    weight: NDArray[np.float64]
    points: NDArray[np.float64]
    unresolved: NDArray[np.int64]


def new_parts(position: ArrayLike, attitude: ArrayLike, kind: ArrayLike, velocity: ArrayLike = 0.0) -> NDArray[np.void]:
    """Parts (`PART`) without spin and awake at time 0.

    Positions (n, 3) [m], attitudes (n, 3, 3), kinds (n,), velocities (n, 3) [m/s].
    """
    kind = np.asarray(kind)
    parts = np.zeros(len(kind), PART)
    parts["position"], parts["attitude"], parts["kind"], parts["there"] = position, attitude, kind, AWAKE
    parts["velocity"] = velocity
    return parts


def read_wall(guide: Guide | None) -> Wall | None:
    """The wall of a guide with play, None without one."""
    if guide is None or guide.radius is None or guide.restitution is None:
        return None
    return Wall(np.array([*guide.foot, 0.0]), guide.axis, guide.radius, guide.restitution, guide.friction)


def new_scratch(kinds: Kinds, n_shapes: int) -> Scratch:
    """Room for any part: each of its corners can touch plate and wall, each of its edges the edge of the plate."""
    of = kinds.record
    n = int((of["corner_to"] - of["corner_from"] + 2 * (of["edge_to"] - of["edge_from"])).max())
    sizes = ((n, 6), (3, 2 * n, 3), (2, 2 * n), (2, n_shapes), (n_shapes, 3), (2, 4), (n, 3))
    corner, contact, law, modal, modes, weight, points = (np.zeros(size) for size in sizes)
    return Scratch(corner, contact, law, modal, modes, weight, points, np.zeros(1, np.int64))


@inlined
def flies(part, kind):
    """Whether a part moves at all; walls and parts asleep do not."""
    return part.there == AWAKE and kind.mass < np.inf


@compiled
def fly_to(part, kind, t):
    """Bring a part to time t [s]."""
    duration = t - part.clock
    part.clock = t
    if duration <= 0.0 or not flies(part, kind):
        return
    for k in range(3):
        part.position[k] += part.velocity[k] * duration
    part.position[2] -= 0.5 * GRAVITY * duration * duration
    part.velocity[2] -= GRAVITY * duration
    _rotate(part.attitude, part.momentum, kind, duration)


def _rotate(attitude, momentum, kind, duration):
    """Advance an attitude; for compiled code only."""
    raise NotImplementedError


@overload(_rotate)
def _rotate_by_kind(attitude, momentum, kind, duration):
    """Only scenes that hold a general top pay for its compilation."""
    if GENERAL in kind.fields:
        return lambda attitude, momentum, kind, duration: rotate_freely(
            attitude, momentum, kind.inertia, kind.axis, duration
        )
    return lambda attitude, momentum, kind, duration: rotate_symmetric(
        attitude, momentum, kind.inertia, kind.axis, duration
    )


@compiled
def write_row(parts, i, kinds, t, row):
    """Write position, velocity, attitude and momentum of a part at time t [s], as it flies until then, into row (ROW,).

    The part itself is left as it is.
    """
    seen = np.empty(1, PART)
    seen[0] = parts[i]
    part = seen[0]
    fly_to(part, kinds.record[part.kind], t)
    for k in range(3):
        row[k], row[3 + k], row[15 + k] = part.position[k], part.velocity[k], part.momentum[k]
        for axis in range(3):
            row[6 + 3 * k + axis] = part.attitude[k, axis]
    return seen.shape[0]  # a record holds no reference to its array, which must live until here


@compiled
def orthonormalise_parts(parts, n):
    """Take the round-off of many flights out of the attitudes of the first n parts."""
    for i in range(n):
        if parts[i].there:
            orthonormalise(parts[i].attitude)


@compiled
def invert_inertia(attitude, inertia, out):
    """Write the inverse inertia tensor in world axes into out (3, 3) [1/(kg m^2)]; zero for infinite inertia."""
    for i in range(3):
        for j in range(3):
            out[i, j] = 0.0
            for k in range(3):
                out[i, j] += attitude[i, k] * attitude[j, k] / inertia[k]


@inlined
def point(part, corners, i, k):
    """Coordinate k of corner i in space [m]."""
    value = part.position[k]
    for axis in range(3):
        value += part.attitude[k, axis] * corners[i, axis]
    return value


@compiled
def turning_speed(part, kind):
    """No point of a part moves faster about its centre [m/s]."""
    momentum, inertia = part.momentum, kind.inertia
    squared = momentum[0] ** 2 + momentum[1] ** 2 + momentum[2] ** 2
    return kind.reach * math.sqrt(squared) / min(inertia[0], inertia[1], inertia[2])


@compiled
def top_speed(part, kind):
    """No point of the part is faster [m/s]; never quite zero."""
    v = part.velocity
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + turning_speed(part, kind) + 1e-12


@compiled
def spin_of(part, kind, spin):
    """Write the angular velocity in world axes [rad/s] into spin (3,)."""
    spin[:] = 0.0
    for axis in range(3):
        along = 0.0
        for k in range(3):
            along += part.attitude[k, axis] * part.momentum[k]
        for k in range(3):
            spin[k] += part.attitude[k, axis] * along / kind.inertia[axis]


@inlined
def relative_velocity(v, w, arm, surface_velocity, out):
    """Velocity of a body point relative to the surface: v + w x arm - surface_velocity."""
    out[0] = v[0] + w[1] * arm[2] - w[2] * arm[1] - surface_velocity[0]
    out[1] = v[1] + w[2] * arm[0] - w[0] * arm[2] - surface_velocity[1]
    out[2] = v[2] + w[0] * arm[1] - w[1] * arm[0] - surface_velocity[2]


@inlined
def dot(a, b):
    """Scalar product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
