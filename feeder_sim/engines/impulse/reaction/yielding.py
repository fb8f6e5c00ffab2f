"""What gives way where a plate takes the impulses of parts, and what impacts take from it; None where it does not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba.core import types
from numba.extending import overload
from numpy.typing import NDArray

from feeder_sim.engines.impulse.contact_problem import ARM_SECOND, IMPULSE, VELOCITY
from feeder_sim.engines.impulse.surface import HEIGHT, SPEED, TURN_X, TURN_Y
from feeder_sim.engines.impulse.vectors import combine, cross, dot, plus, vector
from feeder_sim.engines.reaction import react
from feeder_sim.machine_code import inlined, uncounted

TAKEN, WORK, LIFTED = range(3)  # of the books


class Yielding(NamedTuple):
    """What gives way: how much the reaction of modes has changed since the bounds were made (n_shapes,) [m].

    books: energies [J] since t = 0 that parts got at the plate: TAKEN from its modes, WORK of the contact law, which is
    negative, and LIFTED where they were put back on the surface.
    """

    changed: NDArray[np.complex128]
    books: NDArray[np.float64]


def gives_way(yielding):
    """Whether the plate gives way."""
    raise NotImplementedError("for compiled code only")


def note_carried(n, i, surface, work, yielding):
    """Write how the surface under corner i, contact n, moves with every mode; work.under is filled for it."""
    raise NotImplementedError("for compiled code only")


def give_to_plate(n, n_corners, before, lifted, surface, t, work, yielding):
    """Give the plate at time t [s] the opposite of the impulses of n contacts, and note what was done.

    before: velocity and spin of the part before them; lifted: energy by being put back on the surface [J].
    """
    raise NotImplementedError("for compiled code only")


def _is_none(yielding):
    return isinstance(yielding, types.NoneType)


@overload(gives_way)
def _gives_way(yielding):
    yields = not _is_none(yielding)
    return lambda yielding: yields


@overload(note_carried)
def _note_carried_by_kind(n, i, surface, work, yielding):
    if _is_none(yielding):
        return lambda n, i, surface, work, yielding: None
    return lambda n, i, surface, work, yielding: _note_carried(work.under[i], surface, work.contacts.modes.carried[n])


@overload(give_to_plate)
def _give_by_kind(n, n_corners, before, lifted, surface, t, work, yielding):
    if _is_none(yielding):
        return lambda n, n_corners, before, lifted, surface, t, work, yielding: None
    return lambda n, n_corners, before, lifted, surface, t, work, yielding: _give(
        n, n_corners, before, lifted, surface, t, work, yielding
    )


@inlined
def _note_carried(under, surface, carried):
    moves = surface.half_thickness * surface.in_plane
    for s in range(carried.shape[0]):
        carried[s, 0], carried[s, 1] = -moves * under[s, TURN_X], -moves * under[s, TURN_Y]
        carried[s, 2] = under[s, HEIGHT]


@uncounted
def _give(n, n_corners, before, lifted, surface, t, work, yielding):
    books, modes, taken = yielding.books, work.contacts.modes, work.contacts.modes.taken
    for s in range(taken.shape[0]):
        books[TAKEN] += (work.now[SPEED, s] - 0.5 * taken[s]) * taken[s] / modes.inverse_mass[s]
    books[WORK] += _work(n, before, work)
    books[LIFTED] += lifted
    react(surface, t, taken, yielding.changed)
    for i in range(n_corners):
        point = work.point[i]
        if point.most_push != 0.0:  # else it is above the crest, and nothing is known under it
            for s in range(taken.shape[0]):
                point.surface_velocity[2] -= work.under[i, s, HEIGHT] * taken[s]


@inlined
def _work(n, before, work):
    """Work of the impulses of n contacts in the frame of the surface [J]: sum of p . (u + u')/2.

    before: velocity and spin of the part before them.
    """
    total, body, modes = 0.0, work.bodies, work.contacts.modes
    for i in range(n):
        arm, push = vector(work.contacts.vector[ARM_SECOND, i]), vector(work.contacts.vector[IMPULSE, i])
        first = plus(before[0], 1.0, cross(before[1], arm))
        last = plus(body.velocity[0], 1.0, cross(body.spin[0], arm))
        mean = plus(combine(0.5, first, 0.5, last, 0.0, last), -1.0, work.contacts.vector[VELOCITY, i])
        for s in range(modes.taken.shape[0]):
            mean = plus(mean, 0.5 * modes.taken[s], modes.carried[i, s])
        total += dot(push, mean)
    return total
