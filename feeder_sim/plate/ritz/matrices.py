"""Mass and stiffness matrices of a rectangular plate in products of orthonormal Legendre polynomials.

Fields are the deflection w and the rotations beta_x, beta_y. Matrices are divided by (length/2) (width/2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from feeder_sim.plate.rectangle import RectangularPlate

Parity = tuple[int | None, int | None]  # of w along x and y: 0 even, 1 odd, None both
RIGID_MOTIONS = ((0, 0), (1, 0), (0, 1))  # parity of heave, pitch and roll


@dataclass(frozen=True)
class Basis:
    """The products of polynomials that stand for each field.

    Attributes:
        terms: polynomials per axis.
        fields: orders in x and orders in y of w, beta_x and beta_y; every pair of them is a product.
    """

    terms: int
    fields: tuple[tuple[NDArray[np.int64], NDArray[np.int64]], ...]

    @property
    def sizes(self) -> list[int]:
        """Number of products of each field."""
        return [len(ix) * len(iy) for ix, iy in self.fields]

    def unpacked(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coefficients (n, 3, terms, terms) of n vectors (sum of sizes, n)."""
        n = vectors.shape[1]
        coefficients = np.zeros((n, 3, self.terms, self.terms))
        start = 0
        for field, (ix, iy) in enumerate(self.fields):
            block = vectors[start : start + len(ix) * len(iy)].T.reshape(n, len(ix), len(iy))
            coefficients[:, field, ix[:, None], iy[None, :]] = block
            start += len(ix) * len(iy)
        return coefficients


def basis_of(parity: Parity, terms: int, *, uniform_width: bool = False) -> Basis:
    """The basis of all shapes of one parity; with `uniform_width`, of those that do not vary along y."""
    degrees, even, odd = np.arange(terms), np.arange(0, terms, 2), np.arange(1, terms, 2)
    (x_w, x_b), (y_w, y_b) = ((degrees, degrees) if p is None else (odd, even) if p else (even, odd) for p in parity)
    if uniform_width:
        y_w, y_b = y_w[:1], y_b[:0]
    return Basis(terms, ((x_w, y_w), (x_b, y_w), (x_w, y_b)))  # beta_x ~ w,x swaps the parity in x, beta_y in y


def rigid_count(parity: Parity) -> int:
    """Number of rigid motions of a parity."""
    return sum(all(p in (None, q) for p, q in zip(parity, motion, strict=True)) for motion in RIGID_MOTIONS)


def plate_matrices(
    plate: RectangularPlate, shear_stiffness: float, basis: Basis
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Assemble the stiffness (n, n) and the diagonal of the mass (n,) of the bare plate."""
    (d11, d12, d22, d66), s = plate.bending_stiffnesses, shear_stiffness
    fields = basis.fields
    gram, value_slope, slope_slope = _legendre_integrals(basis.terms)
    lx, ly = 2.0 / plate.length, 2.0 / plate.width

    def integral(a: int, b: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        (ax, ay), (bx, by) = fields[a], fields[b]
        return np.asarray(np.kron(x[np.ix_(ax, bx)], y[np.ix_(ay, by)]), dtype=np.float64)

    g, c, k = gram, value_slope, slope_slope  # int PP, int P P', int P' P'
    ww = s * (lx**2 * integral(0, 0, k, g) + ly**2 * integral(0, 0, g, k))
    w_bx = -s * lx * integral(0, 1, c.T, g)
    w_by = -s * ly * integral(0, 2, g, c.T)
    bx_bx = d11 * lx**2 * integral(1, 1, k, g) + d66 * ly**2 * integral(1, 1, g, k) + s * integral(1, 1, g, g)
    by_by = d22 * ly**2 * integral(2, 2, g, k) + d66 * lx**2 * integral(2, 2, k, g) + s * integral(2, 2, g, g)
    bx_by = lx * ly * (d12 * integral(1, 2, c.T, c) + d66 * integral(1, 2, c, c.T))
    stiffness = np.block([[ww, w_bx, w_by], [w_bx.T, bx_bx, bx_by], [w_by.T, bx_by.T, by_by]])
    mass = np.repeat([plate.mass_per_area, plate.rotary_inertia, plate.rotary_inertia], basis.sizes)
    return stiffness, mass


def thin_plate_basis(plate: RectangularPlate, basis: Basis) -> NDArray[np.float64]:
    """Columns (w, dw/dx, dw/dy) for each polynomial product of w: they span what satisfies beta = grad w."""
    (x_w, y_w), (x_b, _), (_, y_b) = basis.fields
    _, slope, _ = _legendre_integrals(basis.terms)  # P_j' = sum_i slope[i, j] P_i
    dx = 2.0 / plate.length * np.kron(slope[np.ix_(x_b, x_w)], np.eye(len(y_w)))
    dy = 2.0 / plate.width * np.kron(np.eye(len(x_w)), slope[np.ix_(y_b, y_w)])
    return np.vstack([np.eye(len(x_w) * len(y_w)), dx, dy])


def _legendre_integrals(terms: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return int P_i P_j, int P_i P_j' and int P_i' P_j' over [-1, 1] of the orthonormal Legendre polynomials."""
    nodes, weights = legendre.leggauss(terms + 1)
    value, slope = orthonormal_legendre(nodes, terms), legendre_slopes(nodes, terms)
    weighted: NDArray[np.float64] = weights[:, None] * slope
    return np.eye(terms, dtype=np.float64), value.T @ weighted, slope.T @ weighted


def orthonormal_legendre(xi: NDArray[np.float64], terms: int) -> NDArray[np.float64]:
    """Values of the first orthonormal Legendre polynomials at xi, shape (len(xi), terms)."""
    return np.asarray(legendre.legvander(xi, terms - 1) * np.sqrt(np.arange(terms) + 0.5))


def legendre_slopes(xi: NDArray[np.float64], terms: int) -> NDArray[np.float64]:
    """Derivatives of the first orthonormal Legendre polynomials at xi, shape (len(xi), terms)."""
    scale = np.sqrt(np.arange(terms) + 0.5)
    return np.stack([legendre.legval(xi, legendre.legder(row)) for row in np.diag(scale)], axis=1)
