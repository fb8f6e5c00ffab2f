"""Meshes that parts by dimensions are drawn as: closed, turned outside, as large as the part."""

from __future__ import annotations

import math

import pytest
import trimesh

from feeder_sim.part.drawing import ball_mesh
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.solids import ball, box, cylinder, dimer, hex_nut

PARTS = {
    "nut": (hex_nut(5e-3, 2e-3, 2.5e-3, 1.0, "nut"), 1.0),
    "cylinder": (cylinder(5e-3, 2e-3, 1.0, "cylinder"), 1.0),
    "ball": (ball(5e-3, 1.0, "ball"), 1.0),
    "box": (box((1e-3, 2e-3, 3e-3), 1.0, "box"), 1.0),
    "dimer": (dimer(3e-3, 12e-3, 1.0, "dimer", rod_diameter=1e-3, rod_density=1.0), 1.1),  # the rod ends in the balls
}


@pytest.mark.parametrize(("part", "more"), PARTS.values(), ids=PARTS)
def test_a_mesh_is_closed_and_as_large_as_its_part(part: RigidPart, more: float) -> None:
    """At a density of 1 the mass is the volume; polygons in circles and spheres lack up to 2 % of it."""
    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert 0.97 * part.mass < mesh.volume < 1.005 * more * part.mass


def test_the_vertices_of_a_ball_lie_on_it() -> None:
    vertices, faces = ball_mesh(2.0)
    assert vertices.shape == (642, 3) and faces.shape == (1280, 3)
    assert max(abs(math.dist(vertex, (0, 0, 0)) - 2.0) for vertex in vertices) < 1e-12
