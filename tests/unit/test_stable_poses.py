from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from feeder_sim.part.mesh_part import mesh_part
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.solids import ball, cylinder, hex_nut
from feeder_sim.part.stable_poses import NONE, PoseTable, stable_poses


def box(x: float, y: float, z: float) -> RigidPart:
    corners = 0.5 * np.array([[i * x, j * y, k * z] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    inertia = np.array([y * y + z * z, x * x + z * z, x * x + y * y]) / 12.0
    return RigidPart("box", 1.0, inertia, corners, 0.0, corners, np.empty((0, 3), np.int64))


def nut() -> RigidPart:
    return hex_nut(5e-3, 2e-3, 2.5e-3, 7850.0, "nut")


def turned(table: PoseTable, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random poses, members of theirs and yaws: number, yaw, attitude."""
    number, yaw, attitude = [], [], []
    for n, pose in enumerate(table.poses):
        for level in pose.attitude:
            number.append(n)
            yaw.append(rng.uniform(0.0, 2.0 * np.pi / pose.yaws))
            turn = Rotation.from_rotvec([0.0, 0.0, yaw[-1]]) * Rotation.from_quat(level, scalar_first=True)
            attitude.append(turn.as_quat(scalar_first=True))
    return np.array(number), np.array(yaw), np.array(attitude)


@pytest.mark.parametrize(
    ("part", "heights", "faces", "yaws"),
    [
        (nut(), [1.0e-3, 2.5e-3], [2, 6], [6, 2]),
        (box(6e-3, 4e-3, 2e-3), [1e-3, 2e-3, 3e-3], [2, 2, 2], [2, 2, 2]),
        (box(2e-3, 2e-3, 2e-3), [1e-3], [6], [4]),
        (cylinder(4e-3, 3e-3, 7850.0, "rod"), [1.5e-3, 2e-3], [2, 32], [32, 2]),
        (ball(4e-3, 7850.0, "ball"), [], [], []),
    ],
    ids=["nut", "box", "cube", "cylinder", "ball"],
)
def test_symmetric_poses_are_one(part: RigidPart, heights: list[float], faces: list[int], yaws: list[int]) -> None:
    poses = stable_poses(part).poses
    assert [pose.height for pose in poses] == pytest.approx(heights, rel=6e-3)
    assert [len(pose.down) for pose in poses] == faces
    assert [pose.yaws for pose in poses] == yaws
    assert sum(pose.chance for pose in poses) == pytest.approx(1.0 if poses else 0.0)


def test_a_prism_of_no_symmetry_and_its_mirror_images() -> None:
    """A right-angled prism lies on its two triangles in two ways: they are mirror images."""
    triangle = np.array([[0.0, 0.0], [4e-3, 0.0], [0.0, 3e-3]]) - np.array([4e-3, 3e-3]) / 3.0
    corners = np.array([[x, y, z] for z in (-2.5e-3, 2.5e-3) for x, y in triangle])
    part = RigidPart("prism", 1.0, np.ones(3), corners, 0.0, corners, np.empty((0, 3), np.int64))
    poses = stable_poses(part).poses
    assert sorted(len(pose.down) for pose in poses) == [1, 1, 1, 1, 1]
    ends = [pose for pose in poses if abs(pose.down[0][2]) > 0.9]
    assert ends[0].height == pytest.approx(2.5e-3) == ends[1].height


@pytest.mark.parametrize("part", [nut(), cylinder(4e-3, 3e-3, 7850.0, "rod"), box(6e-3, 4e-3, 2e-3)])
def test_number_and_yaw_of_attitudes(part: RigidPart) -> None:
    table = stable_poses(part)
    number, yaw, attitude = turned(table, np.random.default_rng(1))
    assert (table.number(attitude) == number).all()
    round_ones = np.array([table.poses[n].yaws >= 24 for n in number])
    found = table.yaw(attitude)
    assert found[~round_ones] == pytest.approx(yaw[~round_ones], abs=1e-6)
    assert (found[round_ones] == 0.0).all()
    leaning = Rotation.from_rotvec([np.radians(25.0), 0.0, 0.0]).as_quat(scalar_first=True)
    assert table.number(leaning) == NONE


def test_the_yaw_of_a_rod_on_its_side_is_that_of_its_axis() -> None:
    """However it has rolled."""
    table = stable_poses(cylinder(2e-3, 8e-3, 7850.0, "rod"))
    rng, axes, yaws = np.random.default_rng(2), [], []
    for _ in range(50):
        roll = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)])
        attitude = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, np.pi)]) * Rotation.from_rotvec([np.pi / 2, 0, 0])
        x, y, _ = attitude.apply([0.0, 0.0, 1.0])
        axes.append(np.arctan2(y, x))
        yaws.append(table.yaw((attitude * roll).as_quat(scalar_first=True)[None])[0])
    difference = (np.array(yaws) - axes) % np.pi
    spread = np.abs((difference - difference[0] + np.pi / 2) % np.pi - np.pi / 2)
    assert spread.max() < np.radians(6.0)  # half of what is between two of its corners


def of_mesh(mesh: Any, folder: Path) -> RigidPart:
    """As read from a file, with the contact corners of the usual error."""
    mesh.export(folder / "part.stl")
    return mesh_part(folder / "part.stl", 1.0, 7850.0, "part", corner_error=50e-6)


def chamfered_cube(side: float, chamfer: float) -> Any:
    """A cube [mm] whose corners are cut."""
    full, less = 0.5 * side, 0.5 * side - chamfer
    points = [np.roll([full, less, less], n) * signs for n in range(3) for signs in product((-1.0, 1.0), repeat=3)]
    return trimesh.Trimesh(np.array(points)).convex_hull


@pytest.mark.parametrize(
    ("mesh", "faces", "yaws"),
    [
        (trimesh.creation.cylinder(radius=1.5, height=2.0, sections=100), 2, 100),
        (trimesh.creation.annulus(1.0, 3.0, 1.0, sections=128), 2, 128),
        (chamfered_cube(3.0, 0.01), 6, 4),
        (trimesh.creation.box(extents=[10.0, 10.0, 0.03]), 2, 4),
    ],
    ids=["disc", "washer", "cube", "shim"],
)
def test_symmetry_is_that_of_the_mesh_whatever_its_contact_corners(
    mesh: Any, faces: int, yaws: int, tmp_path: Path
) -> None:
    lowest = stable_poses(of_mesh(mesh, tmp_path)).poses[0]
    assert (len(lowest.down), lowest.yaws) == (faces, yaws)


def test_a_capsule_has_one_pose_that_it_rolls_in_and_a_ball_of_facets_one_as_well(tmp_path: Path) -> None:
    for mesh in (trimesh.creation.capsule(height=4.0, radius=1.5), trimesh.creation.icosphere(subdivisions=3)):
        assert len(stable_poses(of_mesh(mesh, tmp_path)).poses) == 1
