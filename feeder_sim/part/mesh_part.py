"""Parts from a mesh file: mass properties of the solid, corners of its convex hull, in the axes of the file."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.part.pieces import read_pieces
from feeder_sim.part.rigid_part import LEVEL, RigidPart

MESH_SUFFIXES = (".stl", ".obj", ".ply", ".off")
FARTHEST_MM = 1e5  # as for all lengths of a scenario
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
        InputError: it is missing, unreadable, not closed, without volume or not one body; pieces that are not its own.
    """
    mesh = closed_mesh(path, unit_mm, key=key)
    held = [] if pieces is None else read_pieces(pieces, path, mesh)
    mesh.apply_scale(unit_mm * 1e-3)
    mesh.fix_normals()
    mesh.density = density
    if not mesh.volume > 0.0:
        raise InputError("encloses no volume", file=path, key=key)
    centre = np.array(mesh.center_mass, float)
    moments, axes = principal_axes(np.array(mesh.moment_inertia))
    try:
        hull = mesh.convex_hull
    except Exception as error:  # as flat as the round-off
        raise InputError("encloses no volume", file=path, key=key) from error
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


def closed_mesh(path: Path, unit_mm: float, *, key: str = "part.file") -> Any:
    """The one closed surface in a mesh file; what the file names besides, as colours and pictures, is left alone.

    Raises:
        InputError: it is missing, unreadable, empty, open, or of several bodies.
    """
    import trimesh

    def refusal(problem: str) -> InputError:
        return InputError(problem, file=path, key=key)

    if path.suffix.lower() not in MESH_SUFFIXES:
        raise refusal(f"is {path.suffix!r}, allowed is {', '.join(MESH_SUFFIXES)}")
    if not path.is_file():
        raise refusal("no such mesh file")
    try:
        with warnings.catch_warnings(action="ignore"):  # of numbers that are refused below
            mesh = trimesh.load_mesh(path, resolver={}, skip_materials=True)
    except ImportError as error:  # of a module that guesses the alphabet of a text
        raise refusal("not a readable mesh: damaged, or its text is not in UTF-8") from error
    except Exception as error:  # the readers of the formats raise what they like
        raise refusal(f"not a readable mesh: {error}") from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise refusal("holds no triangles")
    reach = float(np.abs(mesh.vertices).max()) * unit_mm
    if not reach <= FARTHEST_MM:
        raise refusal(f"reaches {reach:g} mm from its origin, allowed is up to {FARTHEST_MM:g} mm")
    if not mesh.is_watertight:
        raise refusal("is an open mesh, allowed is a closed (watertight) one")
    if mesh.body_count > 1:
        raise refusal(f"holds {mesh.body_count} bodies or cavities, allowed is one body without closed cavities")
    return mesh


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
