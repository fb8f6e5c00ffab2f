"""Mesh files and convex pieces of concave parts: read, and refused in one line where they cannot be what they say."""

from __future__ import annotations

import re
import shutil
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from conftest import NUT_ON_STRIP, REPOSITORY, refusal, toml_of

from feeder_sim.engines.impulse.kinds import read_kinds
from feeder_sim.part.mesh_file import MOST_BYTES, MOST_FACETS, closed_mesh, first_crossing, stored_normals_against
from feeder_sim.part.mesh_part import mesh_part, solid
from feeder_sim.part.pieces import make_pieces, pieces_beside, read_pieces, write_pieces
from feeder_sim.run.prepare import prepare
from feeder_sim.run.provenance import input_hashes
from feeder_sim.scenario import MeshPart, Scenario, parse_scenario

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


QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))  # of a box
PLACES = [(x, y, z) for x in (-2.0, 2.0) for y in (-1.5, 1.5) for z in (-1.0, 1.0)]


def obj_text(corner: str, *, turns: bool = False) -> str:
    """A box of 4 x 3 x 2, its facets written with corners of some form; `turns`: places and facets take turns."""
    lines = [f"v {x} {y} {z}" for x, y, z in PLACES]
    lines += [f"vt {0.01 * i} 0.5" for i in range(24)] + [f"vn {i} 1 0" for i in range(6)]
    if turns:
        lines = []
    for i, quad in enumerate(QUADS):
        if turns:
            lines += [f"v {x} {y} {z}" for x, y, z in (PLACES[k] for k in quad)] + ["f -4 -3 -2 -1"]
            continue
        words = [corner.format(v=k + 1, t=4 * i + j + 1, n=i + 1, minus=k - 8) for j, k in enumerate(quad)]
        lines += [f"g side_{i}", f"usemtl paint_{i}", "f " + " ".join(words)]
    return "\n".join(["mtllib nowhere.mtl", *lines])


@pytest.mark.parametrize("corner", ["{v}", "{v}/{t}", "{v}//{n}", "{v}/{t}/{n}", "{minus}"])
def test_corners_of_an_obj_are_one_where_their_places_are(corner: str, tmp_path: Path) -> None:
    (tmp_path / "box.obj").write_text(obj_text(corner))
    mesh = closed_mesh(tmp_path / "box.obj", 1.0)
    assert (len(mesh.vertices), len(mesh.faces)) == (8, 12) and mesh.volume == pytest.approx(24.0)


def test_negative_numbers_of_an_obj_count_from_the_facet(tmp_path: Path) -> None:
    (tmp_path / "box.obj").write_text(obj_text("", turns=True))
    assert closed_mesh(tmp_path / "box.obj", 1.0).volume == pytest.approx(24.0)


@pytest.mark.parametrize(
    "line", ["f 1 2 9", "f 0 1 2", "f 1 2 -20", "f 1 2 x", "v 1 2", "v 1 2 three"], ids=lambda line: line
)
def test_an_obj_with_a_wrong_line_is_refused(line: str, tmp_path: Path) -> None:
    (tmp_path / "box.obj").write_text(f"{obj_text('{v}')}\n{line}\n")
    assert "not a readable mesh" in refusal(closed_mesh, tmp_path / "box.obj", 1.0)


def test_facets_of_an_off_have_any_number_of_corners(tmp_path: Path) -> None:
    ring = [(np.cos(a), np.sin(a)) for a in np.arange(6) * np.pi / 3.0]
    places = [f"{x} {y} {z}" for z in (0, 1) for x, y in ring]
    sides = [f"4 {i} {(i + 1) % 6} {6 + (i + 1) % 6} {6 + i} 255 0 0" for i in range(6)]
    ends = ["6 5 4 3 2 1 0", "6 6 7 8 9 10 11"]
    head = ["COFF # six sides", "12 8 0"]
    (tmp_path / "prism.off").write_text("\n".join([*head, *places, *sides, *ends]))
    assert closed_mesh(tmp_path / "prism.off", 1.0).volume == pytest.approx(1.5 * np.sqrt(3.0))


@pytest.mark.parametrize("extra", [("nx", "ny", "nz"), ("s", "t"), ("red",)])
def test_a_ply_with_more_than_places_is_read(extra: tuple[str, ...], tmp_path: Path) -> None:
    """Each facet has corners of its own, with what differs between facets."""
    head = [
        "ply",
        "format ascii 1.0",
        "element vertex 24",
        *(f"property float {name}" for name in ("x", "y", "z", *extra)),
    ]
    head += ["element face 6", "property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(map(str, (*PLACES[k], *(0.1 * i for _ in extra)))) for i, quad in enumerate(QUADS) for k in quad]
    facets = [f"4 {4 * i} {4 * i + 1} {4 * i + 2} {4 * i + 3}" for i in range(6)]
    (tmp_path / "box.ply").write_text("\n".join([*head, *rows, *facets, ""]))
    assert closed_mesh(tmp_path / "box.ply", 1.0).volume == pytest.approx(24.0)


@pytest.mark.parametrize("sliver", [(0, 0, 1), (0, 1, 0.5)])
def test_facets_of_no_area_are_left_out_and_said(sliver: tuple[float, ...], tmp_path: Path) -> None:
    """Corners of the sliver: the places of two corners of the box, or a place between them."""
    mesh = box()
    a, b = mesh.vertices[mesh.edges_unique[0]]
    facet = np.array([[a + share * (b - a) for share in sliver]])
    triangles = np.concatenate([mesh.triangles, facet])
    trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(39).reshape(-1, 3), process=False).export(tmp_path / "part.stl")
    part = mesh_part(tmp_path / "part.stl", 1.0, 1000.0, "part")
    assert part.dropped_facets == 1 and 1e9 * solid(part).volume == pytest.approx(24.0)
    raw = NUT_ON_STRIP | {"part": [{"shape": "mesh", "file": str(tmp_path / "part.stl"), "material": "steel"}]}
    assert any(
        "1 facet of no area" in line
        for line in prepare(parse_scenario(toml_of(raw), file=tmp_path / "scenario.toml")).warnings
    )


def test_facets_of_no_area_that_close_a_mesh_stay(tmp_path: Path) -> None:
    """A side divided at its middle, that of its neighbour not: what lies between has no area."""
    mesh = box()
    first = mesh.triangles[0]
    middle = 0.5 * (first[0] + first[1])
    split = [[first[0], middle, first[2]], [middle, first[1], first[2]], [first[0], first[1], middle]]
    triangles = np.concatenate([mesh.triangles[1:], split])
    trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(42).reshape(-1, 3), process=False).export(tmp_path / "part.stl")
    part = mesh_part(tmp_path / "part.stl", 1.0, 1000.0, "part")
    assert part.dropped_facets == 0 and 1e9 * solid(part).volume == pytest.approx(24.0)


def test_an_stl_in_capitals_is_read(tmp_path: Path) -> None:
    (tmp_path / "part.stl").write_text(box().export(file_type="stl_ascii").upper())
    assert closed_mesh(tmp_path / "part.stl", 1.0).volume == pytest.approx(24.0)


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
    assert f"has 10000000 facets, must be up to {MOST_FACETS}: reduce them" in problem
    (tmp_path / "fine.ply").write_text("ply\nformat ascii 1.0\nelement vertex 8\nelement face 3000000\nend_header\n")
    assert "has 3000000 facets" in refusal(closed_mesh, tmp_path / "fine.ply", 1.0)
    with (tmp_path / "fine.obj").open("wb") as file:
        file.truncate(MOST_BYTES + 1)
    assert "MB, must be up to 20 MB" in refusal(closed_mesh, tmp_path / "fine.obj", 1.0)


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


HOOK = REPOSITORY / "models/hook/hook.stl"
NO_LINES_OF_OBJ = ("v 1 2", "v 1 2 nan", "f 1 2 999", "f 1 x 3", "f 1 2")
SCENARIO: dict[str, Any] = NUT_ON_STRIP | {
    "run": {"duration_s": 0.1},
    "part": [{"shape": "mesh", "file": "hook.stl", "count": 2, "start": {"kind": "scattered"}}],
}


@pytest.fixture
def hook(tmp_path: Path) -> Path:
    for file in (HOOK, pieces_beside(HOOK)):
        shutil.copy(file, tmp_path)
    return tmp_path / "hook.stl"


def scenario_of(hook: Path, **part: Any) -> Scenario:
    """Two of the hooks, with more in their table."""
    changes = {f"part[0].{key}": value for key, value in part.items()}
    return parse_scenario(toml_of(SCENARIO, changes), file=hook.parent / "hooks.toml")


def read(hook: Path) -> list[Any]:
    return read_pieces(pieces_beside(hook), hook, trimesh.load_mesh(hook))


def test_pieces_make_up_the_part() -> None:
    part = mesh_part(HOOK, 1.0, 7850.0, "hook", pieces=pieces_beside(HOOK), corner_error=50e-6)
    volumes = [trimesh.Trimesh(1e3 * piece).convex_hull.volume for piece in part.pieces]
    assert len(volumes) == 6
    assert sum(volumes) == pytest.approx(1e9 * solid(part).volume, rel=2e-3)
    assert 1e3 * np.concatenate(part.pieces).min(axis=0) == pytest.approx([-4.5, -6.0, -0.75], abs=1e-3)
    assert mesh_part(HOOK, 1.0, 7850.0, "hook").pieces == ()
    in_mm, in_cm = (mesh_part(HOOK, unit, 7850.0, "hook", pieces=pieces_beside(HOOK)) for unit in (1.0, 10.0))
    assert 10.0 * in_mm.pieces[0] == pytest.approx(in_cm.pieces[0])


def test_a_part_is_cut_and_read_back(tmp_path: Path) -> None:
    pytest.importorskip("coacd")
    file = tmp_path / "bracket.stl"
    shutil.copy(REPOSITORY / "models/bracket/bracket.stl", file)
    mesh = trimesh.load_mesh(file)
    pieces, made_by = make_pieces(mesh, 1.0)
    assert made_by.startswith("coacd 1.")
    write_pieces(pieces_beside(file), pieces, file, made_by)
    back = read(file)
    assert len(back) == len(pieces) == 2
    for written, found in zip(pieces, back, strict=True):
        assert found == pytest.approx(written[0], abs=1e-5)
    assert "--piece-error-mm: is 40, must be 0.06 to 3" in refusal(make_pieces, mesh, 1.0, 40.0)


def test_pieces_of_another_mesh(hook: Path) -> None:
    trimesh.load_mesh(hook).apply_scale(1.01).export(hook)
    assert "was made of another hook.stl" in refusal(read, hook)
    pieces_beside(hook).unlink()
    assert "no such file, make it: feeder-sim part" in refusal(read, hook)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("# sha256", "# md5", "has no line"),
        ("o piece_1\n", "", "piece 0 is not convex: it lies"),  # two pieces in one object
        *(("o piece_1\n", f"o piece_1\n{line}\n", f"is '{line}', which no OBJ file has") for line in NO_LINES_OF_OBJ),
        ("", "", "piece 0 reaches 0.5 out of the hull of the mesh"),
        (r"(?s)o piece_5.*", "", "of the volume of the mesh"),
    ],
)
def test_damaged_pieces(hook: Path, old: str, new: str, expected: str) -> None:
    file = pieces_beside(hook)
    text = file.read_text()
    if "0.5" in expected:  # elsewhere
        first, rest = text.split("o piece_1")
        moved = re.sub(r"(?m)^v (\S+)", lambda x: f"v {float(x[1]) - 0.5:.6f}", first) + "o piece_1" + rest
    else:
        moved = re.sub(old, new, text)
    assert moved != text
    file.write_text(moved)
    assert expected in refusal(read, hook)


def test_scenario_and_record_know_the_pieces(hook: Path) -> None:
    scenario = scenario_of(hook, contact="parts")
    part = scenario.part[0]
    assert isinstance(part, MeshPart) and part.pieces == pieces_beside(hook)
    assert set(input_hashes(scenario)) == {"part[0].file", "part[0].pieces"}
    prepared = prepare(scenario)
    assert len(prepared.scene.kinds[0].pieces) == 6
    assert not [line for line in prepared.warnings if "hull" in line]


def test_what_the_hull_hides_is_said(hook: Path) -> None:
    scenario = scenario_of(hook)
    assert set(input_hashes(scenario)) == {"part[0].file"}
    (line,) = [line for line in prepare(scenario).warnings if "hull" in line]
    assert line.startswith("part[0]: its hull has 2.1 times its volume: parts cannot hook or nest")
    assert "pieces is given, must be none" in refusal(scenario_of, hook, pieces="hook_pieces.obj")
    alone = scenario.changed({"part[0].count": 1})
    assert not [line for line in prepare(alone).warnings if "hull" in line]


def test_too_many_corners_are_said(tmp_path: Path) -> None:
    trimesh.creation.icosphere(subdivisions=3, radius=3.0).export(tmp_path / "hook.stl")
    scenario = scenario_of(tmp_path / "hook.stl", corner_error_um=5.0)
    (line,) = [line for line in prepare(scenario).warnings if "corner" in line]
    found = re.fullmatch(r"part\[0\]\.corner_error_um: is 5, (\d+) corners leave (\d+) um, and no part .* 128", line)
    assert found is not None and int(found[1]) <= 128 and 50 < int(found[2]) < 200


def test_a_piece_may_reach_farther_than_the_corners(hook: Path) -> None:
    scene = prepare(scenario_of(hook, contact="parts")).scene
    (kind,) = scene.kinds
    far = replace(kind, pieces=(*kind.pieces, 1.5 * kind.pieces[0]))
    reach = max(np.linalg.norm(points, axis=1).max() for points in far.pieces)
    assert reach > 1.01 * kind.size
    assert read_kinds(replace(scene, kinds=(far,))).record["reach"][0] == pytest.approx(reach)
    assert read_kinds(scene).record["reach"][0] == pytest.approx(kind.size, rel=0.05)
