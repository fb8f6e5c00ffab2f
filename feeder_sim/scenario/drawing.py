"""A drawing (DXF, SVG) of a plate -> the tables that say the same: its outline, holes, patches and feet.

Layers of these names count, all others do not. In SVG a layer is a group, or one shape, with this name as its id or as
its label in Inkscape.

    outline    the outer edge, and holes within it
    holes      further holes
    patches    rectangles, the piezo patches, from left to right
    feet       circles, upright rectangles or points, from left to right
    fixtures   what stands on the plate, seen from above, from left to right (drawn_tables.py)
    outlets    areas in which parts leave, from left to right

Lines and arcs that make closed rings together are joined; what closes no ring is refused. An `[[actuator]]` or
`[[support]]` without a place takes that of the next patch or foot; a single one stands for all of them, with numbers
behind its name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from feeder_sim.errors import InputError, NotAllowed
from feeder_sim.scenario.drawing_files.dxf import read_dxf
from feeder_sim.scenario.drawing_files.rings import JOIN, check_apart, each_once, rings_of
from feeder_sim.scenario.drawing_files.strokes import LAYERS, MM, MOST_BYTES, Account, Stroke, place_text
from feeder_sim.scenario.drawing_files.svg import read_svg

SQUARE = 0.02  # of the shorter side; how far a patch may be from a rectangle
ROUND = 0.02  # relative; how much smaller than the circle round it a foot may be
CENTRED = 0.01  # of the size of a foot: how far from its middle a point may be that marks its centre


Keys = dict[str, Any]  # of a table


def with_drawing(data: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The keys of a plate with those of its `drawing` in place of it; without one they stay.

    Args:
        data: keys of the plate and of what is on it, as a file has them.
        folder: which the name of the drawing is relative to.

    Raises:
        InputError: a drawing that cannot be read, lacks what is needed, or holds what would be lost.
    """
    if data.get("drawing") is None:
        return data
    result = {key: value for key, value in data.items() if key not in ("drawing", "drawing_unit")}
    for key in ("outline", "length_mm", "width_mm"):
        if result.get(key) is not None:
            raise InputError("is given beside a drawing, must be one of them", key=f"plate.{key}")
    drawing = read_drawing(Path(folder) / str(data["drawing"]), data.get("drawing_unit"), "plate.drawing_unit")
    rings, account, edges = drawing.rings, drawing.account, drawing.edges
    if not edges:
        raise account.refusal(
            f"has no closed ring in the layer outline, must be the plate's edge ({account.to_text()})"
        )
    for ring in edges[1:]:
        if not edges[0].contains(ring):
            place = place_text(ring.centroid.coords[0])
            raise account.refusal(f"has a second ring at {place} in the layer outline, must be the edge and its holes")
    holes = each_once([*edges[1:], *rings["holes"]], account)
    check_apart("outline or holes", holes, account)
    result["outline"] = {"points_mm": _corners(edges[0])}
    drawn_holes = [{"points_mm": _corners(hole)} for hole in holes]
    if isinstance(result.get("hole") or [], list | tuple):  # else the table's own check says what is wrong
        result["hole"] = [*(result.get("hole") or ()), *drawn_holes]
    patches = sorted((_rectangle(ring, account) for ring in rings["patches"]), key=order)
    feet: list[Keys] = [{"at_mm": list(point)} for point in _points_apart(drawing.points, rings["feet"], account)]
    feet = sorted([*feet, *(_foot(ring, account) for ring in rings["feet"])], key=order)
    for layer in ("fixtures", "outlets"):
        account.ignore_layer(layer, layer)
    for key, layer, places in (("actuator", "patches", patches), ("support", "feet", feet)):
        tables = result.get(key) or []
        if not isinstance(tables, list | tuple):  # as above
            continue
        lacking = [isinstance(table, dict) and "at_mm" not in table for table in tables]
        if any(lacking):
            result[key] = placed(tables, lacking, places, f"[[{key}]] without at_mm", layer, account)
        else:
            account.ignore_layer(layer, f"{layer} that no [[{key}]] takes")
    return result | {"drawing_account": account.to_text()}


class Drawing(NamedTuple):
    """What counts in a drawing.

    Attributes:
        rings: of every layer, shapely's polygons [mm].
        points: in the layer of feet [mm].
        account: of its entities.
    """

    rings: dict[str, list[Any]]
    points: list[tuple[float, float]]
    account: Account

    @property
    def edges(self) -> list[Any]:
        """The rings of the layer outline, the largest first."""
        return sorted(self.rings["outline"], key=lambda ring: -ring.area)

    @property
    def middle(self) -> tuple[float, float]:
        """Of the box around the outline [mm], from which a scene is measured; the origin without one."""
        if not self.rings["outline"]:
            return 0.0, 0.0
        x0, y0, x1, y1 = self.edges[0].bounds
        return 0.5 * (x0 + x1), 0.5 * (y0 + y1)


def read_drawing(path: Path, unit: Any, unit_key: str) -> Drawing:
    """Read a drawing; its unit is for one that does not say it, `unit_key` names it in messages.

    Raises:
        InputError: it cannot be read, or holds what would be lost.
    """
    account = Account(path)
    try:
        return _read(path, unit, unit_key, account)
    except InputError:
        raise
    except Exception as error:  # the readers of damaged files, and what is made of them, raise what they like
        raise account.refusal(f"is not a readable drawing ({type(error).__name__})") from error


def _read(path: Path, unit: Any, unit_key: str, account: Account) -> Drawing:
    if not path.is_file() or path.stat().st_size > MOST_BYTES:
        raise account.refusal(f"is no file of up to {MOST_BYTES // 1_000_000} MB, must be a DXF or SVG drawing")
    if unit is not None and (not isinstance(unit, str) or unit not in MM):
        raise NotAllowed(unit, ", ".join(MM), key=unit_key)
    strokes: dict[str, list[Stroke]] = {layer: [] for layer in LAYERS}
    for stroke in (read_svg if path.suffix.lower() == ".svg" else read_dxf)(path, unit, account):
        strokes[stroke.layer].append(stroke)
    points = [(float(s.points[0, 0]), float(s.points[0, 1])) for s in strokes["feet"] if len(s.points) == 1]
    rings = {layer: rings_of(layer, of_layer, account) for layer, of_layer in strokes.items()}
    for layer in ("patches", "feet", "fixtures", "outlets"):
        check_apart(layer, rings[layer], account)
    return Drawing(rings, points, account)


def placed(
    tables: Sequence[Any],
    lacking: Sequence[bool],
    places: Sequence[Keys],
    what: str,
    layer: str,
    account: Account,
    merge: Callable[[Keys, Keys], Keys] = Keys.__or__,
) -> list[Any]:
    """The tables, each that lacks a place with the next of a layer, or the only one with all; `what` they are called.

    `merge` puts a table and a place together.

    Raises:
        InputError: there are more or fewer places.
    """
    unplaced = [table for table, lacks in zip(tables, lacking, strict=True) if lacks]
    if len(unplaced) == 1 and len(places) > 1:
        name = unplaced[0].get("name")
        names = [{} if name is None else {"name": f"{name}_{i + 1}"} for i in range(len(places))]
        copies = [merge(unplaced[0], place) | name_entry for place, name_entry in zip(places, names, strict=True)]
        return [table for table in tables if table is not unplaced[0]] + copies
    if len(unplaced) != len(places):
        raise account.refusal(
            f"has {len(places)} in the layer {layer}, must be as many as there are {what}, {len(unplaced)}, "
            "or one for all"
        )
    following = iter(places)
    return [merge(table, next(following)) if lacks else table for table, lacks in zip(tables, lacking, strict=True)]


def _corners(ring: Any) -> list[list[float]]:
    return [[x, y] for x, y in list(ring.exterior.coords)[:-1]]


def order(place: Keys) -> tuple[float, float]:
    """From left to right, and from below up where that is the same but for round-off."""
    x, y = place["at_mm"]
    return round(x / JOIN) * JOIN, y


def _points_apart(
    points: Sequence[tuple[float, float]], rings: Sequence[Any], account: Account
) -> list[tuple[float, float]]:
    """Points of feet, those drawn twice once, and without the centres of feet that are drawn as rings.

    Raises:
        InputError: a point that lies within a ring and is not its centre.
    """
    import shapely

    apart: list[tuple[float, float]] = []
    for point in points:
        if any(math.dist(point, other) <= JOIN for other in apart):
            account.ignore("points drawn twice")
            continue
        foot = next((ring for ring in rings if ring.covers(shapely.Point(point))), None)
        if foot is None:
            apart.append(point)
        elif math.dist(point, foot.centroid.coords[0]) <= CENTRED * math.sqrt(foot.area):
            account.ignore("centres of feet")
        else:
            raise account.refusal(f"has a point at {place_text(point)} within a foot, must be one of both")
    return apart


def _foot(ring: Any, account: Account) -> dict[str, Any]:
    """Place and size of a foot that is a circle, or a rectangle along the axes."""
    import shapely

    circle = shapely.minimum_bounding_circle(ring)
    low_x, low_y, high_x, high_y = ring.bounds
    if ring.area > (1.0 - ROUND) * circle.area:
        return {"at_mm": [ring.centroid.x, ring.centroid.y], "diameter_mm": 2.0 * math.sqrt(ring.area / math.pi)}
    if ring.symmetric_difference(shapely.box(*ring.bounds)).area <= JOIN * ring.length:
        place = [0.5 * (low_x + high_x), 0.5 * (low_y + high_y)]
        return {"at_mm": place, "size_mm": [high_x - low_x, high_y - low_y]}
    raise account.refusal(
        f"has a foot at {place_text(ring.centroid.coords[0])} that is neither a circle nor a rectangle along the axes"
    )


def _rectangle(ring: Any, account: Account) -> dict[str, Any]:
    """Middle, sides and angle of a patch, its first side the one nearest to x."""
    import shapely

    box = shapely.minimum_rotated_rectangle(ring)
    corners = list(box.exterior.coords)
    sides = [(corners[i + 1][0] - corners[i][0], corners[i + 1][1] - corners[i][1]) for i in range(2)]
    first = max(sides, key=lambda side: abs(side[0]) / math.hypot(*side))
    other = sides[1 - sides.index(first)]
    a, b = math.hypot(*first), math.hypot(*other)
    if box.area - ring.area > SQUARE * min(a, b) ** 2:
        raise account.refusal(f"has a patch at {place_text(ring.centroid.coords[0])} that is no rectangle")
    angle = math.degrees(math.atan2(first[1], first[0]))
    angle = (angle + 90.0) % 180.0 - 90.0
    return {"at_mm": [box.centroid.x, box.centroid.y], "size_mm": [a, b], "angle_deg": round(angle, 6)}
