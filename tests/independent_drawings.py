"""What is drawn in a DXF or SVG file, by a reading of the tests' own: blocks and uses are followed to their shapes.

It is for files without fault: it mends nothing and refuses nothing.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import numpy as np
import shapely
import svgelements
from drawn_plates import Truth
from ezdxf.filemanagement import read
from numpy.typing import NDArray

LAYERS = ("outline", "holes", "patches", "feet")
FINE_MM = 0.0005  # pieces of curves are as near
SNAP_MM = 0.0001
PIECES = 400  # of a curve of SVG
UNITS_MM = {1: 25.4, 4: 1.0, 5: 10.0, 6: 1000.0}
NAMED_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6}
LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
LINK = "{http://www.w3.org/1999/xlink}href"
Points = NDArray[np.float64]  # (n, 2); a single one is a point


def dxf_reading(content: bytes, unit: str | None) -> Truth:
    document = read(io.StringIO(content.decode().replace("\r\n", "\n")))
    mm = NAMED_MM[unit] if unit else UNITS_MM[document.units]
    lines: dict[str, list[Points]] = {layer: [] for layer in LAYERS}
    for layer, entity in _entities(document.modelspace(), ""):
        if layer in LAYERS and entity.dxftype() not in ("TEXT", "MTEXT"):
            lines[layer].append(mm * np.array([(v[0], v[1]) for v in _vertices(entity, FINE_MM / mm)]))
    return _plate(lines)


def _entities(entities: Any, around: str) -> Iterator[tuple[str, Any]]:
    """Lines and curves with their layers; layer 0 in a block is that of the reference."""
    for entity in entities:
        own = entity.dxf.layer.lower()
        layer = around if own == "0" and around else own
        if entity.dxftype() == "INSERT":
            yield from _entities(entity.virtual_entities(), layer)
        elif entity.dxftype() in ("LWPOLYLINE", "POLYLINE"):
            yield from ((layer, piece) for piece in entity.virtual_entities())
        else:
            yield layer, entity


def _vertices(entity: Any, close: float) -> Any:
    if entity.dxftype() == "POINT":
        return [entity.dxf.location]
    if entity.dxftype() == "LINE":
        return [entity.dxf.start, entity.dxf.end]
    return list(entity.flattening(close))


def svg_reading(content: bytes, unit: str | None) -> Truth:
    root = ElementTree.fromstring(content)
    low_x, low_y, width, height = (float(x) for x in root.attrib["viewBox"].split())
    mm = NAMED_MM[unit] if unit else min(_length(root.attrib[k]) / n for k, n in (("width", width), ("height", height)))
    named = {e.attrib["id"]: e for e in root.iter() if "id" in e.attrib}
    lines: dict[str, list[Points]] = {layer: [] for layer in LAYERS}
    for child in root:
        for layer, points in _shapes(child, svgelements.Matrix(), "", named):
            lines[layer].append(mm * (points - [low_x, low_y]) * [1.0, -1.0])
    return _plate(lines)


def _length(text: str) -> float:
    """Of the page [mm]."""
    return float(text[:-2]) * NAMED_MM[text[-2:]]


def _shapes(
    element: Any, around: Any, layer: str, named: dict[str, Any], used: bool = False
) -> Iterator[tuple[str, Points]]:
    """Points of every piece of every shape on a layer, in coordinates of the page."""
    tag = str(element.tag).rpartition("}")[2]
    if tag in ("defs", "namedview") or (tag == "symbol" and not used):
        return
    matrix = svgelements.Matrix(element.attrib.get("transform", "")) * around
    names = (str(element.attrib.get(key, "")).lower() for key in ("id", LABEL))
    layer = next((name for name in names if name in LAYERS), layer)
    if tag == "use":
        x, y = (float(element.attrib.get(key, 0.0)) for key in "xy")
        name = element.attrib.get("href", element.attrib.get(LINK))[1:]
        yield from _shapes(named[name], svgelements.Matrix.translate(x, y) * matrix, layer, named, used=True)
    elif tag in ("g", "symbol"):
        for child in element:
            yield from _shapes(child, matrix, layer, named)
    elif layer and tag in ("path", "rect", "circle", "ellipse", "polygon", "polyline", "line"):
        values = {key: value for key, value in element.attrib.items() if key not in ("transform", "id")}
        kind = {"line": "SimpleLine"}.get(tag, tag.capitalize())
        path = svgelements.Path(values["d"]) if tag == "path" else svgelements.Path(getattr(svgelements, kind)(values))
        for segment in path:
            if not isinstance(segment, svgelements.Move):
                straight = isinstance(segment, svgelements.Line | svgelements.Close)
                at = (segment.point(t) for t in np.linspace(0.0, 1.0, 2 if straight else PIECES + 1))
                yield layer, np.array([matrix.point_in_matrix_space(point) for point in at])


def _plate(lines: dict[str, list[Points]]) -> Truth:
    rings = {layer: _rings([points for points in of_layer if len(points) > 1]) for layer, of_layer in lines.items()}
    edges = sorted(rings["outline"], key=lambda ring: -ring.area)
    plate = shapely.difference(edges[0], shapely.union_all([*edges[1:], *rings["holes"]]))
    feet = [complex(*points[0]) for points in lines["feet"] if len(points) == 1]
    feet += [complex(ring.centroid.x, ring.centroid.y) for ring in rings["feet"]]
    return Truth(plate, tuple(rings["patches"]), tuple(feet))


def _rings(lines: list[Points]) -> list[Any]:
    """Closed rings, each without the rings within it."""
    if not lines:
        return []
    joined = shapely.union_all([shapely.LineString(points) for points in lines], grid_size=SNAP_MM)
    return [shapely.Polygon(face.exterior) for face in shapely.get_parts(shapely.polygonize([joined]))]
