"""Tables of an outline -> outline of a plate, in SI units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.outline import Outline, checked_outline
from feeder_sim.scenario import Ring, load_outline_file

SAGITTA = 1e-5  # [m]; how far the corners of a round hole are from the middles between them
FEWEST, MOST = 48, 720  # corners of a round one


def read_outline_file(path: Path) -> Outline:
    """Read the outer edge and the holes of a plate, in the coordinates of the user.

    Raises:
        InputError: unreadable file, a key or value that is not allowed, polygons that are no plate with holes.
    """
    file = load_outline_file(path)
    try:
        return outline_of(file.exterior, file.hole)
    except ValueError as error:
        raise InputError(str(error), file=path) from error


def outline_of(exterior: Ring, holes: Sequence[Ring]) -> Outline:
    """The outline of a plate.

    Raises:
        ValueError: polygons that are no plate with holes.
    """
    return checked_outline([_corners(exterior), *map(_corners, holes)])


def _corners(ring: Ring) -> NDArray[np.float64]:
    """Corners (n, 2) [m]; those of a circle are so far out that the area is that of the circle."""
    if ring.points_mm is not None:
        return 1e-3 * np.array(ring.points_mm, float)
    if ring.size_mm is not None:
        half = 0.5e-3 * np.array(ring.size_mm)
        return 1e-3 * np.array(ring.centre_mm) + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    radius = 0.5e-3 * (ring.diameter_mm or 0.0)
    n = math.ceil(math.pi / math.acos(max(1.0 - SAGITTA / radius, 0.0))) if radius > SAGITTA else FEWEST
    n = min(max(n, FEWEST), MOST)
    angle = 2.0 * math.pi * np.arange(n) / n
    out = radius * math.sqrt(2.0 * math.pi / n / math.sin(2.0 * math.pi / n))
    return 1e-3 * np.array(ring.centre_mm) + out * np.column_stack([np.cos(angle), np.sin(angle)])
