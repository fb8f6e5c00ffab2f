"""What the impulse engine works on: parts, their motion, walls and scratch space as compiled code takes them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.free_flight import orthonormalise, rotate_freely
from feeder_sim.engines.impulse.vectors import dot, times, vector
from feeder_sim.machine_code import compiled, inlined
from feeder_sim.plate.zener import TABLE_POINTS

ABSENT, AWAKE, ASLEEP = range(3)  # in PART, there
ALONE = -1  # in PART, asleep_with
SLENDER = 4.0  # largest over smallest moment of inertia


# State of one part in world axes at a time of its own, `clock` [s]: columns of the attitude are the body axes; momentum
# is the angular momentum about the centre of mass; there: ABSENT once it has been taken out, ASLEEP while it lies still
# (rest.py), else AWAKE; asleep_with: number of the component that it sleeps in, or ALONE.
# What follows is of a part that is computed without a step (docs/contact.md):
# phase: FREE; PRESSED by a mean force [N] and moment [N m] until it is looked at next; FOLLOWING the surface, whose
# frame at a place it keeps its offset and orientation in. Force and moment change steadily with the push of the plate:
# by a jerk [m/s^3] of the part, and a twist [N m/s]; they have their mean after the time lead [s]. supported: looks for
# which it has not slipped. draws: state of its random numbers. depth: of its deepest point after its last look [m].
# beside: it has come under the sheet of the plate from beside it, and falls past. jammed: until when it has no friction
# [s]. looks: at it, beyond those that pass, until budget [s].
# due: when it is looked at next, among others, and weighed: when it was last seen whether it rests [s].
FREE, PRESSED, FOLLOWING, FIXED, STEADY = range(5)  # FIXED: a fixture of a tray; STEADY: one that moves by itself
PART = np.dtype(
    [
        ("position", "f8", 3),
        ("velocity", "f8", 3),
        ("attitude", "f8", (3, 3)),
        ("momentum", "f8", 3),
        ("clock", "f8"),
        ("kind", "i8"),
        ("there", "i8"),
        ("asleep_with", "i8"),
        ("phase", "i8"),
        ("supported", "i8"),
        ("beside", "i8"),
        ("looks", "f8"),
        ("budget", "f8"),
        ("jammed", "f8"),
        ("depth", "f8"),
        ("draws", "u8"),
        ("force", "f8", 3),
        ("moment", "f8", 3),
        ("jerk", "f8", 3),
        ("twist", "f8", 3),
        ("lead", "f8"),
        ("place", "f8", 2),
        ("offset", "f8", 3),
        ("orientation", "f8", (3, 3)),
        ("due", "f8"),
        ("weighed", "f8"),
    ],
    align=True,
)
# What parts of one kind have in common: mass [kg], infinite for what stands still, and principal inertia; axis of
# symmetry or -1; radius [m] around its corners, their reach from the centre of mass; restitution and friction on the
# plate (0) and between parts (1), and arm of rolling friction on the plate [m], the same for all kinds; where its
# corners and edges are in `Kinds`, and the pieces that meet those of other parts; radius of the two circles of a
# cylinder, 0 for other kinds, and their height over its centre [m].
KIND_FIELDS: list[Any] = [
    ("mass", "f8"),
    ("inertia", "f8", 3),
    ("axis", "i8"),
    ("radius", "f8"),
    ("reach", "f8"),
    ("restitution", "f8", 2),
    ("friction", "f8", 2),
    ("rolling", "f8"),
    ("corner_from", "i8"),
    ("corner_to", "i8"),
    ("edge_from", "i8"),
    ("edge_to", "i8"),
    ("piece_from", "i8"),
    ("piece_to", "i8"),
    ("circle_radius", "f8"),
    ("circle_height", "f8"),
]
KIND = np.dtype(KIND_FIELDS, align=True)
# Laws of impact by choice (impact_law.py): restitution that falls with the speed by a power; by Zener's theory, with
# the inelasticity at 1 m/s, 0 for the walls of a rim, and the table of log e; tangential restitution of balls;
# Poisson's law, which needs no number; that of own_law.py has a mark of its own. Their fields are marks that
# compilation goes by. They come first, as in every record that extends another: numba takes a record with more fields
# at its end for one of the shorter kind.
EXPONENT, ZENER, TANGENTIAL = "restitution_exponent", "zener_inelasticity", "tangential_restitution"
POISSON = "poisson"
EXPONENT_FIELDS: list[Any] = [(EXPONENT, "f8"), ("restitution_speed", "f8")]
ZENER_FIELDS: list[Any] = [(ZENER, "f8"), ("zener_table", "f8", TABLE_POINTS)]
TANGENTIAL_FIELDS: list[Any] = [(TANGENTIAL, "f8")]
POISSON_FIELDS: list[Any] = [(POISSON, "f8")]


# A convex body: where its corners, edges and planes are in `Kinds`; centre of a sphere around it, in principal axes
# from the centre of mass of its part, and the radius of that sphere, both [m].
PIECE = np.dtype(
    [
        ("corner_from", "i8"),
        ("corner_to", "i8"),
        ("edge_from", "i8"),
        ("edge_to", "i8"),
        ("plane_from", "i8"),
        ("plane_to", "i8"),
        ("centre", "f8", 3),
        ("reach", "f8"),
    ],
    align=True,
)


class Kinds(NamedTuple):
    """All kinds of parts: one record `KIND` each, and their convex bodies one behind the other.

    corners: (n, 3) [m]; edges: two corners and the two faces that meet there, counted from the first of their body,
    (m, 4), along the normal of the second times that of the first; planes of the faces: (outward unit normal, offset)
    with normal . x + offset <= 0 inside, (f, 4). piece: a record `PIECE` each, first the
    hull of every kind, by the number of the kind, then the pieces of concave ones.
    """

    record: NDArray[np.void]
    corners: NDArray[np.float64]
    edges: NDArray[np.int64]
    planes: NDArray[np.float64]
    piece: NDArray[np.void]


def kind_type(law: Sequence[Any] = ()) -> np.dtype[np.void]:
    """Type of the records of all kinds: `KIND`, with the marks of laws of impact by choice."""
    return np.dtype([*law, *KIND_FIELDS], align=True)


def new_parts(
    position: ArrayLike,
    attitude: ArrayLike,
    kind: ArrayLike,
    velocity: ArrayLike = 0.0,
    momentum: ArrayLike = 0.0,
) -> NDArray[np.void]:
    """Parts (`PART`) awake at time 0.

    Positions (n, 3) [m], attitudes (n, 3, 3), kinds (n,), velocities (n, 3) [m/s], angular momenta (n, 3) [kg m2/s].
    """
    kind = np.asarray(kind)
    parts = np.zeros(len(kind), PART)
    parts["position"], parts["attitude"], parts["kind"], parts["there"] = position, attitude, kind, AWAKE
    parts["velocity"], parts["momentum"], parts["asleep_with"] = velocity, momentum, ALONE
    return parts


def copied(parts: NDArray[np.void]) -> NDArray[np.void]:
    """A copy of parts (n,), byte by byte, where numpy goes field by field."""
    return parts.view(np.uint8).copy().view(parts.dtype)


@inlined
def flies(part, kind):
    """Whether a part moves at all; walls and parts asleep do not."""
    return part.there == AWAKE and kind.mass < np.inf


@inlined
def in_pieces(kind):
    """Whether parts of a kind meet others by pieces, of which each has a place of its own."""
    return kind.piece_to - kind.piece_from > 1


@compiled
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
        rotate_freely(part.attitude, part.momentum, kind.inertia, kind.axis, duration)
        return
    bent = (duration / 3.0 - part.lead) * 0.5 * duration * duration
    turned = (0.5 * duration - part.lead) * duration
    part.lead -= duration
    for k in range(3):
        gained = part.force[k] / kind.mass * duration
        part.position[k] += (part.velocity[k] + 0.5 * gained) * duration + part.jerk[k] * bent
        part.velocity[k] += gained + part.jerk[k] * turned
        part.momentum[k] += 0.5 * part.moment[k] * duration + part.twist[k] * bent / duration
    part.position[2] -= 0.5 * GRAVITY * duration * duration
    part.velocity[2] -= GRAVITY * duration
    rotate_freely(
        part.attitude, part.momentum, kind.inertia, kind.axis, duration
    )  # at the mean of its momentum, to second order
    for k in range(3):
        part.momentum[k] += 0.5 * part.moment[k] * duration + part.twist[k] * (turned - bent / duration)


@compiled
def orthonormalise_parts(parts, n):
    """Take the round-off of many flights out of the attitudes of the first n parts."""
    for i in range(n):
        if parts[i].there:
            orthonormalise(parts[i].attitude)


@inlined
def inverse_inertia(part, kind):
    """Inverse inertia tensor in world axes, a symmetric matrix [1/(kg m^2)]; zero for infinite inertia."""
    r, a, b, c = part.attitude, 1.0 / kind.inertia[0], 1.0 / kind.inertia[1], 1.0 / kind.inertia[2]
    return (
        a * r[0, 0] * r[0, 0] + b * r[0, 1] * r[0, 1] + c * r[0, 2] * r[0, 2],
        a * r[0, 0] * r[1, 0] + b * r[0, 1] * r[1, 1] + c * r[0, 2] * r[1, 2],
        a * r[0, 0] * r[2, 0] + b * r[0, 1] * r[2, 1] + c * r[0, 2] * r[2, 2],
        a * r[1, 0] * r[1, 0] + b * r[1, 1] * r[1, 1] + c * r[1, 2] * r[1, 2],
        a * r[1, 0] * r[2, 0] + b * r[1, 1] * r[2, 1] + c * r[1, 2] * r[2, 2],
        a * r[2, 0] * r[2, 0] + b * r[2, 1] * r[2, 1] + c * r[2, 2] * r[2, 2],
    )


@inlined
def point(part, corners, i, k):
    """Coordinate k of corner i in space [m]."""
    value = part.position[k]
    for axis in range(3):
        value += part.attitude[k, axis] * corners[i, axis]
    return value


@inlined
def piece_centre(part, piece, k):
    """Coordinate k of the centre of a piece in space [m]."""
    r, centre = part.attitude, piece.centre
    return part.position[k] + (r[k, 0] * centre[0] + r[k, 1] * centre[1] + r[k, 2] * centre[2])


@inlined
def arm_of(part, corners, i):
    """The way from the centre of mass to corner i, in world axes [m]."""
    r, x, y, z = part.attitude, corners[i, 0], corners[i, 1], corners[i, 2]
    return (
        r[0, 0] * x + r[0, 1] * y + r[0, 2] * z,
        r[1, 0] * x + r[1, 1] * y + r[1, 2] * z,
        r[2, 0] * x + r[2, 1] * y + r[2, 2] * z,
    )


@inlined
def height_of(part, corners, i):
    """Height of corner i over the centre of mass [m]."""
    r = part.attitude
    return r[2, 0] * corners[i, 0] + r[2, 1] * corners[i, 1] + r[2, 2] * corners[i, 2]


@compiled
def turning_speed(part, kind):
    """No point of a part moves faster about its centre [m/s]."""
    momentum, inertia = part.momentum, kind.inertia
    squared = momentum[0] ** 2 + momentum[1] ** 2 + momentum[2] ** 2
    if _is_slender(kind):
        return kind.reach * math.sqrt(_squared_spin(part, kind))
    return kind.reach * math.sqrt(squared) / min(inertia[0], inertia[1], inertia[2])


@compiled
def turning_acceleration(part, kind):
    """No point of a part is accelerated more in free flight, but for gravity [m/s^2].

    |dw/dt| <= |w| |L| / I_min for a torque-free body, so a point accelerates by at most 2 reach (L / I_min)^2.
    """
    momentum, inertia = part.momentum, kind.inertia
    least = min(inertia[0], inertia[1], inertia[2])
    if _is_slender(kind):  # |dw/dt| <= w^2 / sqrt(3), by Euler's equations and as I_i + I_j >= I_k
        return 2.0 * kind.reach * _squared_spin(part, kind)
    return 2.0 * kind.reach * dot(momentum, momentum) / (least * least)


@inlined
def _is_slender(kind):
    """Whether |L| / I_min is far more than a part can turn by; else that is the cheaper bound."""
    a, b, c = kind.inertia[0], kind.inertia[1], kind.inertia[2]
    return max(a, b, c) > SLENDER * min(a, b, c) and kind.mass < np.inf


@inlined
def _squared_spin(part, kind):
    """The square of the angular velocity [1/s^2]: it stays that of a symmetric top, of others this is a bound."""
    spin = spin_of(part, kind)
    if kind.axis >= 0:
        return dot(spin, spin)
    return dot(part.momentum, spin) / min(kind.inertia[0], kind.inertia[1], kind.inertia[2])


@compiled
def top_speed(part, kind):
    """No point of the part is faster [m/s]; never quite zero."""
    v = part.velocity
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + turning_speed(part, kind) + 1e-12


@inlined
def spin_of(part, kind):
    """Angular velocity in world axes [rad/s]."""
    return times(inverse_inertia(part, kind), vector(part.momentum))
