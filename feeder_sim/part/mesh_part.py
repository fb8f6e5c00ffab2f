"""Parts from a mesh file: mass properties of the solid, corners of its convex hull, in the axes of the file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.part.mesh_file import closed_mesh
from feeder_sim.part.pieces import read_pieces
from feeder_sim.part.rigid_part import LEVEL, RigidPart

MAX_CORNERS = 64  # hull vertices beyond this many add cost and no contact
ALIGNED = 1e-9  # of a moment of inertia over the largest: products of inertia that small are round-off


def mesh_part(
    path: Path, unit_mm: float, density: float, name: str, *, pieces: Path | None = None, key: str = "part.file"
) -> RigidPart:
    """A part from a file with one closed mesh; `key` names the file in messages.

    Args:
        path: of the file.
        unit_mm: its unit of length [mm].
        density: [kg/m^3].
        name: of the part.
        pieces: file of its convex pieces, by which parts meet each other; without it they do by its hull.
        key: of the scenario.

    Raises:
        InputError: the file is not one closed body of a likely size (mesh_file.py); pieces that are not its own.
    """
    mesh = closed_mesh(path, unit_mm, key=key)
    held = [] if pieces is None else read_pieces(pieces, path, mesh)
    mesh.apply_scale(unit_mm * 1e-3)
    mesh.density = density
    centre = np.array(mesh.center_mass, float)
    moments, axes = principal_axes(np.array(mesh.moment_inertia))
    hull = mesh.convex_hull
    return RigidPart(
        name,
        float(mesh.mass),
        moments,
        spread_corners(np.array(hull.vertices) - centre),
        0.0,
        np.array(mesh.vertices) - centre,
        np.array(mesh.faces),
        principal_axes=axes,
        centre=centre,
        pieces=tuple(spread_corners(points * unit_mm * 1e-3 - centre) for points in held),
    )


@dataclass(frozen=True)
class Solid:
    """Volume of the drawn mesh of a part [m^3], and that of its convex hull over it [1]."""

    volume: float
    hull_over_volume: float


def solid(part: RigidPart) -> Solid:
    """What the drawn mesh of a part encloses."""
    from scipy.spatial import ConvexHull

    a, b, c = np.moveaxis(part.vertices[part.faces], 1, 0)
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)
    size = part.size
    return Solid(volume, float(ConvexHull(part.vertices / size).volume) * size**3 / volume)


def principal_axes(tensor: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Principal moments (3,) of an inertia tensor (3, 3), and the attitude of its principal axes (4,), w first.

    Of a tensor that is diagonal but for round-off, as of a part drawn along its axes, these axes stay.
    """
    from scipy.spatial.transform import Rotation

    if np.abs(tensor - np.diag(np.diag(tensor))).max() <= ALIGNED * np.diag(tensor).max():
        return np.diag(tensor).copy(), np.array(LEVEL)
    moments, axes = np.linalg.eigh(tensor)
    axes = axes if np.linalg.det(axes) > 0 else -axes
    return moments, np.asarray(Rotation.from_matrix(axes).as_quat(scalar_first=True))


def spread_corners(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Keep at most MAX_CORNERS hull vertices, each the farthest from those kept before it."""
    if len(points) <= MAX_CORNERS:
        return points
    kept = [int(np.argmax(np.linalg.norm(points, axis=1)))]
    distance = np.linalg.norm(points - points[kept[0]], axis=1)
    while len(kept) < MAX_CORNERS:
        kept.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[kept[-1]], axis=1))
    return points[np.sort(kept)]
