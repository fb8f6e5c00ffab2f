"""The Ritz modes of a free plate against finite elements assembled by scikit-fem.

Free edges are natural boundary conditions of both weak forms. Thin plate, on the C1 element of Argyris:

    int D [(1-nu) w,ij v,ij + nu lap w lap v] dA = omega^2 int rho h w v + rho h^3/12 grad w . grad v dA

Mindlin plate, on quartic triangles for w and the rotation b, fully integrated; e is the symmetric gradient:

    int D [(1-nu) e(b):e(c) + nu div b div c] + S (grad w - b).(grad v - c) dA
        = omega^2 int rho h w v + rho h^3/12 b.c dA

(Argyris, Fried and Scharpf, Aeronaut. J. 72 (1968) 701; Mindlin, J. Appl. Mech. 18 (1951) 31; Gustafsson and McBain,
J. Open Source Softw. 5 (2020) 2369.) Along a free edge the rotations of a Mindlin plate change within about one
thickness. Strips of elements that wide resolve it; without them the frequencies come out up to 8e-4 too high.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import eigsh
from skfem import Basis, BilinearForm, ElementTriArgyris, ElementTriP4, ElementVector, MeshTri
from skfem.helpers import dd, ddot, div, dot, grad, sym_grad, trace

from feeder_sim.plate.materials import Material
from feeder_sim.plate.modes import plate_modes
from feeder_sim.plate.rectangle import RectangularPlate

# The elastic constants are written out here, so that those of RectangularPlate are verified too.
E, NU, RHO, H = 71.0e9, 0.33, 2770.0, 0.003
D = E * H**3 / (12.0 * (1.0 - NU**2))
S = 5.0 / 6.0 * E / (2.0 * (1.0 + NU)) * H

ALUMINIUM = Material(density=RHO, youngs_modulus=E, poisson_ratio=NU)
RECTANGLE = RectangularPlate(length=0.160, width=0.120, thickness=H, material=ALUMINIUM)
SQUARE = RectangularPlate(length=0.180, width=0.180, thickness=H, material=ALUMINIUM)
HIGHEST_FREQUENCY = 6000.0  # Hz, above every mode that is compared


@BilinearForm
def kirchhoff_stiffness(w: Any, v: Any, _: Any) -> Any:
    return D * ((1.0 - NU) * ddot(dd(w), dd(v)) + NU * trace(dd(w)) * trace(dd(v)))


@BilinearForm
def kirchhoff_mass(w: Any, v: Any, _: Any) -> Any:
    return RHO * H * w * v + RHO * H**3 / 12.0 * dot(grad(w), grad(v))


@BilinearForm
def mindlin_stiffness(w: Any, b: Any, v: Any, c: Any, _: Any) -> Any:
    bending = D * ((1.0 - NU) * ddot(sym_grad(b), sym_grad(c)) + NU * div(b) * div(c))
    return bending + S * dot(grad(w) - b, grad(v) - c)


@BilinearForm
def mindlin_mass(w: Any, b: Any, v: Any, c: Any, _: Any) -> Any:
    return RHO * H * w * v + RHO * H**3 / 12.0 * dot(b, c)


def uniform_axis(length: float, elements: int) -> NDArray[np.float64]:
    return np.linspace(-0.5 * length, 0.5 * length, elements + 1)


def axis_with_edge_strips(length: float, elements: int) -> NDArray[np.float64]:
    """Equal elements between two strips one thickness wide."""
    return np.r_[-0.5 * length, uniform_axis(length - 2.0 * H, elements), 0.5 * length]


def mindlin_basis(plate: RectangularPlate) -> Basis:
    mesh = MeshTri.init_tensor(axis_with_edge_strips(plate.length, 12), axis_with_edge_strips(plate.width, 12))
    return Basis(mesh, ElementTriP4() * ElementVector(ElementTriP4()))


def elastic_modes(
    stiffness: csr_matrix, mass: csr_matrix, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies [Hz] (count,) and vectors (dofs, count) of the lowest modes above the three rigid ones."""
    start = np.random.default_rng(0).standard_normal(stiffness.shape[0])
    squared, vectors = eigsh(stiffness, k=3 + count, M=mass, sigma=-1e5, v0=start)  # rad^2/s^2, below the rigid modes
    order = np.argsort(squared)
    rigid, elastic = order[:3], order[3:]
    assert np.abs(squared[rigid]).max() < 1e-6 * squared[elastic].min()
    return np.sqrt(squared[elastic]) / (2.0 * np.pi), vectors[:, elastic]


def test_kirchhoff_frequencies() -> None:
    mesh = MeshTri.init_tensor(uniform_axis(RECTANGLE.length, 12), uniform_axis(RECTANGLE.width, 9))
    basis = Basis(mesh, ElementTriArgyris())
    expected, _ = elastic_modes(kirchhoff_stiffness.assemble(basis), kirchhoff_mass.assemble(basis), count=10)
    ritz = plate_modes(RECTANGLE, highest_frequency=HIGHEST_FREQUENCY, theory="kirchhoff")
    # They agree to 6e-7, the discretisation error of this mesh (4e-6 with elements of 1.5 times the size).
    np.testing.assert_allclose(ritz.natural_frequency[:10], expected, rtol=2e-6)


@pytest.mark.parametrize(
    "plate", [pytest.param(RECTANGLE, id="rectangle"), pytest.param(SQUARE, id="square", marks=pytest.mark.slow)]
)
def test_mindlin_frequencies(plate: RectangularPlate) -> None:
    basis = mindlin_basis(plate)
    expected, _ = elastic_modes(mindlin_stiffness.assemble(basis), mindlin_mass.assemble(basis), count=15)
    ritz = plate_modes(plate, highest_frequency=HIGHEST_FREQUENCY)
    # They agree to 1.7e-5 (rectangle) and 5.1e-5 (square), the finite elements being the lower: 24 Legendre terms
    # resolve the edge layer no better. With 32 terms they agree to 4e-6.
    np.testing.assert_allclose(ritz.natural_frequency[:15], expected, rtol=1e-4)


@pytest.mark.slow
def test_mindlin_mode_shapes() -> None:
    basis = mindlin_basis(RECTANGLE)
    _, vectors = elastic_modes(mindlin_stiffness.assemble(basis), mindlin_mass.assemble(basis), count=10)
    ritz = plate_modes(RECTANGLE, highest_frequency=HIGHEST_FREQUENCY)
    x, y = basis.mesh.p
    corner = np.argmax(x + y)
    for index in range(10):  # well separated: the 11th frequency is 0.9 % above the 10th
        w, *beta = ritz.evaluate(index, x, y)
        expected_w, *expected_beta = vectors[basis.nodal_dofs, index]  # at the vertices, like x and y
        scale = w[corner] / expected_w[corner]
        # They agree to 4e-5 of the largest deflection and 3.4e-4 of the largest rotation.
        np.testing.assert_allclose(w, scale * expected_w, rtol=0.0, atol=1e-4 * np.abs(w).max())
        atol = 1e-3 * np.abs(beta).max()
        np.testing.assert_allclose(beta, scale * np.array(expected_beta), rtol=0.0, atol=atol)
