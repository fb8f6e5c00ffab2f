"""The bend of a plate under a layer: a few shapes around each layer, superposed on the polynomials of the plate.

Under a patch the plate is several times stiffer, over a length that polynomials of the whole plate do not resolve. A
local mesh of quadratic elements, whose functions vanish on its border, shows how the plate gives way there to what the
layer does to it: resist the bend, and need force to be moved. With the stiffness K of plate and layer between the local
functions l, and the stiffness P and mass Q of the layer between them and a set p of low polynomials, the shapes are

    K_ll^-1 P_lp    and    K_ll^-1 Q_lp.

They join the polynomials in the Ritz method (static responses as trial functions: Craig and Bampton, AIAA J. 6 (1968)
1313; superposed meshes: Fish, Comput. Struct. 43 (1992) 539). All energies are those of the sum, so that frequencies
stay upper bounds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Layer, Section, added_section, bare_section
from feeder_sim.plate.ritz.fields import Fields, Matrix, mass_form, over_fields, polynomial_fields, stiffness_form
from feeder_sim.plate.ritz.matrices import Basis

ELEMENTS = 4  # per axis over the layer
MARGIN = (0.2, 0.55, 1.0)  # ends of the elements beside it, of the width of the margin
WIDTH_OF_MARGIN = 1.0  # of the longer side of the layer
BENDS, MOVES = 4, 2  # degrees of the polynomials that a layer resists, and that move it
LEAST_ENERGY = 1e-9  # of a response, over the largest; a smaller one is made of the others
LEAST_POINTS = 2  # Gauss points per axis of an element, before those for the polynomials that vary over it
Form = Callable[[Fields, Fields, Matrix, Section], Matrix]


@dataclass(frozen=True)
class LocalMesh:
    """Quadratic elements around a layer, along its own axes.

    Attributes:
        layer: in the middle of the mesh.
        ends: ends of the elements along its first and second axis, from its centre [m].
    """

    layer: Layer
    ends: tuple[Matrix, Matrix]

    def quadrature(self, finest: float) -> tuple[Matrix, Matrix]:
        """Gauss points (n, 2), along the axes of the layer [m], and the area of each (n,) [m^2].

        They are dense enough for polynomials that vary over a length `finest` [m].
        """
        (a, da), (b, db) = (_gauss(ends, finest) for ends in self.ends)
        return np.stack(np.meshgrid(a, b, indexing="ij"), axis=-1).reshape(-1, 2), np.outer(da, db).ravel()

    def on_plate(self, local: Matrix) -> Matrix:
        """Points (n, 2) given along the axes of the layer, on the plate [m]."""
        c, s = math.cos(self.layer.angle), math.sin(self.layer.angle)
        return np.asarray(self.layer.centre) + local @ np.array([[c, s], [-s, c]])

    def along_layer(self, points: Matrix) -> Matrix:
        """The other way round."""
        c, s = math.cos(self.layer.angle), math.sin(self.layer.angle)
        return (points - np.asarray(self.layer.centre)) @ np.array([[c, -s], [s, c]])

    def fields(self, local: Matrix) -> Fields:
        """The local functions at points (n, 2) along the axes of the layer [m]; all fields have the same ones."""
        (a, da), (b, db) = (_quadratic(local[:, axis], self.ends[axis]) for axis in range(2))
        c, s = math.cos(self.layer.angle), math.sin(self.layer.angle)
        value, along_a, along_b = (_products(u, v) for u, v in ((a, b), (da, b), (a, db)))
        along_x, along_y = c * along_a - s * along_b, s * along_a + c * along_b
        return Fields((value,) * 3, (along_x,) * 3, (along_y,) * 3)

    def under_layer(self, local: Matrix) -> NDArray[np.bool_]:
        """Which points lie under the layer."""
        a, b = self.layer.size
        return (np.abs(local[:, 0]) < 0.5 * a) & (np.abs(local[:, 1]) < 0.5 * b)


@dataclass(frozen=True)
class LocalField:
    """What a local mesh adds to a set of modes.

    Attributes:
        mesh: the mesh.
        coefficients: of its functions, shape (n_modes, 3, functions): fields w, beta_x, beta_y.
        nearest: coefficients of the polynomials that come nearest to it, shape (n_modes, 3, terms, terms).
    """

    mesh: LocalMesh
    coefficients: Matrix
    nearest: Matrix

    def scaled(self, factor: Matrix) -> LocalField:
        """The same for modes that are multiplied by factors (n_modes,)."""
        return LocalField(
            self.mesh, self.coefficients * factor[:, None, None], self.nearest * factor[:, None, None, None]
        )

    def evaluate(self, points: Matrix) -> Matrix:
        """(w, beta_x, beta_y) of every mode at points (n, 2) of the plate [m], shape (n_modes, 3, n)."""
        functions = self.mesh.fields(self.mesh.along_layer(points)).value[0]
        return np.asarray(self.coefficients @ functions.T)


@dataclass(frozen=True)
class LocalShapes:
    """Shapes around a layer, as trial functions of the plate.

    Attributes:
        mesh: the mesh.
        coefficients: of its functions, (functions of all three fields, shapes).
        stiffness, mass: what the layer adds between the polynomials of the plate, (n, n).
        coupling_stiffness, coupling_mass: between the polynomials and the shapes, (n, shapes).
        own_stiffness, own_mass: between the shapes.
        overlap: integrals of polynomials times shapes, (n, shapes) [m^2].
    """

    mesh: LocalMesh
    coefficients: Matrix
    stiffness: Matrix
    mass: Matrix
    coupling_stiffness: Matrix
    coupling_mass: Matrix
    own_stiffness: Matrix
    own_mass: Matrix
    overlap: Matrix

    def field(self, amounts: Matrix, plate: RectangularPlate, basis: Basis) -> LocalField:
        """What the shapes add to modes that have amounts of them (shapes, n_modes)."""
        coefficients = (self.coefficients @ amounts).T.reshape(amounts.shape[1], 3, -1)
        nearest = 4.0 / (plate.length * plate.width) * self.overlap @ amounts
        return LocalField(self.mesh, coefficients, basis.unpacked(nearest))


def local_shapes(plate: RectangularPlate, basis: Basis, mesh: LocalMesh, *, thin: bool = False) -> LocalShapes:
    """A layer on a plate, and the shapes in which the plate gives way to it.

    In a `thin` plate beta = grad w, which the local functions do not meet: there are no shapes then.
    """
    local, areas = mesh.quadrature(min(plate.length, plate.width) / basis.terms)
    polynomials, inside = polynomial_fields(plate, basis, mesh.on_plate(local)), mesh.under_layer(local)
    bare, added = bare_section(plate), added_section(plate, mesh.layer)
    if thin:
        added = replace(added, shear=0.0)

    def both(form: Form, a: Fields, b: Fields) -> Matrix:
        return form(a, b, areas, bare) + form(a[inside], b[inside], areas[inside], added)

    under, below = polynomials[inside], areas[inside]
    functions = mesh.fields(local)
    if thin:
        chosen = np.zeros((3 * functions.value[0].shape[1], 0))
    else:
        bends = low_polynomials(mesh, local[inside], BENDS)
        moves = low_polynomials(mesh, local[inside], MOVES)
        resisted = over_fields(stiffness_form(functions[inside], bends, below, added), 1)
        moved = over_fields(mass_form(functions[inside], moves, below, added), 1)
        chosen = _static_responses(both(stiffness_form, functions, functions), np.hstack([resisted, moved]))
    shapes = functions.combined(chosen)
    overlap = [p.T @ (areas[:, None] * f) for p, f in zip(polynomials.value, shapes.value, strict=True)]
    return LocalShapes(
        mesh=mesh,
        coefficients=chosen,
        stiffness=stiffness_form(under, under, below, added),
        mass=mass_form(under, under, below, added),
        coupling_stiffness=over_fields(both(stiffness_form, polynomials, shapes), 1),
        coupling_mass=over_fields(both(mass_form, polynomials, shapes), 1),
        own_stiffness=over_fields(over_fields(both(stiffness_form, shapes, shapes), 0), 1),
        own_mass=over_fields(over_fields(both(mass_form, shapes, shapes), 0), 1),
        overlap=np.vstack(overlap),
    )


def _static_responses(stiffness: Matrix, loads: Matrix) -> Matrix:
    """Responses to loads (n, m), combined so that each has the strain energy 1/2 and none is made of the others."""
    from scipy.linalg import cho_factor, cho_solve, eigh

    size = np.linalg.norm(loads, axis=0)
    loads = loads[:, size > 0.0] / size[size > 0.0]  # nothing resists a motion without bend
    responses = cho_solve(cho_factor(stiffness), loads)
    energy, mixture = eigh(loads.T @ responses)
    selected = energy > LEAST_ENERGY * energy.max()
    return np.asarray(responses @ (mixture[:, selected] / np.sqrt(energy[selected])))


def low_polynomials(mesh: LocalMesh, local: Matrix, degree: int) -> Fields:
    """Thin-plate bends w = a^i b^j along the axes of a layer with i + j up to a degree, at points (n, 2) [m]."""
    a, b = (local[:, axis] / mesh.layer.size[axis] for axis in range(2))
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]

    def derivative(times_a: int, times_b: int) -> Matrix:
        columns = []
        for i, j in powers:
            factor = math.perm(i, times_a) * math.perm(j, times_b)
            columns.append(factor * a ** max(i - times_a, 0) * b ** max(j - times_b, 0))
        return np.stack(columns, axis=1) / (mesh.layer.size[0] ** times_a * mesh.layer.size[1] ** times_b)

    aa, ab, bb = derivative(2, 0), derivative(1, 1), derivative(0, 2)
    c, s = math.cos(mesh.layer.angle), math.sin(mesh.layer.angle)
    da, db = derivative(1, 0), derivative(0, 1)
    x, y = c * da - s * db, s * da + c * db
    xx, yy = c * c * aa - 2 * c * s * ab + s * s * bb, s * s * aa + 2 * c * s * ab + c * c * bb
    xy = c * s * (aa - bb) + (c * c - s * s) * ab
    return Fields((derivative(0, 0), x, y), (x, xx, xy), (y, xy, yy))


def joined(form: Matrix, layers: Sequence[LocalShapes], kind: Literal["stiffness", "mass"], per_area: float) -> Matrix:
    """A matrix of the polynomials with rows and columns for the shapes of all layers, whose meshes do not overlap."""
    from scipy.linalg import block_diag

    coupling = per_area * np.hstack([getattr(layer, f"coupling_{kind}") for layer in layers])
    diagonal = per_area * block_diag(*(getattr(layer, f"own_{kind}") for layer in layers))
    return np.block([[form, coupling], [coupling.T, diagonal]])


def meshes_around(plate: RectangularPlate, layers: Sequence[Layer]) -> list[LocalMesh]:
    """A mesh for every layer, as wide as its neighbours and the edge of the plate leave room for."""
    from shapely import Polygon

    areas = [Polygon(layer.corners()) for layer in layers]
    sheet = Polygon([(sx * plate.length / 2, sy * plate.width / 2) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    meshes = []
    for layer, area in zip(layers, areas, strict=True):
        room = [0.5 * area.distance(other) / math.sqrt(2.0) for other in areas if other is not area]
        room.append(area.distance(sheet.exterior) / math.sqrt(2.0))
        margin = min(WIDTH_OF_MARGIN * max(layer.size), *room)
        a, b = (_ends(side, margin) for side in layer.size)
        meshes.append(LocalMesh(layer, (a, b)))
    return meshes


def _ends(side: float, margin: float) -> Matrix:
    """Ends of the elements along one axis of a layer, from its centre [m]."""
    inner = np.linspace(-0.5, 0.5, ELEMENTS + 1) * side
    if margin < 1e-3 * side:
        return inner
    outer = 0.5 * side + margin * np.array(MARGIN)
    return np.concatenate([-outer[::-1], inner, outer])


def _gauss(ends: Matrix, finest: float) -> tuple[Matrix, Matrix]:
    """Gauss points of all elements along an axis, and their lengths [m]."""
    nodes, weights = legendre.leggauss(LEAST_POINTS + math.ceil(np.diff(ends).max() / finest))
    half = 0.5 * np.diff(ends)[:, None]
    return (ends[:-1, None] + half * (1.0 + nodes)).ravel(), (half * weights).ravel()


def _quadratic(position: Matrix, ends: Matrix) -> tuple[Matrix, ...]:
    """Values and slopes of the quadratic functions of elements along an axis that vanish at both ends.

    Returns:
        two arrays (positions, 2 elements - 1): hats at the ends of elements and bubbles inside them.
    """
    n = len(ends) - 1
    inside = (position >= ends[0]) & (position <= ends[-1])
    element = np.clip(np.searchsorted(ends, position, side="right") - 1, 0, n - 1)
    size = np.diff(ends)[element]
    share = np.where(inside, (position - ends[element]) / size, 0.0)
    rows = np.arange(len(position))
    value, slope = (np.zeros((len(position), 2 * n + 1)) for _ in range(2))
    scale = np.where(inside, 1.0 / size, 0.0)
    value[rows, 2 * element], slope[rows, 2 * element] = 1.0 - share, -scale
    value[rows, 2 * element + 2], slope[rows, 2 * element + 2] = share, scale
    value[rows, 2 * element + 1] = 4.0 * share * (1.0 - share)
    slope[rows, 2 * element + 1] = 4.0 * (1.0 - 2.0 * share) * scale
    value[~inside] = 0.0
    return value[:, 1:-1], slope[:, 1:-1]


def _products(a: Matrix, b: Matrix) -> Matrix:
    return np.asarray((a[:, :, None] * b[:, None, :]).reshape(len(a), -1))
