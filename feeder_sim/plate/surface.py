"""The moving top surface: mode shapes on a grid and modal coordinates in time, as arrays that compiled code can take.

With deflection w, rotations beta and modal coordinates q, a point of the top surface (half thickness h/2 above the
mid-plane) moves by

    u = sum_j (-h/2 beta_x, -h/2 beta_y, w)_j q_j(t),    velocity the same with q_j'.

The horizontal part makes parts drift from antinode to node. Shapes are tabulated and interpolated with cubic
Lagrange polynomials: with 80 grid points per wavelength the error of the deflection is 1e-6 of the antinode amplitude.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.drive import ModalTerms
from feeder_sim.plate.mode_shapes import ModeShape
from feeder_sim.plate.outline import Outline
from feeder_sim.single_thread import single_threaded

POINTS_PER_WAVELENGTH = 80
TOGETHER = 20_000  # points whose height is computed at once
MAX_GRID_POINTS = 20_000_000  # of all shapes together; half a gigabyte


@dataclass(frozen=True)
class Surface:
    """Top surface of a moving plate, centred on the origin.

    Attributes:
        length, width, thickness: [m]; x runs along the length.
        x, y: uniform grids [m], shapes (nx,) and (ny,).
        table: (w [1], beta_x [1/m], beta_y [1/m]) of each shape, shape (n_shapes, 3, nx, ny).
        terms: the modal coordinates in time.
        outline: of a plate that is not the whole rectangle; beyond it there is nothing, whatever the table says.
        resting: terms of `terms` that act at all times, as the incline of a tray; None without any.
    """

    length: float
    width: float
    thickness: float
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    table: NDArray[np.float64]
    terms: ModalTerms
    outline: Outline | None = None
    resting: ModalTerms | None = None

    @property
    def n_shapes(self) -> int:
        return len(self.table)

    @cached_property
    def extremes(self) -> NDArray[np.float64]:
        """Largest deflection [1], slope [1/m] and curvature [1/m^2] of every shape, shape (3, n_shapes)."""
        along_x, along_y = np.gradient(self.table[:, 0], self.x, self.y, axis=(1, 2))
        bent_x, twisted = np.gradient(along_x, self.x, self.y, axis=(1, 2))
        bent = np.hypot(np.hypot(bent_x, np.gradient(along_y, self.y, axis=2)), np.sqrt(2.0) * twisted)
        values = np.stack([np.abs(self.table[:, 0]), np.hypot(along_x, along_y), bent])
        if self.outline is not None:
            values = np.where(self._near_plate(self.outline), values, 0.0)
        return np.asarray(values.max(axis=(2, 3)))

    def moved_by(self, terms: ModalTerms) -> Surface:
        """The same surface, which moves in another way."""
        other = replace(self, terms=terms if self.resting is None else terms.joined(self.resting))
        if "extremes" in self.__dict__:  # which take longer than many a stage
            other.__dict__["extremes"] = self.extremes
        return other

    def _near_plate(self, outline: Outline) -> NDArray[np.bool_]:
        """Grid points (nx, ny) that the surface of the plate is interpolated from."""
        spacing = max(self.x[1] - self.x[0], self.y[1] - self.y[0])
        return outline.distance(np.stack(np.meshgrid(self.x, self.y, indexing="ij"), axis=-1)) > -3.0 * spacing

    def displacement(self, points: NDArray[np.float64], t: float) -> NDArray[np.float64]:
        """Displacement [m] of surface points (n, 2) [m] at time t [s], shape (n, 3)."""
        return self._combined(points, self.terms.phasor(t, self.n_shapes)[0].real)

    def velocity(self, points: NDArray[np.float64], t: float) -> NDArray[np.float64]:
        """Velocity [m/s] of surface points (n, 2) [m] at time t [s], shape (n, 3)."""
        terms = self.terms
        rates = ModalTerms(terms.shape, terms.start, terms.stop, terms.coefficient * terms.rate, terms.rate)
        return self._combined(points, rates.phasor(t, self.n_shapes)[0].real)

    def resting_height(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height [m] of surface points (n, 2) [m] of a plate that nothing drives, shape (n,)."""
        if self.resting is None:
            return np.zeros(len(points))
        return self._combined(points, self.resting.phasor(0.0, self.n_shapes)[0].real)[:, 2]

    def heights(self, points: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height [m] of surface points (n, 2) [m], each at its own time (n,) [s], shape (n,)."""
        height = np.empty(len(points))
        for some in np.array_split(np.arange(len(points)), 1 + len(points) // TOGETHER):
            moments, number = np.unique(times[some], return_inverse=True)
            q = self.terms.phasor(moments, self.n_shapes).real[number]
            height[some] = np.einsum("sp,ps->p", self.deflections(points[some]), q)
        return height

    @cached_property
    def trough(self) -> float:
        """How far below z = 0 the surface may be at any time and place, at most [m]."""
        terms = self.terms
        of_shape = np.abs(terms.coefficient)[:, None] * (terms.shape[:, None] == np.arange(self.n_shapes))
        size = of_shape @ self.extremes[0]
        begins = np.unique(terms.start)  # which terms act changes for more only at a start
        return max((float(size[(terms.start <= t) & (t < terms.stop)].sum()) for t in begins), default=0.0)

    def deflection(self, shape: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Deflection w [1] of one mode shape at points (n, 2) [m], shape (n,)."""
        return self.deflections(points)[shape]

    def deflections(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Deflection w [1] of all mode shapes at points (n, 2) [m], shape (n_shapes, n)."""
        return self.modes_at(points)[..., 0]

    def _combined(self, points: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Displacement (n, 3) for modal coordinates q (n_shapes,) [m], or velocity for their rates [m/s]."""
        w, bx, by = np.moveaxis(np.einsum("spc,s->pc", self.modes_at(points), q), -1, 0)
        half = 0.5 * self.thickness
        return np.stack([-half * bx, -half * by, w], axis=1)

    def modes_at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(w [1], beta_x, beta_y [1/m]) of all mode shapes at points (n, 2) [m], shape (n_shapes, n, 3)."""
        ix, weight_x = lagrange_weights(points[:, 0], self.x)
        iy, weight_y = lagrange_weights(points[:, 1], self.y)
        steps = np.arange(4)
        patch = self.table[:, :, (ix[:, None] + steps)[:, :, None], (iy[:, None] + steps)[:, None, :]]
        return np.einsum("scpab,pa,pb->spc", patch, weight_x, weight_y)


@single_threaded
def tabulate(
    shapes: Sequence[ModeShape],
    terms: ModalTerms,
    *,
    length: float,
    width: float,
    thickness: float,
    wavelength: float = math.inf,
    per_wavelength: int = POINTS_PER_WAVELENGTH,
    uniform_y: bool = False,
) -> Surface:
    """Sample mode shapes on a grid fine enough for the shortest wavelength [m].

    Args:
        shapes: one per modal coordinate of `terms`.
        terms: the modal coordinates.
        length: of the plate, along x [m].
        width: of the plate, along y [m].
        thickness: of the plate [m].
        wavelength: the shortest bending wavelength among the shapes [m].
        per_wavelength: grid points in one.
        uniform_y: the shapes do not depend on y, so that four grid lines in y are enough.

    Raises:
        InputError: the plate is too large for its wavelength to be tabulated.
    """
    spacing = wavelength / per_wavelength
    if len(shapes) * (length / spacing + 4.0) * (4.0 if uniform_y else width / spacing + 4.0) > MAX_GRID_POINTS:
        raise InputError(
            f"of {1e3 * length:g} x {1e3 * width:g} mm is too large for waves of {1e3 * wavelength:g} mm, must be "
            f"{MAX_GRID_POINTS} grid points at {per_wavelength} per wavelength",
            key="plate",
        )
    x = np.linspace(-0.5 * length, 0.5 * length, max(4, 1 + math.ceil(length / spacing)))
    y = np.linspace(-0.5 * width, 0.5 * width, 4 if uniform_y else max(4, 1 + math.ceil(width / spacing)))
    table = np.stack([shape.evaluate_grid(x, y) for shape in shapes])
    return Surface(length, width, thickness, x, y, np.ascontiguousarray(table), terms)


def lagrange_weights(
    position: NDArray[np.float64], grid: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Cubic Lagrange interpolation on a uniform grid (m,) [m].

    Returns:
        Index of the first of four grid points for each position (n,) [m], and the weights of the four (n, 4) [1].
        A position outside the grid is moved to its end.
    """
    spacing = grid[1] - grid[0]
    u = np.clip((position - grid[0]) / spacing, 0.0, len(grid) - 1.0)
    first = np.clip(u.astype(np.int64) - 1, 0, len(grid) - 4)
    s = u - first
    a, b, c, d = s, s - 1.0, s - 2.0, s - 3.0
    return first, np.stack([-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0], axis=1)
