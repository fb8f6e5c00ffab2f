"""Which parts can meet within a window of time, and the islands they form; found with a grid over the plate.

A part covers at most `range` [m] in the window. Parts whose bounding spheres, grown by it, are apart cannot meet; those
that are linked by such pairs make an island, and islands advance independently of each other. Of concave parts each two
pieces that can meet are a pair of their own; the centre of a piece covers that range once more as its part turns.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.pairs.due import PAIR
from feeder_sim.engines.impulse.state import in_pieces, piece_centre
from feeder_sim.machine_code import compiled, inlined


class Islands(NamedTuple):
    """Parts and pairs in the order of their islands.

    part: indices (n,) of the parts that are there; those of island i are first_part[i] to first_part[i + 1]. pair and
    first_pair likewise, indices of pairs. place: of every part in `part` (parts,). touching, first_touching: the
    pairs of every part, as place in `pair`, behind one another.
    """

    part: NDArray[np.int64]
    first_part: NDArray[np.int64]
    pair: NDArray[np.int64]
    first_pair: NDArray[np.int64]
    place: NDArray[np.int64]
    touching: NDArray[np.int64]
    first_touching: NDArray[np.int64]


class Grid(NamedTuple):
    """Parts in square cells over the plate: cell of each part (-1: not there), parts in the order of their cells, the
    first of each cell in that order, columns and rows of cells.
    """

    cell_of: NDArray[np.int64]
    order: NDArray[np.int64]
    first: NDArray[np.int64]
    columns: int
    rows: int


class Room(NamedTuple):
    """Half the plate's length and width [m], and how far a part can come in the window [m]."""

    half_x: float
    half_y: float
    reach: float


@compiled
def find_pairs(parts, kinds, n_free, room, old):
    """Pairs (a, b), sorted, that can meet within the window; those of `old` keep their axis.

    Parts from n_free on are walls: beside every part within reach of a side of the plate; as they are flat, they meet
    the hull of a part whatever pieces it has. None where a position is not
    finite, which is for the guard to see.
    """
    n = n_free
    largest = 0.0
    for i in range(n):
        if parts[i].there:
            for k in range(3):
                if not math.isfinite(parts[i].position[k]):
                    return np.empty(0, PAIR)
            largest = max(largest, kinds.record[parts[i].kind].reach + kinds.record[parts[i].kind].radius)
    grid = _sort_into_cells(parts, n, 2.0 * (largest + room.reach))
    candidates = np.empty((0, 4), np.int64)
    for counting in range(2):  # count, then fill
        m = 0
        for i in range(n):
            if not parts[i].there:
                continue
            m = _pairs_of(parts, kinds, i, n_free, room, grid, m, candidates)
        if counting == 0:
            candidates = np.empty((m, 4), np.int64)
    pairs = np.empty(m, PAIR)
    o = 0
    for p in range(m):
        pair = pairs[p]
        pair.a, pair.b = candidates[p, 0], candidates[p, 1]
        pair.piece_a, pair.piece_b = candidates[p, 2], candidates[p, 3]
        while o < old.shape[0] and _order(old[o], pair) < 0:
            o += 1
        if o < old.shape[0] and _order(old[o], pair) == 0:
            pairs[p] = old[o]
        else:
            pair.pressing, pair.repeats, pair.struck = 0, 0, -np.inf
            _first_axis(parts, kinds, pair)
    return pairs


@compiled
def _order(pair, other):
    """Which of two pairs comes first: negative for this one, 0 if they are the same."""
    if pair.a != other.a:
        return pair.a - other.a
    if pair.b != other.b:
        return pair.b - other.b
    if pair.piece_a != other.piece_a:
        return pair.piece_a - other.piece_a
    return pair.piece_b - other.piece_b


@compiled
def _sort_into_cells(parts, n, cell):
    """Grid over the parts that are there, of cells of a size [m] or larger."""
    low_x = low_y = np.inf
    high_x = high_y = -np.inf
    for i in range(n):
        if parts[i].there:
            low_x, high_x = min(low_x, parts[i].position[0]), max(high_x, parts[i].position[0])
            low_y, high_y = min(low_y, parts[i].position[1]), max(high_y, parts[i].position[1])
    # A part that has flown far must not make the grid large: more cells than parts bring nothing.
    cell = max(cell, max(high_x - low_x, high_y - low_y) / (2.0 * math.sqrt(n) + 1.0))
    columns, rows = int((high_x - low_x) / cell) + 1, int((high_y - low_y) / cell) + 1
    cell_of = np.full(n, -1)
    first = np.zeros(columns * rows + 1, np.int64)
    for i in range(n):
        if parts[i].there:
            column = int((parts[i].position[0] - low_x) / cell)
            cell_of[i] = column * rows + int((parts[i].position[1] - low_y) / cell)
            first[cell_of[i] + 1] += 1
    for c in range(columns * rows):
        first[c + 1] += first[c]
    order, filled = np.empty(first[-1], np.int64), first[:-1].copy()
    for i in range(n):
        if cell_of[i] >= 0:
            order[filled[cell_of[i]]] = i
            filled[cell_of[i]] += 1
    return Grid(cell_of, order, first, columns, rows)


@compiled
def _pairs_of(parts, kinds, a, n_free, room, grid, m, candidates):
    """Append the pairs of part a with later ones, in order; returns their number, also while `found` is too small."""
    begin = m
    rows = grid.rows
    column, row = grid.cell_of[a] // rows, grid.cell_of[a] % rows
    for c in range(max(column - 1, 0), min(column + 2, grid.columns)):
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for place in range(grid.first[c * rows + r], grid.first[c * rows + r + 1]):
                b = grid.order[place]
                if b > a and _near(parts, kinds, a, b, room.reach):
                    m = _insert_pieces(parts, kinds, a, b, room.reach, begin, m, candidates)
    reach = kinds.record[parts[a].kind].reach + kinds.record[parts[a].kind].radius + room.reach
    walls = n_free  # what stands around the plate comes behind the fixtures
    while walls < parts.shape[0] and not is_wall(parts[walls], kinds):
        fixture = kinds.record[parts[walls].kind]
        for piece in range(fixture.piece_from, fixture.piece_to):
            if _beside(parts[a], parts[walls], kinds.piece[piece], kinds.corners, reach + room.reach):
                for own in range(kinds.record[parts[a].kind].piece_from, kinds.record[parts[a].kind].piece_to):
                    m = _insert(candidates, begin, m, a, walls, own, piece)
        walls += 1
    for wall in range(walls, parts.shape[0]):
        side = wall - walls  # walls at +y, -y, +x, -x
        distance = room.half_y if side < 2 else room.half_x
        along = parts[a].position[1] if side < 2 else parts[a].position[0]
        if (along if side % 2 == 0 else -along) + reach > distance:
            m = _insert(candidates, begin, m, a, wall, parts[a].kind, parts[wall].kind)
    return m


@inlined
def is_wall(part, kinds):
    """Whether what stands is a wall of the rim: flat, without edges."""
    kind = kinds.record[part.kind]
    return kind.edge_to == kind.edge_from


@compiled
def _beside(part, fixture, piece, corners, reach):
    """Whether a part may come to a piece of a fixture, within a reach of its box [m]."""
    for axis in range(3):
        low, high, place = np.inf, -np.inf, 0.0
        for c in range(piece.corner_from, piece.corner_to):
            low, high = min(low, corners[c, axis]), max(high, corners[c, axis])
        for k in range(3):
            place += fixture.attitude[k, axis] * (part.position[k] - fixture.position[k])
        if place < low - reach or place > high + reach:
            return False
    return True


@compiled
def _insert_pieces(parts, kinds, a, b, range_of_each, begin, m, candidates):
    """Append the pairs of pieces of two parts that can meet, in order; returns the number of all pairs."""
    kind_a, kind_b = kinds.record[parts[a].kind], kinds.record[parts[b].kind]
    concave = in_pieces(kind_a) or in_pieces(kind_b)
    for piece_a in range(kind_a.piece_from, kind_a.piece_to):
        for piece_b in range(kind_b.piece_from, kind_b.piece_to):
            if not concave or _pieces_near(parts, kinds, (a, b), (piece_a, piece_b), range_of_each):
                m = _insert(candidates, begin, m, a, b, piece_a, piece_b)
    return m


@compiled
def _pieces_near(parts, kinds, pair, pieces, range_of_each):
    reach, squared = 0.0, 0.0
    for end in range(2):
        kind = kinds.record[parts[pair[end]].kind]
        turns = range_of_each if in_pieces(kind) else 0.0
        reach += kinds.piece[pieces[end]].reach + kind.radius + range_of_each + turns
    first, second = parts[pair[0]], parts[pair[1]]
    for k in range(3):
        apart = piece_centre(first, kinds.piece[pieces[0]], k) - piece_centre(second, kinds.piece[pieces[1]], k)
        squared += apart * apart
    return squared < reach * reach


@compiled
def _near(parts, kinds, a, b, range_of_each):
    reach = kinds.record[parts[a].kind].reach + kinds.record[parts[a].kind].radius + 2.0 * range_of_each
    reach += kinds.record[parts[b].kind].reach + kinds.record[parts[b].kind].radius
    squared = 0.0
    for k in range(3):
        squared += (parts[a].position[k] - parts[b].position[k]) ** 2
    return squared < reach * reach


@compiled
def _insert(candidates, begin, m, a, b, piece_a, piece_b):
    if m >= candidates.shape[0]:
        return m + 1
    k = m
    while k > begin and candidates[k - 1, 1] > b:
        for column in range(4):
            candidates[k, column] = candidates[k - 1, column]
        k -= 1
    candidates[k, 0], candidates[k, 1], candidates[k, 2], candidates[k, 3] = a, b, piece_a, piece_b
    return m + 1


@compiled
def _first_axis(parts, kinds, pair):
    """From centre to centre; to a wall, across it."""
    axis, a, b = pair.axis, parts[pair.a], parts[pair.b]
    size = 0.0
    if kinds.record[b.kind].mass == np.inf and is_wall(b, kinds):
        for k in range(3):
            axis[k] = b.attitude[k, 1]
            size += axis[k] * (b.position[k] - a.position[k])
        if size < 0.0:
            for k in range(3):
                axis[k] = -axis[k]
        return
    for k in range(3):
        axis[k] = piece_centre(b, kinds.piece[pair.piece_b], k) - piece_centre(a, kinds.piece[pair.piece_a], k)
        size += axis[k] * axis[k]
    size = math.sqrt(size)
    for k in range(3):
        axis[k] = axis[k] / size if size > 0.0 else (1.0 if k == 2 else 0.0)


@compiled
def find_islands(parts, n_free, pairs):
    """Connected parts, by union of their pairs; walls connect nothing."""
    root = np.arange(n_free)
    for p in range(pairs.shape[0]):
        if pairs[p].b < n_free:
            a, b = root_of(root, pairs[p].a), root_of(root, pairs[p].b)
            root[max(a, b)] = min(a, b)
    number = np.full(n_free, -1)
    count = 0
    for i in range(n_free):  # a root is the lowest part of its island
        if parts[i].there:
            r = root_of(root, i)
            if r == i:
                number[i] = count
                count += 1
            else:
                number[i] = number[r]
    part, first_part = grouped(number, count)
    island_of_pair = np.empty(pairs.shape[0], np.int64)
    for p in range(pairs.shape[0]):
        island_of_pair[p] = number[pairs[p].a]
    pair, first_pair = grouped(island_of_pair, count)
    place = np.full(n_free, -1)
    for k in range(part.shape[0]):
        place[part[k]] = k
    touching, first_touching = _pairs_by_part(pairs, pair, n_free)
    return Islands(part, first_part, pair, first_pair, place, touching, first_touching)


@compiled
def root_of(root, i):
    """The lowest part of the set that part i is in, by `root`, which leads there."""
    while root[i] != i:
        root[i] = root[root[i]]
        i = root[i]
    return i


@compiled
def grouped(number, count):
    """Indices ordered by their number (-1: left out), and the first of each of `count` groups."""
    first = np.zeros(count + 1, np.int64)
    for i in range(number.shape[0]):
        if number[i] >= 0:
            first[number[i] + 1] += 1
    for g in range(count):
        first[g + 1] += first[g]
    members, filled = np.empty(first[-1], np.int64), first[:-1].copy()
    for i in range(number.shape[0]):
        if number[i] >= 0:
            members[filled[number[i]]] = i
            filled[number[i]] += 1
    return members, first


@compiled
def _pairs_by_part(pairs, pair, n_free):
    """Places in `pair` of the pairs of every part, and the first of each part."""
    first = np.zeros(n_free + 1, np.int64)
    for k in range(pair.shape[0]):
        first[pairs[pair[k]].a + 1] += 1
        if pairs[pair[k]].b < n_free:
            first[pairs[pair[k]].b + 1] += 1
    for i in range(n_free):
        first[i + 1] += first[i]
    touching, filled = np.empty(first[-1], np.int64), first[:-1].copy()
    for k in range(pair.shape[0]):
        a, b = pairs[pair[k]].a, pairs[pair[k]].b
        touching[filled[a]] = k
        filled[a] += 1
        if b < n_free:
            touching[filled[b]] = k
            filled[b] += 1
    return touching, first
