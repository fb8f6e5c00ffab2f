"""Parts by dimensions: nuts, balls, cylinders, blocks, dimers; their principal axes are those they are drawn in.

Formulas: regular hexagon of circumradius R, area 3 sqrt(3)/2 R^2, polar second moment 5 sqrt(3)/8 R^4; the bore is
taken out of mass and inertia. Nut dimensions: ISO 4032 (width across flats s, largest height m), bore = nominal size.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.part.drawing import BLOCK_FACES, RIM_CORNERS, ball_mesh, circle, ring_mesh
from feeder_sim.part.rigid_part import RigidPart

# size: (across flats, height, bore) [mm]
ISO_4032 = {
    "M2": (4.0, 1.6, 2.0),
    "M2.5": (5.0, 2.0, 2.5),
    "M3": (5.5, 2.4, 3.0),
    "M4": (7.0, 3.2, 4.0),
    "M5": (8.0, 4.7, 5.0),
}


def hex_nut(across: float, height: float, bore: float, density: float, name: str) -> RigidPart:
    """Hexagonal prism with a cylindrical bore along z; the corners are those of the prism.

    Width across flats, height, bore [m]; density [kg/m^3].
    """
    radius = across / math.sqrt(3.0)
    area = 1.5 * math.sqrt(3.0) * radius**2
    prism, core = density * area * height, density * math.pi * bore**2 / 4.0 * height
    polar = 5.0 * math.sqrt(3.0) / 8.0 * radius**4 / area  # of the hexagon, per unit mass
    axial = prism * polar - core * bore**2 / 8.0
    transverse = prism * (polar / 2.0 + height**2 / 12.0) - core * (bore**2 / 16.0 + height**2 / 12.0)
    angle = np.arange(6) * math.pi / 3.0
    rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners = np.concatenate([np.column_stack([rim, np.full(6, z)]) for z in (-height / 2, height / 2)])
    vertices, faces = ring_mesh(rim, bore / 2.0, height)
    inertia = np.array([transverse, transverse, axial])
    return RigidPart(name, prism - core, inertia, corners, 0.0, vertices, faces)


def ball(diameter: float, density: float, name: str) -> RigidPart:
    """Solid sphere of a diameter [m] and a density [kg/m^3]."""
    radius = diameter / 2.0
    mass = density * 4.0 / 3.0 * math.pi * radius**3
    inertia = np.full(3, 0.4 * mass * radius**2)
    return RigidPart(name, mass, inertia, np.zeros((1, 3)), radius, *ball_mesh(radius))


def cylinder(diameter: float, height: float, density: float, name: str) -> RigidPart:
    """Solid circular cylinder along z that touches with both rims, or corners there; lengths [m], density [kg/m^3]."""
    radius = diameter / 2.0
    mass = density * math.pi * radius**2 * height
    transverse = mass * (3.0 * radius**2 + height**2) / 12.0
    rim = circle(radius)
    corners = np.concatenate([np.column_stack([rim, np.full(RIM_CORNERS, z)]) for z in (-height / 2, height / 2)])
    vertices, faces = ring_mesh(rim, 0.0, height)
    inertia = np.array([transverse, transverse, mass * radius**2 / 2.0])
    return RigidPart(name, mass, inertia, corners, 0.0, vertices, faces, circle_radius=radius)


def box(sides: tuple[float, float, float], density: float, name: str) -> RigidPart:
    """Solid block with sides along x, y and z [m], of a density [kg/m^3]."""
    x, y, z = sides
    mass = density * x * y * z
    corners = 0.5 * np.array([[i * x, j * y, k * z] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    inertia = mass / 12.0 * np.array([y * y + z * z, z * z + x * x, x * x + y * y])
    return RigidPart(name, mass, inertia, corners, 0.0, corners, BLOCK_FACES)


def dimer(
    diameter: float, length: float, density: float, name: str, *, rod_diameter: float, rod_density: float = 0.0
) -> RigidPart:
    """Two solid balls on a rod along x that meet a plate with their spheres; the rod counts for mass and drawing only.

    Diameter of the balls, length over all, rod diameter [m]; densities of balls and rod [kg/m^3].
    """
    radius, apart = diameter / 2.0, length - diameter
    ball_mass, per_mass = density * 4.0 / 3.0 * math.pi * radius**3, 0.4 * radius**2
    rod_radius, rod_length = rod_diameter / 2.0, apart - diameter
    rod_mass = rod_density * math.pi * rod_radius**2 * rod_length
    axial = 2.0 * ball_mass * per_mass + rod_mass * rod_radius**2 / 2.0
    transverse = 2.0 * ball_mass * (per_mass + apart**2 / 4.0) + rod_mass * (3.0 * rod_radius**2 + rod_length**2) / 12.0
    corners = np.array([[-apart / 2.0, 0.0, 0.0], [apart / 2.0, 0.0, 0.0]])
    (ball, around), (rod, side) = ball_mesh(radius), ring_mesh(circle(rod_radius), 0.0, apart, 1)
    vertices = np.concatenate([*(corner + ball for corner in corners), rod[:, [2, 0, 1]]])
    faces = np.concatenate([around, len(ball) + around, 2 * len(ball) + side])
    inertia = np.array([axial, transverse, transverse])
    mass = 2.0 * ball_mass + rod_mass
    return RigidPart(name, mass, inertia, corners, radius, vertices, faces)
