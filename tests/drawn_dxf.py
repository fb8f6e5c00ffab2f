"""A drawn plate as a DXF file, in one of the many forms that programs of CAD give it."""

from __future__ import annotations

import cmath
import io
import math
from collections.abc import Sequence
from random import Random
from typing import Any

from drawn_plates import TURN, Arc, Bezier, Item, Line, Map, Segment
from ezdxf.filemanagement import new

MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
CODES = {"inch": 1, "mm": 4, "cm": 5, "m": 6}
NAMES = {"outline": ("outline", "OUTLINE", "Outline"), "holes": ("holes", "HOLES"), "patches": ("patches", "Patches"),
         "feet": ("feet", "FEET")}  # fmt: skip


class DxfSheet:
    """A document under way; lengths given to it are in millimetres.

    Args:
        unit: that coordinates are written in.
        said: whether the file says so.
    """

    def __init__(self, rng: Random, unit: str, said: bool, version: str) -> None:
        self.rng, self.version = rng, version
        self.document: Any = new(version, units=CODES[unit] if said else 0)
        self.space: Any = self.document.modelspace()
        self.to_file = Map(1.0 / MM[unit] + 0j)
        self.blocks = 0

    def bytes(self) -> bytes:
        text = io.StringIO()
        self.document.write(text)
        end = self.rng.choice(["\n", "\r\n"])
        return text.getvalue().replace("\n", end).encode(self.document.output_encoding, "dxfreplace")

    def name(self, layer: str) -> str:
        return self.rng.choice(NAMES.get(layer, (layer,)))

    def draw(self, layer: str, item: Item, style: str = "", **more: Any) -> None:
        """Into the model space."""
        self._into(self.space, self.to_file.item(item), {"layer": self.name(layer), **more}, style)

    def insert(self, layer: str, item: Item, levels: int = 1) -> None:
        """As a block in a block, scaled, turned and mirrored; its layer is that of the entity, or of the reference."""
        item, own = self.to_file.item(item), self.rng.random() < 0.5
        outer, inner = ("0", self.name(layer)) if own else (self.name(layer), "0")
        space = self.space
        for level in range(levels):
            by = Map(
                cmath.rect(self.rng.choice([1.0, 0.5, 3.0, -1.0]), self.rng.choice([0.0, 0.3, TURN / 4, 2.0])),
                complex(self.rng.uniform(-20, 20), self.rng.uniform(-20, 20)),
                self.rng.random() < 0.4,
            )
            item = by.inverse().item(item)
            block = self.document.blocks.new(f"B{self.blocks}")
            self.blocks += 1
            size = abs(by.factor)
            reference = {
                "xscale": size,
                "yscale": -size if by.mirrored else size,
                "rotation": math.degrees(cmath.phase(by.factor)),
                "layer": outer if level == 0 or not own else "0",
            }
            space.add_blockref(block.name, (by.shift.real, by.shift.imag), dxfattribs=reference)
            space = block
            if not own:
                outer = "0"
        self._into(space, item, {"layer": inner}, "")

    def _into(self, space: Any, item: Item, attributes: dict[str, Any], style: str) -> None:
        if isinstance(item, complex):
            space.add_point((item.real, item.imag), dxfattribs=attributes)
            return
        round_arcs = all(isinstance(s, Line) or (isinstance(s, Arc) and s.round) for s in item)
        full = len(item) == 1
        styles = ["loose"] + (["polyline"] * 2 if round_arcs else []) + (["whole"] * 2 if full else [])
        style = style or self.rng.choice(styles)
        if style == "whole":
            self._segment(space, item[0], attributes)
            return
        pieces: list[Segment] = list(item)
        if full and isinstance(item[0], Arc):
            pieces = list(item[0].pieces(self.rng.randint(2, 4)))
        if style == "polyline":
            self._polyline(space, pieces, attributes)
            return
        if all(isinstance(s, Bezier) for s in pieces) and self.rng.random() < 0.5:
            self._spline(space, [s for s in pieces if isinstance(s, Bezier)], attributes)
            return
        self.rng.shuffle(pieces)
        for piece in pieces:
            self._segment(space, piece.reverse() if self.rng.random() < 0.5 else piece, attributes)

    def _polyline(self, space: Any, ring: Sequence[Segment], attributes: dict[str, Any]) -> None:
        corners = [(s.begin.real, s.begin.imag, math.tan(s.sweep / 4) if isinstance(s, Arc) else 0.0) for s in ring]
        closed = self.rng.random() < 0.6
        if not closed:
            corners.append((ring[-1].end.real, ring[-1].end.imag, 0.0))
        if self.version == "R12" or self.rng.random() < 0.3:
            space.add_polyline2d(corners, format="xyb", close=closed, dxfattribs=attributes)
        else:
            space.add_lwpolyline(corners, format="xyb", close=closed, dxfattribs=attributes)

    def _spline(self, space: Any, chain: Sequence[Bezier], attributes: dict[str, Any]) -> None:
        corners = [chain[0].begin, *(z for s in chain for z in s.corners[1:])]
        inner = [float(i) for i in range(len(chain) + 1) for _ in range(3)]
        curve = space.add_spline(degree=3, dxfattribs=attributes)
        curve.control_points = [(z.real, z.imag, 0.0) for z in corners]
        curve.knots = [0.0, *inner, float(len(chain))]

    def _segment(self, space: Any, segment: Segment, attributes: dict[str, Any]) -> None:
        if isinstance(segment, Line):
            begin, end = segment.begin, segment.end
            space.add_line((begin.real, begin.imag), (end.real, end.imag), dxfattribs=attributes)
        elif isinstance(segment, Bezier):
            self._spline(space, [segment], attributes)
        else:
            self._arc(space, segment, attributes)

    def _arc(self, space: Any, arc: Arc, attributes: dict[str, Any]) -> None:
        """Counterclockwise, as all are in DXF; now and then seen from below, as after mirroring."""
        full = abs(arc.sweep) > TURN - 1e-9
        low, high = sorted((arc.start, arc.start + arc.sweep))
        centre = (arc.centre.real, arc.centre.imag)
        if not arc.round:
            low, high = (0.0, TURN) if full else (low % TURN, high % TURN)
            major = arc.rx * cmath.rect(1.0, arc.turn)
            ratio = arc.ry / arc.rx
            if ratio > 1.0:
                major, ratio, low, high = (
                    1j * cmath.rect(arc.ry, arc.turn),
                    1.0 / ratio,
                    low - TURN / 4,
                    high - TURN / 4,
                )
                low, high = (0.0, TURN) if full else (low % TURN, high % TURN)
            space.add_ellipse(centre, (major.real, major.imag), ratio, low, high, dxfattribs=attributes)
            return
        below = self.rng.random() < 0.1
        low, high = (math.degrees(angle + arc.turn) for angle in (low, high))
        if below:
            attributes = attributes | {"extrusion": (0, 0, -1)}
            centre, low, high = (-centre[0], centre[1]), 180.0 - high, 180.0 - low
        if full:
            space.add_circle(centre, arc.rx, dxfattribs=attributes)
        else:
            space.add_arc(centre, arc.rx, low % 360.0, high % 360.0, dxfattribs=attributes)
