"""Room for parts that are looked at together, and what a thread needs for them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.free_part.notes import Notes
from feeder_sim.engines.impulse.pairs.hulls import Hulls
from feeder_sim.engines.impulse.pairs.separating_axis import Meeting
from feeder_sim.engines.impulse.scratch import Scratch, new_scratch
from feeder_sim.engines.impulse.state import Kinds

PAIRS_PER_PART, CONTACTS_PER_PART = 32, 64  # that a component has room for


class Together(NamedTuple):
    """The component that is looked at.

    work: scratch space of all its members; work.member says which parts they are. body: of every part, its number
    among them, or -1. number: of every member, its points, and how long its bounces are summed [s]: chatter; loads:
    where its contacts begin, whether it has a load on the plate, `borne`, and whether another part hits it, `squeezed`.
    pair: places in `Islands.pair` of the pairs that press; first_point: of each, its first row in point (n, 3), from
    the centre of its first part [m]; gap [m] of each, and the origin of its axis with two edges, `along` (pairs, 2, 3):
    see `separating_axis`.
    """

    work: Scratch
    body: NDArray[np.int64]
    number: NDArray[np.int64]
    chatter: NDArray[np.float64]
    first_contact: NDArray[np.int64]
    borne: NDArray[np.bool_]
    squeezed: NDArray[np.bool_]
    pair: NDArray[np.int64]
    first_point: NDArray[np.int64]
    point: NDArray[np.float64]
    gap: NDArray[np.float64]
    origin: NDArray[np.int64]
    along: NDArray[np.float64]


class Tools(NamedTuple):
    """What belongs to one thread; seen: room for a part."""

    hulls: Hulls
    work: Scratch
    meeting: Meeting
    together: Together
    notes: Notes
    seen: NDArray[np.void]


def new_together(kinds: Kinds, parts: int, n_shapes: int) -> Together:
    """Room for a component of all parts."""
    of_piece = int((kinds.piece["corner_to"] - kinds.piece["corner_from"]).max())
    pairs, contacts = PAIRS_PER_PART * parts, CONTACTS_PER_PART * parts
    return Together(
        work=new_scratch(kinds, n_shapes, members=parts, contacts=contacts),
        body=np.full(parts, -1),
        number=np.zeros(parts, np.int64),
        chatter=np.zeros(parts),
        first_contact=np.zeros(parts + 1, np.int64),
        borne=np.zeros(parts, np.bool_),
        squeezed=np.zeros(parts, np.bool_),
        pair=np.zeros(pairs, np.int64),
        first_point=np.zeros(pairs + 1, np.int64),
        point=np.zeros((2 * of_piece * pairs, 3)),
        gap=np.zeros(pairs),
        origin=np.zeros(pairs, np.int64),
        along=np.zeros((pairs, 2, 3)),
    )
