"""Natural modes of a free rectangular Mindlin plate by the Ritz method.

The deflection w and the rotations beta_x, beta_y (beta -> grad w for a thin plate) are expanded in products of
orthonormal Legendre polynomials. With D = E h^3 / 12 (1 - nu^2), shear stiffness S = kappa G h and kappa = 5/6,

    2 U = int D [bx,x^2 + by,y^2 + 2 nu bx,x by,y + (1-nu)/2 (bx,y + by,x)^2] + S [(w,x - bx)^2 + (w,y - by)^2] dA
    2 T = omega^2 int rho h w^2 + rho h^3/12 (bx^2 + by^2) dA

(Mindlin, J. Appl. Mech. 18 (1951) 31; Liew, Xiang and Kitipornchai, Comput. Struct. 49 (1993) 1, for the Ritz form.)
Free edges are natural boundary conditions, so every polynomial is admissible. The four parity classes in x and y
decouple; solving them one by one also aligns the degenerate pairs of a square plate with the plate axes. Kirchhoff's
thin plate is the same energy under the constraint beta = grad w, which the polynomials meet exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike, NDArray

from feeder_sim.plate.materials import Material
from feeder_sim.single_thread import single_threaded

SHEAR_FACTOR = 5.0 / 6.0  # kappa
TERMS_PER_AXIS = 24  # Legendre polynomials
CONVERGENCE_CUT = 4  # terms left out to see whether a mode is resolved
NODE = 1e-6  # of the antinode; a smaller deflection is round-off
CONVERGED = 5e-3  # relative change of a resolved natural frequency without these terms
Theory = Literal["mindlin", "kirchhoff"]
Fields = tuple[tuple[NDArray[np.int64], NDArray[np.int64]], ...]  # orders in x and y of w, beta_x, beta_y


@dataclass(frozen=True)
class RectangularPlate:
    """A uniform rectangular plate with free edges, centred on the origin; x along `length`.

    Attributes:
        length, width, thickness: [m].
        material: elastic constants and density.
    """

    length: float
    width: float
    thickness: float
    material: Material

    @property
    def bending_stiffness(self) -> float:
        """D = E h^3 / 12 (1 - nu^2) [N m]."""
        m = self.material
        return m.youngs_modulus * self.thickness**3 / (12.0 * (1.0 - m.poisson_ratio**2))

    @property
    def shear_stiffness(self) -> float:
        """S = kappa G h [N/m]."""
        m = self.material
        return SHEAR_FACTOR * m.youngs_modulus / (2.0 * (1.0 + m.poisson_ratio)) * self.thickness

    @property
    def mass_per_area(self) -> float:
        """Rho h [kg/m^2]."""
        return self.material.density * self.thickness

    @property
    def rotary_inertia(self) -> float:
        """Rho h^3 / 12 [kg]."""
        return self.material.density * self.thickness**3 / 12.0


@dataclass(frozen=True, eq=False)  # compared and hashed by identity, since arrays have no hash
class PlateModes:
    """Elastic modes of a plate, sorted by frequency; mode number 1 is index 0.

    Mode shapes are scaled to max |w| = 1 over the plate and are positive at the corner (+length/2, +width/2), or, with a
    node there, next to it on the side at +length/2.

    Attributes:
        plate: the plate.
        natural_frequency: [Hz], shape (n_modes,).
        coefficients: of orthonormal Legendre products, shape (n_modes, 3, terms, terms): field (w, beta_x [1/m],
            beta_y [1/m]), order in x, order in y.
        parity: shape (n_modes, 2): 0 when w is even, 1 when it is odd, -1 when it is neither, along x and y.
        modal_mass: twice the kinetic energy over the square of the modal velocity [kg], shape (n_modes,).
    """

    plate: RectangularPlate
    natural_frequency: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    parity: NDArray[np.int64]
    modal_mass: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.natural_frequency)

    def evaluate(self, index: int, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Evaluate one mode at points of the plate.

        Args:
            index: 0-based mode index.
            x: coordinates [m], broadcast against `y`.
            y: coordinates [m].

        Returns:
            (w, beta_x, beta_y), shape (3, ...): deflection [1] and rotations [1/m] per unit modal coordinate.
        """
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        px, py = self._polynomials(x.ravel(), y.ravel())
        values = np.einsum("fin,in->fi", px @ self.coefficients[index], py)
        return values.reshape(3, *x.shape)

    def evaluate_grid(self, index: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Evaluate one mode on the product grid of x (nx,) and y (ny,) [m]; returns shape (3, nx, ny)."""
        px, py = self._polynomials(x, y)
        return px @ self.coefficients[index] @ py.T

    def _polynomials(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        terms = self.coefficients.shape[-1]
        return (
            _orthonormal_legendre(2.0 * x / self.plate.length, terms),
            _orthonormal_legendre(2.0 * y / self.plate.width, terms),
        )


@single_threaded
def plate_modes(
    plate: RectangularPlate,
    *,
    highest_frequency: float,
    theory: Theory = "mindlin",
    terms_per_axis: int = TERMS_PER_AXIS,
    uniform_width: bool = False,
) -> PlateModes:
    """Compute every elastic mode up to a frequency.

    Args:
        plate: the plate.
        highest_frequency: [Hz], inclusive.
        theory: "mindlin" (shear and rotary inertia), or "kirchhoff" (no shear), 2 - 3 % too stiff when the wavelength
            falls to 16 thicknesses.
        terms_per_axis: Legendre polynomials per axis and field.
        uniform_width: only modes that do not vary across the width, the bending of a strip (into a cylinder).

    Returns:
        The modes, none if the lowest lies above `highest_frequency`.

    Raises:
        ValueError: a mode asked for is not resolved: its frequency changes by more than `CONVERGED` when the series
            has `CONVERGENCE_CUT` terms less, as happens for many half waves along a slender plate.
    """
    solutions = []
    for parity in ((0, 0), (1, 0)) if uniform_width else ((0, 0), (0, 1), (1, 0), (1, 1)):
        frequencies, coefficients = _solve_parity_class(plate, parity, theory, terms_per_axis, uniform_width)
        coarse, _ = _solve_parity_class(plate, parity, theory, terms_per_axis - CONVERGENCE_CUT, uniform_width)
        wanted = frequencies <= highest_frequency
        unresolved = coarse[: len(frequencies)] / frequencies[: len(coarse)] - 1.0 > CONVERGED
        if (wanted[: len(unresolved)] & unresolved).any() or wanted.sum() > len(unresolved):
            first = int(np.argmax(unresolved)) if unresolved.any() else len(unresolved) - 1
            resolved = frequencies[first]
            raise ValueError(f"modes above {resolved:.0f} Hz are not resolved by {terms_per_axis} terms per axis")
        solutions += [(f, c, parity) for f, c in zip(frequencies[wanted], coefficients[wanted], strict=True)]
    # The frequencies of a degenerate pair differ by round-off: sorted by parity, their numbering is reproducible.
    solutions.sort(key=lambda mode: (float(f"{mode[0]:.6g}"), mode[2]))
    coefficients = np.array([c for _, c, _ in solutions]).reshape(-1, 3, terms_per_axis, terms_per_axis)
    density = np.array([plate.mass_per_area, plate.rotary_inertia, plate.rotary_inertia])
    modes = PlateModes(
        plate=plate,
        natural_frequency=np.array([f for f, _, _ in solutions]),
        coefficients=coefficients,
        parity=np.array([p for _, _, p in solutions], dtype=np.int64).reshape(-1, 2),
        modal_mass=0.25 * plate.length * plate.width * (coefficients**2).sum(axis=(2, 3)) @ density,
    )
    return _normalised(modes)


def _solve_parity_class(
    plate: RectangularPlate, parity: tuple[int, int], theory: Theory, terms: int, uniform_width: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Solve the Ritz eigenproblem for one parity of w; return elastic frequencies [Hz] and coefficients."""
    from scipy.linalg import eigh

    even, odd = np.arange(0, terms, 2), np.arange(1, terms, 2)
    x_w, y_w = (odd if p else even for p in parity)
    x_b, y_b = (even if p else odd for p in parity)  # beta_x ~ w,x swaps the parity in x, beta_y in y
    if uniform_width:
        y_w, y_b = y_w[:1], y_b[:0]
    fields = ((x_w, y_w), (x_b, y_w), (x_w, y_b))
    # Under the constraint beta = grad w the shear energy is zero. Without the term its round-off is absent, too.
    shear_stiffness = plate.shear_stiffness if theory == "mindlin" else 0.0
    stiffness, mass = _ritz_matrices(plate, shear_stiffness, fields, terms)
    basis = np.eye(len(mass)) if theory == "mindlin" else _thin_plate_basis(plate, fields, terms)
    squared, vectors = eigh(basis.T @ stiffness @ basis, basis.T @ (mass[:, None] * basis))
    rigid = _rigid_count(parity)
    squared, vectors = squared[rigid:], (basis @ vectors)[:, rigid:]
    coefficients = np.zeros((len(squared), 3, terms, terms))
    start = 0
    for field, (ix, iy) in enumerate(fields):
        block = vectors[start : start + len(ix) * len(iy)].T.reshape(len(squared), len(ix), len(iy))
        coefficients[:, field, ix[:, None], iy[None, :]] = block
        start += len(ix) * len(iy)
    return np.sqrt(squared) / (2.0 * np.pi), coefficients


def _thin_plate_basis(plate: RectangularPlate, fields: Fields, terms: int) -> NDArray[np.float64]:
    """Columns (w, dw/dx, dw/dy) for each polynomial product of w: they span what satisfies beta = grad w."""
    (x_w, y_w), (x_b, _), (_, y_b) = fields
    _, slope, _ = _legendre_integrals(terms)  # P_j' = sum_i slope[i, j] P_i
    dx = 2.0 / plate.length * np.kron(slope[np.ix_(x_b, x_w)], np.eye(len(y_w)))
    dy = 2.0 / plate.width * np.kron(np.eye(len(x_w)), slope[np.ix_(y_b, y_w)])
    return np.vstack([np.eye(len(x_w) * len(y_w)), dx, dy])


def _rigid_count(parity: tuple[int, int]) -> int:
    """Number of rigid motions in a parity class: heave is even-even, pitch and roll are odd along one axis."""
    return 0 if parity == (1, 1) else 1


def _ritz_matrices(
    plate: RectangularPlate, shear_stiffness: float, fields: Fields, terms: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Assemble the stiffness (n, n) and the diagonal of the mass (n,), both divided by (length/2)(width/2)."""
    d, s, nu = plate.bending_stiffness, shear_stiffness, plate.material.poisson_ratio
    gram, value_slope, slope_slope = _legendre_integrals(terms)
    lx, ly = 2.0 / plate.length, 2.0 / plate.width

    def integral(a: int, b: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        (ax, ay), (bx, by) = fields[a], fields[b]
        return np.asarray(np.kron(x[np.ix_(ax, bx)], y[np.ix_(ay, by)]), dtype=np.float64)

    g, c, k = gram, value_slope, slope_slope  # int PP, int P P', int P' P'
    ww = s * (lx**2 * integral(0, 0, k, g) + ly**2 * integral(0, 0, g, k))
    w_bx = -s * lx * integral(0, 1, c.T, g)
    w_by = -s * ly * integral(0, 2, g, c.T)
    shear = 0.5 * (1.0 - nu) * d
    bx_bx = d * lx**2 * integral(1, 1, k, g) + shear * ly**2 * integral(1, 1, g, k) + s * integral(1, 1, g, g)
    by_by = d * ly**2 * integral(2, 2, g, k) + shear * lx**2 * integral(2, 2, k, g) + s * integral(2, 2, g, g)
    bx_by = lx * ly * (nu * d * integral(1, 2, c.T, c) + shear * integral(1, 2, c, c.T))
    stiffness = np.block([[ww, w_bx, w_by], [w_bx.T, bx_bx, bx_by], [w_by.T, bx_by.T, by_by]])
    sizes = [len(ix) * len(iy) for ix, iy in fields]
    mass = np.repeat([plate.mass_per_area, plate.rotary_inertia, plate.rotary_inertia], sizes)
    return stiffness, mass


def _legendre_integrals(terms: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return int P_i P_j, int P_i P_j' and int P_i' P_j' over [-1, 1] of the orthonormal Legendre polynomials."""
    nodes, weights = legendre.leggauss(terms + 1)
    value = _orthonormal_legendre(nodes, terms)
    scale = np.sqrt(np.arange(terms) + 0.5)
    slope = np.stack([legendre.legval(nodes, legendre.legder(row)) for row in np.diag(scale)], axis=1)
    weighted: NDArray[np.float64] = weights[:, None] * slope
    return np.eye(terms, dtype=np.float64), value.T @ weighted, slope.T @ weighted


def _orthonormal_legendre(xi: NDArray[np.float64], terms: int) -> NDArray[np.float64]:
    """Values of the first orthonormal Legendre polynomials at xi, shape (len(xi), terms)."""
    return np.asarray(legendre.legvander(xi, terms - 1) * np.sqrt(np.arange(terms) + 0.5))


def _normalised(modes: PlateModes) -> PlateModes:
    """Scale to max |w| = 1, sampled on a grid that includes the corners, and to w > 0 at the corner (+, +).

    A mode with a node in the corner has w > 0 next to it on the side at +length/2.
    """
    x = np.linspace(-0.5, 0.5, 181) * modes.plate.length
    y = np.linspace(-0.5, 0.5, 181) * modes.plate.width
    coefficients, modal_mass = modes.coefficients.copy(), modes.modal_mass.copy()
    for index in range(len(modes)):
        w = modes.evaluate_grid(index, x, y)[0]
        largest = np.abs(w).max()
        side = w[-1, ::-1]
        coefficients[index] *= np.sign(side[np.argmax(np.abs(side) > NODE * largest)]) / largest
        modal_mass[index] /= largest**2
    return replace(modes, coefficients=coefficients, modal_mass=modal_mass)
