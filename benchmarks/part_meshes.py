"""Meshes of parts for benchmarks [mm]: a bracket, which is a general top, and a screw, which is slender."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh


def bracket() -> trimesh.Trimesh:
    """An L of 12 x 9 mm, 8 mm wide, of sheet of 1.5 mm."""
    outline = np.array([[0.0, 0.0], [12.0, 0.0], [12.0, 1.5], [1.5, 1.5], [1.5, 9.0], [0.0, 9.0]])
    flat = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    points = np.concatenate([np.insert(outline, 1, y, axis=1) for y in (0.0, 8.0)])
    sides = [[[i, j, j + 6], [i, j + 6, i + 6]] for i, j in zip(range(6), [1, 2, 3, 4, 5, 0], strict=True)]
    mesh = trimesh.Trimesh(points, np.concatenate([flat[:, ::-1], flat + 6, *np.array(sides)]), process=False)
    mesh.fix_normals()
    return mesh


def screw() -> trimesh.Trimesh:
    """A head of 5.5 x 3 mm and a shank of 3 x 10 mm, of 32 sides."""
    profile = np.array([[0.0, 0.0], [2.75, 0.0], [2.75, 3.0], [1.5, 3.0], [1.5, 13.0], [0.0, 13.0]])
    return trimesh.creation.revolve(profile, sections=32)


def write_meshes(folder: Path) -> dict[str, Path]:
    """The meshes as files in a folder, by name."""
    found = {}
    for mesh in (bracket, screw):
        found[mesh.__name__] = folder / f"{mesh.__name__}.stl"
        mesh().export(found[mesh.__name__])
    return found
