"""Parts that a robot could pick: those whose centres are far enough from the centres of all others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def nearest_neighbours(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance [m] of every point (n, 2) to the nearest other one, shape (n,); infinite for a single point."""
    from scipy.spatial import cKDTree

    if len(points) < 2:
        return np.full(len(points), np.inf)
    return np.asarray(cKDTree(points).query(points, k=2)[0][:, 1])


def pickable(position: NDArray[np.float64], candidates: NDArray[np.bool_], clearance: float) -> NDArray[np.int64]:
    """Parts that can be picked.

    Args:
        position: centres of all parts, shape (n, 3) [m].
        candidates: which parts count, shape (n,); the others are neither picked nor neighbours.
        clearance: smallest distance to the next candidate in plan view [m].

    Returns:
        Indices of the parts, shape (m,).
    """
    index = np.flatnonzero(candidates)
    return index[nearest_neighbours(position[index, :2]) > clearance]
