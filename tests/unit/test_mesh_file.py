"""Mesh files that are no closed body are refused in one line that says what to do."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from conftest import REPOSITORY, refusal

from feeder_sim.part.crossing_facets import first_crossing
from feeder_sim.part.mesh_file import MOST_BYTES, MOST_FACETS, closed_mesh, stored_normals_against

MODELS = REPOSITORY / "models"


def box(*size: float) -> Any:
    return trimesh.creation.box(extents=size or (4.0, 3.0, 2.0))


def refused(mesh: Any, folder: Path, unit_mm: float = 1.0) -> str:
    """The message with which a mesh is refused, once it is in a file."""
    mesh.export(folder / "part.stl")
    message = refusal(closed_mesh, folder / "part.stl", unit_mm)
    assert message.startswith(f"{folder / 'part.stl'}: part.file: ")
    return message


@pytest.mark.parametrize("name", ["bracket", "screw", "hook"])
def test_the_models_are_read(name: str) -> None:
    mesh = closed_mesh(MODELS / name / f"{name}.stl", 1.0)
    assert mesh.is_watertight and mesh.volume > 0.0


def test_open(tmp_path: Path) -> None:
    mesh = box()
    mesh.update_faces(np.arange(12) != 5)
    problem = refused(mesh, tmp_path)
    assert "is an open mesh" in problem and "3 open edges, the first at (" in problem and "Make Manifold" in problem


def test_more_than_two_facets_at_an_edge(tmp_path: Path) -> None:
    pair = [box(2.0, 2.0, 2.0), box(2.0, 2.0, 2.0).apply_translation([2.0, 2.0, 0.0])]
    problem = refused(trimesh.util.concatenate(pair), tmp_path)
    assert "has 1 edges where more than two facets meet, the first at (1, 1, " in problem


def test_inside_out(tmp_path: Path) -> None:
    mesh = box()
    mesh.invert()
    problem = refused(mesh, tmp_path)
    assert "is inside out" in problem and "Recalculate Outside" in problem


def test_one_facet_turned(tmp_path: Path) -> None:
    mesh = box()
    mesh.faces[3] = mesh.faces[3][::-1]
    assert "turned against their neighbours" in refused(trimesh.Trimesh(mesh.vertices, mesh.faces), tmp_path)


@pytest.mark.parametrize("thickness", [0.0, 1e-9])
def test_flat(tmp_path: Path, thickness: float) -> None:
    mesh = box(4.0, 3.0, 1.0)
    mesh.vertices[:, 2] *= thickness
    mesh.export(tmp_path / "part.off", digits=12)
    problem = refusal(closed_mesh, tmp_path / "part.off", 1.0)
    assert re.search(r"is flat and encloses no volume \(4 x 3 x (0|1e-09) mm\)", problem)


def test_two_bodies(tmp_path: Path) -> None:
    two = [box(), box().apply_translation([10.0, 0.0, 0.0])]
    assert "holds 2 bodies" in refused(trimesh.util.concatenate(two), tmp_path)


def dented(to_z: float) -> Any:
    """A box whose top is pushed down in its middle."""
    mesh = box(4.0, 4.0, 2.0).subdivide().subdivide()
    points = mesh.vertices.copy()
    top = (points == [0.0, 0.0, 1.0]).all(axis=1)
    assert top.sum() == 1
    points[top, 2] = to_z
    return trimesh.Trimesh(points, mesh.faces)


def test_intersecting_itself(tmp_path: Path) -> None:
    problem = refused(dented(-1.5), tmp_path)
    assert "intersects itself: facets " in problem and ", -1) mm" in problem and "Boolean" in problem


def test_touching_is_not_intersecting(tmp_path: Path) -> None:
    dented(-0.999).export(tmp_path / "dented.stl")
    closed_mesh(tmp_path / "dented.stl", 1.0)
    beside = [box(2.0, 2.0, 2.0), box(2.0, 2.0, 2.0).apply_translation([2.0, 0.5, 0.5])]  # with a common plane
    both: Any = trimesh.util.concatenate(beside)
    assert first_crossing(np.asarray(both.triangles)) is None
    assert first_crossing(np.asarray(trimesh.creation.icosphere(subdivisions=4).triangles)) is None


@pytest.mark.parametrize("seed", range(3))
def test_crossing_facets_are_found_wherever_they_are(seed: int) -> None:
    """A needle through a ball far away, among many facets: the crossing is at the surface of both."""
    turn = trimesh.transformations.random_rotation_matrix(np.random.default_rng(seed).random(3))
    needle = box(0.2, 0.2, 9.0).apply_transform(turn)
    ball = trimesh.creation.icosphere(subdivisions=4, radius=3.0)
    both: Any = trimesh.util.concatenate([ball, needle])
    found = first_crossing(np.asarray(both.apply_translation([50, 0, 9]).triangles))
    assert found is not None
    assert found[0] < len(ball.faces) <= found[1]
    assert np.linalg.norm(found[2] - [50, 0, 9]) == pytest.approx(3.0, abs=0.05)


@pytest.mark.parametrize(("size", "unit"), [(5.0, 1000.0), (0.005, 1.0), (5000.0, 1.0)])
def test_an_unlikely_size(tmp_path: Path, size: float, unit: float) -> None:
    problem = refused(box(size, size, 0.5 * size), tmp_path, unit)
    assert f"is {size * unit:.4g} mm long with file_unit_mm = {unit:g}" in problem
    assert "25.4 for inches" in problem


def test_too_many_facets_are_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "fine.stl").open("wb") as file:
        file.write(b"\0" * 80 + struct.pack("<I", 10_000_000))
        file.truncate(84 + 50 * 10_000_000)  # takes no room on the disk
    problem = refusal(closed_mesh, tmp_path / "fine.stl", 1.0)
    assert f"has 10000000 facets, allowed is up to {MOST_FACETS}: reduce them" in problem
    (tmp_path / "fine.ply").write_text("ply\nformat ascii 1.0\nelement vertex 8\nelement face 3000000\nend_header\n")
    assert "has 3000000 facets" in refusal(closed_mesh, tmp_path / "fine.ply", 1.0)
    with (tmp_path / "fine.obj").open("wb") as file:
        file.truncate(MOST_BYTES + 1)
    assert "MB, allowed is up to 300 MB" in refusal(closed_mesh, tmp_path / "fine.obj", 1.0)


def test_normals_of_a_text_that_disagree(tmp_path: Path) -> None:
    file = tmp_path / "part.stl"
    text = trimesh.exchange.stl.export_stl_ascii(box())
    file.write_text(text)
    assert stored_normals_against(file) == (0, 12)
    numbers = re.compile(r"(?<=facet normal ).*")
    file.write_text(numbers.sub(lambda found: " ".join(str(-float(n)) for n in found[0].split()), text))
    assert "contradicts itself: 12 of 12 stored normals" in refusal(closed_mesh, file, 1.0)


def with_normals(factor: float) -> bytes:
    """A box as a binary STL file, its stored normals times a factor."""
    data = bytearray(trimesh.exchange.stl.export_stl(box()))
    for at in range(84, 84 + 50 * 12, 50):
        data[at : at + 12] = struct.pack("<3f", *(factor * n for n in struct.unpack("<3f", data[at : at + 12])))
    return bytes(data)


def test_normals_that_disagree(tmp_path: Path) -> None:
    (tmp_path / "part.stl").write_bytes(with_normals(-1.0))
    assert "contradicts itself: 12 of 12 stored normals" in refusal(closed_mesh, tmp_path / "part.stl", 1.0)


def test_normals_of_no_length_say_nothing(tmp_path: Path) -> None:
    (tmp_path / "part.stl").write_bytes(with_normals(0.0))
    assert closed_mesh(tmp_path / "part.stl", 1.0).volume == pytest.approx(24.0)
