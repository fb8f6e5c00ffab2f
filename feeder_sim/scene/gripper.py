"""The fingers of a gripper: convex bodies that must not meet other parts while one is picked."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.part.mesh_file import FLAT, SHORTEST_MM, Refusal, file_state, read_triangles

CONVEX = 1.02  # volume of a finger's hull over its own, at most
FARTHEST_MM = 1000.0  # from the origin, which is below the part
BELOW_MM = 0.01  # by which round-off in a drawing may put a finger below the plate


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


def read_gripper(path: Path, *, key: str = "pick.shape") -> Gripper:
    """Read the fingers of a gripper from a mesh file in millimetres.

    Args:
        path: of the file.
        key: of the scenario, for messages.

    Raises:
        InputError: it is missing, unreadable or too large, of an unlikely size, partly below the plate, or holds a body
            that is not closed, not convex, or flat.
    """
    return _read(path, file_state(path), key)


@functools.lru_cache(maxsize=16)  # it is read for every pick
def _read(path: Path, _: object, key: str) -> Gripper:
    """The gripper of a mesh file; `_` tells states of the file apart."""

    def refusal(problem: str) -> InputError:
        return InputError(problem, file=path, key=key)

    mesh = read_triangles(path, refusal)
    _check_size(np.asarray(mesh.vertices), refusal)
    fingers = tuple(1e-3 * _finger(body, refusal) for body in mesh.split(only_watertight=False))
    below = -float(mesh.vertices[:, 2].min())
    if below > BELOW_MM:
        raise refusal(
            f"reaches {below:.3g} mm below the plate, must be z >= 0: shift it, its origin is on the plate below "
            "the centre of the part"
        )
    return Gripper(fingers)


def _check_size(vertices: NDArray[np.float64], refusal: Refusal) -> None:
    """Refuse a size or a place (n, 3) [mm] that no gripper has, as in a file of another unit."""
    reach = float(np.linalg.norm(vertices, axis=1).max())
    if not reach <= FARTHEST_MM:
        raise refusal(
            f"reaches {reach:.4g} mm from its origin, must be up to {FARTHEST_MM:g} mm: write it in millimetres, "
            "with the origin below the part"
        )
    longest = float(np.ptp(vertices, axis=0).max())
    if longest < SHORTEST_MM:
        raise refusal(
            f"is {longest:.4g} mm long, must be at least {SHORTEST_MM:g} mm: write it in millimetres, not in metres"
        )


def _finger(body: Any, refusal: Refusal) -> NDArray[np.float64]:
    """Corners (n, 3) [mm] of a finger."""
    from scipy.spatial import QhullError

    if not body.is_watertight:
        raise refusal("holds an open mesh, must be closed (watertight) bodies")
    flat = "holds a body that encloses no volume, must be solid bodies, one for each finger"
    with np.errstate(divide="ignore", invalid="ignore"):  # its centre of mass, with the volume, divides by it
        volume = abs(float(body.volume))
    if not volume > FLAT * float(np.ptp(body.vertices, axis=0).prod()):
        raise refusal(flat)
    try:
        hull = body.convex_hull
    except QhullError as error:
        raise refusal(flat) from error
    if not hull.volume <= CONVEX * volume:
        raise refusal(
            f"holds a body whose hull has {hull.volume / volume:.2f} times its volume, must be convex bodies, one "
            "for each finger"
        )
    return np.array(hull.vertices)
