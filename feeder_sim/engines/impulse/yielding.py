"""A plate that gives way to the impulses of parts (`run.reaction`): what contacts do to its modes.

None in place of `Yielding` stands for a plate that moves as it is told; then nothing here is compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba.core import types
from numba.extending import overload
from numpy.typing import NDArray

from feeder_sim.engines.impulse.contact_problem import ARM_FIRST, ARM_SECOND, IMPULSE, MOMENT, VELOCITY, Modes
from feeder_sim.engines.impulse.moving_surface import move_surface
from feeder_sim.engines.impulse.state import (
    ACCELERATION,
    CHANGE,
    HEIGHT,
    JERK,
    KNOWN,
    MOVES,
    NOW,
    OTHER,
    PUSH,
    SLOPE_X,
    SLOPE_Y,
    SPEED,
    TURN_X,
    TURN_Y,
    WITH,
)
from feeder_sim.engines.impulse.vectors import add_to, cross, dot, plus, times, vector, write_to
from feeder_sim.engines.reaction import react
from feeder_sim.machine_code import compiled

TAKEN, WORK = range(2)  # of the books


class Yielding(NamedTuple):
    """What gives way, and its books.

    modes: of the plate; extremes: of their shapes, as in `Surface`; margin, changed: (n_shapes,) [m], how far their
    reaction may change before bounds are made anew, and how much it has changed since.

    books: energies [J] since t = 0 that parts got in contacts: TAKEN from the modes, and WORK of the contact law. That
    is negative but for the hops of parts that stay pressed, at whose begin it gives what it takes again at their end.
    """

    modes: Modes
    extremes: NDArray[np.float64]
    margin: NDArray[np.float64]
    changed: NDArray[np.complex128]
    books: NDArray[np.float64]


def yields(yielding):
    """Whether the plate gives way."""
    raise NotImplementedError("for compiled code only")


def modes_of(yielding):
    """Its modes, None of a plate that does not."""
    raise NotImplementedError("for compiled code only")


def find_carried(m, surface, work, yielding):
    """How the surface at the first m contacts moves with every mode."""
    raise NotImplementedError("for compiled code only")


def changes_surface(size, m, n, surface, t, work, yielding):
    """Let the impulses of the first m contacts of a group act on the modes, and the first n rows see it."""
    raise NotImplementedError("for compiled code only")


@overload(yields)
def _yields(yielding):
    if isinstance(yielding, types.NoneType):
        return lambda yielding: False
    return lambda yielding: True


@overload(modes_of)
def _modes_of(yielding):
    if isinstance(yielding, types.NoneType):
        return lambda yielding: None
    return lambda yielding: yielding.modes


@overload(find_carried)
def _find_carried_by_kind(m, surface, work, yielding):
    if isinstance(yielding, types.NoneType):
        return lambda m, surface, work, yielding: None
    return lambda m, surface, work, yielding: _find_carried(m, surface, work, yielding.modes.carried)


@overload(changes_surface)
def _changes_by_kind(size, m, n, surface, t, work, yielding):
    if isinstance(yielding, types.NoneType):
        return lambda size, m, n, surface, t, work, yielding: None
    return lambda size, m, n, surface, t, work, yielding: _change(size, m, n, surface, t, work, yielding)


@compiled
def _find_carried(m, surface, work, carried):
    """A place in space sees the surface rise at w dq/dt: a place of the plate, which moves sideways, rises along."""
    moves = surface.half_thickness * surface.in_plane
    for i in range(m):
        row, under = work.point[work.row_of[i]], work.under[work.row_of[i]]
        if row[OTHER] >= 0.0 or row[MOVES] == 0.0:
            for s in range(carried.shape[1]):
                write_to(carried[i, s], (0.0, 0.0, 0.0))
            continue
        slope_x = slope_y = 0.0
        for s in range(carried.shape[1]):
            slope_x += under[s, SLOPE_X] * work.now[NOW, s]
            slope_y += under[s, SLOPE_Y] * work.now[NOW, s]
        for s in range(carried.shape[1]):
            along_x, along_y = -moves * under[s, TURN_X], -moves * under[s, TURN_Y]
            write_to(carried[i, s], (along_x, along_y, under[s, HEIGHT] + slope_x * along_x + slope_y * along_y))


@compiled
def _change(size, m, n, surface, t, work, yielding):
    """The impulses act on the modes, and contacts and rows see the surface as it moves then; keeps the books."""
    taken, modes, contacts = yielding.modes.taken, yielding.modes, work.contacts
    from_modes = 0.0
    for s in range(taken.shape[0]):
        from_modes += (work.now[SPEED, s] - 0.5 * taken[s]) * taken[s] / modes.inverse_mass[s]
    yielding.books[TAKEN] += from_modes
    yielding.books[WORK] += _gained(size, m, work) - from_modes
    react(surface, t, taken, yielding.changed)
    for i in range(m):
        for s in range(taken.shape[0]):
            add_to(contacts.vector[VELOCITY, i], -taken[s], vector(modes.carried[i, s]))
    move_surface(t, surface, work.then)
    moves = surface.half_thickness * surface.in_plane
    for i in range(n):
        row, under = work.point[i], work.under[i]
        if row[OTHER] >= 0.0 or row[MOVES] == 0.0:
            continue
        slope_x = slope_y = along_x = along_y = 0.0
        for s in range(taken.shape[0]):
            row[WITH + 2] -= under[s, HEIGHT] * taken[s]
            row[PUSH] += under[s, HEIGHT] * (work.then[ACCELERATION, s] - work.now[ACCELERATION, s])
            row[JERK] += under[s, HEIGHT] * (work.then[CHANGE, s] - work.now[CHANGE, s])
            if row[KNOWN] != 0.0:
                slope_x += under[s, SLOPE_X] * work.now[NOW, s]
                slope_y += under[s, SLOPE_Y] * work.now[NOW, s]
                along_x += moves * under[s, TURN_X] * taken[s]
                along_y += moves * under[s, TURN_Y] * taken[s]
        add_to(row[WITH : WITH + 3], 1.0, (along_x, along_y, slope_x * along_x + slope_y * along_y))
    for s in range(taken.shape[0]):
        work.now[SPEED, s] -= taken[s]
        work.now[ACCELERATION, s], work.now[CHANGE, s] = work.then[ACCELERATION, s], work.then[CHANGE, s]


@compiled
def _gained(size, m, work):
    """Kinetic energy [J] that the impulses of m contacts have given the bodies of a group, which move so afterwards."""
    bodies, contacts, gained = work.bodies, work.contacts, 0.0
    for k in range(size):
        impulse, turning = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for i in range(m):
            for side in range(2):
                if contacts.body[i, side] != k:
                    continue
                sign, arm = 2.0 * side - 1.0, vector(contacts.vector[ARM_SECOND if side == 1 else ARM_FIRST, i])
                p = vector(contacts.vector[IMPULSE, i])
                impulse = plus(impulse, sign, p)
                turning = plus(plus(turning, sign, cross(arm, p)), sign, vector(contacts.vector[MOMENT, i]))
        j = bodies.inverse_inertia[k]
        turned = times((j[0], j[1], j[2], j[3], j[4], j[5]), turning)
        gained += dot(impulse, vector(bodies.velocity[k])) - 0.5 * bodies.inverse_mass[k] * dot(impulse, impulse)
        gained += dot(turning, vector(bodies.spin[k])) - 0.5 * dot(turning, turned)
    return gained
