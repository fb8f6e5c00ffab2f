"""What the engine of one part without a step works on: the part, bounds on the plate, and scratch space."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.contact_problem import Bodies, Contacts, new_room
from feeder_sim.engines.impulse.free_part.edge_piece import EDGE_POINT
from feeder_sim.engines.impulse.state import AWAKE, PART_FIELDS, Kinds, flies, rotate
from feeder_sim.engines.surface_arrays import SurfaceArrays
from feeder_sim.machine_code import inlined
from feeder_sim.scene.scene import Scene

WINDOW = 2e-2  # [s]; bounds follow the ring-up of the plate
FREE, PRESSED, FOLLOWING = range(3)  # in PART, phase
# A point that can touch. sort: ABOVE the crest of the plate, to which the gap is, ON_PLATE, AT_EDGE or ON_WALL. gap
# [m], infinite where there is nothing to touch, its rate [m/s], how fast both sides are accelerated together,
# `closing` [m/s^2], of it `push` by the plate, and its rate [m/s^3]; most_own, most_push: bounds on what both sides
# do of it; unsure: bound on the change of what the point does of it, as far as that is not known [m/s^3]; wild: on
# the fourth derivative of its path, beyond that by turning [m/s^4]; push_rate: mean change of the push while forces
# last [m/s^3]. arm from the centre of mass to the contact [m], normal from the plate, and the velocity of the plate
# there [m/s]. Path of the centre of the sphere around the point: velocity, acceleration, and the vertical part of its
# change; at the edge and at the wall all is along the normal, in the vertical part; there the normal turns by a swing
# [1/s], and `edge` is the row in Scratch.edge. carried: forces see to it (sustained.py). inside: how far it is
# inside, and let go [m]; safe: until when it does not touch [s]; lands: it does then (leap.py).
ABOVE, ON_PLATE, ON_CIRCLE, AT_EDGE, ON_WALL = range(5)
POINT = np.dtype(
    [
        ("sort", "i8"),
        ("gap", "f8"),
        ("rate", "f8"),
        ("closing", "f8"),
        ("closing_rate", "f8"),
        ("push", "f8"),
        ("most_own", "f8"),
        ("most_push", "f8"),
        ("unsure", "f8"),
        ("wild", "f8"),
        ("push_rate", "f8"),
        ("friction", "f8"),
        ("arm", "f8", 3),
        ("normal", "f8", 3),
        ("surface_velocity", "f8", 3),
        ("path_velocity", "f8", 3),
        ("path_acceleration", "f8", 3),
        ("path_jerk", "f8"),
        ("swing", "f8", 3),
        ("rolls", "f8"),
        ("edge", "i8"),
        ("carried", "i8"),
        ("inside", "f8"),
        ("safe", "f8"),
        ("lands", "i8"),
    ],
    align=True,
)
# Of Scratch.under: what each mode shape does under a point: deflection, its slopes, rotations, and how far it moves the
# plate along the normal of the point.
HEIGHT, SLOPE_X, SLOPE_Y, TURN_X, TURN_Y, ALONG = range(6)
NOW, SPEED, ACCELERATION, CHANGE = range(4)  # of Scratch.now and Scratch.then
CIRCLES, EDGE_POINTS = 2, 32  # room for points on the edge of the plate
UNRESOLVED, LATE, SPENT = range(3)  # of Scratch.counts

# State of the part: that of `impulse.state.PART`, and before it, as numba needs it, what it does (docs/contact.md).
# phase: FREE; PRESSED by a mean force [N] and moment [N m] until it is looked at next; FOLLOWING the surface, whose
# frame at a place it has a seat and a facing in. Force and moment change steadily with the push of the plate: by a
# jerk [m/s^3] of the part, and a twist [N m/s]; they have their mean after the time lead [s]. held: looks for which
# it has not slipped. draws: state of its random numbers. depth: of its deepest point after its last look [m]. beside:
# it has come under the sheet of the plate from beside it, and falls past. jammed: until when it has no friction [s].
# looks: at it, beyond those that pass, until budget [s].
OWN_FIELDS: list[Any] = [
    ("phase", "i8"),
    ("held", "i8"),
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
    ("seat", "f8", 3),
    ("facing", "f8", (3, 3)),
]
PART = np.dtype([*OWN_FIELDS, *PART_FIELDS], align=True)


class Exactness(NamedTuple):
    """How exact contacts are.

    tolerance: how far they may be off [m]; touch: from which gap on points touch [m]; noise: random speed of impacts
    [m/s]. approach: what comes nearer by less does not approach [m/s]. longest, sways: forces last no longer than that
    [s], and than the fastest motion of the plate takes to turn by so much [rad]: slip turns once at most. slip,
    slip_at_rest: what slides on by less sticks, on a plate that moves and on one that does not [m/s].
    """

    tolerance: float
    touch: float
    noise: float
    approach: float
    longest: float
    sways: float
    slip: float
    slip_at_rest: float


class Bounds(NamedTuple):
    """What the surface can do at most within a window of time.

    end: of the window [s]; crest: height [m]; slope: steepest [1]; curvature: largest [1/m]; acceleration: of every
    mode shape at its antinode [m/s^2]; amplitude: the same [m]; speed: of any point [m/s]; rate: by which derivatives
    grow, see `bound_window`, and fastest, that of any term [rad/s]; calm: the part may come to rest.
    """

    end: float
    crest: float
    slope: float
    curvature: float
    acceleration: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    speed: float
    rate: float
    fastest: float
    calm: bool
    exact: Exactness


class Tube(NamedTuple):
    """The wall of a tube: a point of its axis [m], unit vector along it, inner radius [m]."""

    foot: NDArray[np.float64]
    axis: NDArray[np.float64]
    radius: float
    restitution: float
    friction: float


class Rim(NamedTuple):
    """Four walls around the plate, at plus and minus half of its length and width (2,) [m]."""

    half: NDArray[np.float64]


class Plate(NamedTuple):
    """The plate in a window: the terms that act, what they can do at most, and the walls over it, or None."""

    surface: SurfaceArrays
    bounds: Bounds
    wall: Tube | Rim | None


class Scratch(NamedTuple):
    """Few arrays, since every one of them makes each call of a compiled function dearer.

    point: (n,), records POINT. under: (n, n_shapes, 6), see HEIGHT. point_of: of every contact, its point. now, then:
    (4, n_shapes), the modal coordinates and three derivatives at two times, see NOW. edge: points on the edge of the
    plate. counts: (3,), impacts and forces that were not solved, contacts found late, budgets of looks spent. before:
    (1,), the part as it was after its last look.
    """

    point: NDArray[np.void]
    under: NDArray[np.float64]
    bodies: Bodies
    contacts: Contacts
    point_of: NDArray[np.int64]
    now: NDArray[np.float64]
    then: NDArray[np.float64]
    edge: NDArray[np.void]
    counts: NDArray[np.int64]
    before: NDArray[np.void]


def new_scratch(kinds: Kinds, n_shapes: int) -> Scratch:
    """Room for the part: its corners, on the plate and at four walls, and the points on the edge of the plate."""
    rows = 5 * int((kinds.record["corner_to"] - kinds.record["corner_from"]).max()) + CIRCLES + EDGE_POINTS
    bodies, contacts, _ = new_room(1, rows)
    return Scratch(
        point=np.zeros(rows + 1, POINT),
        under=np.zeros((rows + 1, n_shapes, 6)),
        bodies=bodies,
        contacts=contacts,
        point_of=np.zeros(rows, np.int64),
        now=np.zeros((4, n_shapes)),
        then=np.zeros((4, n_shapes)),
        edge=np.zeros(EDGE_POINTS, EDGE_POINT),
        counts=np.zeros(3, np.int64),
        before=np.zeros(1, PART),
    )


def read_walls(scene: Scene) -> Tube | Rim | None:
    """The wall of a guide with play, or of a rim; None without either."""
    guide = scene.guides[0]
    if scene.rim:
        return Rim(0.5 * np.array([scene.surface.length, scene.surface.width]))
    if guide is None or guide.radius is None or guide.restitution is None:
        return None
    return Tube(np.array([*guide.foot, 0.0]), guide.axis, guide.radius, guide.restitution, guide.friction)


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
        part.momentum[k] += 0.5 * part.moment[k] * duration + part.twist[k] * bent / duration
    part.position[2] -= 0.5 * GRAVITY * duration * duration
    part.velocity[2] -= GRAVITY * duration
    rotate(part.attitude, part.momentum, kind, duration)  # at the mean of its momentum, to second order
    for k in range(3):
        part.momentum[k] += 0.5 * part.moment[k] * duration + part.twist[k] * (turned - bent / duration)
