"""Pairs, islands and the order of events, each against the plainest algorithm there is."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import from_python, piston_scenario
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from feeder_sim.engines.impulse import island
from feeder_sim.engines.impulse.kinds import read_kinds, rim_walls
from feeder_sim.engines.impulse.pairs import neighbours
from feeder_sim.engines.impulse.pairs.due import PAIR
from feeder_sim.engines.impulse.state import Kinds, new_parts
from feeder_sim.scenario import Ball, HexNut, Scattered
from feeder_sim.scene.scene import Scene, build_scene

find_pairs, find_islands = from_python(neighbours.find_pairs), from_python(neighbours.find_islands)
all_due, earliest, set_due = map(from_python, (island.all_due, island.earliest_of, island.set_due))
HALF = 0.1  # [m], of the plate
NONE = np.empty(0, PAIR)
Records = NDArray[np.void]


def plate(count: int, *, rim: bool) -> Scene:
    """Nuts and balls of two sizes on a plate, with walls around it or not."""
    start = Scattered(kind="scattered")
    nuts = HexNut(size="M2.5", count=count, start=start)
    balls = Ball(shape="ball", diameter_mm=12.0, count=count, start=start)
    square = {"length_mm": 2e3 * HALF, "width_mm": 2e3 * HALF, "rim": rim}
    return build_scene(piston_scenario(frequency_hz=500.0, plate=square, part=(nuts, balls), duration_s=0.1))


def cloud(count: int, seed: int, *, rim: bool = False, spread: float = 0.5 * HALF) -> tuple[Records, Kinds, int]:
    """Parts at random places, a fifth of them taken out, then the walls; and the number of parts without walls."""
    scene, rng = plate(count, rim=rim), np.random.default_rng(seed)
    kinds, (centres, attitudes) = read_kinds(scene), rim_walls(scene)
    n, walls = 2 * count, len(centres)
    parts = new_parts(
        np.concatenate([rng.normal(size=(n, 3)) * [spread, spread, 3e-3], centres]),
        np.concatenate([np.tile(np.eye(3), (n, 1, 1)), attitudes]),
        np.concatenate([scene.kind_of, np.full(walls, len(scene.kinds))]),
    )
    parts["there"] = np.concatenate([rng.random(n) > 0.2, np.ones(walls)])
    return parts, kinds, n


def found(parts: Records, kinds: Kinds, n: int, range_: float, old: Records = NONE) -> Records:
    pairs: Records = find_pairs(parts, kinds, n, neighbours.Room(HALF, HALF, range_), old)
    return pairs


def brute_force(parts: Records, kinds: Kinds, n: int, range_: float) -> list[tuple[int, int]]:
    """All pairs whose bounding spheres, grown by the range, overlap; and parts whose sphere reaches over a side."""
    size = (kinds.record["reach"] + kinds.record["radius"])[parts["kind"]] + range_
    sides = np.array([[0.0, 1.0], [0.0, -1.0], [1.0, 0.0], [-1.0, 0.0]])
    expected = []
    for a in range(n):
        for b in range(a + 1, n):
            near = np.linalg.norm(parts["position"][a] - parts["position"][b]) < size[a] + size[b]
            if parts["there"][a] and parts["there"][b] and near:
                expected.append((a, b))
        for wall in range(n, len(parts)):
            if parts["there"][a] and parts["position"][a, :2] @ sides[wall - n] + size[a] > HALF:
                expected.append((a, wall))
    return expected


@pytest.mark.parametrize("rim", [False, True])
@pytest.mark.parametrize("range_", [0.0, 1e-4, 5e-3])
@pytest.mark.parametrize("count", [1, 3, 40, 80])
def test_pairs_are_those_of_brute_force(count: int, range_: float, rim: bool) -> None:
    n_pairs = 0
    for seed in range(5):
        # From far apart to all in a lump, in one place and in a row; and one that has flown away.
        for spread in (0.5 * HALF, 5e-3, 0.0):
            parts, kinds, n = cloud(count, seed, rim=rim, spread=spread)
            parts["there"][0] = 1
            if spread == 0.0:
                parts["there"][:n], parts["position"][:n] = 1, [0.01, 0.02, 0.003]
                parts["position"][:n, 0] += seed * 1e-3 * np.arange(n)
            if seed == 4:
                parts["position"][0, :2] = [3.0, -2.0]
            pairs = found(parts, kinds, n, range_)
            expected = brute_force(parts, kinds, n, range_)
            assert list(zip(pairs["a"].tolist(), pairs["b"].tolist(), strict=True)) == expected
            n_pairs += len(expected)
    assert n_pairs > 0 or count == 1


def test_new_pairs_begin_with_the_axis_between_their_centres() -> None:
    parts, kinds, n = cloud(40, 3, rim=True)
    pairs = found(parts, kinds, n, 1e-3)
    free = pairs["b"] < n
    assert free.any() and not free.all()
    apart = parts["position"][pairs["b"]] - parts["position"][pairs["a"]]
    expected = apart / np.linalg.norm(apart, axis=1, keepdims=True)
    assert pairs["axis"][free] == pytest.approx(expected[free])
    # To a wall it is the outward normal of that side.
    outward = np.array([[0.0, 1, 0], [0.0, -1, 0], [1.0, 0, 0], [-1.0, 0, 0]])
    inside = np.abs(parts["position"][pairs["a"], :2]).max(axis=1) < HALF
    kept = ~free & inside
    assert pairs["axis"][kept] == pytest.approx(outward[pairs["b"][kept] - n])


def test_pairs_that_were_there_before_keep_their_axis() -> None:
    parts, kinds, n = cloud(40, 5)
    all_pairs = found(parts, kinds, n, 1e-3)
    rng = np.random.default_rng(0)
    kept = rng.random(len(all_pairs)) < 0.5
    axes = rng.normal(size=(kept.sum(), 3))
    # Half of them were known; so was one that is none any more.
    known = np.append(all_pairs[kept], np.array([(n, n + 1, 0, 0, 1, 0.0, 0, (1.0, 1.0, 1.0))], PAIR))
    known["axis"][:-1], known["pressing"][:-1] = axes, 1
    again = found(parts, kinds, n, 1e-3, known)
    assert np.array_equal(again["a"], all_pairs["a"]) and np.array_equal(again["b"], all_pairs["b"])
    assert np.array_equal(again["axis"][kept], axes)
    assert np.array_equal(again["axis"][~kept], all_pairs["axis"][~kept])
    assert np.array_equal(again["pressing"], kept)


@pytest.mark.parametrize("rim", [False, True])
@pytest.mark.parametrize(("count", "range_"), [(3, 1e-3), (40, 0.0), (40, 2e-3), (150, 1e-3)])
def test_islands_are_connected_components(count: int, range_: float, rim: bool) -> None:
    for seed in range(5):
        parts, kinds, n = cloud(count, seed, rim=rim)
        pairs = found(parts, kinds, n, range_)
        islands = find_islands(parts, n, pairs)
        free = pairs["b"] < n  # walls connect nothing
        links = coo_array((np.ones(free.sum()), (pairs["a"][free], pairs["b"][free])), shape=(n, n))
        _, label = connected_components(links, directed=False)
        there = np.flatnonzero(parts["there"][:n])
        assert sorted(islands.part) == list(there)
        assert np.array_equal(islands.part[islands.place[there]], there)
        groups = np.split(islands.part, islands.first_part[1:-1])
        assert len(groups) == len(np.unique(label[there]))
        for group in groups:
            assert len(np.unique(label[group])) == 1
        # Every pair is in the island of its parts, and in the list of each of them.
        assert sorted(islands.pair) == list(range(len(pairs)))
        for number, members in enumerate(np.split(islands.pair, islands.first_pair[1:-1])):
            assert set(pairs["a"][members]) <= set(groups[number])
        for part in range(n):
            places = islands.touching[islands.first_touching[part] : islands.first_touching[part + 1]]
            expected = np.flatnonzero((pairs["a"] == part) | (pairs["b"] == part))
            assert sorted(islands.pair[places]) == list(expected)


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8, 33, 200])
def test_tournament_tree_finds_what_a_scan_finds(n: int) -> None:
    """Times from a small set, so that ties are frequent: of these the lowest number is next."""
    rng = np.random.default_rng(n)
    tree, due = all_due(n, 0.25), np.full(n, 0.25)
    for _ in range(2000):
        assert tree[1] == due.min()
        assert earliest(tree) == int(np.argmin(due))
        event = int(earliest(tree)) if rng.random() < 0.5 else int(rng.integers(n))
        due[event] = np.inf if rng.random() < 0.05 else rng.integers(20) / 16
        set_due(tree, event, due[event])
