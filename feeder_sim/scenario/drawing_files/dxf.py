"""DXF: entities of the model space, those of inserted blocks included -> strokes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from feeder_sim.errors import MissingExtra
from feeder_sim.scenario.drawing_files.strokes import MM, ROUND, SAGITTA, Account, Points, Stroke, layer_of

# $INSUNITS -> [mm]: inch, foot, mm, cm, m, mil, yard, micron, dm
OF_HEADER = {1: 25.4, 2: 304.8, 4: 1.0, 5: 10.0, 6: 1000.0, 9: 0.0254, 10: 914.4, 13: 0.001, 14: 100.0}
CURVES = {"LINE", "ARC", "CIRCLE", "ELLIPSE", "LWPOLYLINE", "POLYLINE", "SPLINE", "SOLID", "TRACE"}
QUADS = ("SOLID", "TRACE")
TEXTS = {"TEXT", "MTEXT", "ATTDEF", "ATTRIB", "DIMENSION", "ARC_DIMENSION", "LARGE_RADIAL_DIMENSION", "LEADER"}
TEXTS |= {"MULTILEADER", "MLEADER", "TOLERANCE", "ACAD_TABLE"}
PICTURES = {"IMAGE", "WIPEOUT", "OLE2FRAME", "OLEFRAME", "VIEWPORT", "LIGHT", "PDFUNDERLAY", "DWFUNDERLAY"}
SAYS_UNIT = re.compile(rb"(?:^|\n)\s*9\s*\r?\n\$INSUNITS\s*[\r\n]|\x09\x00?\$INSUNITS\x00")  # text, binary
FRAME = 16  # flag of a vertex that a curve through a polyline does not go through
WORK = 50  # vertices that cost as much as an entity
NEEDED = {"LINE": ("start", "end"), "ARC": ("center", "radius", "start_angle", "end_angle")}
NEEDED |= {"CIRCLE": ("center", "radius"), "ELLIPSE": ("center", "major_axis", "ratio"), "POINT": ("location",)}
NEEDED |= {"INSERT": ("name", "insert")}
SOME = 1000  # points after which it is seen whether there are too many
DEEPEST = 16  # inserts in inserts
READ = "lines, arcs, circles, ellipses, polylines, splines and blocks of them"


def read_dxf(path: Path, unit: str | None, account: Account) -> Iterator[Stroke]:
    """Strokes of a DXF drawing.

    Args:
        path: of the drawing.
        unit: `drawing_unit`, for a drawing that does not say its own.
        account: to which every entity goes.

    Raises:
        InputError: a drawing that cannot be read, or not be understood.
        MissingExtra: ezdxf is not installed.
    """
    try:
        from ezdxf.filemanagement import readfile
        from ezdxf.lldxf.const import DXFError
    except ImportError:
        raise MissingExtra("drawing", key="plate.drawing") from None
    try:
        document = readfile(path)
    except (DXFError, OSError, UnicodeError, ValueError) as error:
        raise account.refusal("is not a readable DXF drawing") from error
    units = document.units if SAYS_UNIT.search(path.read_bytes()) else 0  # ezdxf takes metres where no header says it
    return _Reader(document, _millimetres(units, unit, account), account).strokes()


def _millimetres(code: int, unit: str | None, account: Account) -> float:
    """Of a unit of the drawing, by its header or by `drawing_unit`, which may not contradict each other."""
    header = OF_HEADER.get(code)
    if header is None and (code or unit is None):
        cause = f"has units of the kind {code} of DXF" if code else "does not say its unit"
        allowed = "another unit" if code else f"drawing_unit with {', '.join(MM)}"
        raise account.refusal(f"{cause}, must be {allowed}")
    if unit is not None and header not in (None, MM[unit]):
        raise account.refusal(f"says that its unit is {header:g} mm, drawing_unit is {unit!r}: must be no other")
    return MM[unit] if header is None else header  # type: ignore[index]


class _Reader:
    """One pass over the entities of a document."""

    def __init__(self, document: Any, mm: float, account: Account) -> None:
        self.document, self.mm, self.account = document, mm, account
        self._work: dict[str, int] = {}  # by name of a block

    def strokes(self) -> Iterator[Stroke]:
        for layout in self.document.layouts:
            if layout.name != "Model":
                for entity in layout:
                    if layer_of(entity.dxf.layer) is not None or entity.dxftype() == "INSERT":
                        self.account.ignore("outside of the model space")
        for entity in self.document.modelspace():
            yield from self._entity(entity, entity.dxf.layer, 0, False)

    def _entity(self, entity: Any, layer_name: str, depth: int, hidden: bool) -> Iterator[Stroke]:
        """Strokes of an entity, on its own layer or, where that is 0 in a block, on that of the insert."""
        self.account.count()
        kind, layer = entity.dxftype(), layer_of(layer_name)
        hidden = hidden or self._is_hidden(entity, layer_name)
        if kind == "INSERT":
            yield from self._insert(entity, layer_name, depth, hidden)
        elif kind in TEXTS:
            self.account.ignore("texts and dimensions")
        elif kind in PICTURES:
            self.account.ignore("pictures and views")
        elif kind in ("XLINE", "RAY"):
            self.account.ignore("construction lines")
        elif layer is None and (kind == "POINT" or kind not in CURVES):
            self.account.foreign_layers[layer_name] += 1
        elif layer is None:
            self.account.ignore_foreign(layer_name)
        elif kind == "POINT" and layer != "feet":
            self.account.ignore("points outside of feet")
        else:
            self._check(entity, kind, layer, hidden)
            yield from self._curve(entity, kind, layer)

    def _is_hidden(self, entity: Any, layer_name: str) -> bool:
        """Whether an entity, or its layer, is not shown."""
        table = self.document.layers
        layer = table.get(layer_name) if table.has_entry(layer_name) else None
        return bool(entity.dxf.get("invisible", 0) or (layer is not None and (layer.is_off() or layer.is_frozen())))

    def _check(self, entity: Any, kind: str, layer: str, hidden: bool) -> None:
        """Refuse what is not seen, what is not read, and what lacks a place."""
        if hidden:
            raise self.account.hidden(kind, layer)
        mesh = any(getattr(entity, name, False) for name in ("is_poly_face_mesh", "is_polygon_mesh"))
        if kind not in CURVES | {"POINT", "HATCH", "MPOLYGON"} or mesh:
            raise self.account.refusal(f"has a {kind} in the layer {layer}, must be {READ}: explode it")
        missing = [name for name in NEEDED.get(kind, ()) if not entity.dxf.hasattr(name)]
        if missing:
            raise self.account.refusal(f"has a {kind} without {missing[0]} in the layer {layer}: the file is damaged")

        if getattr(entity, "has_width", False):
            raise self.account.refusal(f"has a {kind} with a width in the layer {layer}, must be lines without one")
        if kind == "ARC" and math.isclose(entity.dxf.start_angle % 360.0, entity.dxf.end_angle % 360.0, abs_tol=1e-9):
            raise self.account.refusal(f"has an ARC that ends where it begins in the layer {layer}, must be a CIRCLE")

    def _insert(self, insert: Any, layer_name: str, depth: int, hidden: bool) -> Iterator[Stroke]:
        """Strokes of a block where it is inserted."""
        if depth >= DEEPEST:
            raise self.account.refusal(f"has blocks in blocks in blocks, must be {DEEPEST} levels")
        if not insert.dxf.hasattr("name") or insert.block() is None:
            raise self.account.refusal("inserts a block that it lacks: the file is damaged")
        if insert.block().block_record.is_xref:
            raise self.account.refusal(f"refers to another drawing, {insert.dxf.name!r}, must be bound references")
        if not len(insert.block()):
            self.account.ignore("empty blocks")
        self.account.count(self._work_of(insert.dxf.name))
        if insert.mcount > 1:
            self.account.count(insert.mcount)  # before they are made
            for single in insert.multi_insert():
                yield from self._insert(single, layer_name, depth, hidden)
            return
        from ezdxf.xclip import XClip

        if XClip(insert).has_clipping_path:
            raise self.account.refusal(f"has a clipped insert of {insert.dxf.name!r}, must be whole ones")
        self.account.ignore("texts and dimensions", len(insert.attribs))
        skipped: list[str] = []
        for entity in insert.virtual_entities(skipped_entity_callback=lambda e, reason: skipped.append(e.dxftype())):
            entity_layer = entity.dxf.layer
            yield from self._entity(entity, layer_name if entity_layer == "0" else entity_layer, depth + 1, hidden)
        if skipped:
            raise self.account.refusal(f"inserts a block with a {skipped[0]}, which cannot be placed: explode it")

    def _work_of(self, name: str) -> int:
        """What it costs to insert a block, in entities."""
        if name not in self._work:
            vertices = 0
            for entity in self.document.blocks.get(name):
                if entity.dxftype() == "LWPOLYLINE":
                    vertices += len(entity)
                elif entity.dxftype() == "POLYLINE":
                    vertices += len(entity.vertices)
                elif entity.dxftype() == "SPLINE":
                    vertices += len(entity.control_points) + len(entity.fit_points)
                elif entity.dxftype() == "HATCH":
                    for path in entity.paths:
                        edges: Any = getattr(path, "edges", None) or getattr(path, "vertices", ())
                        vertices += len(edges)
            self._work[name] = vertices // WORK
        return self._work[name]

    def _curve(self, entity: Any, kind: str, layer: str) -> Iterator[Stroke]:
        """Strokes of one entity that is read."""
        if kind == "POINT":
            yield self.account.add_point(layer, np.array([[entity.dxf.location.x, entity.dxf.location.y]]) * self.mm)
            return
        self.account.check_reach(layer, _control(entity, kind) * self.mm)
        fill = kind in ("HATCH", "MPOLYGON")
        sagitta = SAGITTA / self.mm
        curves = _filled_edges(entity, sagitta) if fill else [_points(entity, kind, sagitta, self.account)]
        if not sum(map(len, curves)):
            self.account.ignore("lines without length")
        for curve in filter(len, curves):
            points = curve * self.mm
            self._check_level(points, kind, layer)
            closed = getattr(entity, "is_closed", False) is True or getattr(entity, "closed", False) is True
            stroke: Literal["line", "fill"] = "fill" if fill else "line"
            yield from self.account.add_stroke(layer, points[:, :2], closed=closed or kind in QUADS, kind=stroke)

    def _check_level(self, points: Points, kind: str, layer: str) -> None:
        """Refuse what does not lie in a plane of the same height."""
        if not len(points) or np.ptp(points[:, 2]) <= SAGITTA:
            return
        raise self.account.refusal(f"has a {kind} in the layer {layer} that is not level, must be a flat drawing")


def _control(entity: Any, kind: str) -> Points:
    """Points that reach as far as a curve does, in units of the drawing, shape (n, 2)."""
    dxf = entity.dxf
    if kind in ("ARC", "CIRCLE"):
        return np.array([[dxf.radius, dxf.radius]], float)
    if kind == "ELLIPSE":
        reach = float(dxf.major_axis.magnitude) * max(1.0, abs(dxf.ratio))
        return np.array([[reach, reach]])
    if kind == "SPLINE":
        points = [*entity.control_points, *entity.fit_points]
        return np.array([[x, y] for x, y, *_ in points], float).reshape(-1, 2)
    if kind == "LWPOLYLINE":
        return np.array(entity.get_points("xyb"), float).reshape(-1, 3)
    return np.empty((0, 2))


def _points(entity: Any, kind: str, sagitta: float, account: Account, before: int = 0) -> Points:
    """Points of a curve, in units of the drawing, shape (n, 3); `before` are those of the curve that it is a piece of.

    Raises:
        InputError: there are too many.
    """
    dxf = entity.dxf
    if kind == "LINE":
        vertices = [dxf.start, dxf.end]
    elif kind in ("ARC", "CIRCLE"):
        size = min(sagitta, ROUND * abs(dxf.radius))
        share = (dxf.end_angle - dxf.start_angle) % 360.0 / 360.0 if kind == "ARC" else 1.0
        account.check_points(before + int(share * math.pi / math.sqrt(2.0 * size / abs(dxf.radius))) if size else 0)
        vertices = list(entity.flattening(size)) if size else []
    elif kind in ("ELLIPSE", "SPLINE"):
        vertices = []
        for vertex in entity.flattening(sagitta, 16):
            vertices.append(vertex)
            if not len(vertices) % SOME:
                account.check_points(before + len(vertices))
    elif kind in QUADS:
        vertices = entity.wcs_vertices()
    else:
        if kind == "POLYLINE":
            entity.vertices[:] = [vertex for vertex in entity.vertices if not vertex.dxf.flags & FRAME]
        pieces: list[Points] = []
        for piece in entity.virtual_entities():
            pieces.append(_points(piece, piece.dxftype(), sagitta, account, before))
            before += len(pieces[-1])
        return _chain(pieces)
    return np.array([vertex.xyz for vertex in vertices]).reshape(-1, 3)


def _chain(pieces: Sequence[Points]) -> Points:
    """Pieces of a polyline one after the other; arcs come with either end first."""
    chain = [piece for piece in pieces if len(piece)]
    for i, piece in enumerate(chain):
        before, after = chain[i - 1][-1], chain[(i + 1) % len(chain)]
        if i:
            turned = np.hypot(*(piece[-1] - before)[:2]) < np.hypot(*(piece[0] - before)[:2])
        else:
            first, last = (
                min(np.hypot(*(end - at)[:2]) for at in (after[0], after[-1])) for end in (piece[0], piece[-1])
            )
            turned = len(chain) > 1 and first < last
        chain[i] = piece[::-1] if turned else piece
    return np.vstack(chain) if chain else np.empty((0, 3))


def _filled_edges(entity: Any, sagitta: float) -> list[Points]:
    """The edges of a hatch, in units of the drawing, each (n, 3)."""
    from ezdxf.path import make_path

    curves = make_path(entity, segments=64).sub_paths()
    return [np.array([v.xyz for v in curve.flattening(sagitta)]).reshape(-1, 3) for curve in curves if len(curve)]
