"""What is fixed to a plate and moves with it: bonded layers (piezo patches, bars) and point masses.

A layer adds its mass and the rotary inertia of its place beside the mid-plane. With the plate it bends as a laminate
in which no force acts in the plane: with the stiffnesses A, B, C of both (of stretch, coupling, and bending about the
plate's mid-plane)

    D = C - B A^-1 B

(reduced bending stiffness; Reissner and Stavsky, J. Appl. Mech. 28 (1961) 402). For a narrow layer it is that of a
bimetal. All integrals are by Gauss quadrature over the layer.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from feeder_sim.plate.materials import Material
from feeder_sim.plate.rectangle import SHEAR_FACTOR, RectangularPlate
from feeder_sim.plate.ritz import Basis, Parity, legendre_slopes, orthonormal_legendre

MIRRORED = 1e-9  # [m], [kg]; what differs by less from its mirror image is its own


@dataclass(frozen=True)
class Layer:
    """A rectangular layer bonded to one side of a plate.

    Attributes:
        centre: (x, y) [m].
        size: along its own axes (a, b) [m].
        angle: of its first axis from x [rad].
        thickness: [m].
        side: -1 below the plate, 1 above it.
        material: isotropic.
    """

    centre: tuple[float, float]
    size: tuple[float, float]
    angle: float
    thickness: float
    side: int
    material: Material

    @property
    def mass(self) -> float:
        """[kg]."""
        return self.material.density * self.thickness * self.size[0] * self.size[1]

    def corners(self, shortened: float = 0.0) -> NDArray[np.float64]:
        """Its corners (4, 2) [m], counter-clockwise, if each edge is moved inward by a length [m]."""
        a, b = (0.5 * side - shortened for side in self.size)
        c, s = math.cos(self.angle), math.sin(self.angle)
        own = np.array([[-a, -b], [a, -b], [a, b], [-a, b]])
        return np.asarray(self.centre) + own @ np.array([[c, s], [-s, c]])

    def mirrored(self, axis: int) -> Layer:
        """Its mirror image with x (axis 0) or y (axis 1) turned round."""
        x, y = self.centre
        centre = (-x, y) if axis == 0 else (x, -y)
        return Layer(centre, self.size, -self.angle, self.thickness, self.side, self.material)


@dataclass(frozen=True)
class PointMass:
    """A mass fixed to a plate at a point.

    Attributes:
        centre: (x, y) [m].
        mass: [kg].
        offset: distance of its centre of mass from the mid-plane of the plate [m].
    """

    centre: tuple[float, float]
    mass: float
    offset: float = 0.0

    def mirrored(self, axis: int) -> PointMass:
        """Its mirror image with x (axis 0) or y (axis 1) turned round."""
        x, y = self.centre
        return PointMass((-x, y) if axis == 0 else (x, -y), self.mass, self.offset)


Attachment = Layer | PointMass


def parity_classes(attachments: Sequence[Attachment]) -> list[Parity]:
    """The parities that can be solved one by one: all four without attachments, fewer where they break a symmetry."""
    kept = [_is_mirrored(attachments, axis) for axis in range(2)]
    return [(x, y) for x in ((0, 1) if kept[0] else (None,)) for y in ((0, 1) if kept[1] else (None,))]


def _is_mirrored(attachments: Sequence[Attachment], axis: int) -> bool:
    own = Counter(_signature(attachment) for attachment in attachments)
    return own == Counter(_signature(attachment.mirrored(axis)) for attachment in attachments)


def _signature(attachment: Attachment) -> Hashable:
    """The same for attachments of the same effect."""
    if isinstance(attachment, PointMass):
        numbers = np.array([*attachment.centre, attachment.mass, attachment.offset])
        return tuple(np.round(numbers / MIRRORED).astype(np.int64).tolist())
    corners = np.round(attachment.corners() / MIRRORED).astype(np.int64).tolist()
    place = tuple(sorted(tuple(corner) for corner in corners))
    return place, attachment.thickness, attachment.side, attachment.material


def section_stiffness(plate: RectangularPlate, layer: Layer) -> tuple[NDArray[np.float64], float]:
    """What a layer adds to the bending stiffness D11, D12, D22 as a matrix (2, 2), and to D66 [N m]."""
    h, t = plate.thickness, layer.thickness
    z = 0.5 * (h + t)  # the sign drops out of B A^-1 B
    (p11, p12, p22, p66), (l11, l12, l22, l66) = plate.material.plane_stress, layer.material.plane_stress
    q_plate, q_layer = np.array([[p11, p12], [p12, p22]]), np.array([[l11, l12], [l12, l22]])
    stretch, coupling = q_plate * h + q_layer * t, q_layer * t * z
    bending = q_layer * (t**3 / 12.0 + t * z**2) - coupling @ np.linalg.solve(stretch, coupling)
    twisting = l66 * (t**3 / 12.0 + t * z**2) - (l66 * t * z) ** 2 / (p66 * h + l66 * t)
    return bending, twisting


def attached_matrices(
    plate: RectangularPlate, attachments: Sequence[Attachment], basis: Basis, *, with_shear: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What attachments add to the stiffness (n, n) and the mass (n, n) of a plate; see feeder_sim.plate.ritz."""
    n = sum(basis.sizes)
    stiffness, mass = np.zeros((n, n)), np.zeros((n, n))
    scale = 4.0 / (plate.length * plate.width)
    for attachment in attachments:
        if isinstance(attachment, PointMass):
            values = _Fields(plate, basis, np.array([attachment.centre]))
            weights = np.array([scale * attachment.mass])
            mass += values.mass(weights, attachment.offset**2)
            continue
        points, areas = quadrature(attachment, _points_per_axis(plate, attachment, basis.terms))
        values = _Fields(plate, basis, points)
        h, t, density = plate.thickness, attachment.thickness, attachment.material.density
        distance_squared = ((0.5 * h + t) ** 3 - (0.5 * h) ** 3) / (3.0 * t)  # mean over the layer's thickness
        mass += values.mass(scale * density * t * areas, distance_squared)
        bending, twisting = section_stiffness(plate, attachment)
        shear = SHEAR_FACTOR * attachment.material.in_plane_shear_modulus * t if with_shear else 0.0
        stiffness += values.stiffness(scale * areas, bending, twisting, shear)
    return stiffness, mass


def quadrature(layer: Layer, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gauss points (n^2, 2) [m] of a layer, and the area of each (n^2,) [m^2]."""
    nodes, weights = legendre.leggauss(n)
    a, b = np.meshgrid(0.5 * layer.size[0] * nodes, 0.5 * layer.size[1] * nodes, indexing="ij")
    c, s = math.cos(layer.angle), math.sin(layer.angle)
    points = np.asarray(layer.centre) + np.stack([a * c - b * s, a * s + b * c], axis=-1).reshape(-1, 2)
    return points, np.outer(weights, weights).ravel() * 0.25 * layer.size[0] * layer.size[1]


def _points_per_axis(plate: RectangularPlate, layer: Layer, terms: int) -> int:
    """Enough Gauss points for products of two polynomials over the layer; `terms` + 1 are exact for a whole plate."""
    share = max(layer.size) / min(plate.length, plate.width)
    return min(terms + 1, 6 + math.ceil(terms * share))


class _Fields:
    """Values and slopes of all functions of a basis at points of a plate, each (points, functions)."""

    def __init__(self, plate: RectangularPlate, basis: Basis, points: NDArray[np.float64]) -> None:
        xi, eta = 2.0 * points[:, 0] / plate.length, 2.0 * points[:, 1] / plate.width
        x, y = orthonormal_legendre(xi, basis.terms), orthonormal_legendre(eta, basis.terms)
        dx = 2.0 / plate.length * legendre_slopes(xi, basis.terms)
        dy = 2.0 / plate.width * legendre_slopes(eta, basis.terms)
        self._starts = np.cumsum([0, *basis.sizes])
        self._fields = basis.fields
        self.value = [self._products(field, x, y) for field in range(3)]
        self.slope_x = [self._products(field, dx, y) for field in range(3)]
        self.slope_y = [self._products(field, x, dy) for field in range(3)]

    def _products(self, field: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        ix, iy = self._fields[field]
        values = np.zeros((len(x), self._starts[-1]))
        block = (x[:, ix, None] * y[:, None, iy]).reshape(len(x), -1)
        values[:, self._starts[field] : self._starts[field + 1]] = block
        return values

    def mass(self, weights: NDArray[np.float64], distance_squared: float) -> NDArray[np.float64]:
        """Matrix of w^2 + distance^2 (beta_x^2 + beta_y^2)."""
        w, beta_x, beta_y = self.value
        rotary = _form(beta_x, weights, beta_x) + _form(beta_y, weights, beta_y)
        return _form(w, weights, w) + distance_squared * rotary

    def stiffness(
        self, weights: NDArray[np.float64], bending: NDArray[np.float64], twisting: float, shear: float
    ) -> NDArray[np.float64]:
        """Matrix of the strain energy of bending (2, 2), twisting and shear stiffness."""
        along_x, along_y = self.slope_x[1], self.slope_y[2]
        twist = self.slope_y[1] + self.slope_x[2]
        crossed = _form(along_x, weights, along_y)
        total = bending[0, 0] * _form(along_x, weights, along_x) + bending[1, 1] * _form(along_y, weights, along_y)
        total += bending[0, 1] * (crossed + crossed.T) + twisting * _form(twist, weights, twist)
        if shear > 0.0:
            for angle in (self.slope_x[0] - self.value[1], self.slope_y[0] - self.value[2]):
                total += shear * _form(angle, weights, angle)
        return total


def _form(a: NDArray[np.float64], weights: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a.T @ (weights[:, None] * b))
