"""Modes by finite elements against closed forms, the Ritz method and another element.

Kirchhoff's thin plate is the limit of Mindlin's. Its free edges differ by terms of the order of thickness over
wavelength, so that plates here are thin where the closed form is Kirchhoff's.

Disc and annulus: w = (a J_n + b I_n + c Y_n + d K_n)(k r) cos(n theta), with moment and Kirchhoff's shear zero at free
edges (Leissa, Vibration of Plates, NASA SP-160 (1969), ch. 2).
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.sparse.linalg import eigsh
from scipy.special import ivp, jvp, kvp, yvp
from skfem import Basis, BilinearForm, ElementTriArgyris, MeshTri
from skfem.helpers import dd, ddot, trace

from feeder_sim.plate.actuators import Actuator
from feeder_sim.plate.elements.mesh import triangulate
from feeder_sim.plate.elements.mindlin import Support, element_modes
from feeder_sim.plate.materials import Material
from feeder_sim.plate.modes import plate_modes
from feeder_sim.plate.outline import Outline, checked_outline, rectangle_of
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Layer, PointMass

NU = 0.33
ALUMINIUM = Material(density=2770.0, youngs_modulus=71.0e9, poisson_ratio=NU)
FIRST = 20  # modes that are compared
WITHIN = 1e-3
SQUARE = RectangularPlate(0.18, 0.18, 0.003, ALUMINIUM)
PATCH = Material(density=7700.0, youngs_modulus=77.0e9, poisson_ratio=0.31)


def plate_of(outline: Outline, thickness: float, material: Material = ALUMINIUM) -> RectangularPlate:
    return RectangularPlate(*outline.size, thickness, material)


def circle(radius: float, n: int = 360) -> NDArray[np.float64]:
    """Corners of a polygon with the area of the circle."""
    angle = 2.0 * math.pi * np.arange(n) / n
    out = radius * math.sqrt(2.0 * math.pi / n / math.sin(2.0 * math.pi / n))
    return out * np.column_stack([np.cos(angle), np.sin(angle)])


def edge_determinant(k: Any, n: int, radii: tuple[float, ...]) -> Any:
    """Zero where k, shape (...), is a wavenumber of a mode with n nodal diameters and free edges at the radii."""
    rows = []
    for r in radii:
        moments, shears = [], []
        for bessel in (jvp, ivp, yvp, kvp)[: 2 * len(radii)]:
            w, w1, w2, w3 = (k**order * bessel(n, k * r, order) for order in range(4))
            moments.append(w2 + NU * (w1 / r - n**2 * w / r**2))
            change = w3 + w2 / r - (1.0 + n**2) * w1 / r**2 + 2.0 * n**2 * w / r**3
            shears.append(change - (1.0 - NU) * n**2 / r * (w1 / r - w / r**2))
        rows += [moments, shears]
    matrix = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    return np.linalg.det(matrix / np.abs(matrix).max(axis=-2, keepdims=True))


def round_plate(radii: tuple[float, ...], thickness: float) -> NDArray[np.float64]:
    """The first natural frequencies of a thin disc or annulus [Hz], those with nodal diameters twice."""
    found = []
    k = np.linspace(0.3, 12.0, 1500)
    outer, inside = radii[0], tuple(r / radii[0] for r in radii)
    for n in range(9):
        values = edge_determinant(k, n, inside)
        roots = [
            brentq(edge_determinant, k[i], k[i + 1], args=(n, inside))
            for i in np.flatnonzero(values[:-1] * values[1:] < 0.0)
        ]
        found += [root / outer for root in roots] * (1 if n == 0 else 2)
    plate = RectangularPlate(1.0, 1.0, thickness, ALUMINIUM)
    wave = math.sqrt(plate.bending_stiffness / plate.mass_per_area) / (2.0 * math.pi)
    return wave * np.sort(found)[:FIRST] ** 2


@pytest.mark.parametrize(
    "radii", [pytest.param((0.1,), id="disc"), pytest.param((0.1, 0.04), id="annulus", marks=pytest.mark.slow)]
)
def test_a_free_round_plate_has_the_frequencies_of_the_closed_form(radii: tuple[float, ...]) -> None:
    expected = round_plate(radii, 2e-4)
    outline = checked_outline([circle(radius) for radius in radii])
    modes, _ = element_modes(plate_of(outline, 2e-4), outline, highest_frequency=1.05 * expected[-1], finer=1.3)
    found = modes.natural_frequency[:FIRST]
    assert np.abs(found / expected - 1.0).max() < WITHIN
    pairs = [i for i in range(FIRST - 1) if expected[i] == expected[i + 1]]
    assert len(pairs) > 6 and max(abs(found[i + 1] / found[i] - 1.0) for i in pairs) < 2e-4


@pytest.mark.parametrize(
    ("length", "width"), [(0.18, 0.18), (0.16, 0.12), pytest.param(0.2, 0.05, marks=pytest.mark.slow)]
)
def test_a_free_rectangle_has_the_modes_of_the_ritz_method(length: float, width: float) -> None:
    plate = RectangularPlate(length, width, 0.003, ALUMINIUM)
    ritz = plate_modes(plate, highest_frequency=13_000.0)
    modes, _ = element_modes(plate, rectangle_of(length, width), highest_frequency=13_100.0)
    n = len(ritz)
    assert np.abs(modes.natural_frequency[:n] / ritz.natural_frequency - 1.0).max() < WITHIN
    x, y = (np.linspace(-0.5, 0.5, 41) * side for side in (length, width))
    alone = np.flatnonzero(np.diff(ritz.natural_frequency, prepend=0.0, append=1e9)[:n] > 60.0)
    alone = alone[np.diff(ritz.natural_frequency, append=1e9)[alone] > 60.0]
    for i in alone.tolist():
        difference = modes.evaluate_grid(i, x, y)[0] - ritz.evaluate_grid(i, x, y)[0]
        assert np.abs(difference).max() < 0.02, i
        assert modes.modal_mass[i] == pytest.approx(ritz.modal_mass[i], rel=0.03)


def edge(begin: tuple[float, float], end: tuple[float, float], hold: Literal["hinged", "clamped"]) -> Support:
    place = shapely.LineString([begin, end])
    return Support(hold, np.zeros((0, 2)), np.zeros(0), 0.0, 0.0, place)


def test_a_plate_on_hinges_has_the_frequencies_of_theory() -> None:
    """Thin, all edges hinged: (m^2 / a^2 + n^2 / b^2) pi / 2 sqrt(D / rho h)."""
    a, b, thickness = 0.2, 0.15, 2e-4
    outline, corners = rectangle_of(a, b), rectangle_of(a, b).exterior.tolist()
    supports = [edge(tuple(corners[i - 1]), tuple(corners[i]), "hinged") for i in range(4)]
    plate = plate_of(outline, thickness)
    wave = 0.5 * math.pi * math.sqrt(plate.bending_stiffness / plate.mass_per_area)
    expected = np.sort([wave * ((m / a) ** 2 + (n / b) ** 2) for m in range(1, 9) for n in range(1, 9)])[:FIRST]
    modes, _ = element_modes(plate, outline, highest_frequency=1.05 * expected[-1], supports=supports, finer=1.3)
    assert np.abs(modes.natural_frequency[:FIRST] / expected - 1.0).max() < 2.0 * WITHIN


@pytest.mark.slow
def test_a_cantilever_has_the_bending_modes_of_a_beam() -> None:
    """Without contraction across it a strip is a beam: (beta l)^2 = 1.8751^2, 4.6941^2, 7.8548^2."""
    length, width, thickness = 0.1, 0.012, 5e-4
    plate = RectangularPlate(length, width, thickness, Material(2770.0, 71.0e9, 0.0))
    clamp = edge((-0.5 * length, -0.5 * width), (-0.5 * length, 0.5 * width), "clamped")
    wave = math.sqrt(plate.bending_stiffness / plate.mass_per_area) / (2.0 * math.pi * length**2)
    modes, _ = element_modes(plate, rectangle_of(length, width), highest_frequency=1000.0, supports=[clamp])
    straight = [i for i in range(len(modes)) if np.ptp(modes.evaluate(i, 0.5 * length, [-0.005, 0.005])[0]) < 0.01]
    expected = wave * np.array([1.875104, 4.694091]) ** 2
    np.testing.assert_allclose(modes.natural_frequency[straight][:2], expected, rtol=WITHIN)


def test_a_stiff_plate_on_four_springs_moves_as_a_rigid_body() -> None:
    """Heave sqrt(4 k / m), tilt sqrt(4 k d^2 / I) about both axes, and damping by the loss of the springs."""
    d, k = 0.05, 2000.0
    springs = [
        Support("spring", np.array([[x, y]]), np.ones(1), k, 0.3, shapely.Point(x, y)) for x in (-d, d) for y in (-d, d)
    ]
    modes, loss = element_modes(SQUARE, rectangle_of(0.18, 0.18), highest_frequency=600.0, supports=springs)
    mass = SQUARE.mass_per_area * 0.18**2
    inertia = mass * 0.18**2 / 12.0 + SQUARE.rotary_inertia * 0.18**2
    heave, tilt = math.sqrt(4.0 * k / mass) / (2.0 * math.pi), math.sqrt(4.0 * k * d**2 / inertia) / (2.0 * math.pi)
    np.testing.assert_allclose(modes.natural_frequency[:3], sorted([heave, tilt, tilt]), rtol=2e-3)
    assert loss[:3] == pytest.approx([0.15] * 3, rel=1e-3)
    assert 0.0 < loss[3] < 0.02


@pytest.mark.parametrize(
    "place",
    [
        shapely.Point(0.0213, -0.0137),
        shapely.Point(0.02, -0.01).buffer(0.001),
        shapely.box(-0.03, -0.02, 0.01, 0.03),
        shapely.LineString([(-0.05, -0.03), (0.02, 0.051)]),
        shapely.LineString([(-0.09, -0.03), (-0.09, 0.05)]),
    ],
    ids=["point", "small disc", "rectangle", "line", "piece of an edge"],
)
def test_what_is_held_stays_and_the_rest_moves(place: Any) -> None:
    """However small it is, and wherever it lies between the corners of the mesh."""
    held = Support("clamped", np.zeros((0, 2)), np.zeros(0), 0.0, 0.0, place)
    modes, _ = element_modes(SQUARE, rectangle_of(0.18, 0.18), highest_frequency=1500.0, supports=[held])
    assert len(modes) > 4
    inside = place.representative_point()
    motion = modes.evaluate_whole(np.array([[inside.x, inside.y]]))[..., 0]
    assert np.abs(motion[:, 0]).max() < 1e-4 and np.abs(motion[:, 1:]).max() < 0.2


HOLES = [np.array([0.04, 0.12]) + circle(0.01, 72), np.array([0.16, 0.04]) + circle(0.006, 72)]
ELL = np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 0.08], [0.08, 0.08], [0.08, 0.16], [0.0, 0.16]])


@BilinearForm
def kirchhoff(w: Any, v: Any, _: Any) -> Any:
    return (1.0 - NU) * ddot(dd(w), dd(v)) + NU * trace(dd(w)) * trace(dd(v))


@BilinearForm
def inertia(w: Any, v: Any, _: Any) -> Any:
    return w * v


@pytest.mark.slow
def test_an_l_with_two_holes_has_the_modes_that_another_element_gives() -> None:
    """Argyris' element of a thin plate, twice continuous, on a mesh of its own."""
    thickness = 2e-4
    outline = checked_outline([ELL, *HOLES]).moved(np.array([-0.1, -0.08]))
    plate = plate_of(outline, thickness)
    points, triangles = triangulate(outline, (), 0.007)
    basis = Basis(MeshTri(np.ascontiguousarray(points.T), np.ascontiguousarray(triangles.T)), ElementTriArgyris())
    squared = eigsh(kirchhoff.assemble(basis), k=FIRST + 3, M=inertia.assemble(basis), sigma=-1e3)[0]
    wave = math.sqrt(plate.bending_stiffness / plate.mass_per_area) / (2.0 * math.pi)
    expected = wave * np.sqrt(np.sort(squared)[3:])
    modes, _ = element_modes(plate, outline, highest_frequency=1.05 * expected[-1], finer=1.5)
    assert np.abs(modes.natural_frequency[:FIRST] / expected - 1.0).max() < 2.0 * WITHIN


def test_patches_and_masses_act_as_in_the_ritz_method() -> None:
    """Frequencies of a plate that carries them, and the force of a patch on its modes."""
    layers = (
        Layer((0.02, -0.01), (0.03, 0.02), 0.4, 0.001, -1, PATCH),
        Layer((-0.05, 0.04), (0.02, 0.02), 0.0, 0.002, 1, PATCH),
    )
    attachments = (*layers, PointMass((0.06, 0.05), 0.004, 0.002))
    ritz = plate_modes(SQUARE, highest_frequency=6000.0, attachments=attachments)
    modes, _ = element_modes(SQUARE, rectangle_of(0.18, 0.18), highest_frequency=6000.0, attachments=attachments)
    assert len(modes) == len(ritz)
    assert np.abs(modes.natural_frequency / ritz.natural_frequency - 1.0).max() < WITHIN
    actuator = Actuator("a", layers[0], 0.1)
    one, other = (actuator.force_per_volt(each) / np.sqrt(each.modal_mass) for each in (modes, ritz))
    assert np.abs(np.abs(one) - np.abs(other)).max() < 0.015 * np.abs(other).max()


def test_ninety_modes_keep_apart_and_are_of_unit_mass() -> None:
    """Shapes are orthogonal with the mass of the plate, by another quadrature than that of the elements."""
    outline = checked_outline([ELL, *HOLES]).moved(np.array([-0.1, -0.08]))
    plate = plate_of(outline, 0.0025)
    modes, _ = element_modes(plate, outline, highest_frequency=6000.0)
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.1, 0.1, (60_000, 2)) * np.array([1.0, 0.8])
    points = points[outline.holds(points)]
    w, bx, by = np.moveaxis(modes.evaluate_whole(points), 1, 0)
    area = outline.polygon.area / len(points)
    gram = area * (plate.mass_per_area * w @ w.T + plate.rotary_inertia * (bx @ bx.T + by @ by.T))
    gram /= np.sqrt(np.outer(modes.modal_mass, modes.modal_mass))
    assert np.abs(gram - np.eye(len(modes))).max() < 0.03
