"""`Surface` as compiled code takes it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.outline_arrays import OutlineArrays, outline_arrays
from feeder_sim.plate.surface import Surface
from feeder_sim.scenario import Run


class SurfaceArrays(NamedTuple):
    """Grid, table and terms of a `Surface`, half the thickness, the switches of the scenario, and the outline.

    in_plane: 1 when the surface moves in its plane, else 0; tangent: take it for a plane under the part;
    outline: None on a whole rectangle.
    """

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
    tangent: bool
    outline: OutlineArrays | None


def surface_arrays(surface: Surface, run: Run) -> SurfaceArrays:
    """Collect the arrays of a surface and the switches of a run."""
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
        1.0 if run.in_plane_velocity else 0.0,
        run.tangent_surface,
        outline_arrays(surface.outline),
    )
