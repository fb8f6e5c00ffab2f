"""Random numbers inside compiled loops: a stream is one integer, so that it is saved and goes on bit by bit.

SplitMix64 (Steele, Lea and Flood, OOPSLA 2014), made normal by the formula of Box and Muller.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from feeder_sim.machine_code import inlined

STEP, FIRST, SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
SHIFTS = np.uint64(30), np.uint64(27), np.uint64(31)
UNUSED = np.uint64(11)  # bits that a float has no room for


def new_streams(rng: np.random.Generator, n: int) -> NDArray[np.uint64]:
    """The states (n,) of n streams that a generator begins."""
    return rng.integers(2**64, size=n, dtype=np.uint64)


@inlined
def _uniform(state):
    """The next number in (0, 1), and the state after it."""
    state = state + STEP
    z = state
    z = (z ^ (z >> SHIFTS[0])) * FIRST
    z = (z ^ (z >> SHIFTS[1])) * SECOND
    return (float((z ^ (z >> SHIFTS[2])) >> UNUSED) + 0.5) * 2.0**-53, state


@inlined
def half_normal(state):
    """The next size of a standard normal number, and the state of the stream after it."""
    one, state = _uniform(state)
    other, state = _uniform(state)
    return math.sqrt(-2.0 * math.log(one)) * abs(math.cos(2.0 * math.pi * other)), state
