"""The column that a heap is poured from: layers in hexagonal packing, one part size apart."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.scenario import Heap

APART = 1e-4  # [m]; smallest distance between the bounding spheres of two parts at the start
WIDEST_HEAP = 500  # parts side by side


def check_width(start: Heap, size: float, *, key: str) -> None:
    """Refuse a heap that is absurdly wide for parts of a size [m]; `key` names its start in the message.

    Raises:
        InputError: it is.
    """
    widest = 2e3 * WIDEST_HEAP * size
    if start.diameter_mm > widest:
        raise InputError(
            f"is {start.diameter_mm:g}, allowed is up to {WIDEST_HEAP} times the size of a part, {widest:.4g}",
            key=f"{key}.diameter_mm",
        )


def column(start: Heap, size: float, count: int, *, key: str) -> NDArray[np.float64]:
    """Centres (count, 3) [m] of bounding spheres of a radius [m], the lowest layer that much above z = 0.

    Raises:
        InputError: as `check_width`.
    """
    check_width(start, size, key=key)
    pitch = 2.0 * (size + APART)
    reach = max(0.0, 0.5e-3 * start.diameter_mm - size)
    n = math.ceil(reach / pitch) + 1
    a, b = np.meshgrid(np.arange(-2 * n, 2 * n + 1), np.arange(-2 * n, 2 * n + 1))
    grid = pitch * np.column_stack([(a + 0.5 * b).ravel(), (0.5 * math.sqrt(3.0) * b).ravel()])
    layer = grid[np.hypot(*grid.T) <= reach + 1e-9]
    index = np.arange(count)
    height = size + pitch * (index // len(layer))
    centres = np.column_stack([layer[index % len(layer)], height])
    centres[:, :2] += 1e-3 * np.array(start.centre_mm)
    return centres
