"""What the engine of one part without a step works on: the points of the part that can touch, and scratch space."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.contact_problem import Bodies, Contacts, new_room
from feeder_sim.engines.impulse.free_part.edge_piece import EDGE_POINT
from feeder_sim.engines.impulse.state import PART, Kinds
from feeder_sim.machine_code import inlined

# A point that can touch. sort: ABOVE the crest of the plate, to which the gap is, ON_PLATE, AT_EDGE or ON_WALL. gap
# [m], infinite where there is nothing to touch, its rate [m/s], how fast both sides are accelerated together,
# `closing` [m/s^2], of it `push` by the plate, and its rate [m/s^3]; most_own, most_push: bounds on what both sides
# do of it; jerk_bound: on the change of what the point does of it, as far as that is not known [m/s^3]; snap_bound: on
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
        ("most_push", "f8"),
        ("surface_velocity", "f8", 3),
        ("closing", "f8"),
        ("closing_rate", "f8"),
        ("push", "f8"),
        ("most_own", "f8"),
        ("jerk_bound", "f8"),
        ("snap_bound", "f8"),
        ("push_rate", "f8"),
        ("friction", "f8"),
        ("arm", "f8", 3),
        ("normal", "f8", 3),
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
CIRCLES, EDGE_POINTS = 2, 32  # room for points on the edge of the plate
UNRESOLVED, LATE, SPENT = range(3)  # of Scratch.counts


FROM_MODES, BY_IMPACTS, BY_CORRECTION = range(3)  # of Yielding.energy_account


class Yielding(NamedTuple):
    """What gives way: how much the reaction of modes has changed since the bounds were made (n_shapes,) [m].

    energy_account: energies [J] since t = 0 that parts got at the plate: FROM_MODES; BY_IMPACTS, the work of the
    contact law, which is negative; and BY_CORRECTION, where they were put back on the surface.
    """

    changed: NDArray[np.complex128]
    energy_account: NDArray[np.float64]


class Scratch(NamedTuple):
    """Few arrays, since every one of them makes each call of a compiled function dearer.

    point: (n,), records POINT. under: (n, n_shapes, 6), see `surface.HEIGHT`; the last row is no point's. Of parts that
    are looked at together they lie one behind the other, as do those of edge and before: see `of_member`. bodies and
    contacts: of one problem. point_of: of every contact, its point; member: of every body, its part. now, then: (4,
    n_shapes), the modal coordinates and three derivatives at two times, see `surface.NOW`. edge: points on the edge of
    the plate. counts: (3,), impacts and forces that were not solved, contacts found late, budgets of looks spent.
    before: (1,), the part as it was after its last look. corners: (n, 3), of a part in steps: some of its own, or
    points on its circles and at the edge [m].
    """

    point: NDArray[np.void]
    under: NDArray[np.float64]
    bodies: Bodies
    contacts: Contacts
    point_of: NDArray[np.int64]
    member: NDArray[np.int64]
    now: NDArray[np.float64]
    then: NDArray[np.float64]
    edge: NDArray[np.void]
    counts: NDArray[np.int64]
    before: NDArray[np.void]
    corners: NDArray[np.float64]
    yielding: Yielding


def new_scratch(kinds: Kinds, n_shapes: int, yielding: int = 0, members: int = 1, contacts: int = 0) -> Scratch:
    """Room for any part: its corners, on the plate and at four walls, and the points on the edge of the plate.

    yielding: number of modes that give way. members: parts that are looked at together, each with rows of its own, and
    the contacts of all.
    """
    of, piece = kinds.record, kinds.piece
    corners, edges = of["corner_to"] - of["corner_from"], of["edge_to"] - of["edge_from"]
    n = int(max((5 * corners).max() + CIRCLES + EDGE_POINTS, (corners + 2 * edges).max()))
    of_piece = int((piece["corner_to"] - piece["corner_from"]).max())  # each may lie on a face of another one
    contacts = max(n, 2 * of_piece, contacts)
    bodies, problem = new_room(max(2, members), contacts, yielding)
    return Scratch(
        point=np.zeros(members * (n + 1), POINT),
        under=np.zeros((members * (n + 1), n_shapes, 6)),
        bodies=bodies,
        contacts=problem,
        point_of=np.zeros(contacts, np.int64),
        member=np.zeros(max(2, members), np.int64),
        now=np.zeros((4, n_shapes)),
        then=np.zeros((4, n_shapes)),
        edge=np.zeros(members * EDGE_POINTS, EDGE_POINT),
        counts=np.zeros(3, np.int64),
        before=np.zeros(members, PART),
        corners=np.zeros((n, 3)),
        yielding=Yielding(np.zeros(yielding, complex), np.zeros(3)),
    )


@inlined
def of_member(k, work):
    """The scratch space of member k of parts that are looked at together, as body 0; contacts are those of all."""
    n, b = work.point.shape[0] // work.before.shape[0], work.bodies
    body = Bodies(b.velocity[k : k + 1], b.spin[k : k + 1], b.inverse_mass[k : k + 1], b.inverse_inertia[k : k + 1])
    return Scratch(
        work.point[k * n : (k + 1) * n],
        work.under[k * n : (k + 1) * n],
        body,
        work.contacts,
        work.point_of,
        work.member,
        work.now,
        work.then,
        work.edge[k * EDGE_POINTS : (k + 1) * EDGE_POINTS],
        work.counts,
        work.before[k : k + 1],
        work.corners,
        work.yielding,
    )
