"""The outline of a plate, from nothing but the points that a measurement or a mesh has on it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.outline import Outline, checked_outline, rectangular

NEIGHBOURS = 4
COMMON = 95.0  # percentile of the distances to these neighbours
LONGEST_EDGE = 2.0  # times that distance; where points are farther apart there is no plate
LEAST_HOLE = 0.75  # of that length; the radius of a hole. Smaller ones are gaps between scattered points
SAME_PLACE = 1e-6  # of the size of the plate


def distinct(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 2) without those at the same place, as the nodes of a solid above each other are."""
    grain = SAME_PLACE * float(np.ptp(points, axis=0).max()) or 1.0
    _, first = np.unique(np.round(points / grain).astype(np.int64), axis=0, return_index=True)
    return points[np.sort(first)]


def outline_of_points(points: NDArray[np.float64]) -> tuple[Outline, float]:
    """The concave hull of points (n, 2) [m] that are all distinct, with holes where they leave room for more.

    An outline that is its bounding box within the distance of neighbours becomes that box.

    Returns:
        the outline; how wide the widest gap between points is that is taken for plate, though it may be a hole [m].

    Raises:
        ValueError: the points are too few, or on a line.
    """
    import shapely
    from scipy.spatial import Delaunay, QhullError, cKDTree

    try:
        corners = Delaunay(points).simplices
    except (QhullError, ValueError) as error:
        raise ValueError(f"has {len(points)} places, allowed are at least 3 that are not on a line") from error
    sides = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    lengths = np.linalg.norm(points[sides[:, 0]] - points[sides[:, 1]], axis=1)
    near = cKDTree(points).query(points, k=min(NEIGHBOURS + 1, len(points)))[0][:, -1]
    limit = LONGEST_EDGE * float(np.percentile(near, COMMON))
    ratio = (limit - lengths.min()) / max(float(np.ptp(lengths)), 1e-300)
    hull = shapely.concave_hull(shapely.MultiPoint(points), ratio=float(np.clip(ratio, 0.0, 1.0)), allow_holes=True)
    if hull.geom_type != "Polygon":
        raise ValueError(f"has {len(points)} places, allowed are at least 3 that are not on a line")
    areas = [shapely.Polygon(hole).area for hole in hull.interiors]
    least = np.pi * (LEAST_HOLE * limit) ** 2
    holes = [hole for hole, area in zip(hull.interiors, areas, strict=True) if area > least]
    widest = max((area for area in areas if area <= least), default=0.0)
    found = checked_outline([shapely.get_coordinates(ring) for ring in (hull.exterior, *holes)])
    return as_box(found) if rectangular(found, 0.5 * limit) else found, 2.0 * math.sqrt(widest / np.pi)


def as_box(outline: Outline) -> Outline:
    """The bounding box of an outline."""
    (left, low), (right, high) = outline.exterior.min(axis=0), outline.exterior.max(axis=0)
    return Outline(np.array([[left, low], [right, low], [right, high], [left, high]]))
