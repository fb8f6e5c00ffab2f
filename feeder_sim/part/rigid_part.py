"""A rigid part: mass and inertia about its centre of mass, contact corners and drawn mesh.

Everything is in the *part's axes*: those in which it was drawn, with the origin at the centre of mass. The principal
axes, in which engines compute, are turned against them by `principal_axes`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

# [m]; MuJoCo's corners are spheres of this radius, and so are all others: the part rides this much higher everywhere.
CORNER_RADIUS = 1e-6
STEADY = 1e9  # moments of inertia about axes that a part in a plane does not turn about, over the one it turns about
LEVEL = (1.0, 0.0, 0.0, 0.0)  # the quaternion of no turn


def _as_drawn() -> NDArray[np.float64]:
    return np.array(LEVEL)


@dataclass(frozen=True)
class RigidPart:
    """A rigid body, in its own axes, origin at the centre of mass.

    Attributes:
        name: for messages and the scene.
        mass: [kg].
        inertia: principal moments, shape (3,) [kg m^2].
        corners: points that can touch the plate, shape (n, 3) [m]; centres of a ball or of a dimer's balls.
        corner_radius: radius of the sphere around each corner [m], 0 for true corners.
        vertices, faces: closed mesh for drawing, shapes (n, 3) [m] and (m, 3).
        principal_axes: attitude of the principal axes in the part's axes, quaternion (4,), w first.
        centre: the centre of mass in the axes and from the origin of the file that it was drawn in, shape (3,) [m].
        corner_error: how far the hull of the corners lies below that of the mesh, at most [m].
        pieces: corners (n, 3) [m] of each convex piece that parts meet each other with; none: the hull of all corners.
        circle_radius: of a cylinder along z that meets the plate with the circles around its ends [m], on which its
            corners lie; 0 for what meets it with its corners.
        dropped_facets: of its mesh file, which have no area and are left out.
    """

    name: str
    mass: float
    inertia: NDArray[np.float64]
    corners: NDArray[np.float64]
    corner_radius: float
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    principal_axes: NDArray[np.float64] = field(default_factory=_as_drawn)
    centre: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    corner_error: float = 0.0
    pieces: tuple[NDArray[np.float64], ...] = ()
    circle_radius: float = 0.0
    dropped_facets: int = 0

    @property
    def size(self) -> float:
        """Largest distance of a surface point from the centre of mass [m]."""
        return float(np.linalg.norm(self.corners, axis=1).max() + self.corner_radius)

    @property
    def longest(self) -> float:
        """Largest extent along a principal axis [m]."""
        return float(np.ptp(self.in_principal_axes(self.corners), axis=0).max() + 2.0 * self.corner_radius)

    @property
    def thinnest(self) -> float:
        """Smallest extent along a principal axis [m]; that of a part in a plane lies in it."""
        extent = np.ptp(self.in_principal_axes(self.corners), axis=0)
        across = min((d for d in extent if d > 0.0), default=0.0) if self.corner_radius == 0.0 else extent.min()
        return float(across + 2.0 * self.corner_radius)

    @property
    def is_turned(self) -> bool:
        """Whether its principal axes are not the ones it was drawn in."""
        return tuple(self.principal_axes.tolist()) != LEVEL

    def lowest(self, quaternion: NDArray[np.float64]) -> float:
        """Height of the lowest point relative to the centre of mass [m] at an attitude (w first)."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_quat(quaternion, scalar_first=True)
        if self.circle_radius > 0.0:
            x, y, z = turn.as_matrix()[2]
            return float(-self.circle_radius * math.hypot(x, y) - self.corners[:, 2].max() * abs(z))
        turned = turn.apply(self.corners)
        return float(turned[:, 2].min() - self.corner_radius)

    def in_principal_axes(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) [m] of the part's axes, in its principal axes."""
        if not self.is_turned:
            return points
        from scipy.spatial.transform import Rotation

        inverse = Rotation.from_quat(self.principal_axes, scalar_first=True).inv()
        return np.ascontiguousarray(inverse.apply(points)) if len(points) else points

    def principal_attitude(self, quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
        """Attitude (..., 4) of its principal axes, from that of the part; w first."""
        return _turned(quaternion, self.principal_axes) if self.is_turned else quaternion

    def attitude(self, principal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Attitude (..., 4) of the part, from that of its principal axes; w first."""
        if not self.is_turned:
            return principal
        w, x, y, z = self.principal_axes
        return _turned(principal, np.array([w, -x, -y, -z]))


def _turned(quaternion: NDArray[np.float64], turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Hamilton product quaternion (..., 4) * turn (4,), w first."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, float), -1, 0)
    a, b, c, d = turn
    return np.stack(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ],
        axis=-1,
    )


def outline(part: RigidPart, yaw: float) -> RigidPart:
    """The part reduced to its outline in the plane y = 0, turned by a yaw [rad] before: corners (n, 3) with y = 0.

    Forces at such corners have no moment about x and z where the surface does not depend on y. The large moments of
    inertia about these axes keep round-off from tipping the part over, which stands on its outline like a coin.
    """
    from scipy.spatial.transform import Rotation

    turn = np.array([[math.cos(yaw), -math.sin(yaw), 0.0], [math.sin(yaw), math.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    corners = part.corners @ turn.T
    flat = np.unique(np.column_stack([corners[:, 0], 0.0 * corners[:, 1], corners[:, 2]]).round(9), axis=0) + 0.0
    axes = turn
    if part.is_turned:
        axes = turn @ Rotation.from_quat(part.principal_axes, scalar_first=True).as_matrix()
    about_y = float((axes @ np.diag(part.inertia) @ axes.T)[1, 1])
    moments = np.array([STEADY * about_y, about_y, STEADY * about_y])
    return replace(
        part,
        corners=flat,
        inertia=moments,
        vertices=part.vertices @ turn.T,
        principal_axes=_as_drawn(),
        pieces=(),
        circle_radius=0.0,
    )
