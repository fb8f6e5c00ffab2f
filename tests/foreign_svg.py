"""SVG files that others could have drawn: ordinary ones, odd ones and hostile ones."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import shapely.affinity
from drawn_plates import DrawnPlate, Item, Line, Map, Ring, Truth, ellipse, polygon, random_plate, rectangle
from drawn_svg import HEAD, INKSCAPE, Page, element, nested, path_data, random_page, used
from foreign_dxf import GAPS_MM, with_gap
from foreign_files import ForeignFile, damaged

# What is odd in a drawing: it is refused, or read as it was meant. What is hidden may also be left out.
ODD = (
    "no box", "pixels", "stretched", "unclosed filled path", "unclosed stroked path", "gap", "gap in a hole",
    "no display", "hidden hole", "misspelt holes", "misspelt outline", "svg in svg", "switch", "link",
    "units in shapes", "symbol with a box", "style sheet", "two plates", "island", "hole over the edge",
    "text for a hole", "stray line", "line across", "clip", "outline never used", "use of another file",
    "use of nothing", "round corners", "skew", "arc without radius", "hole twice", "picture", "line caps",
    "path with an error", "attribute entity", "symbol and hidden use",
)  # fmt: skip
LABELS = {"outline": "Outline", "holes": "HOLES", "patches": "Patches", "feet": "feet"}


def on_page(plate: DrawnPlate, rng: Random, kind: str = "") -> tuple[DrawnPlate, Page]:
    """The plate with its lower left corner near that of a page that it fits on."""
    low_x, low_y, high_x, high_y = polygon(plate.outline).bounds
    plate = plate.mapped(Map(shift=complex(7.0 - low_x, 9.0 - low_y)))
    circles = (ellipse(foot, 1.0, 1.0) if isinstance(foot, complex) else foot for foot in plate.feet)
    plate = replace(plate, feet=tuple(circles))
    return plate, random_page(rng, high_x - low_x + 20.0, high_y - low_y + 20.0, kind)


def document(page: Page, body: str, rng: Random, before: str = "") -> bytes:
    """What programs write around a drawing."""
    head = f'<?xml version="1.0" encoding="{rng.choice(["UTF-8", "utf-8"])}" standalone="no"?>\n{before}'
    foreign = '<sodipodi:namedview id="base" inkscape:zoom="1.4"><inkscape:grid id="g1"/></sodipodi:namedview>'
    other = '<!-- plate & "co" --><g id="dimensions"><path d="M 0 0 H 9 V 9"/><text x="1" y="2">M &#8960; 5</text></g>'
    text = f"{head}<svg {HEAD} {INKSCAPE} version='1.1' {page.attributes}>\n{foreign}\n{other}\n{body}\n</svg>\n"
    return text.replace("\n", rng.choice(["\n", "\r\n"])).encode()


def ordinary_svg(rng: Random) -> ForeignFile:
    """A drawing without fault: nothing in it may be lost."""
    plate, page = on_page(random_plate(rng), rng)
    uses, levels = rng.choice([0.0, 0.0, 0.6]), rng.choice([0, 0, 1, 3])
    layers: dict[str, list[Item]] = {}
    for layer, item in plate.items(rng):
        layers.setdefault(layer, []).append(page.to_user.item(item))
    definitions, body = "", ""
    for layer, items in rng.sample(sorted(layers.items(), key=lambda entry: entry[0]), len(layers)):
        shapes = ""
        if len(items) > 1 and layer == "outline" and rng.random() < 0.4:
            data = " ".join(path_data(item, rng) for item in items if not isinstance(item, complex))
            shapes, items = f'<path d="{data}" fill-rule="evenodd"/>\n', []
        for i, item in enumerate(items):
            if rng.random() < uses:
                definition, use = used(item, rng, f"{layer}_{i}_shape")
                definitions, shapes = definitions + definition, f"{shapes}{use}\n"
            else:
                inner, ahead, behind = nested(item, rng, levels)
                shapes += f"{ahead}{element(inner, rng)}{behind}\n"
        body += in_layer(layer, shapes, rng)
    body = f"<defs>{definitions}</defs>\n{body}"
    if uses and rng.random() < 0.5:  # a definition may come behind its use
        body = f"{body[body.index('</defs>') + 7 :]}\n<defs>{definitions}</defs>"
    return _file(
        page, document(page, body, rng), plate, f"SVG, {page.said}, {uses:.0%} in uses", (plate.truth(),), True
    )


def in_layer(layer: str, shapes: str, rng: Random) -> str:
    """A group that is a layer, by its id or by its label in Inkscape."""
    style = rng.choice(['fill="none" stroke="#000"', 'style="fill:none;stroke:black;stroke-width:0.1"', ""])
    name = rng.choice(
        [f'id="{layer}"', f'inkscape:groupmode="layer" id="layer{layer}" inkscape:label="{LABELS[layer]}"']
    )
    return f"<g {name} {style}>\n{shapes}</g>\n"


def _file(
    page: Page,
    content: bytes,
    plate: DrawnPlate,
    said: str,
    truths: tuple[Truth, ...] | None,
    ordinary: bool = False,
    slack_mm: float = 0.0,
) -> ForeignFile:
    return ForeignFile(
        content, ".svg", said, truths, ordinary=ordinary, slack_mm=slack_mm, unit=page.unit,
        patches=bool(plate.patches), feet=bool(plate.feet),
    )  # fmt: skip


def odd_svg(rng: Random, odd: str) -> ForeignFile:
    """A drawing with one thing in it that is not as it should be, or not in every program."""
    plate = random_plate(rng, straight_only=odd in ("gap", "units in shapes", "unclosed filled path"))
    spot = polygon(plate.outline).centroid
    hole = rectangle(complex(spot.x, spot.y), 9.0, 7.0, 0.4)
    if odd == "units in shapes":
        plate = replace(plate, outline=rectangle(0j, 120.0, 90.0))
        hole = rectangle(0j, 9.0, 7.0)
    plate = DrawnPlate(plate.outline, (hole,))
    box = odd if odd in ("no box", "pixels", "stretched") else "box"
    plate, page = on_page(plate, rng, box)
    hole = plate.holes[0]
    gap = rng.choice(GAPS_MM) if odd.startswith("gap") else 0.0
    truth, without = plate.truth(), DrawnPlate(plate.outline).truth()
    truths: tuple[Truth, ...] = (truth,)
    if odd in ("no display", "hidden hole", "style sheet", "clip"):
        truths = (truth, without)
    elif odd in ("outline never used", "symbol and hidden use"):
        truths = (without,) if odd == "outline never used" else (truth, without)
    elif odd in ("two plates", "island", "use of another file"):
        truths = ()
    elif odd == "hole over the edge":
        hole = rectangle(plate.outline[0].begin, 9.0, 7.0)
        truths = (DrawnPlate(plate.outline, (hole,)).truth(),)
    elif odd == "skew":
        return _skewed(plate, rng)
    elif odd == "stretched":
        truths = (Truth(shapely.affinity.scale(truth.plate, page.stretch, 1.0, origin=(0, 0))),)
    body, before = _odd_body(odd, plate.outline, hole, page, gap, rng)
    said = f"SVG with {odd}, {page.said}" + (f", {gap} mm" if gap else "")
    return _file(page, document(page, body, rng, before), plate, said, truths, slack_mm=gap)


def page_ring(page: Page, ring: Ring) -> Ring:
    item = page.to_user.item(ring)
    assert isinstance(item, tuple)
    return item


def _skewed(plate: DrawnPlate, rng: Random) -> ForeignFile:
    """All in a group that is sheared, of a page in millimetres."""
    size = 'width="300mm" height="300mm" viewBox="0 0 300 300"'
    page = Page(size, Map(1.0 + 0j, 300j, True), "skew")
    shapes = "".join(element(page_ring(page, ring), rng, style="path") for ring in (plate.outline, *plate.holes))
    body = f'<g transform="matrix(1 0 0.3 1 0 0)">{in_layer("outline", shapes, rng)}</g>'
    sheared = shapely.affinity.affine_transform(plate.truth().plate, [1, -0.3, 0, 1, 90.0, 0])
    return _file(page, document(page, body, rng), plate, "SVG with skew", (Truth(sheared),))


def _odd_body(odd: str, outline: Ring, hole: Ring, page: Page, gap: float, rng: Random) -> tuple[str, str]:
    """Layers of the drawing, and what comes before the outermost element."""
    edge, inner, before = page_ring(page, outline), page_ring(page, hole), ""
    edges, holes = element(edge, rng, style="path"), element(inner, rng, style="path")
    if odd == "gap":
        edges = element(page_ring(page, with_gap(outline, gap, rng)), rng, style="lines")
    elif odd == "gap in a hole":
        holes = element(page_ring(page, with_gap(hole, gap, rng)), rng, style="lines")
    elif odd.startswith("unclosed"):
        fill = 'fill="none" stroke="red"' if odd == "unclosed stroked path" else ""
        edges = f'<path {fill} d="{path_data(edge[:-1] or edge, rng, close=len(edge) == 1)}"/>'
        holes = f'<path {fill} d="{path_data(inner[:-1], rng, close=False)}"/>'
    elif odd == "no display":
        hidden = rng.choice(['display="none"', 'style="display:none"'])
        holes = f"<g {hidden}>{holes}</g>"
    else:
        return _more(odd, edges, holes, edge, inner, page, rng)
    return in_layer("outline", edges, rng) + in_layer("holes", holes, rng), before


def _more(odd: str, edges: str, holes: str, edge: Ring, inner: Ring, page: Page, rng: Random) -> tuple[str, str]:
    """The same for oddities that stand around a shape or beside it."""
    z, before = inner[0].begin, ""
    mm = abs(page.to_user.factor)
    corner, end = f'x="{z.real}" y="{z.imag}"', f'x2="{z.real + 900 * mm}" y2="{z.imag}"'
    around = {
        "hidden hole": '<g visibility="hidden">{}</g>',
        "svg in svg": "<svg>{}</svg>",
        "switch": "<switch><g>{}</g></switch>",
        "link": '<a xlink:href="https://example.org">{}</a>',
        "symbol with a box": '<symbol id="s" viewBox="0 0 50 50" overflow="visible">{}</symbol>'
        '<use href="#s" width="50" height="50"/>',
        "style sheet": "<style>.no {{ display: none }}</style><g class='no'>{}</g>",
        "clip": "<clipPath id='c'><rect width='1' height='1'/></clipPath><g clip-path='url(#c)'>{}</g>",
        "outline never used": "<defs>{}</defs>",
        "symbol and hidden use": "<defs><g id='d'>{}</g></defs><use href='#d' style='display:none'/>",
        "use of another file": "{}<use href='other.svg#part'/>",
        "use of nothing": "{}<use href='#no-such-thing'/>",
        "text for a hole": f"{{}}<text {corner}>O</text>",
        "picture": f"{{}}<image {corner} width='9' height='9' href='no.png'/>",
        "arc without radius": "{}",
        "path with an error": "{}<path d='M 1 1 L 5'/>",
        "line caps": "<g stroke='red' stroke-linecap='square' stroke-width='3'>{}</g>",
    }.get(odd, "{}")
    holes = around.format(holes)
    if odd in ("stray line", "line across"):
        far = end if odd == "line across" else f'x2="{z.real - 2 * mm}" y2="{z.imag - 12 * mm}"'
        begin = f'x1="{z.real - (900 if odd == "line across" else 3) * mm}" y1="{z.imag - 12 * mm}"'
        edges += f"<line {begin} {far.replace(f'{z.imag}', f'{z.imag - 12 * mm}', 1)}/>"
    elif odd == "two plates":
        edges += element(page_ring(page, rectangle(500.0 + 500j, 50.0, 40.0)), rng, style="path")
    elif odd == "island":
        centre = sum(s.begin for s in inner) / 4
        edges += holes + element(rectangle(centre, 2.0 * mm, 2.0 * mm, -0.4), rng, style="path")
        holes = ""
    elif odd == "hole twice":
        edges += holes
    elif odd == "units in shapes":
        edges, holes = (_rect_in_mm(ring, page) for ring in (edge, inner))
    elif odd == "arc without radius":
        holes = f'<path d="M {z.real} {z.imag} ' + " ".join(
            f"A 0 0 0 0 1 {s.end.real} {s.end.imag}" for s in inner if isinstance(s, Line)
        ) + ' Z"/>'  # fmt: skip
    elif odd == "attribute entity":
        before, edges = '<!DOCTYPE svg [<!ENTITY edge "outline">]>\n', f'<g id="&edge;">{edges}</g>'
        return edges + in_layer("holes", holes, rng), before
    layers = {"outline": "outline", "holes": "holes"}
    body = in_layer("outline", edges, rng) + in_layer("holes", holes, rng)
    if odd.startswith("misspelt"):
        wrong = odd.split()[1]
        body = body.replace(f'id="{layers[wrong]}"', f'id="{wrong[:-1]}x"').replace(
            f'"{LABELS[wrong]}"', f'"{wrong}_1"'
        )
    return body, before


def _rect_in_mm(ring: Ring, page: Page) -> str:
    """Lengths with a unit, each 96/25.4 units of the user."""
    share = 25.4 / 96
    low = complex(min(s.begin.real for s in ring), min(s.begin.imag for s in ring))
    high = complex(max(s.begin.real for s in ring), max(s.begin.imag for s in ring))
    size = high - low
    return (
        f'<rect x="{low.real * share}mm" y="{low.imag * share}mm" width="{size.real * share}mm" '
        f'height="{size.imag * share}mm"/>'
    )


def hostile_svg(rng: Random) -> ForeignFile:
    """A damaged drawing, or one that takes for ever."""
    kinds = ["cycle", "self", "uses", "deep", "laughs", "far", "arc", "many", "zero box", "curve", "transform", "list"]
    kind = rng.choice(["damaged"] * 16 + kinds)
    if kind == "damaged":
        return damaged(ordinary_svg(rng) if rng.random() < 0.7 else odd_svg(rng, rng.choice(ODD)), rng)
    big = rng.choice(["1e7", "1e20", "1e150", "1e300", "1e400", "nan", "inf"])
    before, box = "", "0 0 120 90"
    inner = '<circle cx="60" cy="45" r="5"/>'
    if kind == "cycle":
        inner = '<g id="a"><use href="#b"/></g><g id="b"><use href="#a"/></g>'
    elif kind == "self":
        inner = '<g id="a"><circle r="5"/><use href="#a" x="3"/></g>'
    elif kind == "uses":
        groups = (f'<g id="u{i}">{f"""<use href="#u{i + 1}"/>""" * 10}</g>' for i in range(9))
        inner = f'<defs>{"".join(groups)}<g id="u9">{inner}</g></defs><use href="#u0"/>'
    elif kind == "deep":
        depth = rng.choice([500, 5000, 200_000])
        inner = "<g>" * depth + inner + "</g>" * depth
    elif kind == "laughs":
        lines = "".join(f'<!ENTITY l{i} "{f"&l{i + 1};" * 10}">' for i in range(9))
        before, inner = f'<!DOCTYPE svg [{lines}<!ENTITY l9 "{"ha" * 50}">]>', "<text>&l0;</text>"
    elif kind == "far":
        inner = f'<path d="M 0 0 L {big} 0 L {big} {big} Z"/>'
    elif kind == "arc":
        inner = f'<path d="M 0 0 A {big} {big} 0 1 1 9 9 Z"/><ellipse cx="60" cy="45" rx="{big}" ry="1"/>'
    elif kind == "curve":
        inner = f'<path d="M 0 0 C {big} 0 -{big} 9 {big} {big} T {big} 1 Z"/>'
    elif kind == "zero box":
        box = rng.choice(["0 0 0 0", "0 0 120", "0 0 -120 90", "x", f"0 0 {big} {big}", "0,0,120,90,1", ""])
    elif kind == "transform":
        inner = f'<g transform="{rng.choice([f"scale({big})", "scale(0)", "rotate()", "matrix(1 2)", f"skewX({big})", "rotate(90deg", "translate(1mm)"])}">{inner}</g>'  # noqa: E501
    elif kind == "list":
        inner = f'<polygon points="{"1 " * rng.choice([7, 20_001])}"/>'
    else:
        numbers = (f'<line x1="{rng.random() * 99}" y1="{rng.random() * 90}" x2="60" y2="{rng.random() * 90}"/>'
                   for _ in range(8000))  # fmt: skip
        inner = "".join(numbers)
    text = (
        f'<?xml version="1.0"?>\n{before}<svg {HEAD} width="120mm" height="90mm" viewBox="{box}">'
        f'<rect id="outline" width="120" height="90"/><g id="holes">{inner}</g></svg>'
    )
    said = f"SVG, hostile: {kind} {big}"
    return ForeignFile(text.encode(), ".svg", said, None, patches=False, feet=False)
