"""The bond and the stiffness of a piezo patch, against finite elements of plate, glue and patch."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse.linalg import splu
from skfem import (
    Basis,
    BilinearForm,
    ElementHex0,
    ElementHexS2,
    ElementTriP0,
    ElementTriP3,
    ElementVector,
    FacetBasis,
    Functional,
    LinearForm,
    MeshHex,
    MeshTri,
    condense,
    solve,
)
from skfem.helpers import ddot, div, sym_grad, trace
from test_piezo_patches import patched_stiffness

from feeder_sim.plate.actuators import bond_share, moment_of_strain, share_of_curvature
from feeder_sim.plate.materials import MATERIALS, Material
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Layer, added_section, bare_section

ALUMINIUM = MATERIALS["aluminium"]
CERAMIC = Material(7700.0, 1.0 / 13e-12, 0.31)
GLUE = 1e9  # shear modulus [Pa]
FAR = 0.03  # half of the plate [m]
THICK = 0.003
PATCH = Layer((0.0, 0.0), (0.01, 0.01), 0.0, 0.002, -1, CERAMIC)


def dense_to(start: float, end: float, count: int, at: float) -> NDArray[np.float64]:
    """Ends of elements between two places, denser toward one of them."""
    share = np.linspace(0.0, 1.0, count + 1)
    return np.asarray(start + (end - start) * (1.0 - (1.0 - share) ** 2.2 if at == end else share**2.2))


def plane(layer: Layer, inside: int, outside: int) -> list[NDArray[np.float64]]:
    """Ends of elements along x and y of a quarter of the plate."""
    halves = [0.5 * side for side in layer.size]
    return [np.unique(np.r_[dense_to(0.0, a, inside, a), dense_to(a, FAR, outside, a)]) for a in halves]


def solid_work(layer: Layer, glue: float) -> float:
    """Work [J/1] of the stretch by 1 of a patch on its stresses, under a moment of 1 N on all edges of the plate.

    By reciprocity that is what the patch does with the plate. A quarter, solid elements of second degree; layer above.
    """
    x, y = plane(layer, 8, 6)
    top = 0.5 * THICK
    z = np.r_[dense_to(-top, top, 5, top), dense_to(top + glue, top + glue + layer.thickness, 5, top + glue)]
    mesh = MeshHex.init_tensor(x, y, np.unique(z.round(12)))
    centre = mesh.p[:, mesh.t].mean(axis=1)
    under = (centre[0] < 0.5 * layer.size[0]) & (centre[1] < 0.5 * layer.size[1])
    mesh = mesh.restrict(np.flatnonzero((centre[2] < top) | under))
    height = mesh.p[:, mesh.t].mean(axis=1)[2]
    in_patch = height > top + glue
    moduli = [(m.youngs_modulus, m.poisson_ratio) for m in (ALUMINIUM, CERAMIC)] + [(2.0 * GLUE * 1.35, 0.35)]
    young, poisson = np.array(moduli)[np.where(height < top, 0, np.where(in_patch, 1, 2))].T
    basis = Basis(mesh, ElementVector(ElementHexS2()), intorder=4)
    constant = basis.with_element(ElementHex0())
    lame = constant.interpolate(young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)))
    shear = constant.interpolate(young / (2.0 * (1.0 + poisson)))

    @BilinearForm
    def stiffness(u: Any, v: Any, w: Any) -> Any:
        e, f = sym_grad(u), sym_grad(v)
        return 2.0 * w["shear"] * ddot(e, f) + w["lame"] * trace(e) * trace(f)

    load = np.zeros(basis.N)
    for axis in range(2):
        edge = FacetBasis(mesh, basis.elem, facets=mesh.facets_satisfying(lambda p, k=axis: np.isclose(p[k], FAR)))
        traction = LinearForm(lambda v, w, k=axis: 12.0 / THICK**3 * w.x[2] * v[k])
        load += traction.assemble(edge)
    middle = [
        basis.get_dofs(lambda p, k=axis: np.isclose(p[k], 0.0)).keep([f"u^{axis + 1}"]).all() for axis in range(2)
    ]
    corner = int(np.argmin(np.abs(mesh.p[0]) + np.abs(mesh.p[1]) + np.abs(mesh.p[2] + top)))
    fixed = np.unique(np.r_[middle[0], middle[1], basis.nodal_dofs[2][corner]])
    matrix, rest, u, free = condense(stiffness.assemble(basis, lame=lame, shear=shear), load, D=fixed)
    options = {"SymmetricMode": True}
    u[free] = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options).solve(rest)

    @Functional
    def work(w: Any) -> Any:
        e = sym_grad(w["u"])
        return w["patch"] * (2.0 * w["shear"] * (e[0, 0] + e[1, 1]) + 2.0 * w["lame"] * trace(e))

    patch = constant.interpolate(np.where(in_patch, 1.0, 0.0))
    return 4.0 * float(work.assemble(basis, u=basis.interpolate(u), patch=patch, lame=lame, shear=shear))


def laminate_work(layer: Layer) -> float:
    """The same of a laminate, by elements of a Mindlin plate."""
    plate = RectangularPlate(2.0 * FAR, 2.0 * FAR, THICK, ALUMINIUM)
    mesh = MeshTri.init_tensor(*plane(layer, 6, 6))
    centre = mesh.p[:, mesh.t].mean(axis=1)
    under = (centre[0] < 0.5 * layer.size[0]) & (centre[1] < 0.5 * layer.size[1])
    basis = Basis(mesh, ElementTriP3() * ElementVector(ElementTriP3()))
    constant = basis.with_element(ElementTriP0())
    bare, added = bare_section(plate), added_section(plate, layer)

    def field(of_plate: float, of_layer: float) -> Any:
        return constant.interpolate(of_plate + np.where(under, of_layer, 0.0))

    stiffness = patched_stiffness.assemble(
        basis,
        d11=field(bare.bending[0, 0], added.bending[0, 0]),
        d12=field(bare.bending[0, 1], added.bending[0, 1]),
        d66=field(bare.twisting, added.twisting),
        shear=field(bare.shear, added.shear),
    )
    load = np.zeros(basis.N)
    fixed = []
    for axis in range(2):
        edge = FacetBasis(mesh, basis.elem, facets=mesh.facets_satisfying(lambda p, k=axis: np.isclose(p[k], FAR)))
        load += LinearForm(lambda v, c, w, k=axis: c[k]).assemble(edge)
        fixed.append(basis.get_dofs(lambda p, k=axis: np.isclose(p[k], 0.0)).keep([f"u^{axis + 1}^2"]).all())
    fixed.append(basis.get_dofs(lambda p: np.isclose(p[0], 0.0) & np.isclose(p[1], 0.0)).keep(["u^1"]).all()[:1])
    u = solve(*condense(stiffness, load, D=np.unique(np.concatenate(fixed))))
    bend = Functional(lambda w: w["patch"] * div(w["u"][1]))
    patch = constant.interpolate(np.where(under, 1.0, 0.0))
    return 4.0 * moment_of_strain(plate, layer) * float(bend.assemble(basis, u=basis.interpolate(u), patch=patch))


@pytest.mark.slow
@pytest.mark.parametrize("glue", [0.0, 50e-6, 200e-6])
def test_bond_of_a_patch_is_that_of_solid_elements(glue: float) -> None:
    """The source's patch, 10 x 10 x 2 mm on 3 mm: perfect bond, thin glue, thick glue."""
    plate = RectangularPlate(2.0 * FAR, 2.0 * FAR, THICK, ALUMINIUM)
    share = solid_work(PATCH, glue) / laminate_work(PATCH)
    assert bond_share(plate, PATCH, glue / GLUE) == pytest.approx(share, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("size", [(0.02, 0.02, 0.002), (0.01, 0.01, 0.0005), (0.02, 0.005, 0.002)])
@pytest.mark.parametrize("glue", [0.0, 200e-6])
def test_bond_of_other_patches(size: tuple[float, float, float], glue: float) -> None:
    plate = RectangularPlate(2.0 * FAR, 2.0 * FAR, THICK, ALUMINIUM)
    layer = replace(PATCH, size=size[:2], thickness=size[2])
    share = solid_work(layer, glue) / laminate_work(layer)
    assert bond_share(plate, layer, glue / GLUE) == pytest.approx(share, rel=0.1)


@pytest.mark.parametrize(("length", "width"), [(0.01, 0.01), (0.014, 0.007), (0.02, 0.005)])
@pytest.mark.parametrize("thickness", [0.0005, 0.001, 0.002])
def test_curvature_under_a_patch_is_that_of_a_stiffer_plate(length: float, width: float, thickness: float) -> None:
    plate = RectangularPlate(2.0 * FAR, 2.0 * FAR, THICK, ALUMINIUM)
    layer = replace(PATCH, size=(length, width), thickness=thickness)
    bending, nu = bare_section(plate).bending[0, 0], ALUMINIUM.poisson_ratio
    bare = moment_of_strain(plate, layer) * length * width * 2.0 / (bending * (1.0 + nu))
    assert share_of_curvature(plate, layer) == pytest.approx(laminate_work(layer) / bare, rel=0.025)


def test_a_large_patch_with_a_perfect_bond_keeps_all_of_its_action() -> None:
    """The plate around it adds 1 %: it holds the stretch, which a laminate by itself is free to have."""
    plate = RectangularPlate(2.0, 2.0, THICK, ALUMINIUM)
    wide = [bond_share(plate, replace(PATCH, size=(a, a), thickness=1e-4), 0.0) for a in (0.1, 0.2, 0.4)]
    assert wide == pytest.approx([1.0] * 3, abs=0.02)


def test_all_patches_and_bonds_have_sensible_factors() -> None:
    rng = np.random.default_rng(0)
    for _ in range(500):
        thickness, layer_thickness, *size = 10.0 ** rng.uniform([-3.5, -4.5, -2.7, -2.7], [-2.0, -2.3, -0.7, -0.7])
        plate = RectangularPlate(1.0, 1.0, thickness, ALUMINIUM)
        layer = replace(PATCH, size=tuple(size), thickness=layer_thickness)
        assert 0.0 < bond_share(plate, layer, 10.0 ** rng.uniform(-16.0, -11.0)) < 1.5
        assert 0.0 < share_of_curvature(plate, layer) < 1.0


def test_glue_takes_some_action_the_more_the_softer() -> None:
    plate = RectangularPlate(0.1, 0.1, THICK, ALUMINIUM)
    shares = [bond_share(plate, PATCH, slip) for slip in np.geomspace(1e-16, 1e-10, 13)]
    assert shares == sorted(shares, reverse=True) and 0.0 < shares[-1] < 0.01 and shares[0] < 1.0
