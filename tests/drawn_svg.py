"""A drawn plate as an SVG file: lengths, boxes of view, groups, uses and shapes as the standard has them."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from random import Random

from drawn_plates import Arc, Bezier, Item, Line, Map, Ring, Segment

MM = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6, "px": 25.4 / 96, "": 25.4 / 96}
HEAD = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
INKSCAPE = (
    'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
    'xmlns:sodipodi="http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd"'
)


@dataclass(frozen=True)
class Page:
    """Attributes of the outermost element, and where a point of the drawing [mm] lies in its coordinates.

    Args:
        attributes: of `svg`.
        to_user: from [mm], y upwards.
        said: for messages.
        unit: `drawing_unit` that the file needs.
        stretch: of x, by a box of view of another shape.
    """

    attributes: str
    to_user: Map
    said: str
    unit: str | None = None
    stretch: float = 1.0


def random_page(rng: Random, width_mm: float, height_mm: float, kind: str = "") -> Page:
    """A page of at least this size, with the drawing on it from its lower left corner."""
    kind = kind or rng.choice(["box", "box", "box with offset", "other shape", "no size", "percent"])
    if kind in ("no size", "percent"):
        unit = rng.choice(["mm", "cm", "inch"])
        user = 1.0 / {"mm": 1.0, "cm": 10.0, "inch": 25.4}[unit]
        box = f'viewBox="0 0 {width_mm * user!r} {height_mm * user!r}"'
        size = 'width="100%" height="100%" ' if kind == "percent" else ""
        return Page(size + box, Map(user + 0j, 1j * height_mm * user, True), f"{kind}, in {unit}", unit)
    unit = rng.choice(["px", ""]) if kind == "pixels" else rng.choice(["mm", "mm", "cm", "in", "pt", "pc"])
    size = f'width="{width_mm / MM[unit]!r}{unit}" height="{height_mm / MM[unit]!r}{unit}"'
    if kind in ("no box", "pixels"):
        user = 1.0 / MM["px"]
        return Page(size, Map(user + 0j, 1j * height_mm * user, True), f"{kind}, size in {unit}")
    user = rng.choice([1.0, 1.0, 10.0, 72 / 25.4, 0.1])
    box_width, box_height = width_mm * user, height_mm * user
    corner = 0j if kind == "box" else complex(rng.uniform(-99.0, 99.0), rng.uniform(-99.0, 99.0))
    more, stretch = "", 1.0
    if kind == "other shape":  # the box fits in, which adds to one of its sides
        more = rng.choice(["", "xMidYMid", "xMinYMin meet", "xMaxYMax meet"])
        more = f' preserveAspectRatio="{more}"' if more else ""
        size = f'width="{width_mm * rng.uniform(1.0, 2.0) / MM[unit]!r}{unit}" height="{height_mm / MM[unit]!r}{unit}"'
    if kind == "stretched":
        more, stretch = ' preserveAspectRatio="none"', rng.choice([1.0, 1.3, 0.7])
        size = f'width="{width_mm * stretch / MM[unit]!r}{unit}" height="{height_mm / MM[unit]!r}{unit}"'
    box = f'viewBox="{corner.real!r} {corner.imag!r} {box_width!r} {box_height!r}"'
    place = Map(user + 0j, corner + 1j * box_height, True)
    return Page(f"{size} {box}{more}", place, f"{kind}, size in {unit}, {user:.4g} a mm", stretch=stretch)


def _n(number: float) -> str:
    return f"{number:.12g}"


def _p(z: complex, between: str = " ") -> str:
    return f"{_n(z.real)}{between}{_n(z.imag)}"


def element(item: Item, rng: Random, attributes: str = "", style: str = "") -> str:
    """A ring in user units."""
    assert isinstance(item, tuple)  # SVG has no points
    first = item[0]
    if style == "" and len(item) == 1 and isinstance(first, Arc) and rng.random() < 0.6:
        return _whole_ellipse(first, rng, attributes)
    if style == "" and all(isinstance(s, Line) for s in item):
        style = rng.choice(["polygon", "polyline", "path", "path", "lines", "rect"])
    if style == "rect" and len(item) == 4:
        side, other = item[0].end - item[0].begin, item[1].end - item[1].begin
        size = f'width="{_n(abs(side))}" height="{_n(abs(other))}"'
        ahead = (other / side).imag > 0
        begin = item[0].begin if ahead else item[0].begin + other
        turn = math.degrees(cmath.phase(side))
        return f'<rect {attributes} {size} transform="translate({_p(begin)}) rotate({_n(turn)})"/>'
    if style in ("polygon", "polyline"):
        corners = [s.begin for s in item] + ([item[0].begin] if style == "polyline" else [])
        return f'<{style} {attributes} points="{" ".join(_p(z, ",") for z in corners)}"/>'
    if style == "lines":
        pieces = [s if rng.random() < 0.5 else s.reverse() for s in item]
        rng.shuffle(pieces)
        return f"<g {attributes}>{''.join(_line(s.begin, s.end) for s in pieces)}</g>"
    return f'<path {attributes} d="{path_data(item, rng)}"/>'


def _line(a: complex, b: complex) -> str:
    return f'<line x1="{_n(a.real)}" y1="{_n(a.imag)}" x2="{_n(b.real)}" y2="{_n(b.imag)}" stroke="red"/>'


def _whole_ellipse(arc: Arc, rng: Random, attributes: str) -> str:
    if arc.round and rng.random() < 0.7:
        return f'<circle {attributes} cx="{_n(arc.centre.real)}" cy="{_n(arc.centre.imag)}" r="{_n(arc.rx)}"/>'
    turn = f"rotate({_n(math.degrees(arc.turn))} {_p(arc.centre)})"
    return (
        f'<ellipse {attributes} cx="{_n(arc.centre.real)}" cy="{_n(arc.centre.imag)}" rx="{_n(arc.rx)}" '
        f'ry="{_n(arc.ry)}" transform="{turn}"/>'
    )


def path_data(ring: Ring, rng: Random, close: bool = True) -> str:
    """Commands of a path, absolute or relative."""
    pieces: list[Segment] = []
    for segment in ring:
        pieces += segment.pieces(3) if isinstance(segment, Arc) and abs(segment.sweep) > 2.0 else [segment]
    words, at = [f"M {_p(pieces[0].begin)}"], pieces[0].begin
    for segment in pieces:
        relative = rng.random() < 0.3
        base = at if relative else 0j
        if isinstance(segment, Line):
            word = f"L {_p(segment.end - base)}"
        elif isinstance(segment, Bezier):
            word = "C " + " ".join(_p(z - base) for z in segment.corners[1:])
        else:
            way = 1 if segment.sweep > 0 else 0
            turn = _n(math.degrees(segment.turn))
            word = f"A {_n(segment.rx)} {_n(segment.ry)} {turn} 0 {way} {_p(segment.end - base)}"
        words.append(word.lower() if relative else word)
        at = segment.end
    return " ".join(words) + (rng.choice([" Z", "z"]) if close else "")


def nested(item: Item, rng: Random, levels: int) -> tuple[Item, str, str]:
    """An item in groups that turn, scale, mirror and shift it back to where it was; what is before and behind it."""
    before = behind = ""
    for _ in range(levels):
        size, turn = rng.choice([1.0, 0.5, 4.0]), rng.choice([0.0, 30.0, 90.0, 200.0])
        shift, mirrored = complex(rng.uniform(-30, 30), rng.uniform(-30, 30)), rng.random() < 0.3
        by = Map(cmath.rect(size, math.radians(turn)), shift, mirrored)
        item = by.inverse().item(item)
        words = f"translate({_p(shift, ',')}) rotate({_n(turn)}) scale({_n(size)} {_n(-size if mirrored else size)})"
        if rng.random() < 0.4:
            f, j = by.factor, by.factor * (-1j if mirrored else 1j)
            words = f"matrix({_n(f.real)} {_n(f.imag)} {_n(j.real)} {_n(j.imag)} {_p(shift)})"
        before, behind = f'{before}<g transform="{words}">', f"{behind}</g>"
    return item, before, behind


def used(item: Item, rng: Random, name: str) -> tuple[str, str]:
    """A definition and its use, moved and back; a symbol has no box of its own here."""
    shift = complex(rng.uniform(-30, 30), rng.uniform(-30, 30))
    shape = element(Map(shift=-shift).item(item), rng)
    word = rng.choice(["g", "symbol", "g"])
    style = ' overflow="visible"' if word == "symbol" else ""
    link = rng.choice(["href", "xlink:href"])
    place = (
        f'x="{_n(shift.real)}" y="{_n(shift.imag)}"' if rng.random() < 0.5 else f'transform="translate({_p(shift)})"'
    )
    return f'<{word} id="{name}"{style}>{shape}</{word}>', f'<use {link}="#{name}" {place}/>'
