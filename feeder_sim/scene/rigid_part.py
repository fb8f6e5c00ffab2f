"""Rigid parts: contact corners, drawn mesh, mass and inertia about the centre of mass, in principal axes.

Formulas: regular hexagon of circumradius R, area 3 sqrt(3)/2 R^2, polar second moment 5 sqrt(3)/8 R^4; the bore is
taken out of mass and inertia. Nut dimensions: ISO 4032 (width across flats s, largest height m), bore = nominal size.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.scenario import Ball, Cylinder, HexNut, MeshPart, PartSpec, resolve_material

MESH_SUFFIXES = (".stl", ".obj", ".ply", ".off")
# size: (across flats, height, bore) [mm]
ISO_4032 = {
    "M2": (4.0, 1.6, 2.0),
    "M2.5": (5.0, 2.0, 2.5),
    "M3": (5.5, 2.4, 3.0),
    "M4": (7.0, 3.2, 4.0),
    "M5": (8.0, 4.7, 5.0),
}
LEAST_INERTIA = 1e-15  # [kg], [kg m^2]: what MuJoCo takes for zero; a steel ball of 0.3 mm has just more
RIM_CORNERS = 32  # per rim of a cylinder, where it touches with corners: 0.5 % of the radius inside it, at most
STEADY = 1e9  # moments of inertia about axes that a part in a plane does not turn about, over the one it turns about
# [m]; MuJoCo's corners are spheres of this radius, and so are all others: the part rides this much higher everywhere.
CORNER_RADIUS = 1e-6
FARTHEST_MM = 1e5  # as for all lengths of a scenario
MAX_CORNERS = 64  # hull vertices beyond this many add cost and no contact


@dataclass(frozen=True)
class RigidPart:
    """A rigid body in its principal frame, origin at the centre of mass.

    Attributes:
        name: for messages and the scene.
        mass: [kg].
        inertia: principal moments, shape (3,) [kg m^2].
        corners: points that can touch the plate, shape (n, 3) [m]; one point at the origin for a ball.
        corner_radius: radius of the sphere around each corner [m], 0 for true corners.
        vertices, faces: closed mesh for drawing, shapes (n, 3) [m] and (m, 3).
        circle_radius: of a cylinder along z that meets the plate with the circles around its ends [m], on which its
            corners lie; 0 for what meets it with its corners.
    """

    name: str
    mass: float
    inertia: NDArray[np.float64]
    corners: NDArray[np.float64]
    corner_radius: float
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    circle_radius: float = 0.0

    @property
    def size(self) -> float:
        """Largest distance of a surface point from the centre of mass [m]."""
        return float(np.linalg.norm(self.corners, axis=1).max() + self.corner_radius)

    @property
    def longest(self) -> float:
        """Largest extent along a principal axis [m]."""
        return float(np.ptp(self.corners, axis=0).max() + 2.0 * self.corner_radius)

    @property
    def thinnest(self) -> float:
        """Smallest extent along a principal axis [m]; that of a part in a plane lies in it."""
        extent = np.ptp(self.corners, axis=0)
        return float(min((d for d in extent if d > 0.0), default=0.0) + 2.0 * self.corner_radius)

    def lowest(self, quaternion: NDArray[np.float64]) -> float:
        """Height of the lowest point relative to the centre of mass [m] at an attitude (w first)."""
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_quat(quaternion, scalar_first=True).apply(self.corners)
        if self.circle_radius > 0.0:
            x, y, z = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()[2]
            return float(-self.circle_radius * math.hypot(x, y) - self.corners[:, 2].max() * abs(z))
        return float(turned[:, 2].min() - self.corner_radius)


def outline(part: RigidPart, yaw: float) -> RigidPart:
    """The part reduced to its outline in the plane y = 0, turned by a yaw [rad] before: corners (n, 3) with y = 0.

    Forces at such corners have no moment about x and z where the surface does not depend on y. The large moments of
    inertia about these axes keep round-off from tipping the part over, which stands on its outline like a coin.
    """
    turn = np.array([[math.cos(yaw), -math.sin(yaw), 0.0], [math.sin(yaw), math.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    corners = part.corners @ turn.T
    flat = np.unique(np.column_stack([corners[:, 0], 0.0 * corners[:, 1], corners[:, 2]]).round(9), axis=0) + 0.0
    about_y = float((turn @ np.diag(part.inertia) @ turn.T)[1, 1])
    moments = np.array([STEADY * about_y, about_y, STEADY * about_y])
    return replace(part, corners=flat, inertia=moments, vertices=part.vertices @ turn.T, circle_radius=0.0)


def build_part(spec: PartSpec, *, name: str = "part") -> RigidPart:
    """Turn a part of the scenario into a rigid body.

    Raises:
        InputError: a mesh file that is missing, unreadable, not closed or without volume; a part too small.
    """
    part = _shaped(spec, resolve_material(spec.material).density, name)
    if spec.guide is not None:  # the wall of a tube is met with corners
        part = replace(part, circle_radius=0.0)
    if min(part.mass, part.inertia.min()) < LEAST_INERTIA:
        raise InputError(
            f"has a mass of {part.mass:.3g} kg and a moment of inertia of {part.inertia.min():.3g} kg m2, allowed is "
            f"at least {LEAST_INERTIA:g} each (MuJoCo's limit)",
            key="part",
        )
    return part


def _shaped(spec: PartSpec, density: float, name: str) -> RigidPart:
    if isinstance(spec, HexNut):
        return hex_nut(spec, density, name)
    if isinstance(spec, Ball):
        return ball(spec.diameter_mm * 1e-3, density, name)
    if isinstance(spec, Cylinder):
        return cylinder(spec.diameter_mm * 1e-3, spec.height_mm * 1e-3, density, name)
    return mesh_part(spec, density, name)


def hex_nut(spec: HexNut, density: float, name: str) -> RigidPart:
    """Hexagonal prism with a cylindrical bore along z; the corners are those of the prism."""
    across, height, bore = (1e-3 * d for d in nut_dimensions(spec))
    radius = across / math.sqrt(3.0)
    area = 1.5 * math.sqrt(3.0) * radius**2
    prism, core = density * area * height, density * math.pi * bore**2 / 4.0 * height
    polar = 5.0 * math.sqrt(3.0) / 8.0 * radius**4 / area  # of the hexagon, per unit mass
    axial = prism * polar - core * bore**2 / 8.0
    transverse = prism * (polar / 2.0 + height**2 / 12.0) - core * (bore**2 / 16.0 + height**2 / 12.0)
    angle = np.arange(6) * math.pi / 3.0
    rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners = np.concatenate([np.column_stack([rim, np.full(6, z)]) for z in (-height / 2, height / 2)])
    vertices, faces = _ring_mesh(rim, bore / 2.0, height)
    inertia = np.array([transverse, transverse, axial])
    return RigidPart(name, prism - core, inertia, corners, 0.0, vertices, faces)


def nut_dimensions(spec: HexNut) -> tuple[float, float, float]:
    """Across flats, height, bore [mm]."""
    if spec.size is not None:
        return ISO_4032[spec.size]
    assert spec.across_flats_mm is not None and spec.height_mm is not None and spec.bore_mm is not None
    return spec.across_flats_mm, spec.height_mm, spec.bore_mm


def ball(diameter: float, density: float, name: str) -> RigidPart:
    """Solid sphere."""
    import trimesh

    radius = diameter / 2.0
    mass = density * 4.0 / 3.0 * math.pi * radius**3
    drawn = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    inertia = np.full(3, 0.4 * mass * radius**2)
    return RigidPart(name, mass, inertia, np.zeros((1, 3)), radius, np.array(drawn.vertices), np.array(drawn.faces))


def cylinder(diameter: float, height: float, density: float, name: str) -> RigidPart:
    """Solid circular cylinder along z, touching with both rims, or at corners around them."""
    radius = diameter / 2.0
    mass = density * math.pi * radius**2 * height
    transverse = mass * (3.0 * radius**2 + height**2) / 12.0
    angle = 2.0 * math.pi * np.arange(RIM_CORNERS) / RIM_CORNERS
    rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners = np.concatenate([np.column_stack([rim, np.full(RIM_CORNERS, z)]) for z in (-height / 2, height / 2)])
    vertices, faces = _ring_mesh(rim, 0.0, height)
    inertia = np.array([transverse, transverse, mass * radius**2 / 2.0])
    return RigidPart(name, mass, inertia, corners, 0.0, vertices, faces, radius)


def mesh_part(spec: MeshPart, density: float, name: str) -> RigidPart:
    """Any closed mesh: mass properties of the solid, corners of its convex hull."""
    mesh = _closed_mesh(spec)
    mesh.apply_scale(spec.file_unit_mm * 1e-3)
    mesh.fix_normals()
    mesh.density = density
    if not mesh.volume > 0.0:
        raise InputError("encloses no volume", file=spec.file, key="part.file")
    moments, axes = np.linalg.eigh(np.array(mesh.moment_inertia))
    rotation = axes.T if np.linalg.det(axes) > 0 else -axes.T
    vertices = (np.array(mesh.vertices) - mesh.center_mass) @ rotation.T
    try:
        hull = mesh.convex_hull
    except Exception as error:  # as flat as the round-off
        raise InputError("encloses no volume", file=spec.file, key="part.file") from error
    corners = spread_corners((np.array(hull.vertices) - mesh.center_mass) @ rotation.T)
    return RigidPart(name, float(mesh.mass), moments, corners, 0.0, vertices, np.array(mesh.faces))


def _closed_mesh(spec: MeshPart) -> Any:
    """The one closed surface in a mesh file; what the file names besides, as colours and pictures, is left alone.

    Raises:
        InputError: it is missing, unreadable, empty, open, or of several bodies.
    """
    import trimesh

    def refusal(problem: str) -> InputError:
        return InputError(problem, file=spec.file, key="part.file")

    if spec.file.suffix.lower() not in MESH_SUFFIXES:
        raise refusal(f"is {spec.file.suffix!r}, allowed is {', '.join(MESH_SUFFIXES)}")
    if not spec.file.is_file():
        raise refusal("no such mesh file")
    try:
        with warnings.catch_warnings(action="ignore"):  # of numbers that are refused below
            mesh = trimesh.load_mesh(spec.file, resolver={}, skip_materials=True)
    except ImportError as error:  # of a module that guesses the alphabet of a text
        raise refusal("not a readable mesh: damaged, or its text is not in UTF-8") from error
    except Exception as error:  # the readers of the formats raise what they like
        raise refusal(f"not a readable mesh: {error}") from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise refusal("holds no triangles")
    reach = float(np.abs(mesh.vertices).max()) * spec.file_unit_mm
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


def _ring_mesh(
    rim: NDArray[np.float64], bore_radius: float, height: float, per_side: int = 8
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Closed mesh of a prism over a convex outline (n, 2) with a round bore; radius 0 closes it to the axis."""
    sides = len(rim)
    fraction = np.arange(per_side) / per_side
    outline = np.concatenate([rim[i] + fraction[:, None] * (rim[(i + 1) % sides] - rim[i]) for i in range(sides)])
    inner = bore_radius * outline / np.linalg.norm(outline, axis=1, keepdims=True)
    n = len(outline)
    rings = [(outline, -height / 2), (outline, height / 2), (inner, height / 2), (inner, -height / 2)]
    vertices = np.concatenate([np.column_stack([ring, np.full(n, z)]) for ring, z in rings])
    faces = []
    for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)):
        i, j = np.arange(n), (np.arange(n) + 1) % n
        faces += [
            np.column_stack([a * n + i, a * n + j, b * n + j]),
            np.column_stack([a * n + i, b * n + j, b * n + i]),
        ]
    import trimesh

    mesh = trimesh.Trimesh(vertices, np.concatenate(faces), process=True)
    mesh.update_faces(mesh.nondegenerate_faces())
    return np.array(mesh.vertices), np.array(mesh.faces)
