"""A drawing (DXF, SVG) of a plate -> the tables that say the same: its outline, holes, patches and feet.

Layers of these names count, all others do not. In SVG a layer is a group, or one shape, with this name as its id or as
its label in Inkscape.

    outline    the outer edge, and holes within it
    holes      further holes
    patches    rectangles, the piezo patches, from left to right
    feet       circles or points, from left to right

Lines and arcs that make closed rings together are joined. An `[[actuator]]` or `[[support]]` without a place takes that
of the next patch or foot; a single one stands for all of them, with numbers behind its name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from feeder_sim.errors import InputError, MissingExtra

CLOSE = 0.005  # [mm]; how far straight pieces may be from a curve
SNAP = 0.001  # [mm]; ends of lines that close are one
SQUARE = 0.02  # of the shorter side; how far a patch may be from a rectangle
MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
OF_HEADER = {1: "inch", 4: "mm", 5: "cm", 6: "m"}  # $INSUNITS
LAYERS = ("outline", "holes", "patches", "feet")
MOST_BYTES = 50_000_000
Point = tuple[float, float]


def with_drawing(data: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The keys of a plate with those of its `drawing` in place of it; without one they stay.

    Args:
        data: keys of the plate and of what is on it, as a file has them.
        folder: which the name of the drawing is relative to.

    Raises:
        InputError: a drawing that cannot be read or lacks what is needed.
    """
    if data.get("drawing") is None:
        return data
    path = Path(folder) / str(data["drawing"])
    rings, points = _read(path, data.get("drawing_unit"))
    found = {key: value for key, value in data.items() if key not in ("drawing", "drawing_unit")}
    for key in ("outline", "length_mm", "width_mm"):
        if found.get(key) is not None:
            raise InputError("is given beside a drawing, allowed is one of them", key=f"plate.{key}")
    edges = sorted(rings["outline"], key=lambda ring: -ring.area)
    if not edges:
        raise InputError("has no closed ring in the layer outline, allowed is one with the plate's edge", file=path)
    holes = [*edges[1:], *rings["holes"]]
    found["outline"] = {"points_mm": _corners(edges[0])}
    found["hole"] = [*(found.get("hole") or ()), *({"points_mm": _corners(hole)} for hole in holes)]
    patches = [_rectangle(ring, path) for ring in sorted(rings["patches"], key=lambda ring: ring.centroid.x)]
    feet: list[dict[str, Any]] = [{"at_mm": list(point)} for point in points]
    feet += [{"at_mm": [r.centroid.x, r.centroid.y], "diameter_mm": _diameter(r)} for r in rings["feet"]]
    feet.sort(key=lambda foot: foot["at_mm"][0])
    for key, places in (("actuator", patches), ("support", feet)):
        if found.get(key):
            found[key] = _placed(list(found[key]), places, key, path)
    return found


def _placed(
    tables: list[dict[str, Any]], places: Sequence[dict[str, Any]], key: str, path: Path
) -> list[dict[str, Any]]:
    """The tables, those without a place with one from the drawing."""
    waiting = [table for table in tables if isinstance(table, dict) and "at_mm" not in table]
    if not waiting:
        return tables
    layer = "patches" if key == "actuator" else "feet"
    if len(waiting) == 1 and len(places) > 1:
        name = waiting[0].get("name")
        names = [{} if name is None else {"name": f"{name}_{i + 1}"} for i in range(len(places))]
        copies = [waiting[0] | place | own for place, own in zip(places, names, strict=True)]
        return [table for table in tables if table is not waiting[0]] + copies
    if len(waiting) != len(places):
        raise InputError(
            f"has {len(places)} in the layer {layer}, allowed are as many as there are [[{key}]] without at_mm, "
            f"{len(waiting)}, or one [[{key}]] for all",
            file=path,
        )
    following = iter(places)
    return [table if "at_mm" in table else table | next(following) for table in tables]


def _read(path: Path, unit: Any) -> tuple[dict[str, list[Any]], list[tuple[float, float]]]:
    """Rings of every layer as shapely's polygons, and points in the layer of feet [mm]."""
    import shapely

    if not path.is_file() or path.stat().st_size > MOST_BYTES:
        raise InputError(
            f"is no file of up to {MOST_BYTES // 1_000_000} MB, allowed is a DXF or SVG drawing", file=path
        )
    lines: dict[str, list[Any]] = {layer: [] for layer in LAYERS}
    points = []
    for layer, way in (_svg if path.suffix.lower() == ".svg" else _dxf)(path, unit):
        if len(way) > 1:
            lines[layer].append(shapely.LineString(way))
        elif layer == "feet":
            points += way
    return {layer: _rings(of_layer) for layer, of_layer in lines.items()}, points


def _dxf(path: Path, unit: Any) -> Iterator[tuple[str, list[Point]]]:
    """Layer and points [mm] of every line, curve and point."""
    try:
        from ezdxf.filemanagement import readfile
        from ezdxf.lldxf.const import DXFError
        from ezdxf.path import make_path
    except ImportError:
        raise MissingExtra("drawing", key="plate.drawing") from None
    try:
        document = readfile(path)
    except (DXFError, OSError, UnicodeError, ValueError) as error:
        raise InputError("is not a readable DXF drawing", file=path) from error
    mm = _mm(OF_HEADER.get(document.units) if unit is None else unit, path)
    for entity in document.modelspace():
        layer = entity.dxf.layer.lower()
        if layer not in LAYERS:
            continue
        if entity.dxftype() == "POINT":
            yield layer, [(mm * entity.dxf.location.x, mm * entity.dxf.location.y)]
            continue
        try:
            curve = make_path(entity)
        except TypeError:
            continue  # texts, dimensions
        way = [(mm * v.x, mm * v.y) for v in curve.flattening(CLOSE / mm)]
        yield layer, [*way, way[0]] if way and curve.is_closed else way


def _svg(path: Path, unit: Any) -> Iterator[tuple[str, list[Point]]]:
    """Layer and points [mm] of every path, y upwards from the lower edge of the page."""
    try:
        import svgelements as svg
    except ImportError:
        raise MissingExtra("drawing", key="plate.drawing") from None
    try:
        page = svg.SVG.parse(str(path), ppi=25.4)  # which makes a unit of what is drawn one millimetre
    except (ElementTree.ParseError, OSError, UnicodeError, ValueError, AttributeError, TypeError) as error:
        raise InputError("is not a readable SVG drawing", file=path) from error
    says = str(page.values.get("width", "")).strip()
    if unit is None:
        mm = 1.0 if says.endswith(("mm", "cm", "in", "pt", "pc")) else _mm(None, path)
    else:
        mm = _mm(unit, path) * (page.viewbox.width / page.width if page.viewbox is not None and page.width else 1.0)
    height = float(page.height or 0.0)

    def within(shapes: Any, around: str) -> Iterator[tuple[str, list[Point]]]:
        for shape in shapes:
            names = (shape.id, shape.values.get("{http://www.inkscape.org/namespaces/inkscape}label"))
            layer = next((str(name).lower() for name in names if str(name).lower() in LAYERS), around)
            if isinstance(shape, svg.Group):
                yield from within(shape, layer)
            elif isinstance(shape, svg.Shape) and layer:
                for piece in abs(svg.Path(shape)).as_subpaths():
                    ways = [_followed(s.point, CLOSE / mm) for s in svg.Path(piece) if not isinstance(s, svg.Move)]
                    corners = [at for i, way in enumerate(ways) for at in (way if i == 0 else way[1:])]
                    yield layer, [(mm * x, mm * (height - y)) for x, y in corners]

    yield from within(page, "")


def _followed(point: Callable[[float], Any], close: float) -> list[Point]:
    """Points of a curve over 0 to 1, the lines between them within `close` of it."""

    def between(a: float, b: float, depth: int) -> list[float]:
        middle = 0.5 * (a + b)
        p, q, m = point(a), point(b), point(middle)
        off = math.hypot(0.5 * (p[0] + q[0]) - m[0], 0.5 * (p[1] + q[1]) - m[1])
        if depth >= 2 and (off < close or depth > 12):
            return [b]
        return between(a, middle, depth + 1) + between(middle, b, depth + 1)

    straight = point(0.0), point(1.0), point(0.3)
    (ax, ay), (bx, by), (cx, cy) = ((at[0], at[1]) for at in straight)
    if math.hypot(ax + 0.3 * (bx - ax) - cx, ay + 0.3 * (by - ay) - cy) < 1e-9:
        return [(ax, ay), (bx, by)]
    return [(float(at[0]), float(at[1])) for at in map(point, [0.0, *between(0.0, 1.0, 0)])]


def _mm(unit: Any, path: Path) -> float:
    """Millimetres of a unit."""
    if unit not in MM:
        raise InputError(f"does not say its unit, allowed is drawing_unit with {', '.join(MM)}", file=path)
    return MM[unit]


def _rings(lines: Sequence[Any]) -> list[Any]:
    """Closed rings that lines make, each as a polygon without holes."""
    import shapely

    if not lines:
        return []
    joined = shapely.union_all(lines, grid_size=SNAP)
    faces = shapely.get_parts(shapely.polygonize([joined]))
    # A ring within another one makes a hole in its face, and is a face itself.
    return [shapely.Polygon(face.exterior) for face in faces]


def _corners(ring: Any) -> list[list[float]]:
    return [[x, y] for x, y in list(ring.exterior.coords)[:-1]]


def _diameter(ring: Any) -> float:
    """Of the circle with its area [mm]."""
    return 2.0 * math.sqrt(ring.area / math.pi)


def _rectangle(ring: Any, path: Path) -> dict[str, Any]:
    """Middle, sides and angle of a patch, its first side the one nearest to x."""
    import shapely

    box = shapely.minimum_rotated_rectangle(ring)
    corners = list(box.exterior.coords)
    sides = [(corners[i + 1][0] - corners[i][0], corners[i + 1][1] - corners[i][1]) for i in range(2)]
    first = max(sides, key=lambda side: abs(side[0]) / math.hypot(*side))
    other = sides[1 - sides.index(first)]
    a, b = math.hypot(*first), math.hypot(*other)
    if box.area - ring.area > SQUARE * min(a, b) ** 2:
        raise InputError(
            f"has a patch at ({ring.centroid.x:.4g}, {ring.centroid.y:.4g}) mm that is no rectangle", file=path
        )
    angle = math.degrees(math.atan2(first[1], first[0]))
    angle = (angle + 90.0) % 180.0 - 90.0
    return {"at_mm": [box.centroid.x, box.centroid.y], "size_mm": [a, b], "angle_deg": round(angle, 6)}
