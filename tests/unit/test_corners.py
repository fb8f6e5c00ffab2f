"""Contact corners: as few as an error allows, and not lopsided."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from conftest import REPOSITORY
from scipy.spatial import ConvexHull

from feeder_sim.part.corners import MOST_CORNERS, contact_corners


def vertices(mesh: Any) -> np.ndarray:
    """Hull vertices [m] of a mesh in mm, about its centre of mass."""
    return 1e-3 * (np.array(mesh.convex_hull.vertices) - mesh.center_mass)


def depth_by_support(points: np.ndarray, corners: np.ndarray) -> float:
    """The error another way: largest difference of the extents of both in any of many directions."""
    directions = np.random.default_rng(0).normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return float(((points @ directions.T).max(axis=0) - (corners @ directions.T).max(axis=0)).max())


@pytest.mark.parametrize(("error_um", "most"), [(40.0, 100), (80.0, 40), (200.0, 10)])
def test_the_error_is_kept(error_um: float, most: int) -> None:
    """A bracket of ten corners, each of them a cloud of 40 vertices some ten micrometres wide."""
    points = vertices(trimesh.load_mesh(REPOSITORY / "models/bracket/bracket.stl"))
    rough = (points + 30e-6 * np.random.default_rng(3).normal(size=(40, *points.shape))).reshape(-1, 3)
    rough = rough[ConvexHull(1e3 * rough).vertices]
    corners, error = contact_corners(rough, 1e-6 * error_um)
    assert 0.0 < error <= 1e-6 * error_um
    assert 0.5 * error <= depth_by_support(rough, corners) <= error + 1e-12
    assert {tuple(c) for c in corners} <= {tuple(p) for p in rough}
    assert len(corners) <= most


def test_a_larger_error_takes_fewer_corners() -> None:
    points = vertices(trimesh.load_mesh(REPOSITORY / "models/screw/screw.stl"))
    numbers = [len(contact_corners(points, 1e-6 * error)[0]) for error in (25.0, 50.0, 100.0)]
    assert numbers == [72, 48, 36]


@pytest.mark.parametrize(("sides", "error_um"), [(12, 20.0), (48, 30.0), (50, 50.0), (36, 100.0)])
def test_what_is_round_stays_even(sides: int, error_um: float) -> None:
    """The corners kept of each rim of a cylinder are those of a regular polygon or a few: their centre is the axis."""
    cylinder = trimesh.creation.cylinder(radius=2.0, height=3.0, sections=sides)
    corners, _ = contact_corners(vertices(cylinder), 1e-6 * error_um)
    for rim in (corners[corners[:, 2] > 0.0], corners[corners[:, 2] < 0.0]):
        assert 3 <= len(rim) <= sides
        assert np.linalg.norm(rim[:, :2].mean(axis=0)) < 1e-9


def test_corners_that_a_box_needs_are_all_kept() -> None:
    points = vertices(trimesh.creation.box(extents=[6.0, 4.0, 2.0]))
    corners, error = contact_corners(points, 100e-6)
    assert (corners == points).all() and error == 0.0


def test_a_ball_is_cut_short_evenly() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=3.0)
    corners, error = contact_corners(vertices(ball), 10e-6)
    assert len(corners) <= MOST_CORNERS
    assert 50e-6 < error < 150e-6
    assert np.linalg.norm(corners.mean(axis=0)) < 0.1e-3


def test_many_sides_that_have_no_divisor() -> None:
    """101 sides: all orbits but single vertices are too large for what a part may have."""
    cylinder = trimesh.creation.cylinder(radius=2.0, height=3.0, sections=101)
    corners, error = contact_corners(vertices(cylinder), 30e-6)
    assert len(corners) <= MOST_CORNERS
    assert error <= 30e-6


def test_no_error_takes_each_vertex_once() -> None:
    points = vertices(trimesh.load_mesh(REPOSITORY / "models/bracket/bracket.stl"))
    for some in (points, np.array(trimesh.creation.box((1.6, 0.8, 0.45)).vertices), points[:9]):
        corners, error = contact_corners(some, 0.0)
        assert error < 1e-12 and len(corners) == len(np.unique(corners, axis=0)) <= len(some)
