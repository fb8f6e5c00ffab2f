"""Piezo patches, bars and masses on a plate, against closed forms and finite elements.

Finite elements: the Mindlin plate of test_plate_against_scikit_fem.py with more stiffness and mass under a patch.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse.linalg import eigsh
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP0,
    ElementTriP4,
    ElementVector,
    LinearForm,
    MeshTri,
)
from skfem.helpers import ddot, div, dot, grad, sym_grad

from feeder_sim.plate.actuators import Actuator, moment_of_strain
from feeder_sim.plate.materials import MATERIALS, Material
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Layer, PointMass, added_section, bare_section

ALUMINIUM = MATERIALS["aluminium"]
CERAMIC = Material(7700.0, 1.0 / 13e-12, 0.31)
PLATE = RectangularPlate(0.16, 0.12, 0.003, ALUMINIUM)
PATCH = Layer((0.02, -0.01), (0.02, 0.015), 0.0, 0.002, -1, CERAMIC)


def test_force_on_a_free_beam_is_that_of_the_slopes_at_the_ends_of_the_patch() -> None:
    """F = M b (w'(x2) - w'(x1)), with the first mode of a free-free beam, cos(kL) cosh(kL) = 1."""
    plate = RectangularPlate(0.4, 0.1, 1e-4, Material(2700.0, 70e9, 0.0))
    modes = plate_modes(plate, highest_frequency=60.0, theory="kirchhoff", uniform_width=True)
    layer = Layer((0.05, 0.01), (0.06, 0.04), 0.0, 1e-5, -1, CERAMIC)
    kl = 4.730040744862704 * np.array([0.02, 0.08]) / 0.4  # k x, x from the middle
    half = 0.5 * 4.730040744862704
    # Symmetric about the middle: w = cos(kx)/cos(kL/2) + cosh(kx)/cosh(kL/2), scaled to w = 1 at the ends.
    slope = 0.5 * (4.730040744862704 / 0.4) * (-np.sin(kl) / np.cos(half) + np.sinh(kl) / np.cosh(half))
    force = Actuator("patch", layer, moment_per_volt=2.0).force_per_volt(modes)[0]
    assert force == pytest.approx(2.0 * 0.04 * (slope[1] - slope[0]), rel=1e-6)


def test_force_of_a_turned_patch_above_the_plate() -> None:
    """A quarter turn exchanges the sides; the other side of the plate changes the sign."""
    modes = plate_modes(PLATE, highest_frequency=3000.0)
    along = Actuator("a", PATCH, 1.0).force_per_volt(modes)
    turned = replace(PATCH, size=PATCH.size[::-1], angle=0.5 * np.pi, side=1)
    np.testing.assert_allclose(Actuator("b", turned, 1.0).force_per_volt(modes), -along, rtol=1e-12, atol=1e-15)


def test_laminate_is_the_bimetal_of_timoshenko() -> None:
    """Curvature of a bimetal under a strain of one side (Timoshenko, J. Opt. Soc. Am. 11 (1925) 233), biaxial."""
    plate = RectangularPlate(1.0, 1.0, 0.003, Material(2770.0, 71e9, 0.3))
    layer = Layer((0.0, 0.0), (0.1, 0.1), 0.0, 0.002, -1, Material(7700.0, 77e9, 0.3))
    m, n = 0.002 / 0.003, 77e9 / 71e9
    expected = 6.0 * (1.0 + m) ** 2 / (0.005 * (3.0 * (1.0 + m) ** 2 + (1.0 + m * n) * (m**2 + 1.0 / (m * n))))
    bending = bare_section(plate).bending + added_section(plate, layer).bending
    curvature = np.linalg.solve(bending, np.full(2, moment_of_strain(plate, layer)))
    np.testing.assert_allclose(curvature, expected, rtol=1e-12)


def test_thin_patch_has_the_moment_of_a_thin_patch() -> None:
    """E t (h + t) / 2 (1 - nu) for a patch too thin to stiffen the plate."""
    layer = replace(PATCH, thickness=1e-7)
    assert moment_of_strain(PLATE, layer) == pytest.approx(0.5e-7 * PLATE.thickness / (13e-12 * (1.0 - 0.31)), rel=2e-4)


@BilinearForm
def patched_stiffness(w: Any, b: Any, v: Any, c: Any, field: Any) -> Any:
    e, f = sym_grad(b), sym_grad(c)
    bending = field["d66"] * 2.0 * ddot(e, f) + field["d12"] * div(b) * div(c)  # D11 = D12 + 2 D66 where isotropic
    rest = field["d11"] - field["d12"] - 2.0 * field["d66"]
    bending += rest * (e[0, 0] * f[0, 0] + e[1, 1] * f[1, 1])
    return bending + field["shear"] * dot(grad(w) - b, grad(v) - c)


@BilinearForm
def patched_mass(w: Any, b: Any, v: Any, c: Any, field: Any) -> Any:
    return field["mass"] * w * v + field["rotary"] * dot(b, c)


def refined(side: float, low: float, high: float) -> NDArray[np.float64]:
    """Ends of elements along an axis, fine around a patch from low to high and at the edges of the plate."""
    inner = np.linspace(-0.5 * side + PLATE.thickness, 0.5 * side - PLATE.thickness, 9)
    outer = np.r_[-0.5 * side, inner, 0.5 * side]
    beside = np.array([0.001, 0.003, 0.007])
    fine = np.concatenate([low - beside[::-1], np.linspace(low, high, 5), high + beside])
    return np.unique(np.concatenate([outer[(outer < fine[0] - 2e-3) | (outer > fine[-1] + 2e-3)], fine]))


def finite_elements(plate: RectangularPlate, layer: Layer, count: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Frequencies [Hz] of the lowest elastic modes, and int div beta over the layer / sqrt(modal mass)."""
    (x, y), (a, b) = layer.centre, layer.size
    mesh = MeshTri.init_tensor(
        refined(plate.length, x - 0.5 * a, x + 0.5 * a), refined(plate.width, y - 0.5 * b, y + 0.5 * b)
    )
    centre = mesh.p[:, mesh.t].mean(axis=1)
    under = (np.abs(centre[0] - x) < 0.5 * a) & (np.abs(centre[1] - y) < 0.5 * b)
    basis = Basis(mesh, ElementTriP4() * ElementVector(ElementTriP4()))
    constant = basis.with_element(ElementTriP0())
    bare, added = bare_section(plate), added_section(plate, layer)

    def field(name: str) -> Any:
        values = {
            "d11": (bare.bending[0, 0], added.bending[0, 0]),
            "d12": (bare.bending[0, 1], added.bending[0, 1]),
            "d66": (bare.twisting, added.twisting),
            "shear": (bare.shear, added.shear),
            "mass": (bare.mass, added.mass),
            "rotary": (bare.rotary, added.rotary),
        }[name]
        return constant.interpolate(values[0] + np.where(under, values[1], 0.0))

    fields = {name: field(name) for name in ("d11", "d12", "d66", "shear", "mass", "rotary")}
    stiffness, mass = patched_stiffness.assemble(basis, **fields), patched_mass.assemble(basis, **fields)
    start = np.random.default_rng(0).standard_normal(stiffness.shape[0])
    squared, vectors = eigsh(stiffness, k=3 + count, M=mass, sigma=-1e5, v0=start)
    order = np.argsort(squared)[3:]
    inside = constant.interpolate(np.where(under, 1.0, 0.0))
    stretch = LinearForm(lambda v, c, w: w["inside"] * div(c)).assemble(basis, inside=inside)
    return np.sqrt(squared[order]) / (2.0 * np.pi), np.abs(stretch @ vectors[:, order])  # eigsh scales to mass 1


@pytest.mark.slow
def test_patch_against_finite_elements() -> None:
    frequencies, stretch = finite_elements(PLATE, PATCH, 12)
    modes = plate_modes(PLATE, highest_frequency=4000.0, attachments=[PATCH])
    # The frequencies agree to 4e-4 and the forces to 0.7 %; those of the bare plate are up to 3 % away.
    np.testing.assert_allclose(modes.natural_frequency[:12], frequencies, rtol=1e-3)
    force = np.abs(Actuator("patch", PATCH, 1.0).force_per_volt(modes)) / np.sqrt(modes.modal_mass)
    np.testing.assert_allclose(force[:12], stretch, rtol=0.01, atol=0.01 * stretch.max())
    bare = plate_modes(PLATE, highest_frequency=4000.0).natural_frequency
    assert np.abs(bare[:12] / frequencies - 1.0).max() > 0.01


@pytest.mark.slow
def test_symmetric_layouts_are_solved_by_parity() -> None:
    """A pair of patches, mirror images, keeps one symmetry; a mass of nothing beside it breaks it for the solver."""
    pair = [PATCH, PATCH.mirrored(0)]
    by_parity = plate_modes(PLATE, highest_frequency=2000.0, attachments=pair, terms_per_axis=20)
    nothing = PointMass((0.011, 0.017), 1e-15)
    together = plate_modes(PLATE, highest_frequency=2000.0, attachments=[*pair, nothing], terms_per_axis=20)
    assert set(by_parity.parity[:, 0].tolist()) == {0, 1} and set(by_parity.parity[:, 1].tolist()) == {-1}
    assert set(together.parity.ravel().tolist()) == {-1}
    np.testing.assert_allclose(together.natural_frequency, by_parity.natural_frequency, rtol=1e-8)
    np.testing.assert_allclose(together.modal_mass, by_parity.modal_mass, rtol=1e-6)


def test_small_mass_lowers_frequencies_by_its_share_of_the_modal_mass() -> None:
    """Rayleigh: d omega / omega = -m (w^2 + z^2 |beta|^2) / 2 m_j."""
    at, mass, offset = (0.03, 0.02), 1e-6, 0.05
    bare = plate_modes(PLATE, highest_frequency=2500.0)
    loaded = plate_modes(PLATE, highest_frequency=2500.0, attachments=[PointMass(at, mass, offset)])
    for index in range(len(bare)):
        w, bx, by = bare.evaluate(index, *at)
        expected = -0.5 * mass * (w**2 + offset**2 * (bx**2 + by**2)) / bare.modal_mass[index]
        change = loaded.natural_frequency[index] / bare.natural_frequency[index] - 1.0
        assert change == pytest.approx(expected, rel=2e-2, abs=1e-8)


def test_orthotropic_constants_of_an_isotropic_plate_give_its_modes() -> None:
    e, nu = ALUMINIUM.youngs_modulus, ALUMINIUM.poisson_ratio
    same = replace(ALUMINIUM, youngs_modulus_y=e, shear_modulus=e / (2.0 * (1.0 + nu)))
    isotropic, orthotropic = (frequencies(replace(PLATE, material=material)) for material in (ALUMINIUM, same))
    np.testing.assert_allclose(orthotropic, isotropic, rtol=1e-8)


def frequencies(plate: RectangularPlate) -> NDArray[np.float64]:
    modes: PlateModes = plate_modes(plate, highest_frequency=4000.0)
    return modes.natural_frequency


def test_orthotropic_plate_turned_by_a_right_angle_is_the_same_plate() -> None:
    wood = Material(600.0, 12e9, 0.4, youngs_modulus_y=0.9e9, shear_modulus=0.7e9)
    plate = replace(PLATE, material=wood)
    np.testing.assert_allclose(frequencies(plate.turned), frequencies(plate), rtol=1e-8)


def test_orthotropic_strip_bends_with_its_own_stiffness() -> None:
    """Free-free beam with D11: cos(kL) cosh(kL) = 1."""
    material = Material(600.0, 12e9, 0.3, youngs_modulus_y=2e9, shear_modulus=0.7e9)
    plate = RectangularPlate(0.3, 0.1, 1e-3, material)
    modes = plate_modes(plate, highest_frequency=400.0, theory="kirchhoff", uniform_width=True)
    d11 = 12e9 / (1.0 - 0.3**2 * 2e9 / 12e9) * 1e-9 / 12.0
    expected = (4.730040744862704 / 0.3) ** 2 * np.sqrt(d11 / 0.6) / (2.0 * np.pi)
    assert modes.natural_frequency[0] == pytest.approx(expected, rel=1e-4)  # rotary inertia takes 2e-5
