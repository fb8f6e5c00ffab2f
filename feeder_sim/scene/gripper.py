"""The fingers of a gripper: convex bodies that must not meet other parts while one is picked."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.part.mesh_file import MESH_SUFFIXES

CONVEX = 1.02  # volume of a finger's hull over its own, at most


@dataclass(frozen=True)
class Gripper:
    """Fingers around a part that lies at yaw 0, the centre of mass above the origin, the plate at z = 0.

    Attributes:
        fingers: corners of each, (n, 3) [m].
    """

    fingers: tuple[NDArray[np.float64], ...]

    def placed(self, place: NDArray[np.float64], yaw: float) -> Gripper:
        """The gripper around a part at a place (x, y, ...) [m] and a yaw [rad]."""
        c, s = np.cos(yaw), np.sin(yaw)
        turn, shift = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.array([place[0], place[1], 0.0])
        return Gripper(tuple(corners @ turn.T + shift for corners in self.fingers))

    def outlines(self, below: float) -> list[Any]:
        """Plan view of what of each finger is below a height [m]: shapely polygons, none for fingers above it."""
        return [polygon for corners in self.fingers if (polygon := _outline(corners, below)) is not None]


def _outline(corners: NDArray[np.float64], below: float) -> Any:
    """Plan view of what of a convex body, from its corners (n, 3) [m], is below a height [m]; None for nothing."""
    import shapely

    low = corners[:, 2] <= below
    if not low.any():
        return None
    points = [corners[low, :2]]
    if not low.all():  # a convex body is cut where lines between its corners are
        down, up = corners[low][:, None], corners[~low][None]
        share = (below - down[..., 2:]) / (up[..., 2:] - down[..., 2:])
        points.append((down[..., :2] + share * (up[..., :2] - down[..., :2])).reshape(-1, 2))
    return shapely.convex_hull(shapely.MultiPoint(np.concatenate(points)))


@functools.lru_cache(maxsize=16)
def read_gripper(path: Path) -> Gripper:
    """Read the fingers of a gripper from a mesh file in millimetres.

    Raises:
        InputError: it is missing, unreadable, holds no closed body, or one that is not convex.
    """
    import trimesh

    def refusal(problem: str) -> InputError:
        return InputError(problem, file=path, key="pick.shape")

    if path.suffix.lower() not in MESH_SUFFIXES:
        raise refusal(f"is {path.suffix!r}, allowed is {', '.join(MESH_SUFFIXES)}")
    if not path.is_file():
        raise refusal("no such mesh file")
    try:
        mesh = trimesh.load_mesh(path, resolver={}, skip_materials=True)
    except Exception as error:  # the readers of the formats raise what they like
        raise refusal(f"not a readable mesh: {error}") from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0 or not np.isfinite(mesh.vertices).all():
        raise refusal("holds no triangles")
    fingers = []
    for body in mesh.split(only_watertight=False):
        if not body.is_watertight:
            raise refusal("holds an open mesh, allowed are closed (watertight) bodies")
        hull = body.convex_hull
        if not hull.volume <= CONVEX * abs(body.volume):
            raise refusal(
                f"holds a body whose hull has {hull.volume / abs(body.volume):.2f} times its volume, allowed are "
                "convex bodies, one for each finger"
            )
        fingers.append(1e-3 * np.array(hull.vertices))
    return Gripper(tuple(fingers))
