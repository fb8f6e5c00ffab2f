"""The hopper that a plate is filled from: which parts come out of it next.

It holds the kinds in the ratio of their counts. A scene has a fixed number of places for parts of each kind, so that
one may come only while one of its kind is not on the plate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from feeder_sim.scene.scene import Scene


def generator(scene: Scene, seed_index: int, cycle: int) -> np.random.Generator:
    """Random numbers of the refill at the end of a cycle: its own, so that none before it have to be remembered."""
    return np.random.default_rng(np.random.SeedSequence(scene.scenario.run.seed, spawn_key=(seed_index, cycle)))


def next_parts(scene: Scene, free: NDArray[np.bool_], number: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices of the parts that come next, in this order, shape (number,) or fewer.

    Args:
        scene: has the kinds.
        free: which parts are not on the plate, shape (parts,).
        number: that are wanted.
        rng: draws the kind of each, in proportion to the counts of the kinds of which a part is free.
    """
    counts = np.bincount(scene.kind_of)
    left = [np.flatnonzero(free & (scene.kind_of == kind)).tolist() for kind in range(len(counts))]
    parts: list[int] = []
    for _ in range(min(number, int(free.sum()))):
        weight = np.where([bool(of_kind) for of_kind in left], counts, 0)
        kind = int(rng.choice(len(counts), p=weight / weight.sum()))
        parts.append(left[kind].pop(0))
    return np.array(parts, np.int64)
