"""Natural modes of a free rectangular Mindlin plate by the Ritz method.

The deflection w and the rotations beta_x, beta_y (beta -> grad w for a thin plate) are expanded in products of
orthonormal Legendre polynomials. With D = E h^3 / 12 (1 - nu^2), shear stiffness S = kappa G h and kappa = 5/6,

    2 U = int D [bx,x^2 + by,y^2 + 2 nu bx,x by,y + (1-nu)/2 (bx,y + by,x)^2] + S [(w,x - bx)^2 + (w,y - by)^2] dA
    2 T = omega^2 int rho h w^2 + rho h^3/12 (bx^2 + by^2) dA

(Mindlin, J. Appl. Mech. 18 (1951) 31; Liew, Xiang and Kitipornchai, Comput. Struct. 49 (1993) 1, for the Ritz form.)
Free edges are natural boundary conditions, so every polynomial is admissible. What is fixed to the plate adds to both
energies (feeder_sim.plate.ritz.attachments, feeder_sim.plate.ritz.local_field). The four parity classes in x and y
decouple; solving them one by one also aligns the degenerate pairs of a square plate with the plate axes. Kirchhoff's
thin plate is the same energy under the constraint beta = grad w, which the polynomials meet exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feeder_sim.plate.outline import Outline
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Attachment, Layer, PointMass, parity_classes
from feeder_sim.plate.ritz.fields import point_mass_form
from feeder_sim.plate.ritz.local_field import LocalField, LocalMesh, joined, local_shapes, meshes_around
from feeder_sim.plate.ritz.matrices import (
    Parity,
    basis_of,
    orthonormal_legendre,
    plate_matrices,
    rigid_count,
    thin_plate_basis,
)
from feeder_sim.single_thread import solver_single_threaded

TERMS_PER_AXIS = 24  # Legendre polynomials
CONVERGENCE_CUT = 4  # terms left out to see whether a mode is resolved
NODE = 1e-6  # of the antinode; a smaller deflection is round-off
RESOLVED_BEYOND = 1.5  # of the highest frequency asked for, up to which a coarse series is looked at
LEAST_OF_PLATE = 1e-6  # of a vector; the rest of it are shapes around layers
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
        local: what layers add to the modes around them. `evaluate` has the polynomials that come nearest to the whole;
            a mode file does not keep it.
        outline: of a plate that is not the whole rectangle, which then is its bounding box; what the coefficients say
            outside means nothing. None for a rectangle.
    """

    plate: RectangularPlate
    natural_frequency: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    parity: NDArray[np.int64]
    modal_mass: NDArray[np.float64]
    local: tuple[LocalField, ...] = ()
    outline: Outline | None = None

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

    def evaluate_whole(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Evaluate all modes with what layers add, at points (n, 2) [m]; returns shape (n_modes, 3, n)."""
        px, py = self._polynomials(points[:, 0], points[:, 1])
        polynomials = self.coefficients - sum(field.nearest for field in self.local)
        smooth = np.einsum("ni,mfij,nj->mfn", px, polynomials, py, optimize=True)
        return np.asarray(smooth + sum(field.evaluate(points) for field in self.local))

    def _polynomials(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        terms = self.coefficients.shape[-1]
        return (
            orthonormal_legendre(2.0 * x / self.plate.length, terms),
            orthonormal_legendre(2.0 * y / self.plate.width, terms),
        )


class Unresolved(ValueError):
    """The series of a plate is too short for the modes that are asked for."""


@solver_single_threaded
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
        Unresolved: a mode asked for is not resolved: its frequency changes by more than `CONVERGED` when the series
            has `CONVERGENCE_CUT` terms less, as happens for many half waves along a slender plate.
    """
    problem = _Problem(plate, theory, tuple(attachments), uniform_width, highest_frequency)
    by_parity = [problem.solve(parity, terms_per_axis) for parity in problem.parities]
    for modes, parity in zip(by_parity, problem.parities, strict=True):
        frequencies = modes.natural_frequency
        coarse = problem.solve(parity, terms_per_axis - CONVERGENCE_CUT).natural_frequency
        requested = frequencies <= highest_frequency
        unresolved = coarse[: len(frequencies)] / frequencies[: len(coarse)] - 1.0 > CONVERGED
        if (requested[: len(unresolved)] & unresolved).any() or requested.sum() > len(unresolved):
            first = int(np.argmax(unresolved)) if unresolved.any() else len(unresolved) - 1
            resolved = frequencies[first]
            raise Unresolved(f"modes above {resolved:.0f} Hz are not resolved by {terms_per_axis} terms per axis")
    return _normalised(_in_order(by_parity, highest_frequency))


@dataclass(frozen=True)
class _Problem:
    """The Ritz eigenproblem of a plate with what is fixed to it; parity by parity."""

    plate: RectangularPlate
    theory: Theory
    attachments: tuple[Attachment, ...]
    uniform_width: bool
    highest_frequency: float

    @property
    def parities(self) -> list[Parity]:
        return [(0, 0), (1, 0)] if self.uniform_width else parity_classes(self.attachments)

    @cached_property
    def meshes(self) -> list[LocalMesh]:
        """Around the layers."""
        return meshes_around(self.plate, [layer for layer in self.attachments if isinstance(layer, Layer)])

    def solve(self, parity: Parity, terms: int) -> PlateModes:
        """The elastic modes of one parity, not normalised."""
        from scipy.linalg import eigh

        plate, thin = self.plate, self.theory == "kirchhoff"
        basis = basis_of(parity, terms, uniform_width=self.uniform_width)
        # Under the constraint beta = grad w the shear energy is zero. Without the term its round-off is absent, too.
        stiffness, diagonal = plate_matrices(plate, 0.0 if thin else plate.shear_stiffness, basis)
        mass = np.diag(diagonal)
        per_area = 4.0 / (plate.length * plate.width)
        layers = [local_shapes(plate, basis, mesh, thin=thin) for mesh in self.meshes]
        for layer in layers:
            stiffness, mass = stiffness + per_area * layer.stiffness, mass + per_area * layer.mass
        for point in self.attachments:
            if isinstance(point, PointMass):
                mass = mass + per_area * point_mass_form(plate, basis, point)
        columns = thin_plate_basis(plate, basis) if thin else np.eye(len(mass))
        stiffness, mass = columns.T @ stiffness @ columns, columns.T @ mass @ columns
        polynomials = len(mass)
        if layers and not thin:
            stiffness, mass = joined(stiffness, layers, "stiffness", per_area), joined(mass, layers, "mass", per_area)
        # Without a parity the matrices are large: only the modes that are asked for are computed.
        highest = (2.0 * np.pi * RESOLVED_BEYOND * self.highest_frequency) ** 2
        chosen = {"subset_by_value": (-np.inf, highest)} if None in parity else {}
        squared, vectors = eigh(stiffness, mass, **chosen)
        # Shapes around layers that have another parity make modes of their own, without polynomials.
        of_plate = np.linalg.norm(vectors[:polynomials], axis=0) > LEAST_OF_PLATE * np.linalg.norm(vectors, axis=0)
        squared, vectors = squared[of_plate][rigid_count(parity) :], vectors[:, of_plate][:, rigid_count(parity) :]
        amounts = np.split(vectors[polynomials:], np.cumsum([layer.coefficients.shape[1] for layer in layers])[:-1])
        local = tuple(layer.field(each, plate, basis) for layer, each in zip(layers, amounts, strict=False))
        return PlateModes(
            plate=plate,
            natural_frequency=np.sqrt(squared) / (2.0 * np.pi),
            coefficients=sum((field.nearest for field in local), basis.unpacked(columns @ vectors[:polynomials])),
            parity=np.tile([-1 if p is None else p for p in parity], (len(squared), 1)),
            modal_mass=(vectors * (mass @ vectors)).sum(axis=0) / per_area,
            local=local,
        )


def _in_order(by_parity: Sequence[PlateModes], highest_frequency: float) -> PlateModes:
    """The modes of all parities up to a frequency [Hz], in order of frequency."""
    rows = [
        (float(f"{modes.natural_frequency[i]:.6g}"), tuple(modes.parity[i].tolist()), k, i)
        for k, modes in enumerate(by_parity)
        for i in np.flatnonzero(modes.natural_frequency <= highest_frequency)
    ]
    # The frequencies of a degenerate pair differ by round-off: sorted by parity, their numbering is reproducible.
    order = [(k, i) for _, _, k, i in sorted(rows)]

    def gathered(name: str) -> NDArray[Any]:
        return np.array([getattr(by_parity[k], name)[i] for k, i in order])

    terms = by_parity[0].coefficients.shape[-1]
    local = []
    for number, first in enumerate(by_parity[0].local):
        fields = [(by_parity[k].local[number], i) for k, i in order]
        coefficients = np.array([field.coefficients[i] for field, i in fields])
        nearest = np.array([field.nearest[i] for field, i in fields])
        local.append(LocalField(first.mesh, coefficients, nearest))
    return PlateModes(
        plate=by_parity[0].plate,
        natural_frequency=gathered("natural_frequency"),
        coefficients=gathered("coefficients").reshape(-1, 3, terms, terms),
        parity=gathered("parity").astype(np.int64).reshape(-1, 2),
        modal_mass=gathered("modal_mass"),
        local=tuple(local),
    )


def _normalised(modes: PlateModes) -> PlateModes:
    """Scale to max |w| = 1, sampled on a grid that includes the corners, and to w > 0 at the corner (+, +).

    A mode with a node in the corner has w > 0 next to it on the side at +length/2.
    """
    x = np.linspace(-0.5, 0.5, 181) * modes.plate.length
    y = np.linspace(-0.5, 0.5, 181) * modes.plate.width
    factor = np.empty(len(modes))
    for index in range(len(modes)):
        w = modes.evaluate_grid(index, x, y)[0]
        largest = np.abs(w).max()
        side = w[-1, ::-1]
        factor[index] = np.sign(side[np.argmax(np.abs(side) > NODE * largest)]) / largest
    return replace(
        modes,
        coefficients=modes.coefficients * factor[:, None, None, None],
        modal_mass=modes.modal_mass * factor**2,
        local=tuple(field.scaled(factor) for field in modes.local),
    )
