"""Piezo patches: the force with which a bonded patch drives a mode.

A patch that wants to stretch by the strain e in both directions bends the plate with a line moment M [N] round its
edge. The modal force is

    F_j = M int (d beta_x / dx + d beta_y / dy) dA = M  closed line integral of beta . n ds

over the area of the patch (Crawley and de Luis, AIAA J. 25 (1987) 1373; Dimitriadis, Fuller and Rogers, J. Vib.
Acoust. 113 (1991) 100). M is positive for a patch below the plate that stretches. In a laminate without a force in the
plane, with N = E e t / (1 - nu) the force per length of the held patch, z its distance from the mid-plane, and A, B as
in feeder_sim.plate.ritz.attachments,

    M = N (z - B / A),    for a thin patch N (h + t) / 2,    e = d31 n V / t with n layers of ceramic.

Two factors go with it:

- The *bond*. The stress enters the patch over a length from its edges, by shear of the glue and of the ceramic (Crawley
  and de Luis, as above; the ceramic: Suhir, J. Appl. Mech. 53 (1986) 657). See `bond_share`.
- The *stiffness* of the patch. M acts on the plate that the patch makes stiffer. On the modes of the bare plate, which
  bends more there, it has to be smaller by `share_of_curvature`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Layer

PERFECT_BOND = 0.0  # slip over shear stress [m/Pa]: thickness over shear modulus of the glue
LAGGING_BOND = 100e-6 / 0.5e9  # a thick line, 0.1 mm, of a tough adhesive, 0.5 GPa
D31_TOLERANCE = 1.1  # factor; data sheets promise 5 to 10 %
# Three numbers by finite elements of plate, glue and patch: slip of the ceramic over its shear stress, in thickness
# over shear modulus (1/3 in Suhir's theory); and the disc whose bond is that of a rectangle: by how much of the plate's
# thickness its radius is smaller, and the power of the ratio of the sides with which it is larger.
CERAMIC_SLIP, EDGE_LOSS, LONGER = 0.44, 0.13, 0.2
LONGEST = 4.0
EDGE_POINTS = 24  # of the line integral along an edge; exact for polynomials of degree 47
VACUUM_PERMITTIVITY = 8.8541878128e-12  # [F/m]


class Shapes(Protocol):
    """Modes of a plate, known where patches are."""

    def __len__(self) -> int: ...

    def evaluate_whole(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(w [1], beta_x, beta_y [1/m]) of all modes at points (n, 2) [m], shape (n_modes, 3, n)."""
        ...


@dataclass(frozen=True)
class Actuator:
    """A piezo patch bonded to a plate.

    Attributes:
        name: by which a drive names it.
        layer: the patch as a layer of the plate.
        moment_per_volt: line moment M over the voltage [N/V], both as amplitudes.
        moment_spread: factor by which that may be larger or smaller [1]; 1 of a calibrated one.
        capacitance: of the clamped patch [F].
        loss_tangent: of its ceramic [1].
    """

    name: str
    layer: Layer
    moment_per_volt: float
    moment_spread: float = 1.0
    capacitance: float = 0.0
    loss_tangent: float = 0.0

    def force_per_volt(self, modes: Shapes) -> NDArray[np.float64]:
        """Modal force over the voltage [N/V] of every mode, shape (n_modes,)."""
        points, normals = edge_quadrature(self.layer)
        rotation = modes.evaluate_whole(points)[:, 1:]
        return -self.layer.side * self.moment_per_volt * np.einsum("mfp,pf->m", rotation, normals)


def modal_force_table(modes: Shapes, actuators: Sequence[Actuator]) -> NDArray[np.float64]:
    """Modal force over the voltage [N/V] of all modes and actuators, shape (n_modes, n_actuators)."""
    forces = [actuator.force_per_volt(modes) for actuator in actuators]
    return np.array(forces).reshape(len(forces), len(modes)).T


def edge_quadrature(layer: Layer) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (n, 2) [m] along the edges of a layer, and the outward normal times the length of each (n, 2) [m]."""
    nodes, weights = legendre.leggauss(EDGE_POINTS)
    start = layer.corners()
    along = np.roll(start, -1, axis=0) - start
    points = start[:, None] + 0.5 * (1.0 + nodes)[:, None] * along[:, None]
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return points.reshape(-1, 2), (0.5 * weights[:, None] * outward[:, None]).reshape(-1, 2)


def moment_of_strain(plate: RectangularPlate, layer: Layer) -> float:
    """Line moment M [N] of a layer over the strain that it would have if it were free [1].

    On an orthotropic plate it is the mean of both directions.
    """
    h, t = plate.thickness, layer.thickness
    z = 0.5 * (h + t)
    (p11, p12, p22, _), (l11, l12, l22, _) = plate.material.plane_stress, layer.material.plane_stress
    blocked_force = np.array([l11 + l12, l12 + l22]) * t
    stretch = np.array([[p11, p12], [p12, p22]]) * h + np.array([[l11, l12], [l12, l22]]) * t
    coupling = np.array([[l11, l12], [l12, l22]]) * t * z
    return float((blocked_force * z - coupling @ np.linalg.solve(stretch, blocked_force)).mean())


def moment_of_voltage(
    plate: RectangularPlate, layer: Layer, strain_per_volt: float, *, slip: float | None, loaded: bool
) -> tuple[float, float]:
    """Line moment over the voltage [N/V], and the factor by which it may be larger or smaller.

    Args:
        plate: the plate.
        layer: the patch.
        strain_per_volt: of the free patch [1/V].
        slip: of the glue over its shear stress [m/Pa]; None: anything between `PERFECT_BOND` and `LAGGING_BOND`.
        loaded: whether the modes that it drives are those of the plate with the patch.
    """
    shares = [bond_share(plate, layer, each) for each in ((PERFECT_BOND, LAGGING_BOND) if slip is None else (slip,))]
    moment = moment_of_strain(plate, layer) * strain_per_volt * math.sqrt(shares[0] * shares[-1])
    if not loaded:
        moment *= share_of_curvature(plate, layer)
    return moment, D31_TOLERANCE * math.sqrt(shares[0] / shares[-1])


@dataclass(frozen=True)
class _Bonded:
    """Plate and patch in plane stress, isotropic, directions of an orthotropic plate averaged; in SI units."""

    modulus: tuple[float, float]  # E / (1 - nu^2) of plate and patch
    poisson: tuple[float, float]
    thickness: tuple[float, float]

    @property
    def apart(self) -> float:
        """Distance of their middles."""
        return 0.5 * sum(self.thickness)

    @property
    def stretch(self) -> tuple[float, float]:
        """Stiffness of each against stretch."""
        return self.modulus[0] * self.thickness[0], self.modulus[1] * self.thickness[1]

    @property
    def bending(self) -> tuple[float, float]:
        """Stiffness of each against bending about its own middle."""
        return self.stretch[0] * self.thickness[0] ** 2 / 12.0, self.stretch[1] * self.thickness[1] ** 2 / 12.0

    @property
    def biaxial(self) -> tuple[float, float]:
        """1 + nu of each: stiffness in both directions at once over that in one."""
        return 1.0 + self.poisson[0], 1.0 + self.poisson[1]

    @property
    def moment(self) -> float:
        """Moment that both directions of stretch of the patch by 1 make."""
        plate, patch = (a * b for a, b in zip(self.stretch, self.biaxial, strict=True))
        return self.apart * plate * patch / (plate + patch)

    @property
    def share_in_disc(self) -> float:
        """Curvature of a round patch over that of the plate far away."""
        (d, d_patch), (b, b_patch) = self.bending, self.biaxial
        return 2.0 * d / ((1.0 - self.poisson[0]) * d + b * d + b_patch * d_patch + self.moment * self.apart)


def _bonded(plate: RectangularPlate, layer: Layer) -> _Bonded:
    (p11, p12, p22, _), (l11, l12, l22, _) = plate.material.plane_stress, layer.material.plane_stress
    q, q_layer = 0.5 * (p11 + p22), 0.5 * (l11 + l22)
    return _Bonded((q, q_layer), (p12 / q, l12 / q_layer), (plate.thickness, layer.thickness))


def _elongation(layer: Layer) -> float:
    """Ratio of the sides of a patch, up to that for which it was compared with finite elements."""
    return min(max(layer.size) / min(layer.size), LONGEST)


def share_of_curvature(plate: RectangularPlate, layer: Layer) -> float:
    """Curvature of the plate under a layer over that of the bare plate, mean of both directions [1].

    In a round inclusion (Kirchhoff's equation outside, w ~ r^2 within; deflection, slope and moment continuous) it is
    2 D / ((1 - nu) D + K), with K the stiffness of plate and layer against bending in both directions at once. What a
    rectangle adds to that was taken from finite elements (tests/verification/test_patch_moment.py).
    """
    disc, sides = _bonded(plate, layer).share_in_disc, _elongation(layer)
    return disc * (1.0 + (1.0 - disc) ** 2 * (0.05 + 0.13 * (sides + 1.0 / sides - 2.0)))


def bond_share(plate: RectangularPlate, layer: Layer, slip: float) -> float:
    """Share of its action that a patch keeps behind glue that slips by `slip` over its shear stress [m/Pa].

    That of a disc. The slip between patch and plate is s = C I1(r / l), with l^2 (1 / A_plate + 1 / A_patch + z^2 / D)
    the slip of the whole bond over its stress, A = E t / (1 - nu^2) and D the sum of both bending stiffnesses. No force
    acts at the edge of the patch; forces, moments, displacements and slopes go on into the plate around it, which is
    bent by 1 in all directions far away.
    """
    from scipy.special import ive

    two = _bonded(plate, layer)
    (a, a_patch), (d, d_patch), (b, b_patch), z = two.stretch, two.bending, two.biaxial, two.apart
    slip += CERAMIC_SLIP * layer.thickness / layer.material.in_plane_shear_modulus
    area = layer.size[0] * layer.size[1]
    radius = max(math.sqrt(area / math.pi) * _elongation(layer) ** LONGER - EDGE_LOSS * plate.thickness, EDGE_LOSS * z)
    lag = math.sqrt(slip / (1.0 / a + 1.0 / a_patch + z * z / (d + d_patch)))
    grows = ive(0, radius / lag) / ive(1, radius / lag) / lag - 1.0 / radius  # slope of s at the edge over s [1/m]
    edge, edge_patch = (grows + nu / radius for nu in two.poisson)
    # Unknown: strain of patch and plate without the slip; force by it; displacement and slope that the plate around
    # takes on. Rows: no force on the patch; force, displacement, slope and moment are those of the plate around it.
    force = lag * lag / radius
    rows = [
        [a_patch * b_patch, 0.0, force * edge_patch * radius, 0.0, 0.0],
        [0.0, a * b, -force * edge * radius, a * (1.0 - two.poisson[0]), 0.0],
        [0.0, 1.0, -force / a, -1.0, 0.0],
        [-1.0 / z, 1.0 / z, force * z / (d + d_patch), 0.0, -1.0],
        [
            -(d * b + d_patch * b_patch) / z,
            (d * b + d_patch * b_patch) / z,
            force * radius * z / (d + d_patch) * (d * edge + d_patch * edge_patch),
            0.0,
            d * (1.0 - two.poisson[0]),
        ],
    ]
    scale = np.array([1.0, 1.0, 1.0 / force, 1.0, 1.0])
    strain, _, shear, _, _ = scale * np.linalg.solve(np.array(rows) * scale, [0.0, 0.0, 0.0, 1.0, d * b])
    resultant = a_patch * b_patch * (strain + force * shear / a_patch)  # of the stress in the patch, its mean
    return float(abs(resultant) / (two.moment * two.share_in_disc))


def clamped_capacitance(layer: Layer, relative_permittivity: float, layers: int) -> float:
    """Capacitance [F] of a patch of so many layers of ceramic, which are connected in parallel."""
    area = layer.size[0] * layer.size[1]
    return relative_permittivity * VACUUM_PERMITTIVITY * area * layers**2 / layer.thickness
