"""Every entity of a drawing is taken, ignored by a rule that is named, or refused with its place; nothing is lost."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import shapely
from command_line import feeder_sim
from conftest import REPOSITORY
from ezdxf.filemanagement import new

from feeder_sim.errors import InputError
from feeder_sim.scenario.drawing import with_drawing

Draw = Callable[[Any, Any], object]  # on the model space of a document
AREA = 200.0 * 100.0
HOLE, FOOT = {"layer": "holes"}, {"layer": "feet"}
TABLES = {"actuator": [{"name": "piezo"}], "support": [{}]}


def dxf_of(path: Path, draw: Draw, units: int = 4, version: str = "R2010") -> Path:
    """A plate of 200 x 100 and what `draw` adds."""
    document = new(version, units=units)
    rectangle(document.modelspace(), "outline", 0.0, 0.0, 200.0, 100.0)
    draw(document.modelspace(), document)
    document.saveas(path)
    return path


def rectangle(space: Any, layer: str, x: float, y: float, width: float, height: float, **keys: Any) -> Any:
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
    return space.add_polyline2d(corners, close=True, dxfattribs={"layer": layer} | keys)


def svg_of(path: Path, body: str, page: str = 'width="200mm" height="100mm" viewBox="0 0 200 100"') -> Path:
    names = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" xmlns:other="urn:other"'
    plate = '<rect id="outline" width="200" height="100"/>'
    path.write_text(f"<svg {names} {page}>{plate}{body}</svg>", encoding="utf-8")
    return path


def tables_of(path: Path, **keys: Any) -> dict[str, Any]:
    return with_drawing({"drawing": path.name} | keys, path.parent)


def area_of(path: Path, **keys: Any) -> float:
    """Of the plate without its holes [mm2]."""
    tables = tables_of(path, **keys)
    return shapely.Polygon(tables["outline"]["points_mm"], [hole["points_mm"] for hole in tables["hole"]]).area


def block(space: Any, document: Any, layer: str = "0", **insert: Any) -> None:
    """A round hole of radius 5 as a block, inserted at (50, 50)."""
    document.blocks.new("screw").add_circle((0.0, 0.0), 5.0, dxfattribs={"layer": layer})
    space.add_blockref("screw", (50.0, 50.0), dxfattribs=HOLE | insert)


def nested(space: Any, document: Any) -> None:
    block(space, document)
    outer = document.blocks.new("pair")
    for x in (0.0, 20.0):
        outer.add_blockref("screw", (x, 0.0), dxfattribs={"layer": "0"})
    space.add_blockref("pair", (100.0, 30.0), dxfattribs={"layer": "holes", "rotation": 90.0})


def arcs_and_lines(space: Any, _: Any) -> None:
    """A slot of two lines and two arcs, in any order and direction, their ends 0.05 to 1.3 um apart."""
    layer = {"layer": "holes"}
    space.add_line((60.0, 45.0), (40.0, 45.00005), dxfattribs=layer)
    space.add_arc((60.0, 50.0), 5.0, -90.0, 90.0, dxfattribs=layer)
    space.add_arc((40.0, 50.0), 5.0, 90.0, 270.0, dxfattribs=layer)
    space.add_line((60.0, 55.0), (40.0, 55.0), dxfattribs=layer)


def bulges(space: Any, _: Any) -> None:
    corners = [(40.0, 45.0, 0.0), (60.0, 45.0, 1.0), (60.0, 55.0, 0.0), (40.0, 55.0, 1.0)]
    space.add_lwpolyline(corners, format="xyb", close=True, dxfattribs=HOLE)


ROUND = math.pi * 25.0
SLOT = 200.0 + ROUND
HOLES: list[tuple[Draw, float]] = [
    (lambda space, _: space.add_circle((50.0, 50.0), 5.0, dxfattribs=HOLE), ROUND),
    (block, ROUND),
    (lambda space, document: block(space, document, layer="HOLES"), ROUND),
    (lambda space, document: block(space, document, xscale=2.0, yscale=-1.0, rotation=30.0), 2.0 * ROUND),
    (lambda s, d: block(s, d, row_count=2, column_count=3, row_spacing=20.0, column_spacing=15.0), 6.0 * ROUND),
    (nested, 3.0 * ROUND),
    (arcs_and_lines, SLOT),
    (bulges, SLOT),
    (lambda space, _: space.add_ellipse((50, 50), (10, 0), 0.5, dxfattribs=HOLE), 2.0 * ROUND),
    (lambda space, _: space.add_solid([(40, 40), (60, 40), (40, 50), (60, 50)], {"layer": "holes"}), 200.0),
    (lambda space, _: [rectangle(space, "holes", 40, 40, 20, 10) for _ in range(2)], 200.0),
    (lambda space, _: rectangle(space, "file$0$holes", 40, 40, 20, 10), 200.0),
]


@pytest.mark.parametrize(("draw", "holes"), HOLES)
@pytest.mark.parametrize(("units", "mm"), [(4, 1.0), (5, 10.0), (1, 25.4)])
def test_a_hole_is_taken_however_it_is_drawn(draw: Draw, holes: float, units: int, mm: float, tmp_path: Path) -> None:
    path = dxf_of(tmp_path / "plate.dxf", draw, units)
    assert area_of(path) == pytest.approx(mm**2 * (AREA - holes), rel=2e-5)


LOST: list[tuple[Draw, str]] = [
    (lambda s, _: s.add_lwpolyline([(9, 9), (60, 9), (60, 40), (9, 40), (9, 9.03)], dxfattribs=HOLE),
     "holes ... (9, 9) mm, 0.03 mm"),
    (lambda s, _: s.add_arc((50, 50), 5, 0, 359.95, dxfattribs=HOLE), "holes ... (55, 49.996) mm, 0.004 mm"),
    (lambda s, _: s.add_line((10, 10), (190, 10), dxfattribs={"layer": "outline"}), "outline ... open line"),
    (lambda s, _: s.add_line((0, 10), (200, 10), dxfattribs={"layer": "outline"}), "outline ... open line"),
    (lambda s, _: s.add_line((10, 10), (20, 10), dxfattribs={"layer": "patches"}), "patches ... (10, 10) mm"),
    (lambda s, _: s.add_line((10, 10), (20, 10), dxfattribs=FOOT), "feet ... open line"),
    (lambda s, _: rectangle(s, "hole", 40, 40, 20, 10), "'hole' (did you mean 'holes'?)"),
    (lambda s, _: rectangle(s, "Outlines", 40, 40, 20, 10), "did you mean 'outline'"),
    (lambda s, _: rectangle(s, "Foot", 40, 40, 20, 10), "did you mean 'feet'"),
    (lambda s, _: rectangle(s, "outline", 300, 40, 20, 10), "second ring at (310, 45) mm"),
    (lambda s, _: rectangle(s, "holes", 40, 40, 20, 10, invisible=1), "hidden POLYLINE ... holes"),
    (lambda s, d: (d.layers.add("holes").off(), rectangle(s, "holes", 40, 40, 20, 10)), "hidden POLYLINE"),
    (lambda s, d: (d.layers.add("holes").freeze(), rectangle(s, "holes", 40, 40, 20, 10)), "hidden POLYLINE"),
    (lambda s, _: s.add_3dface([(40, 40), (60, 40), (60, 50), (40, 50)], dxfattribs=HOLE), "has a 3DFACE"),
    (lambda s, _: s.add_line((10, 10, 0), (20, 10, 5), dxfattribs=HOLE), "not level"),
    (lambda s, _: s.add_circle((50, 50), 1e20, dxfattribs=FOOT), "feet ... 100000 mm"),
    (lambda s, _: s.add_lwpolyline([(40, 40), (60, 50), (60, 40), (40, 50)], close=True, dxfattribs=HOLE),
     "holes ... meets itself"),
    (lambda s, _: s.add_hatch(dxfattribs=HOLE).paths.add_polyline_path([(40, 40), (60, 40), (60, 50)]),
     "has a fill at"),
    (lambda s, _: [rectangle(s, "patches", x, 40, 20, 10) for x in (40, 50)], "patches ... over each other"),
    (lambda s, _: s.add_lwpolyline([(4, 4), (9, 4), (4, 9)], close=True, dxfattribs=FOOT), "foot at ... neither"),
    (lambda s, d: (d.blocks.new("a").add_blockref("a", (0, 0)), s.add_blockref("a", (0, 0))), "blocks in blocks"),
    (lambda s, _: s.add_lwpolyline([(40, 40), (60, 40)], dxfattribs=HOLE | {"const_width": 4.0}), "with a width"),
    (lambda s, d: (d.add_xref_def("o.dxf", "other"), s.add_blockref("other", (0, 0))), "refers to another drawing"),
    (lambda s, _: s.add_arc((50, 50), 5, 30, 390, dxfattribs=HOLE), "ARC that ends where it begins"),
    (lambda s, _: rectangle(s, "holes copy", 40, 40, 20, 10), "did you mean 'holes'"),
    (lambda s, _: (s.add_circle((9, 9), 5, dxfattribs=FOOT), s.add_point((11, 9), dxfattribs=FOOT)), "within a foot"),
    (lambda s, _: [s.add_circle((50, 50), r, dxfattribs=HOLE) for r in (0.4, 20.0)], "over each other"),
    (lambda s, _: s.add_blockref("nowhere", (0, 0), dxfattribs=HOLE), "block that it lacks"),
]  # fmt: skip


@pytest.mark.parametrize(("draw", "expected"), LOST)
def test_what_would_be_lost_is_refused_with_its_place(draw: Draw, expected: str, tmp_path: Path) -> None:
    path = dxf_of(tmp_path / "plate.dxf", draw)
    with pytest.raises(InputError) as refusal:
        tables_of(path, **TABLES)
    for text in expected.split(" ... "):
        assert text in str(refusal.value)


def test_an_outline_with_a_gap_is_not_replaced_by_its_hole(tmp_path: Path) -> None:
    document = new(units=4)
    space = document.modelspace()
    corners = [(0.0, 0.0), (200.0, 0.0), (200.0, 100.0), (0.0, 100.0), (0.0, 0.004)]
    space.add_lwpolyline(corners, dxfattribs={"layer": "outline"})
    space.add_circle((50.0, 50.0), 20.0, dxfattribs={"layer": "outline"})
    document.saveas(tmp_path / "plate.dxf")
    with pytest.raises(InputError, match=r"layer outline.*\(0, 0\) mm, 0.004 mm"):
        tables_of(tmp_path / "plate.dxf")


def test_what_is_ignored_is_named(tmp_path: Path) -> None:
    def draw(space: Any, document: Any) -> None:
        space.add_text("plate", dxfattribs={"layer": "outline"})
        space.add_point((5.0, 5.0), dxfattribs=HOLE)
        space.add_line((3.0, 3.0), (3.0, 3.0), dxfattribs=HOLE)
        space.add_circle((5.0, 5.0), 1.0, dxfattribs={"layer": "frame"})
        rectangle(space, "patches", 40.0, 40.0, 20.0, 10.0)
        document.layout("Layout1").add_circle((0, 0), 5.0, dxfattribs=HOLE)

    account = tables_of(dxf_of(tmp_path / "plate.dxf", draw))["drawing_account"]
    assert account.startswith("plate.dxf: 1 taken (outline 1), ignored ")
    for text in (
        "1 texts and dimensions", "1 points outside of feet", "1 lines without length", "1 in other layers (frame)",
        "1 outside of the model space", "1 patches that no [[actuator]] takes",
    ):  # fmt: skip
        assert text in account


def test_check_prints_the_account(tmp_path: Path) -> None:
    for name in ("l_plate.dxf", "l_plate.toml", "l_drift.toml"):
        (tmp_path / name).write_bytes((REPOSITORY / "docs/tutorial" / name).read_bytes())
    result = feeder_sim("check", tmp_path / "l_drift.toml")
    assert (
        "Of the drawing l_plate.dxf: 12 taken (outline 6, holes 2, patches 1, feet 3), ignored none." in result.stdout
    )


@pytest.mark.parametrize("units", [6, 1])
def test_a_dxf_whose_unit_contradicts_drawing_unit_is_refused(units: int, tmp_path: Path) -> None:
    path = dxf_of(tmp_path / "plate.dxf", lambda *_: None, units)
    with pytest.raises(InputError, match="drawing_unit is 'mm'"):
        tables_of(path, drawing_unit="mm")


def test_a_dxf_without_a_header_says_no_unit(tmp_path: Path) -> None:
    text = dxf_of(tmp_path / "plate.dxf", lambda *_: None, version="R12").read_text()
    (tmp_path / "plate.dxf").write_text("0\nSECTION\n2\nENTITIES\n" + text.split("ENTITIES\n", 1)[1])
    with pytest.raises(InputError, match="does not say its unit"):
        tables_of(tmp_path / "plate.dxf")
    assert area_of(tmp_path / "plate.dxf", drawing_unit="mm") == pytest.approx(AREA)


PAGES = [
    ('width="200mm" height="100mm" viewBox="0 0 200 100"', 1.0),
    ('width="20cm" height="10cm" viewBox="0 0 200 100"', 1.0),
    ('width="566.929pt" height="283.465pt" viewBox="0 0 200 100"', 1.0),
    ('width="47.244pc" height="23.622pc" viewBox="0 0 200 100"', 1.0),
    ('width="7.874in" height="3.937in" viewBox="0 0 200 100"', 1.0),
    ('width="800q" height="400q" viewBox="0 0 200 100"', 1.0),
    ('width="200mm" viewBox="0 0 200 100"', 1.0),
    ('width="400mm" height="100mm" viewBox="0 0 200 100"', 1.0),  # fits whole
    ('width="400mm" height="100mm" viewBox="0 0 200 100" preserveAspectRatio="xMinYMin slice"', 2.0),
    ('width="400mm" height="100mm" viewBox="0 0 200 100" preserveAspectRatio="none"', math.sqrt(2.0)),
    ('width="200mm" height="100mm"', 25.4 / 96.0),  # units of the user are pixels of CSS
    ('width="300mm" height="200mm" viewBox="-20 -50 300 200"', 1.0),
]


@pytest.mark.parametrize(("page", "mm"), PAGES)
def test_units_of_an_svg_are_those_of_the_standard(page: str, mm: float, tmp_path: Path) -> None:
    path = svg_of(tmp_path / "plate.svg", "", page)
    assert area_of(path) == pytest.approx(mm**2 * AREA, rel=1e-4)


@pytest.mark.parametrize("page", ['width="200px" height="100px"', 'viewBox="0 0 200 100"', 'width="100%"', ""])
def test_an_svg_in_pixels_needs_its_unit(page: str, tmp_path: Path) -> None:
    path = svg_of(tmp_path / "plate.svg", "", page)
    with pytest.raises(InputError, match="does not say its unit"):
        tables_of(path)
    assert area_of(path, drawing_unit="cm") == pytest.approx(100.0 * AREA)


def test_an_svg_whose_unit_contradicts_drawing_unit_is_refused(tmp_path: Path) -> None:
    path = svg_of(tmp_path / "plate.svg", "")
    assert area_of(path, drawing_unit="mm") == pytest.approx(AREA)
    with pytest.raises(InputError, match="drawing_unit is 'inch'"):
        tables_of(path, drawing_unit="inch")


SVG_HOLES = [
    ('<circle cx="50" cy="50" r="5"/>', ROUND),
    ('<ellipse cx="50" cy="50" rx="10" ry="5"/>', 2.0 * ROUND),
    ('<rect x="40" y="45" width="30" height="10" rx="5"/>', SLOT),
    ('<rect x="1cm" y="50%" width="10%" height="10"/>', 200.0),
    ('<path d="M 40 40 H 60 V 50 H 40" />', 200.0),  # filled, so that it closes
    ('<path d="M 40 40 H 60 V 50 H 40 Z" fill="none"/>', 200.0),
    ('<g fill="none"><path d="M 40 40 H 60"/><path d="M 40 50 v -10 M 60 40 v 10 h -20"/></g>', 200.0),
    ('<polygon points="40,40 60,40 60,50 40,50"/>', 200.0),
    ('<polyline points="40,40 60,40 60,50 40,50"/>', 200.0),
    ('<path d="M45 50 a5 5 0 1010 0 5 5 0 10-10 0"/>', ROUND),
    ('<g transform="skewX(20) translate(10 3)"><circle cx="50" cy="50" r="5"/></g>', ROUND),
    ('<g transform="matrix(0,2,-1,0,90,10)"><path d="M30 20a5 5 0 0 1 10 0 5 5 0 0 1-10 0"/></g>', 2.0 * ROUND),
    ('<use xlink:href="#screw" x="50" y="50"/><use href="#screw" transform="translate(90 50) scale(2)"/>', 5.0 * ROUND),
    ('<use href="#two" x="50" y="30"/>', 2.0 * ROUND),
    ('<use href="#mark" x="20" y="20" width="20" height="20"/>', 4.0 * ROUND),
    ('<svg x="20" y="20" width="20" height="20" viewBox="0 0 10 10"><circle cx="5" cy="5" r="5"/></svg>', 4.0 * ROUND),
    ('<other:note/><!-- holes --><a><circle cx="50" cy="50" r="5"/></a>', ROUND),
    ('<g visibility="hidden"><circle visibility="visible" cx="50" cy="50" r="5"/></g>', ROUND),
    ('<g transform="translate(1-2)"><ellipse cx="50" cy="50" rx="5"/></g>', ROUND),
    ('<use href="#page" x="20" y="20" width="20" height="20"/>', 4.0 * ROUND),
    ('<path class="thin" d="M 40 40 H 60"/><path class="thin" d="M 40 40 V 50 H 60 V 40"/>', 200.0),
]
DEFINED = (
    '<style>.thin {fill: none}</style><defs><circle id="screw" r="5"/><symbol id="mark" viewBox="0 0 10 10">'
    '<circle cx="5" cy="5" r="5"/></symbol><svg id="page" viewBox="0 0 10 10">'
    '<circle cx="5" cy="5" r="5"/></svg><g id="two"><use href="#screw"/><use href="#screw" y="20"/></g></defs>'
)


@pytest.mark.parametrize(("shape", "holes"), SVG_HOLES)
def test_a_hole_of_an_svg_is_taken_however_it_is_drawn(shape: str, holes: float, tmp_path: Path) -> None:
    path = svg_of(tmp_path / "plate.svg", f'{DEFINED}<g id="holes">{shape}</g>')
    assert area_of(path) == pytest.approx(AREA - holes, rel=2e-5)


SVG_LOST = [
    ('<g id="holes" fill="none"><path d="M 40 40 H 60 V 50 H 40 V 40.03"/></g>', "holes ... (40, 59.97) mm, 0.03 mm"),
    ('<g id="holes"><line x1="40" y1="40" x2="60" y2="40"/></g>', "holes ... open line"),
    ('<circle id="hole1" r="5"/>', "did you mean 'holes'"),
    ('<g id="Patch"><circle r="5"/></g>', "did you mean 'patches'"),
    ('<g id="holes" style="display: none"><circle cx="50" cy="50" r="5"/></g>', "hidden circle"),
    ('<g id="holes" clip-path="url(#a)"><circle cx="50" cy="50" r="5"/></g>', "clipped circle"),
    ('<g id="holes"><use href="#nowhere"/></g>', "'#nowhere'"),
    ('<g id="holes"><use href="other.svg#a"/></g>', "'other.svg#a'"),
    ('<g id="holes"><use href="#holes"/></g>', "into itself"),
    ('<g id="holes"><other:circle cx="50" cy="50" r="5"/></g>', "another namespace"),
    ('<g id="holes"><circle cx="50" cy="50" r="2em"/></g>', "'2em'"),
    ('<g id="holes"><path d="M 40 40 H 60 X 3"/></g>', "has a path"),
    ('<g id="holes"><path d="M 40 40 L 60"/></g>', "has a path"),
    ('<g id="holes" transform="turn(3)"><circle r="5"/></g>', "'turn(3)'"),
    ('<g id="holes" style="transform: scale(2)"><circle r="5"/></g>', "by a style"),
    ('<g id="holes"><circle cx="1e300" cy="50" r="5"/></g>', "100000 mm"),
    ('<g id="holes"><circle cx="50" cy="50" r="1e30"/></g>', "100000 mm"),
    ("<style>#holes path {fill: none}</style>", "'#holes path'"),
    ("<style>.a {fill: none !important}</style>", "!important"),
    ('<switch><g id="holes"><circle cx="50" cy="50" r="5"/></g></switch>', "shapes in a switch"),
    (
        '<g id="holes"><rect transform="rotate(9)" transform-origin="50 50" width="9" height="9"/></g>',
        "transform-origin",
    ),
    ('<g id="holes"><rect x="50" y="50" width="-9" height="9"/></g>', "negative size"),
    ('<g id="holes"><switch><circle cx="50" cy="50" r="5"/></switch></g>', "shapes in a switch"),
]


@pytest.mark.parametrize(("body", "expected"), SVG_LOST)
def test_what_an_svg_would_lose_is_refused(body: str, expected: str, tmp_path: Path) -> None:
    path = svg_of(tmp_path / "plate.svg", body)
    with pytest.raises(InputError) as refusal:
        tables_of(path)
    for text in expected.split(" ... "):
        assert text in str(refusal.value)


def test_thousands_of_groups_and_copies_of_copies_end_soon(tmp_path: Path) -> None:
    groups = "<g>" * 10_000 + '<circle id="holes" cx="50" cy="50" r="5"/>' + "</g>" * 10_000
    assert area_of(svg_of(tmp_path / "plate.svg", groups)) == pytest.approx(AREA - ROUND, rel=2e-5)
    levels = "".join(f'<g id="g{i}">{f"""<use href="#g{i - 1}"/>""" * 10 if i else ""}</g>' for i in range(10))
    with pytest.raises(InputError, match="more than 20000 entities"):
        tables_of(svg_of(tmp_path / "plate.svg", levels))


def test_a_page_that_paints_nothing_closes_nothing(tmp_path: Path) -> None:
    page = 'fill="none" width="200mm" height="100mm" viewBox="0 0 200 100"'
    with pytest.raises(InputError, match=r"holes.*10 mm from the next line"):
        tables_of(svg_of(tmp_path / "plate.svg", '<path id="holes" d="M 40 40 H 60 V 50 H 40"/>', page))


@pytest.mark.parametrize(
    "hostile",
    [
        f'<circle id="holes" cx="{"1" * 50_000}x" r="5"/>',
        f'<g id="holes" transform="rotate({"1" * 50_000}x)"><circle r="5"/></g>',
        f'<path id="holes" d="M0 0 {"z" * 50_000}"/>',
        f'<path id="holes" d="M0 0 {"l1 1z" * 10_000}"/>',
        f"<style>{'a' * 50_000}</style>",
        f"<style>{'/*' * 50_000}</style>",
        f"<style>{'a{}' * 50_000}</style>",
        f'<g id="{"holes" * 20_000}">{"<circle/>" * 1000}</g>',
    ],
)
def test_hostile_texts_end_soon(hostile: str, tmp_path: Path) -> None:
    path = svg_of(tmp_path / "plate.svg", hostile)
    began = time.process_time()
    with contextlib.suppress(InputError):
        tables_of(path)
    assert time.process_time() - began < 3.0


def test_small_circles_have_their_area(tmp_path: Path) -> None:
    for path in (
        svg_of(tmp_path / "plate.svg", '<circle id="holes" cx="50" cy="50" r="0.1"/>'),
        dxf_of(tmp_path / "plate.dxf", lambda space, _: space.add_circle((50, 50), 0.1, dxfattribs=HOLE)),
    ):
        (hole,) = tables_of(path)["hole"]
        assert shapely.Polygon(hole["points_mm"]).area == pytest.approx(0.01 * math.pi, rel=2e-3)


def test_the_centre_of_a_foot_is_no_second_foot(tmp_path: Path) -> None:
    def draw(space: Any, _: Any) -> None:
        space.add_circle((50, 50), 5, dxfattribs=FOOT)
        space.add_point((50, 50), dxfattribs=FOOT)

    tables = tables_of(dxf_of(tmp_path / "plate.dxf", draw), support=[{}])
    assert len(tables["support"]) == 1 and "1 centres of feet" in tables["drawing_account"]
