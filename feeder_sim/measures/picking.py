"""What a robot could pick: parts whose centres keep their distance from all others."""

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
    """Indices of the candidates (n,) whose centres (n, 3) are farther than the clearance [m] from all other ones."""
    index = np.flatnonzero(candidates)
    return index[nearest_neighbours(position[index, :2]) > clearance]
