"""Strokes of one layer -> closed rings, or a refusal that says where they are open and how far.

A stroke that is closed is a ring. Ends of open ones that lie within `JOIN` are one place; the rings they make are the
faces between them. What closes no ring is refused: a plate without one of its holes has other modes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.scenario.drawing_files.strokes import SAGITTA, Account, Points, Stroke, place_text

JOIN = 0.002  # [mm]; ends of lines that close are one. Below what any plate is cut to, above the digits of any file
GRID = 0.001  # [mm]; places of joined lines, so that lines drawn twice are one
MOST_MEETINGS = 20  # of a line with others, on average; the time to join them goes as all meetings
TOGETHER = 100  # lines whose meetings are counted at once
NEAR = 1e-5  # [mm]; points of a ring that are closer are one
THIN = 1e-6  # [mm2]; a ring that encloses less is a line drawn back and forth


def rings_of(layer: str, strokes: Sequence[Stroke], account: Account) -> list[Any]:
    """Closed rings that the strokes of a layer make, each as shapely's polygon without holes, each once.

    Raises:
        InputError: a line that closes no ring, with the place and the size of its gap; a ring that crosses itself, or
            encloses nothing; a fill whose edge is not drawn.
    """
    import shapely

    lines = [stroke for stroke in strokes if len(stroke.points) > 1 and stroke.kind != "fill"]
    ends, meets = _joined_ends(lines)
    rings, loose = [], []
    for i, stroke in enumerate(lines):
        points = np.vstack([ends[2 * i], stroke.points[1:-1], ends[2 * i + 1]])
        alone = not (meets[2 * i] or meets[2 * i + 1])
        if stroke.closed or (ends[2 * i] == ends[2 * i + 1]).all() or (stroke.kind == "filled" and alone):
            rings.append(_ring(layer, points, account))
        else:
            loose.append(shapely.LineString(points))
    if loose:
        rings += _faces(layer, loose, account)
    unique_rings = each_once(rings, account)
    tree = shapely.STRtree(unique_rings)
    for stroke in strokes:
        if stroke.kind != "fill":
            continue
        edge = _ring(layer, stroke.points, account)
        if not any(_alike(edge, unique_rings[i]) for i in tree.query(edge)):
            place = place_text(stroke.points.mean(axis=0))
            raise account.refusal(f"has a fill at {place} in the layer {layer} without lines round it, must be both")
    return unique_rings


def _joined_ends(lines: Sequence[Stroke]) -> tuple[Points, NDArray[np.bool_]]:
    """Ends of strokes (2 n, 2) [mm], those that are one place moved to it; which ones meet that of another (2 n,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    ends = np.array([end for stroke in lines for end in (stroke.points[0], stroke.points[-1])]).reshape(-1, 2)
    meets = np.zeros(len(ends), bool)
    free = np.flatnonzero(np.repeat([not stroke.closed for stroke in lines], 2))
    if not len(free):
        return ends, meets
    pairs = cKDTree(ends[free]).query_pairs(JOIN, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(free), len(free)))
    number, label = connected_components(graph, directed=False)
    count = np.bincount(label, minlength=number)
    middles = np.stack([np.bincount(label, ends[free, k], number) / count for k in (0, 1)], axis=1)
    foreign_pairs = pairs[free[pairs[:, 0]] // 2 != free[pairs[:, 1]] // 2]
    meets[free[foreign_pairs.ravel()]] = True
    ends[free] = middles[label]
    return ends, meets


def _ring(layer: str, points: Points, account: Account) -> Any:
    """The polygon that a closed stroke, or one that is closed by a straight line, encloses."""
    import shapely

    # Points that are one but for round-off make a ring that crosses itself there.
    corners = points[np.hypot(*(points - np.roll(points, 1, axis=0)).T) > NEAR]
    polygon = shapely.Polygon(corners) if len(corners) >= 3 else None
    if polygon is not None and not polygon.is_valid:
        where = _place_in(shapely.is_valid_reason(polygon))
        raise account.refusal(f"has a ring in the layer {layer} that meets itself{where}, must be one that does not")
    if polygon is None or polygon.area <= THIN:
        raise account.refusal(f"has a ring at {place_text(points[0])} in the layer {layer} that encloses nothing")
    return polygon


def _place_in(reason: str) -> str:
    """The place in GEOS' words, "" without one."""
    numbers = re.findall(r"[-+.\deE]+", reason.partition("[")[2])
    return f" at {place_text([float(number) for number in numbers[:2]])}" if len(numbers) >= 2 else ""


def _faces(layer: str, loose: Sequence[Any], account: Account) -> list[Any]:
    """Rings that open strokes make together."""
    import shapely

    tree, crossings = shapely.STRtree(loose), 0
    for batch in np.array_split(np.array(loose, object), 1 + len(loose) // TOGETHER):
        crossings += len(tree.query(batch, predicate="intersects")[0])
        if crossings > MOST_MEETINGS * len(loose) + TOGETHER:
            raise account.refusal(f"has {len(loose)} lines across each other in the layer {layer}, must be rings")
    joined = shapely.union_all(loose, grid_size=GRID)
    faces, cuts, dangles, invalid = shapely.polygonize_full([joined])
    for open_lines in (dangles, cuts, invalid):
        if not shapely.is_empty(open_lines):
            raise account.refusal(_gap(layer, shapely.get_parts(open_lines), shapely.get_parts(joined)))
    # A ring within another one makes a hole in its face, and is a face itself.
    return [shapely.Polygon(face.exterior) for face in shapely.get_parts(faces)]


def _gap(layer: str, open_lines: Sequence[Any], lines: Sequence[Any]) -> str:
    """Where lines are open, and how far the next line is."""
    import shapely

    ends = [{line.coords[0], line.coords[-1]} for line in lines]
    places, count = np.unique([place for pair in ends for place in pair], axis=0, return_counts=True)
    free = places[count == 1]
    of_open = {place for line in open_lines for place in (line.coords[0], line.coords[-1])}
    starts = [place for place in map(tuple, free) if place in of_open]
    if not starts:
        return (
            f"has a line at {place_text(open_lines[0].coords[0])} in the layer {layer} that is part of no closed ring"
        )
    gaps = []
    for start in starts:
        to_ends = np.hypot(*(free - start).T)
        other_lines = [line for line, pair in zip(lines, ends, strict=True) if start not in pair]
        to_lines = shapely.distance(other_lines, shapely.Point(start)) if other_lines else np.empty(0)
        gaps.append(min(to_ends[to_ends > 0.0].min(initial=np.inf), to_lines.min(initial=np.inf)))
    least = int(np.argmin(gaps))
    away = f", {gaps[least]:.3g} mm from the next line" if np.isfinite(gaps[least]) else ""
    return (
        f"has an open line in the layer {layer}: it ends at {place_text(starts[least])}{away}, must be closed "
        f"rings, whose ends meet within {JOIN:g} mm"
    )


def each_once(rings: Sequence[Any], account: Account) -> list[Any]:
    """The rings without those that are drawn twice."""
    import shapely

    if len(rings) < 2:
        return list(rings)
    tree = shapely.STRtree(rings)
    unique_rings: list[Any] = []
    dropped: set[int] = set()
    for i, ring in enumerate(rings):
        if i in dropped:
            account.ignore("rings drawn twice")
            continue
        unique_rings.append(ring)
        dropped |= {int(j) for j in tree.query(ring) if j > i and _alike(ring, rings[j])}
    return unique_rings


def check_apart(layer: str, rings: Sequence[Any], account: Account) -> None:
    """Refuse rings that lie within or over each other; they may share an edge.

    Raises:
        InputError: two that do, with a place.
    """
    import shapely

    if len(rings) < 2:
        return
    tree = shapely.STRtree(rings)
    for i, j in tree.query(rings, predicate="intersects").T:
        common = rings[i].intersection(rings[j]) if i < j else None
        most = JOIN * (rings[i].length + rings[j].length)
        if common is not None and common.area > min(most, 0.1 * rings[i].area, 0.1 * rings[j].area):
            place = place_text(common.centroid.coords[0])
            raise account.refusal(f"has two rings over each other at {place} in the layer {layer}, must be rings apart")


def _alike(first: Any, second: Any) -> bool:
    """Whether two rings are one that is drawn twice."""
    limit = 2.0 * SAGITTA * (first.length + second.length)
    return bool(abs(first.area - second.area) < limit and first.symmetric_difference(second).area < limit)
