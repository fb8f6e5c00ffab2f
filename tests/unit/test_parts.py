from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from conftest import refusal, toml_of
from scipy.spatial.transform import Rotation

from feeder_sim.part.solids import ISO_4032
from feeder_sim.scenario import Ball, Cylinder, Dimer, HexNut, MeshPart, Tube, parse_scenario
from feeder_sim.scene.part import build_part


def test_nut_of_the_source_weighs_what_it_should() -> None:
    assert build_part(HexNut(size="M2.5")).mass == pytest.approx(0.263e-3, rel=2e-3)


@pytest.mark.parametrize("size", sorted(ISO_4032))
def test_nut_formulas_agree_with_its_mesh(size: str) -> None:
    part = build_part(HexNut.model_validate({"size": size}))
    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    assert mesh.is_watertight
    mesh.density = 7850.0
    # The drawn bore is a polygon of 48 sides, 0.3 % smaller than the round one.
    assert mesh.mass == pytest.approx(part.mass, rel=3e-3)
    assert np.diag(mesh.moment_inertia) == pytest.approx(part.inertia, rel=3e-3)
    assert mesh.center_mass == pytest.approx(np.zeros(3), abs=1e-9)
    across, height, _ = ISO_4032[size]
    assert np.ptp(part.corners, axis=0) == pytest.approx(np.array([across * 2 / 3**0.5, across, height]) * 1e-3)


def test_a_nut_by_dimensions_equals_the_nut_by_size() -> None:
    by_size = build_part(HexNut(size="M2.5"))
    by_dimensions = build_part(HexNut(across_flats_mm=5.0, height_mm=2.0, bore_mm=2.5))
    assert by_dimensions.mass == by_size.mass


def test_ball_and_cylinder() -> None:
    ball = build_part(Ball(shape="ball", diameter_mm=3.0))
    assert ball.mass == pytest.approx(7850 * np.pi / 6 * 0.003**3)
    assert ball.corner_radius == pytest.approx(0.0015)
    rod = build_part(Cylinder(shape="cylinder", diameter_mm=4.0, height_mm=6.0))
    mesh = trimesh.creation.cylinder(radius=0.002, height=0.006, sections=400)
    mesh.density = 7850.0
    assert rod.mass == pytest.approx(mesh.mass, rel=1e-3)
    assert rod.inertia == pytest.approx(np.diag(mesh.moment_inertia), rel=1e-3)


@pytest.mark.parametrize("rod_density", [0.0, 2500.0])
def test_a_dimer_is_two_balls_on_a_rod(rod_density: float) -> None:
    spec = Dimer(
        shape="dimer", ball_diameter_mm=5.0, length_mm=25.0, rod_diameter_mm=1.0, rod_density_kg_m3=rod_density
    )
    part = build_part(spec)
    ball = build_part(Ball(shape="ball", diameter_mm=5.0))
    rod = trimesh.creation.cylinder(radius=0.5, height=15.0, sections=400)  # in mm, as trimesh has no tiny bodies
    rod.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    rod.density = 1e-9 * rod_density
    assert part.mass == pytest.approx(2.0 * ball.mass + rod.mass, rel=1e-4)
    balls = 2.0 * ball.inertia + 2.0 * ball.mass * 0.01**2 * np.array([0.0, 1.0, 1.0])
    assert part.inertia == pytest.approx(balls + 1e-6 * np.diag(rod.moment_inertia), rel=1e-4)
    assert (part.longest, part.thinnest, part.size) == pytest.approx((0.025, 0.005, 0.0125))
    upright = np.asarray(Rotation.from_euler("y", 90.0, degrees=True).as_quat(scalar_first=True))
    assert [part.lowest(np.array(q)) for q in ((1.0, 0.0, 0.0, 0.0), upright)] == pytest.approx([-0.0025, -0.0125])
    assert part.vertices.max(axis=0) == pytest.approx([0.0125, 0.0025, 0.0025], rel=1e-2)


DIMER: dict[str, Any] = {
    "plate": {"kind": "piston"},
    "drive": [{"frequency_hz": 25.0, "amplitude_um": 300.0}],
    "part": [{"shape": "dimer", "ball_diameter_mm": 5.0, "length_mm": 25.0}],
    "run": {"duration_s": 1.0},
}


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("part[0].length_mm", 9.0, "length_mm is 9, must be at least 10"),
        ("part[0].rod_diameter_mm", 6.0, "rod_diameter_mm is 6, must be up to ball_diameter_mm"),
        ("part[0].guide.kind", "slide", "guide is given, must be none for a dimer"),
        ("part[0].count", 2, "part.count adds up to 2, must be 1 with a dimer"),
        ("plate.rim", True, "plate.rim is true, must be false with a dimer"),
        ("run.engine", "mujoco", 'run.engine is "mujoco", must be "impulse" with a dimer'),
    ],
)
def test_a_dimer_is_refused_where_it_would_meet_other_bodies(key: str, value: Any, message: str) -> None:
    start = {"part[0].start": {"kind": "scattered"}} if key == "part[0].count" else {}
    text = toml_of(DIMER, start | {key: value})
    assert message in refusal(parse_scenario, text, file=Path("dimer.toml"))


@pytest.mark.parametrize("tilt", [0.0, 0.4, 1.5])
def test_a_free_cylinder_is_lowest_on_a_circle_and_a_guided_one_at_a_corner(tilt: float) -> None:
    rod: dict[str, Any] = {"shape": "cylinder", "diameter_mm": 4.0, "height_mm": 6.0}
    free, guided = Cylinder(**rod), Cylinder(**rod, guide=Tube(kind="tube", inner_diameter_mm=5.0))
    turned = Rotation.from_euler("yz", [tilt, 0.3]) * Rotation.from_euler("z", 0.05)  # between two corners
    quaternion = np.asarray(turned.as_quat(scalar_first=True))
    lowest = -(0.002 * np.sin(tilt) + 0.003 * np.cos(tilt))
    assert build_part(free).lowest(quaternion) == pytest.approx(lowest, abs=1e-15)
    at_a_corner = build_part(guided).lowest(quaternion)
    assert at_a_corner == pytest.approx(lowest + 0.002 * np.sin(tilt) * (1.0 - np.cos(0.05)), abs=1e-15)


def test_mesh_file_keeps_mass_and_finds_principal_axes(tmp_path: Path) -> None:
    turned = trimesh.creation.box(extents=[2.0, 3.0, 5.0])
    turned.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [4, 5, 6]))
    turned.export(tmp_path / "box.stl")
    part = build_part(MeshPart(shape="mesh", file=tmp_path / "box.stl"))
    mass = 7850 * 30e-9
    expected = mass / 12 * np.array([4 + 9, 4 + 25, 9 + 25]) * 1e-6
    assert part.mass == pytest.approx(mass, rel=1e-5)
    assert part.inertia == pytest.approx(expected, rel=1e-5)
    assert np.sort(np.ptp(part.in_principal_axes(part.corners), axis=0)) == pytest.approx([2e-3, 3e-3, 5e-3], rel=1e-5)


def test_file_that_is_no_mesh_is_refused(tmp_path: Path) -> None:
    (tmp_path / "part.stl").write_text("not a mesh")
    assert "part.stl" in refusal(build_part, MeshPart(shape="mesh", file=tmp_path / "part.stl"))
