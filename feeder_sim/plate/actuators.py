"""Piezo patches: the force with which a bonded patch drives a mode.

A patch that wants to stretch by the strain e in both directions bends the plate with a line moment M [N] round its
edge. The modal force is

    F_j = M int (d beta_x / dx + d beta_y / dy) dA = M  closed line integral of beta . n ds

over the area of the patch (Crawley and de Luis, AIAA J. 25 (1987) 1373; Dimitriadis, Fuller and Rogers, J. Vib.
Acoust. 113 (1991) 100). M is positive for a patch below the plate that stretches. In a laminate without a force in the
plane, with N = E e t / (1 - nu) the force per length of the held patch, z its distance from the mid-plane, and A, B as
in feeder_sim.plate.ritz.attachments,

    M = N (z - B / A),    for a thin patch N (h + t) / 2,    e = d31 n V / t with n layers of ceramic.

The stress enters the patch over a short way from its edges. So it acts as if it were shorter by `shear_lag` at each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Layer

# Shear lag over the thickness of the plate, for a perfect bond and patches of a third to the whole of that thickness:
# plane elasticity gives 0.28 for a third, 0.30 for two thirds, 0.21 for the whole. Glue makes it longer.
SHEAR_LAG = 0.3
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
        shear_lag: by which the patch is shorter at each edge for its action [m].
        capacitance: of the clamped patch [F].
        loss_tangent: of its ceramic [1].
    """

    name: str
    layer: Layer
    moment_per_volt: float
    shear_lag: float = 0.0
    capacitance: float = 0.0
    loss_tangent: float = 0.0

    def force_per_volt(self, modes: Shapes) -> NDArray[np.float64]:
        """Modal force over the voltage [N/V] of every mode, shape (n_modes,)."""
        points, normals = edge_quadrature(self.layer, self.shear_lag)
        rotation = modes.evaluate_whole(points)[:, 1:]
        return -self.layer.side * self.moment_per_volt * np.einsum("mfp,pf->m", rotation, normals)


def modal_force_table(modes: Shapes, actuators: Sequence[Actuator]) -> NDArray[np.float64]:
    """Modal force over the voltage [N/V] of all modes and actuators, shape (n_modes, n_actuators)."""
    forces = [actuator.force_per_volt(modes) for actuator in actuators]
    return np.array(forces).reshape(len(forces), len(modes)).T


def edge_quadrature(layer: Layer, shortened: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (n, 2) [m] along the edges of a layer, and the outward normal times the length of each (n, 2) [m]."""
    nodes, weights = legendre.leggauss(EDGE_POINTS)
    start = layer.corners(shortened)
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
    held = np.array([l11 + l12, l12 + l22]) * t
    stretch = np.array([[p11, p12], [p12, p22]]) * h + np.array([[l11, l12], [l12, l22]]) * t
    coupling = np.array([[l11, l12], [l12, l22]]) * t * z
    return float((held * z - coupling @ np.linalg.solve(stretch, held)).mean())


def clamped_capacitance(layer: Layer, relative_permittivity: float, layers: int) -> float:
    """Capacitance [F] of a patch of so many layers of ceramic, which are connected in parallel."""
    area = layer.size[0] * layer.size[1]
    return relative_permittivity * VACUUM_PERMITTIVITY * area * layers**2 / layer.thickness
