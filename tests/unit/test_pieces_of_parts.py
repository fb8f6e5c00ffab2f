"""Convex pieces of a concave part: written, read back, and refused where they are not its own."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from conftest import NUT_ON_STRIP, REPOSITORY, refusal, toml_of

from feeder_sim.engines.impulse.kinds import read_kinds
from feeder_sim.part.mesh_part import mesh_part, solid
from feeder_sim.part.pieces import make_pieces, pieces_beside, read_pieces, write_pieces
from feeder_sim.run.prepare import prepare
from feeder_sim.run.provenance import input_hashes
from feeder_sim.scenario import MeshPart, Scenario, parse_scenario

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
    assert "--piece-error-mm: is 40, allowed is 0.06 to 3" in refusal(make_pieces, mesh, 1.0, 40.0)


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
    assert not [line for line in prepared.cautions if "hull" in line]


def test_what_the_hull_hides_is_said(hook: Path) -> None:
    scenario = scenario_of(hook)
    assert set(input_hashes(scenario)) == {"part[0].file"}
    (line,) = [line for line in prepare(scenario).cautions if "hull" in line]
    assert line.startswith("part[0]: its hull has 2.1 times its volume: parts cannot hook or nest")
    assert "pieces is given, allowed is none" in refusal(scenario_of, hook, pieces="hook_pieces.obj")
    alone = scenario.changed({"part[0].count": 1})
    assert not [line for line in prepare(alone).cautions if "hull" in line]


def test_too_many_corners_are_said(tmp_path: Path) -> None:
    trimesh.creation.icosphere(subdivisions=3, radius=3.0).export(tmp_path / "hook.stl")
    scenario = scenario_of(tmp_path / "hook.stl", corner_error_um=5.0)
    (line,) = [line for line in prepare(scenario).cautions if "corner" in line]
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
