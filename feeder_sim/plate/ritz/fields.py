"""Values and slopes of trial functions at points of a plate, and the energies they make there.

With the bending stiffnesses D, the shear stiffness S, the mass mu and the rotary inertia J per area,

    2 U = int D11 bx,x^2 + 2 D12 bx,x by,y + D22 by,y^2 + D66 (bx,y + by,x)^2 + S [(w,x - bx)^2 + (w,y - by)^2] dA
    2 T = omega^2 int mu w^2 + J (bx^2 + by^2) dA
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import PointMass, Section
from feeder_sim.plate.ritz.matrices import Basis, legendre_slopes, orthonormal_legendre

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Fields:
    """Trial functions of w, beta_x and beta_y at points.

    Attributes:
        value: three arrays (points, functions).
        along_x, along_y: their derivatives [1/m].
    """

    value: tuple[Matrix, Matrix, Matrix]
    along_x: tuple[Matrix, Matrix, Matrix]
    along_y: tuple[Matrix, Matrix, Matrix]

    def __getitem__(self, points: NDArray[np.bool_]) -> Fields:
        """The same at some of the points."""
        value, along_x, along_y = (
            (each[0][points], each[1][points], each[2][points]) for each in (self.value, self.along_x, self.along_y)
        )
        return Fields(value, along_x, along_y)

    def combined(self, coefficients: Matrix) -> Fields:
        """Sums of the functions, with coefficients (functions of all three fields, sums)."""
        rows = np.split(coefficients, np.cumsum([each.shape[1] for each in self.value])[:-1])
        value, along_x, along_y = (
            (each[0] @ rows[0], each[1] @ rows[1], each[2] @ rows[2])
            for each in (self.value, self.along_x, self.along_y)
        )
        return Fields(value, along_x, along_y)


def polynomial_fields(plate: RectangularPlate, basis: Basis, points: Matrix) -> Fields:
    """The Legendre products of a basis at points (n, 2) [m]."""
    xi, eta = 2.0 * points[:, 0] / plate.length, 2.0 * points[:, 1] / plate.width
    x, y = orthonormal_legendre(xi, basis.terms), orthonormal_legendre(eta, basis.terms)
    dx = 2.0 / plate.length * legendre_slopes(xi, basis.terms)
    dy = 2.0 / plate.width * legendre_slopes(eta, basis.terms)

    def products(in_x: Matrix, in_y: Matrix) -> tuple[Matrix, Matrix, Matrix]:
        w, beta_x, beta_y = (
            (in_x[:, ix, None] * in_y[:, None, iy]).reshape(len(points), -1) for ix, iy in basis.fields
        )
        return w, beta_x, beta_y

    return Fields(products(x, y), products(dx, y), products(x, dy))


def stiffness_form(a: Fields, b: Fields, areas: Matrix, section: Section) -> Matrix:
    """The strain energy between two sets of functions, (functions of a, functions of b); areas of the points [m^2]."""
    (d11, d12), (_, d22) = section.bending
    d66, s = section.twisting, section.shear
    value, x, y = _weighted(a, areas)
    w_w = s * (x[0] @ b.along_x[0] + y[0] @ b.along_y[0])
    x_x = d11 * (x[1] @ b.along_x[1]) + d66 * (y[1] @ b.along_y[1]) + s * (value[1] @ b.value[1])
    y_y = d22 * (y[2] @ b.along_y[2]) + d66 * (x[2] @ b.along_x[2]) + s * (value[2] @ b.value[2])
    x_y = d12 * (x[1] @ b.along_y[2]) + d66 * (y[1] @ b.along_x[2])
    y_x = d12 * (y[2] @ b.along_x[1]) + d66 * (x[2] @ b.along_y[1])
    w_x, w_y = -s * (x[0] @ b.value[1]), -s * (y[0] @ b.value[2])
    x_w, y_w = -s * (value[1] @ b.along_x[0]), -s * (value[2] @ b.along_y[0])
    return np.block([[w_w, w_x, w_y], [x_w, x_x, x_y], [y_w, y_x, y_y]])


def mass_form(a: Fields, b: Fields, areas: Matrix, section: Section) -> Matrix:
    """The kinetic energy between two sets of functions, as `stiffness_form`."""
    from scipy.linalg import block_diag

    value, _, _ = _weighted(a, areas)
    inertia = (section.mass, section.rotary, section.rotary)
    return np.asarray(block_diag(*(m * (value[field] @ b.value[field]) for field, m in enumerate(inertia))))


def point_mass_form(plate: RectangularPlate, basis: Basis, point: PointMass) -> Matrix:
    """The kinetic energy of a mass fixed to a plate, between the polynomials of a basis."""
    functions = polynomial_fields(plate, basis, np.array([point.centre]))
    section = Section(np.zeros((2, 2)), 0.0, 0.0, point.mass, point.mass * point.offset**2)
    return mass_form(functions, functions, np.ones(1), section)


def over_fields(form: Matrix, axis: int) -> Matrix:
    """A form for functions that have all three fields at once: the sum of its parts for w, beta_x and beta_y."""
    return np.asarray(sum(np.split(form, 3, axis=axis)))


def _weighted(fields: Fields, areas: Matrix) -> tuple[list[Matrix], list[Matrix], list[Matrix]]:
    """Transposed values and slopes times the areas of the points, field by field."""
    each = (fields.value, fields.along_x, fields.along_y)
    value, x, y = ([np.ascontiguousarray((areas[:, None] * f).T) for f in group] for group in each)
    return value, x, y
