"""What is fixed to a plate and moves with it: bonded layers (piezo patches, bars) and point masses.

A layer adds its mass and the rotary inertia of its place beside the mid-plane. With the plate it bends as a laminate
in which no force acts in the plane: with the stiffnesses A, B, C of both (of stretch, coupling, and bending about the
plate's mid-plane)

    D = C - B A^-1 B

(reduced bending stiffness; Reissner and Stavsky, J. Appl. Mech. 28 (1961) 402), as a bimetal does.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.materials import Material
from feeder_sim.plate.rectangle import SHEAR_FACTOR, RectangularPlate
from feeder_sim.plate.ritz.matrices import Parity

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
        layer_corners = np.array([[-a, -b], [a, -b], [a, b], [-a, b]])
        return np.asarray(self.centre) + layer_corners @ np.array([[c, s], [-s, c]])

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
    symmetric = [_is_mirrored(attachments, axis) for axis in range(2)]
    return [(x, y) for x in ((0, 1) if symmetric[0] else (None,)) for y in ((0, 1) if symmetric[1] else (None,))]


def _is_mirrored(attachments: Sequence[Attachment], axis: int) -> bool:
    signatures = Counter(_signature(attachment) for attachment in attachments)
    return signatures == Counter(_signature(attachment.mirrored(axis)) for attachment in attachments)


def _signature(attachment: Attachment) -> Hashable:
    """The same for attachments of the same effect."""
    if isinstance(attachment, PointMass):
        numbers = np.array([*attachment.centre, attachment.mass, attachment.offset])
        return tuple(np.round(numbers / MIRRORED).astype(np.int64).tolist())
    corners = np.round(attachment.corners() / MIRRORED).astype(np.int64).tolist()
    place = tuple(sorted(tuple(corner) for corner in corners))
    return place, attachment.thickness, attachment.side, attachment.material


@dataclass(frozen=True)
class Section:
    """Stiffness and inertia per area of a plate, or what a layer adds to them.

    Attributes:
        bending: D11, D12, D22 as a matrix (2, 2) [N m].
        twisting: D66 [N m].
        shear: [N/m].
        mass: [kg/m^2].
        rotary: rotary inertia [kg].
    """

    bending: NDArray[np.float64]
    twisting: float
    shear: float
    mass: float
    rotary: float


def bare_section(plate: RectangularPlate) -> Section:
    """The section of a plate without layers."""
    d11, d12, d22, d66 = plate.bending_stiffnesses
    bending = np.array([[d11, d12], [d12, d22]])
    return Section(bending, d66, plate.shear_stiffness, plate.mass_per_area, plate.rotary_inertia)


def added_section(plate: RectangularPlate, layer: Layer) -> Section:
    """What a layer adds to the section of a plate."""
    h, t = plate.thickness, layer.thickness
    z = 0.5 * (h + t)  # the sign drops out of B A^-1 B
    (p11, p12, p22, p66), (l11, l12, l22, l66) = plate.material.plane_stress, layer.material.plane_stress
    q_plate, q_layer = np.array([[p11, p12], [p12, p22]]), np.array([[l11, l12], [l12, l22]])
    stretch, coupling = q_plate * h + q_layer * t, q_layer * t * z
    bending = q_layer * (t**3 / 12.0 + t * z**2) - coupling @ np.linalg.solve(stretch, coupling)
    twisting = l66 * (t**3 / 12.0 + t * z**2) - (l66 * t * z) ** 2 / (p66 * h + l66 * t)
    shear = SHEAR_FACTOR * layer.material.in_plane_shear_modulus * t
    density = layer.material.density
    return Section(bending, twisting, shear, density * t, density * ((0.5 * h + t) ** 3 - (0.5 * h) ** 3) / 3.0)
