"""`Surface` as compiled code takes it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.surface import Surface


class SurfaceArrays(NamedTuple):
    """Grid, table and terms of a `Surface`, half the thickness, and whether it moves in its plane (1 or 0)."""

    grid_x: NDArray[np.float64]
    grid_y: NDArray[np.float64]
    table: NDArray[np.float64]
    term_shape: NDArray[np.int64]
    term_start: NDArray[np.float64]
    term_stop: NDArray[np.float64]
    coefficient: NDArray[np.complex128]
    rate: NDArray[np.complex128]
    half_thickness: float
    in_plane: float


def surface_arrays(surface: Surface, *, in_plane: bool) -> SurfaceArrays:
    """Collect the arrays of a surface."""
    terms = surface.terms
    return SurfaceArrays(
        surface.x,
        surface.y,
        surface.table,
        terms.shape,
        terms.start,
        terms.stop,
        terms.coefficient,
        terms.rate,
        0.5 * surface.thickness,
        1.0 if in_plane else 0.0,
    )
