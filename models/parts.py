"""Makes the meshes under models/ [mm]: an L bracket, a screw, a hook, the fingers of a gripper."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from feeder_sim.part.mesh_file import closed_mesh
from feeder_sim.part.pieces import make_pieces, pieces_beside, write_pieces

MODELS = Path(__file__).parent

# x and z of the bracket: 12 long, 9 high, 1.5 thick, base down
BRACKET = ((0.0, 0.0), (12.0, 0.0), (12.0, 1.5), (1.5, 1.5), (1.5, 9.0), (0.0, 9.0))
BRACKET_WIDTH = 8.0
# radius and z of a cap screw M3 x 8 without thread and socket, from the tip to the head
SCREW = ((0.0, 0.0), (1.5, 0.0), (1.5, 8.0), (2.75, 8.0), (2.75, 11.0), (0.0, 11.0))
SCREW_SIDES = 48
# x and y of the middle of the hook's wire: an S whose mouths are wide enough for the wire of another hook
HOOK = ((-3.75, 1.5), (-3.75, 5.25), (0.0, 5.25), (0.0, -5.25), (3.75, -5.25), (3.75, -1.5))
HOOK_WIRE = 1.5  # square
# fingers of a gripper, around the middle of the bracket as drawn: size of each, and how far they are open along y
FINGER, OPENING = (4.0, 2.0, 25.0), 11.0
CONCAVE = ("bracket", "screw", "hook")  # parts that get convex pieces


def part_meshes() -> dict[str, Any]:
    """The meshes by name, closed and outside out."""
    import shapely
    import trimesh

    upright = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    bracket = prism(shapely.Polygon(BRACKET), BRACKET_WIDTH)
    bracket.apply_transform(upright).apply_translation([0.0, BRACKET_WIDTH, 0.0])
    wire = shapely.LineString(HOOK).buffer(0.5 * HOOK_WIRE, cap_style="flat", join_style="mitre")
    return {
        "bracket": bracket,
        "screw": trimesh.creation.revolve(np.array(SCREW), sections=SCREW_SIDES),
        "hook": prism(wire, HOOK_WIRE),
        "fingers": trimesh.util.concatenate([_finger(side) for side in (-1.0, 1.0)]),
    }


def _finger(side: float) -> Any:
    """A finger on either side, standing on the plate."""
    import trimesh

    middle = [0.0, side * 0.5 * (OPENING + FINGER[1]), 0.5 * FINGER[2]]
    return trimesh.creation.box(extents=FINGER).apply_translation(middle)


def prism(outline: Any, height: float) -> Any:
    """The mesh of a prism over a polygon without holes, from z = 0 up to a height."""
    import shapely
    import trimesh

    corners = np.array(shapely.orient_polygons(outline).exterior.coords)[:-1]
    number = {tuple(corner): i for i, corner in enumerate(corners.tolist())}
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(outline))
    top = np.array([[number[tuple(c)] for c in _counter_clockwise(t.exterior.coords[:3])] for t in triangles])
    n = len(corners)
    i, j = np.arange(n), (np.arange(n) + 1) % n
    sides = np.concatenate([np.column_stack([i, j, j + n]), np.column_stack([i, j + n, i + n])])
    vertices = np.concatenate([np.column_stack([corners, np.full(n, z)]) for z in (0.0, height)])
    return trimesh.Trimesh(vertices, np.concatenate([top[:, ::-1], top + n, sides]))


def _counter_clockwise(triangle: ArrayLike) -> list[list[float]]:
    points = np.array(triangle)
    a, b = points[1] - points[0], points[2] - points[0]
    ordered = points if a[0] * b[1] - a[1] * b[0] > 0.0 else points[::-1]
    return [[float(c) for c in point] for point in ordered]


def write_parts() -> None:
    """Write each mesh as STL into the folder of its name, and the convex pieces of the parts."""
    for name, mesh in part_meshes().items():
        assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0.0, name
        file = MODELS / name / f"{name}.stl"
        file.parent.mkdir(exist_ok=True)
        mesh.export(file)
    for name in CONCAVE:
        part = MODELS / name / f"{name}.stl"
        pieces, made_by = make_pieces(closed_mesh(part, 1.0), 1.0)
        write_pieces(pieces_beside(part), pieces, part, made_by)


if __name__ == "__main__":
    write_parts()
