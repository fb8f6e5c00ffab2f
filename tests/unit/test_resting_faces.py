"""Which faces a part comes to rest on, and how often, against the same calculation in trimesh."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from feeder_sim.part.stable_poses import _resting_faces


@pytest.mark.parametrize("number", range(30))
def test_chances_are_those_of_trimesh(number: int) -> None:
    """Of random hulls, flat ones among them."""
    rng = np.random.default_rng(1000 + number)
    points = rng.normal(size=(int(rng.integers(5, 40)), 3)) * [1.0, rng.uniform(0.3, 1.0), rng.uniform(0.2, 1.0)]
    points = points[ConvexHull(points).vertices]
    points -= points.mean(axis=0)
    hull = trimesh.Trimesh(points / np.abs(points).max()).convex_hull
    transforms, expected = trimesh.poses.compute_stable_poses(hull, center_mass=np.zeros(3))
    theirs = -np.asarray(transforms)[:, 2, :3]
    down, chance = _resting_faces(points)
    assert len(down) == len(theirs)
    same = (down @ theirs.T).argmax(axis=1)
    assert sorted(same) == list(range(len(theirs)))
    assert (down * theirs[same]).sum(
        axis=1
    ).min() > 1.0 - 1e-5  # of two faces nearly in one plane either stands for both
    assert chance == pytest.approx(expected[same] / expected.sum(), abs=1e-9)


def test_a_box_rests_on_its_six_faces_as_often_as_they_are_seen() -> None:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-2, 2) for z in (-3, 3)], float)
    down, chance = _resting_faces(corners)
    assert len(down) == 6 and chance.sum() == pytest.approx(1.0)
    for axis, (half, others) in enumerate(((1.0, (2.0, 3.0)), (2.0, (1.0, 3.0)), (3.0, (1.0, 2.0)))):
        a, b = others  # solid angle of a rectangle, seen from above its middle
        seen = 4.0 * np.arcsin(a * b / np.sqrt((a * a + half * half) * (b * b + half * half)))
        faces = np.abs(down[:, axis]) > 0.5
        assert faces.sum() == 2 and chance[faces] == pytest.approx(seen / (4.0 * np.pi))
