"""A plate that gives way to the impulses of parts (`run.reaction`): what contacts do to its modes.

None in place of `Yielding` stands for a plate that moves as it is told; then nothing here is compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba.core import types
from numba.extending import overload
from numpy.typing import NDArray

from feeder_sim.engines.impulse.contact_problem import Modes
from feeder_sim.engines.impulse.state import HEIGHT, KNOWN, MOVES, OTHER, SPEED, TURN_X, TURN_Y, WITH
from feeder_sim.engines.reaction import react
from feeder_sim.machine_code import compiled

TAKEN, WORK = range(2)  # of the books


class Yielding(NamedTuple):
    """The modes; how much their reaction has changed since the bounds were made (n_shapes,) [m].

    books: energies [J] since t = 0 that parts got at the plate: TAKEN from its modes, and WORK of the contact law, which
    is negative.
    """

    modes: Modes
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


def changes_surface(parts, m, surface, t, work, yielding):
    """Let the impulses of the first m contacts act on the modes."""
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
def _changes_by_kind(parts, m, surface, t, work, yielding):
    if isinstance(yielding, types.NoneType):
        return lambda parts, m, surface, t, work, yielding: None
    return lambda parts, m, surface, t, work, yielding: _change(parts, m, surface, t, work, yielding)


@compiled
def _find_carried(m, surface, work, carried):
    moves = surface.half_thickness * surface.in_plane
    for i in range(m):
        row, under = work.point[work.row_of[i]], work.under[work.row_of[i]]
        on_plate = row[OTHER] < 0.0 and row[MOVES] > 0.0
        for s in range(carried.shape[1]):
            carried[i, s, 0] = -moves * under[s, TURN_X] if on_plate else 0.0
            carried[i, s, 1] = -moves * under[s, TURN_Y] if on_plate else 0.0
            carried[i, s, 2] = under[s, HEIGHT] if on_plate else 0.0


@compiled
def _change(parts, m, surface, t, work, yielding):
    """The impulses act on the modes, and rows see the surface as it moves then; keeps the books."""
    taken, modes, books = yielding.modes.taken, yielding.modes, yielding.books
    for s in range(taken.shape[0]):
        books[TAKEN] += (work.now[SPEED, s] - 0.5 * taken[s]) * taken[s] / modes.inverse_mass[s]
    react(surface, t, taken, yielding.changed)
    for s in range(taken.shape[0]):
        work.now[SPEED, s] -= taken[s]
    for i in range(work.from_row[work.group.shape[0]]):
        row, under = work.point[i], work.under[i]
        if row[OTHER] >= 0.0 or row[MOVES] == 0.0:
            continue
        for s in range(taken.shape[0]):
            row[WITH + 2] -= under[s, HEIGHT] * taken[s]
            if row[KNOWN] != 0.0:
                moves = surface.half_thickness * surface.in_plane
                row[WITH] += moves * under[s, TURN_X] * taken[s]
                row[WITH + 1] += moves * under[s, TURN_Y] * taken[s]
