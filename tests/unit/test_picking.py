"""What can be picked: clearance between centres, in plan view, among the parts that are there."""

from __future__ import annotations

import numpy as np
import pytest

from feeder_sim.measures.picking import isolated, nearest_neighbours

# A pair 4 mm apart, a part 10 mm from the pair's second one, and one far away [mm].
PLACES = 1e-3 * np.array([[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [4.0, 10.0, 1.0], [50.0, 0.0, 1.0]])
ALL = np.ones(4, bool)


def test_nearest_neighbours_by_hand() -> None:
    assert nearest_neighbours(PLACES[:, :2]) == pytest.approx([4e-3, 4e-3, 10e-3, 46e-3])


def test_nearest_neighbours_against_all_pairs() -> None:
    points = np.random.default_rng(0).normal(size=(200, 2))
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(distance, np.inf)
    assert nearest_neighbours(points) == pytest.approx(distance.min(axis=1))


def test_a_part_alone_has_no_neighbour() -> None:
    assert list(nearest_neighbours(np.zeros((1, 2)))) == [np.inf]
    assert nearest_neighbours(np.zeros((0, 2))).shape == (0,)


def test_parts_in_one_place_are_no_distance_apart() -> None:
    assert list(nearest_neighbours(np.zeros((3, 2)))) == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("clearance_mm", "expected"),
    [(3.0, [0, 1, 2, 3]), (4.5, [2, 3]), (9.9, [2, 3]), (10.1, [3]), (46.1, [])],
)
def test_what_is_farther_than_the_clearance_is_picked(clearance_mm: float, expected: list[int]) -> None:
    assert np.flatnonzero(isolated(PLACES, ALL, 1e-3 * clearance_mm)).tolist() == expected


def test_who_stands_exactly_at_the_clearance_is_not_picked() -> None:
    apart = np.array([[0.0, 0.0, 0.0], [0.25, 0.0, 0.0]])
    assert np.flatnonzero(isolated(apart, np.ones(2, bool), 0.25)).tolist() == []
    assert np.flatnonzero(isolated(apart, np.ones(2, bool), np.nextafter(0.25, 0.0))).tolist() == [0, 1]


def test_distance_is_seen_from_above() -> None:
    stacked = PLACES.copy()
    stacked[3] = [0.0, 0.0, 0.5]  # far above the first one
    assert np.flatnonzero(isolated(stacked, ALL, 9e-3)).tolist() == [2]


def test_parts_that_are_gone_are_neither_picked_nor_in_the_way() -> None:
    there = np.array([True, False, True, True])
    assert np.flatnonzero(isolated(PLACES, there, 9.9e-3)).tolist() == [0, 2, 3]
    assert np.flatnonzero(isolated(PLACES, np.array([False, False, True, False]), 1.0)).tolist() == [2]
    assert np.flatnonzero(isolated(PLACES, np.zeros(4, bool), 1e-3)).tolist() == []
