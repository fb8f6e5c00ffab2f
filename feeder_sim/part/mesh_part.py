"""Parts from a mesh file: mass properties of the solid, corners of its convex hull, in the axes of the file."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.part.corners import contact_corners
from feeder_sim.part.mesh_file import closed_mesh, file_state
from feeder_sim.part.pieces import pieces_beside, read_pieces
from feeder_sim.part.rigid_part import LEVEL, RigidPart

CONVEX = 1.0 + 1e-4  # hull over volume of a mesh that is taken for convex
BODY_ERROR = 1e-6  # [m]; how far corners of bodies that stand may lie below their mesh
ALIGNED = 1e-9  # of a moment of inertia over the largest: products of inertia that small are round-off


def mesh_part(
    path: Path,
    unit_mm: float,
    density: float,
    name: str,
    *,
    corner_error: float = 0.0,
    pieces: Path | None = None,
    key: str = "part.file",
) -> RigidPart:
    """A part from a file with one closed mesh.

    Args:
        path: of the file.
        unit_mm: its unit of length [mm].
        density: [kg/m^3].
        name: of the part.
        corner_error: how far the hull of its corners may lie below that of the mesh [m].
        pieces: file of its convex pieces, by which parts meet each other; without it they do by its hull.
        key: of the scenario, for messages.

    Raises:
        InputError: the file is not one closed body of a likely size (mesh_file.py); pieces that are not its own.
    """
    read = _read if path.is_file() else _read.__wrapped__  # which says that there is none
    part: RigidPart = read(path, file_state(path), unit_mm, density, corner_error, pieces, file_state(pieces), key)
    return replace(part, name=name)


@functools.lru_cache(maxsize=16)  # scenes are built many times of the same parts
def _read(
    path: Path,
    _: object,
    unit_mm: float,
    density: float,
    corner_error: float,
    pieces: Path | None,
    __: object,
    key: str,
) -> RigidPart:
    """The part of a mesh file; `_` and `__` tell states of the files apart."""
    mesh = closed_mesh(path, unit_mm, key=key)
    piece_vertices = [] if pieces is None else read_pieces(pieces, path, mesh)
    mesh.apply_scale(unit_mm * 1e-3)
    mesh.density = density
    centre = np.array(mesh.center_mass, float)
    moments, axes = principal_axes(np.array(mesh.moment_inertia))
    corners, error = contact_corners(np.array(mesh.convex_hull.vertices) - centre, corner_error)
    return RigidPart(
        path.stem,
        float(mesh.mass),
        moments,
        corners,
        0.0,
        np.array(mesh.vertices) - centre,
        np.array(mesh.faces),
        principal_axes=axes,
        centre=centre,
        corner_error=error,
        dropped_facets=mesh.metadata["dropped_facets"],
        pieces=tuple(_thinned(1e-3 * unit_mm * points - centre, corner_error) for points in piece_vertices),
    )


def mesh_bodies(path: Path, unit_mm: float, *, pieces: Path | None, key: str) -> list[NDArray[np.float64]]:
    """Corners (n, 3) [m] of the convex bodies of a mesh, in the axes of its file: its hull, or pieces of a concave one.

    Raises:
        InputError: as for `mesh_part`.
    """
    mesh = closed_mesh(path, unit_mm, key=key)
    if pieces is None and mesh.convex_hull.volume <= CONVEX * mesh.volume:
        bodies = [np.array(mesh.convex_hull.vertices)]
    else:
        bodies = read_pieces(pieces or pieces_beside(path), path, mesh, key=key)
    return [_thinned(1e-3 * unit_mm * points, BODY_ERROR) for points in bodies]


def _thinned(points: NDArray[np.float64], error: float) -> NDArray[np.float64]:
    """Corners of a convex piece, (n, 3) [m], to an error [m]."""
    middle = points.mean(axis=0)
    return contact_corners(points - middle, error)[0] + middle


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
