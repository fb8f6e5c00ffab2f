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

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feeder_sim.plate.attachments import Attachment, attached_matrices, parity_classes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz import (
    Parity,
    basis_of,
    orthonormal_legendre,
    plate_matrices,
    rigid_count,
    thin_plate_basis,
)
from feeder_sim.single_thread import single_threaded

TERMS_PER_AXIS = 24  # Legendre polynomials
CONVERGENCE_CUT = 4  # terms left out to see whether a mode is resolved
NODE = 1e-6  # of the antinode; a smaller deflection is round-off
RESOLVED_BEYOND = 1.5  # of the highest frequency asked for, up to which a coarse series is looked at
CONVERGED = 5e-3  # relative change of a resolved natural frequency without these terms
Theory = Literal["mindlin", "kirchhoff"]


@dataclass(frozen=True, eq=False)  # compared and hashed by identity, since arrays have no hash
class PlateModes:
    """Elastic modes of a plate, sorted by frequency; mode number 1 is index 0.

    Mode shapes are scaled to max |w| = 1 over the plate. They are positive at the corner (+length/2, +width/2), or,
    with a node there, next to it on the side at +length/2.

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
            orthonormal_legendre(2.0 * x / self.plate.length, terms),
            orthonormal_legendre(2.0 * y / self.plate.width, terms),
        )


@single_threaded
def plate_modes(
    plate: RectangularPlate,
    *,
    highest_frequency: float,
    theory: Theory = "mindlin",
    terms_per_axis: int = TERMS_PER_AXIS,
    uniform_width: bool = False,
    attachments: Sequence[Attachment] = (),
) -> PlateModes:
    """Compute every elastic mode up to a frequency.

    Args:
        plate: the plate.
        highest_frequency: [Hz], inclusive.
        theory: "mindlin" (shear and rotary inertia), or "kirchhoff" (no shear), 2 - 3 % too stiff when the wavelength
            falls to 16 thicknesses.
        terms_per_axis: Legendre polynomials per axis and field.
        uniform_width: only modes that do not vary across the width, the bending of a strip (into a cylinder).
        attachments: what is fixed to the plate. They break the symmetry in x or y unless they have it, too.

    Returns:
        The modes, none if the lowest lies above `highest_frequency`.

    Raises:
        ValueError: a mode asked for is not resolved: its frequency changes by more than `CONVERGED` when the series
            has `CONVERGENCE_CUT` terms less, as happens for many half waves along a slender plate.
    """
    solutions = []
    for parity in ((0, 0), (1, 0)) if uniform_width else parity_classes(attachments):
        solve = partial(_solve_class, plate, parity, theory, attachments, uniform_width, highest_frequency)
        frequencies, coefficients, masses = solve(terms_per_axis)
        coarse, _, _ = solve(terms_per_axis - CONVERGENCE_CUT)
        wanted = frequencies <= highest_frequency
        unresolved = coarse[: len(frequencies)] / frequencies[: len(coarse)] - 1.0 > CONVERGED
        if (wanted[: len(unresolved)] & unresolved).any() or wanted.sum() > len(unresolved):
            first = int(np.argmax(unresolved)) if unresolved.any() else len(unresolved) - 1
            resolved = frequencies[first]
            raise ValueError(f"modes above {resolved:.0f} Hz are not resolved by {terms_per_axis} terms per axis")
        own = tuple(-1 if p is None else p for p in parity)
        rows = zip(frequencies[wanted], coefficients[wanted], masses[wanted], strict=True)
        solutions += [(f, own, c, m) for f, c, m in rows]
    # The frequencies of a degenerate pair differ by round-off: sorted by parity, their numbering is reproducible.
    solutions.sort(key=lambda mode: (float(f"{mode[0]:.6g}"), mode[1]))
    modes = PlateModes(
        plate=plate,
        natural_frequency=np.array([f for f, _, _, _ in solutions]),
        coefficients=np.array([c for _, _, c, _ in solutions]).reshape(-1, 3, terms_per_axis, terms_per_axis),
        parity=np.array([p for _, p, _, _ in solutions], dtype=np.int64).reshape(-1, 2),
        modal_mass=np.array([m for _, _, _, m in solutions]),
    )
    return _normalised(modes)


def _solve_class(
    plate: RectangularPlate,
    parity: Parity,
    theory: Theory,
    attachments: Sequence[Attachment],
    uniform_width: bool,
    highest_frequency: float,
    terms: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Solve the Ritz eigenproblem of one parity; return elastic frequencies [Hz], coefficients, modal masses [kg]."""
    from scipy.linalg import eigh

    basis = basis_of(parity, terms, uniform_width=uniform_width)
    # Under the constraint beta = grad w the shear energy is zero. Without the term its round-off is absent, too.
    shear_stiffness = plate.shear_stiffness if theory == "mindlin" else 0.0
    stiffness, diagonal = plate_matrices(plate, shear_stiffness, basis)
    mass = np.diag(diagonal)
    if attachments:
        added = attached_matrices(plate, attachments, basis, with_shear=theory == "mindlin")
        stiffness, mass = stiffness + added[0], mass + added[1]
    columns = np.eye(len(mass)) if theory == "mindlin" else thin_plate_basis(plate, basis)
    # Without a parity the matrices are large: only the modes that are asked for are computed.
    highest = (2.0 * np.pi * RESOLVED_BEYOND * highest_frequency) ** 2
    chosen = {"subset_by_value": (-np.inf, highest)} if None in parity else {}
    squared, vectors = eigh(columns.T @ stiffness @ columns, columns.T @ mass @ columns, **chosen)
    rigid = rigid_count(parity)
    squared, vectors = squared[rigid:], (columns @ vectors)[:, rigid:]
    masses = 0.25 * plate.length * plate.width * (vectors * (mass @ vectors)).sum(axis=0)
    return np.sqrt(squared) / (2.0 * np.pi), basis.unpacked(vectors), masses


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
