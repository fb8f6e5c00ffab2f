"""Which faces a part comes to rest on, and how often, when it is put down slowly."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from feeder_sim.part.quasi_static import resting_faces
from feeder_sim.part.solids import cylinder

TURN = Rotation.from_euler("xyz", [0.3, 1.1, -2.0]).as_matrix()
ASIDE = np.array([0.6, -1.2, 0.3])  # of the centre of mass


def block(x: float, y: float, z: float) -> NDArray[np.float64]:
    """Corners of a block of half these sides about its middle."""
    return np.array(list(product((-x, x), (-y, y), (-z, z))))


def prism(sides: int, length: float) -> NDArray[np.float64]:
    """Corners of a regular prism of circumradius 1 along z."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.concatenate([np.column_stack([rim, np.full(sides, z)]) for z in (-length / 2.0, length / 2.0)])


def random_hull(number: int) -> NDArray[np.float64]:
    """Corners about a random point inside."""
    rng = np.random.default_rng(number)
    points = rng.normal(size=(int(rng.integers(5, 40)), 3)) * [1.0, rng.uniform(0.2, 1.0), rng.uniform(0.1, 1.0)]
    points = points[ConvexHull(points).vertices]
    return np.asarray(points - rng.dirichlet(np.full(len(points), 0.7)) @ points)


def chances(points: NDArray[np.float64], down: NDArray[np.float64]) -> NDArray[np.float64]:
    """Chance of each of these directions (n, 3), shape (n,)."""
    faces, chance = resting_faces(points)
    along = down @ faces.T
    assert along.max(axis=1) == pytest.approx(1.0)
    return np.asarray(chance[along.argmax(axis=1)])


def nearest(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], list[int]]:
    """The point nearest to the origin of the convex hull of a few corners (n, 3), and the corners that span it."""
    points: list[tuple[float, list[int], NDArray[np.float64]]] = []
    for size in (1, 2, 3):
        for chosen in map(list, combinations(range(len(corners)), size)):
            first, sides = corners[chosen[0]], corners[chosen[1:]] - corners[chosen[0]]
            weights = np.linalg.lstsq(sides.T, -first, rcond=None)[0] if size > 1 else np.empty(0)
            if (weights >= 0.0).all() and weights.sum() <= 1.0:
                point = first + weights @ sides
                points.append((float(point @ point), chosen, point))
    _, chosen, point = min(points, key=lambda near: near[0])
    return point, chosen


def put_down(points: NDArray[np.float64], down: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the direction down of one part (3,) goes, stretch by stretch.

    Of what it stands on, the part turns about the point nearest to the centre of mass, until another corner is as low.
    """
    support = [int((points @ down).argmax())]
    while True:
        pivot, spanning = nearest(points[support])
        support = [support[i] for i in spanning]
        distance = np.linalg.norm(pivot)
        radial = pivot / distance
        across = down - (down @ radial) * radial
        if np.linalg.norm(across) < 1e-9:
            return down
        across /= np.linalg.norm(across)
        turned = np.arctan2(down @ across, down @ radial)
        angles = np.arctan2(distance - points @ radial, points @ across)
        angles[support] = np.inf
        angles[angles <= turned + 1e-12] = np.inf
        down = np.cos(angles.min()) * radial + np.sin(angles.min()) * across
        support = support + np.flatnonzero(angles < angles.min() + 1e-9).tolist()


def check_against_paths(points: NDArray[np.float64], parts: int) -> None:
    down, chance = resting_faces(points)
    assert chance.sum() == pytest.approx(1.0, abs=1e-12) and (chance > 0.0).all()
    start = np.random.default_rng(1).normal(size=(parts, 3))
    start /= np.linalg.norm(start, axis=1, keepdims=True)
    along = np.array([put_down(points, direction) for direction in start]) @ down.T
    assert along.max(axis=1) == pytest.approx(1.0, abs=1e-6)
    share = np.bincount(along.argmax(axis=1), minlength=len(down)) / parts
    deviation = (share - chance) / np.sqrt(np.maximum(chance, 1.0 / parts) / parts)
    assert np.abs(deviation).max() < 3.5, deviation


@pytest.mark.parametrize("number", [2, 3, 7, 12, 16, 21])
def test_chances_of_random_hulls_are_shares_of_paths(number: int) -> None:
    check_against_paths(random_hull(number), 1000)


@pytest.mark.parametrize(
    "points",
    [block(1.0, 2.0, 3.0), block(1.0, 2.0, 3.0) + ASIDE, prism(5, 8.0), prism(3, 0.8) + ASIDE / 4.0],
    ids=["block", "uneven block", "long prism", "uneven slab"],
)
def test_chances_of_prisms_are_shares_of_paths(points: NDArray[np.float64]) -> None:
    check_against_paths(points, 1500)


def test_regular_parts_rest_on_all_faces_alike() -> None:
    for points in (block(1.0, 1.0, 1.0), block(1.0, 1.0, 1.0)[[0, 3, 5, 6]], np.concatenate([np.eye(3), -np.eye(3)])):
        faces = len(np.unique(ConvexHull(points).equations.round(6), axis=0))
        assert resting_faces(points)[1] == pytest.approx(np.full(faces, 1.0 / faces), abs=1e-12)


def test_a_block_rests_on_a_face_as_often_as_it_is_seen() -> None:
    """By symmetry the edges of the basins are the edges of the block, seen from its middle."""
    down, chance = resting_faces(block(1.0, 2.0, 3.0))
    assert len(down) == 6
    for axis, (half, a, b) in enumerate(((1.0, 2.0, 3.0), (2.0, 1.0, 3.0), (3.0, 1.0, 2.0))):
        seen = 4.0 * np.arcsin(a * b / np.sqrt((a * a + half * half) * (b * b + half * half)))
        assert chance[np.abs(down[:, axis]) > 0.5] == pytest.approx([seen / (4.0 * np.pi)] * 2, abs=1e-12)


def test_a_long_prism_rests_on_its_sides_alike() -> None:
    down, chance = resting_faces(prism(6, 20.0))
    ends = np.abs(down[:, 2]) > 0.5
    assert chance[~ends] == pytest.approx([(1.0 - chance[ends].sum()) / 6.0] * 6, abs=1e-12)
    assert 0.0 < chance[ends].sum() < 0.01


@pytest.mark.parametrize(
    "points",
    [block(1.0, 2.0, 3.0) + ASIDE, prism(64, 1.5), cylinder(4e-3, 3e-3, 7850.0, "rod").corners]
    + [random_hull(number) for number in range(30)],
)
def test_a_part_that_is_turned_has_the_same_chances(points: NDArray[np.float64]) -> None:
    down, chance = resting_faces(points)
    assert chance == pytest.approx(chances(points @ TURN.T, down @ TURN.T), abs=1e-9)


def test_a_centre_of_mass_over_the_edge_of_a_face() -> None:
    """A block sheared until its bottom ends below its centre: what comes to the bottom stays, or all of it goes on."""
    sheared = block(1.0, 1.0, 2.0)
    sheared[:, 0] += 0.5 * sheared[:, 2]
    bottom = []
    for beyond in (-1e-4, -1e-6, -1e-8, 1e-8, 1e-6):
        down, chance = resting_faces(sheared - [beyond, 0.0, 0.0])
        assert chance.sum() == pytest.approx(1.0, abs=1e-12)
        bottom.append(float(chance[down[:, 2] < -0.999].sum()))
    assert bottom == pytest.approx([0.0512082] * 3 + [0.0] * 2, abs=1e-5)


def test_a_face_that_rolls_onto_a_ridge_goes_to_either_side_alike() -> None:
    """Of parts with a plane of symmetry, some corners on it: whole regions meet a saddle in the plane."""
    mirror = np.diag([1.0, -1.0, 1.0])
    for number in range(40):
        rng = np.random.default_rng(number)
        half, middle = rng.normal(size=(8, 3)), rng.normal(size=(5, 3)) * [1.0, 0.0, 1.0]
        points = np.concatenate([half, half @ mirror, middle])
        points = points[ConvexHull(points).vertices]
        points -= points.mean(axis=0)
        down, chance = resting_faces(points)
        assert chance == pytest.approx(chances(points, down @ mirror), abs=1e-9)


def test_triangles_of_one_face_are_one_but_for_the_precision_of_a_file() -> None:
    """Corners within faces and edges, off by what 32 bits keep."""
    grid = np.array(list(product(np.linspace(-1.0, 1.0, 5), repeat=3)))
    surface = grid[np.abs(grid).max(axis=1) == 1.0] * [1.0, 2.0, 3.0]
    down, chance = resting_faces(surface + np.random.default_rng(1).normal(scale=1e-7, size=surface.shape))
    expected = chances(block(1.0, 2.0, 3.0), down.round(3))
    assert len(down) == 6 and chance == pytest.approx(expected, abs=1e-5)
