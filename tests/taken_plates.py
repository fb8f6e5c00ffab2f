"""What the package takes a drawing for, and whether that is what was drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import shapely.affinity
from drawn_plates import Truth
from foreign_files import ForeignFile

CLOSE_MM = 0.005  # how far straight pieces may be from a curve
SAME = 1e-4  # share of the area

Taken = tuple[list[Any], list[list[Any]], list[tuple[float, ...]], list[tuple[float, ...]]]


def plate_text(file: ForeignFile, name: str) -> str:
    """A plate file with the drawing."""
    unit = f'drawing_unit = "{file.unit}"\n' if file.unit else ""
    patch = '[[actuator]]\nname = "p"\nthickness_mm = 1.0\nd31_pm_per_v = 180.0\n' if file.patches else ""
    foot = "[[support]]\nstiffness_n_per_mm = 20.0\nloss_factor = 0.2\n" if file.feet else ""
    plate = "thickness_mm = 2.0\ndamping_ratio = 0.002\nhighest_frequency_hz = 3000.0\n"
    return f'[plate]\ndrawing = "{name}"\n{unit}{plate}{patch}{foot}'


def taken_plate(path: Path) -> Taken:
    """Edge, holes, patches (x, y, sides, angle) and feet (x, y) of a plate file [mm]."""
    from feeder_sim.scenario import load_plate_file

    file = load_plate_file(path)
    assert file.plate.outline is not None and file.plate.outline.points_mm is not None
    return (
        list(file.plate.outline.points_mm),
        [list(hole.points_mm or ()) for hole in file.hole],
        [(*a.at_mm, *a.size_mm, a.angle_deg) for a in file.actuator],
        [tuple(s.at_mm) for s in file.support],
    )


def plate_of(taken: Taken) -> Truth:
    edge, holes, patches, feet = taken
    plate = shapely.Polygon(edge)
    if holes:
        plate = shapely.difference(plate, shapely.union_all([shapely.Polygon(hole) for hole in holes]))
    rectangles = []
    for x, y, a, b, angle in patches:
        upright = shapely.box(x - a / 2, y - b / 2, x + a / 2, y + b / 2)
        rectangles.append(shapely.affinity.rotate(upright, angle, origin=(x, y)))
    return Truth(plate, tuple(rectangles), tuple(complex(*foot) for foot in feet))


def difference(taken: Taken, file: ForeignFile) -> str:
    """How the plate differs from what was drawn, which may be moved as a whole; "" if it does not."""
    assert file.truths is not None
    if not file.truths:
        return "was taken, though it draws no plate"
    plate = plate_of(taken)
    return min((between(plate, truth, file.slack_mm) for truth in file.truths), key=len)


def between(plate: Truth, truth: Truth, slack_mm: float = 0.0) -> str:
    """How two plates differ, of which the first may be moved as a whole."""
    low, low_drawn = plate.plate.bounds[:2], truth.plate.bounds[:2]
    shift = (low_drawn[0] - low[0], low_drawn[1] - low[1])
    moved = shapely.affinity.translate(plate.plate, *shift)
    allowed = SAME * truth.plate.area + (CLOSE_MM + slack_mm / 4) * truth.plate.length
    off = shapely.symmetric_difference(moved, truth.plate).area
    if off > allowed:
        return f"has {plate.plate.area:.6g} mm2, drawn are {truth.plate.area:.6g} ({off:.4g} elsewhere)"
    if len(plate.patches) != len(truth.patches):
        return f"has {len(plate.patches)} patches, drawn are {len(truth.patches)}"
    if len(plate.feet) != len(truth.feet):
        return f"has {len(plate.feet)} feet, drawn are {len(truth.feet)}"
    for drawn in truth.patches:
        placed = (shapely.affinity.translate(patch, *shift) for patch in plate.patches)
        if min(shapely.symmetric_difference(patch, drawn).area for patch in placed) > 0.01 * drawn.area:
            return f"has no patch at {drawn.centroid}"
    for foot in truth.feet:
        if min(abs(foot - other - complex(*shift)) for other in plate.feet) > 0.02:
            return f"has no foot at {foot}"
    return ""
