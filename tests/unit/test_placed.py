"""Parts laid down one by one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from conftest import refusal
from scipy.spatial.transform import Rotation

from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.solids import hex_nut
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.overlap import parts_overlap
from feeder_sim.scene.scene import build_scene
from feeder_sim.scene.start import start_poses

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def scenario(places: list[tuple[float, float, float]], **part: Any) -> Scenario:
    nut: dict[str, Any] = {"shape": "hex_nut", "size": "M2.5"}
    raw = {
        "plate": {"kind": "strip", "thickness_mm": 3.0, "length_mm": 110.0},
        "drive": [{"frequency_hz": 4750.0, "amplitude_um": 1.0}],
        "part": [nut | part | {"start": {"kind": "placed", "places_mm_deg": places}}],
        "run": {"seeds": 1, "duration_s": 0.1},
    }
    return validated(raw, Scenario, Path("scenario.toml"))


def test_everyone_is_where_the_scenario_says() -> None:
    places = [(0.0, 0.0, 0.0), (0.0, 5.2, 0.0), (-20.0, 10.0, 77.0)]  # the first two all but touch with their flats
    scene = build_scene(scenario(places))
    poses = start_poses(scene, np.random.default_rng(3))
    assert len(poses) == 3
    for (x, y, yaw), pose in zip(places, poses, strict=True):
        assert pose.position * 1e3 == pytest.approx(np.array([x, y, 1.01]))
        turned = Rotation.from_quat(pose.quaternion, scalar_first=True).as_euler("xyz", degrees=True)
        assert turned == pytest.approx(np.array([0.0, 0.0, yaw]))


@pytest.mark.parametrize(
    ("places", "part", "line"),
    [
        ([(0, 0, 0), (5.0, 0, 0)], {}, "places_mm_deg[1]: overlaps part_0, allowed is a place of its own"),
        ([(0, 0, 0), (80.0, 0, 0)], {}, "places_mm_deg[1]: is [80, 0], allowed is +-55.0, +-"),
        ([(0, 0, 0)], {"count": 2}, "count is 2, allowed is 1, as many as places"),
        ([], {"count": 1}, "places_mm_deg"),
    ],
)
def test_bad_places_are_one_line(places: list[Any], part: dict[str, Any], line: str) -> None:
    assert line in refusal(lambda: start_poses(build_scene(scenario(places, **part)), np.random.default_rng(0)))


def test_hulls_that_reach_into_each_other_are_said(tmp_path: Path) -> None:
    trimesh.creation.box(extents=[4.0, 4.0, 2.0]).export(tmp_path / "box.stl")
    nuts = scenario([(0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (10.0, 0.0, 0.0)])
    mesh = {"shape": "mesh", "file": str(tmp_path / "box.stl"), "start": nuts.part[0].start.model_dump()}
    prepared = prepare(nuts.changed({"part": [mesh]}))
    assert [line for line in prepared.cautions if "the hulls of part_0 and part_1 overlap by" in line]


def hook() -> RigidPart:
    """A U out of three boxes, open along y."""
    nut = hex_nut(5e-3, 2e-3, 2.5e-3, 7850.0, "hook")
    boxes = [((-4.0, 0.0), (1.0, 8.0)), ((4.0, 0.0), (1.0, 8.0)), ((0.0, -3.5), (8.0, 1.0))]
    pieces = tuple(
        1e-3 * np.array([[x + i * a / 2, y + j * b / 2, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        for (x, y), (a, b) in boxes
    )
    corners = np.concatenate(pieces)
    return RigidPart("hook", 1e-3, nut.inertia, corners, 0.0, corners, nut.faces, pieces=pieces)


@pytest.mark.parametrize(
    ("place_mm", "yaw_deg", "overlaps"),
    [
        ((3.0, 1.2, 0.0), 180.0, False),  # a leg of each stands in the other
        ((0.9, 1.2, 0.0), 180.0, True),  # the legs meet
        ((3.0, 0.0, 0.0), 0.0, True),
        ((3.0, 0.0, 2.1), 0.0, False),  # above
        ((0.0, 7.6, 0.0), 0.0, True),
        ((0.0, 8.1, 0.0), 0.0, False),
    ],
)
def test_overlap_is_that_of_the_pieces(place_mm: Any, yaw_deg: float, overlaps: bool) -> None:
    turned = Rotation.from_euler("z", yaw_deg, degrees=True).as_quat(scalar_first=True)
    a, b = hook(), hook()
    assert parts_overlap(a, (np.zeros(3), LEVEL), b, (1e-3 * np.array(place_mm), turned)) == overlaps
