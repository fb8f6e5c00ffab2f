"""The mesh of a part in a replay."""

from __future__ import annotations

from typing import Any

import numpy as np

from feeder_sim.records.recording import PartRecord
from feeder_sim.replay.plate import MM

NUT = (214, 140, 30)


def drawn_part(part: PartRecord, colour: tuple[int, int, int] = NUT) -> Any:
    """The mesh of a part in millimetres, with one normal per face so that edges look sharp."""
    import rerun as rr
    import trimesh

    mesh = trimesh.Trimesh(part.vertices * MM, part.faces, process=False)
    vertices = mesh.vertices[mesh.faces].reshape(-1, 3)  # no face shares a vertex with another
    return rr.Mesh3D(
        vertex_positions=vertices,
        triangle_indices=np.arange(len(vertices)).reshape(-1, 3),
        vertex_normals=np.repeat(mesh.face_normals, 3, axis=0),
        albedo_factor=colour,
    )


def radius_of(part: PartRecord) -> float:
    """Radius [mm] of the ball around the centre of mass that holds a part."""
    return MM * float(np.linalg.norm(part.vertices, axis=1).max())
