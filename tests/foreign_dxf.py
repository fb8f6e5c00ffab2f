"""DXF files that others could have drawn: ordinary ones, odd ones and hostile ones."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import shapely.affinity
from drawn_dxf import DxfSheet
from drawn_plates import DrawnPlate, Line, Ring, Truth, ellipse, polygon, random_plate, rectangle
from foreign_files import ForeignFile, damaged

# What is odd in a drawing: it is refused, or read as it was meant. What is hidden may also be left out.
ODD = (
    "gap", "gap in a hole", "open patch", "open hole", "stray line", "line across", "misspelt holes",
    "misspelt outline", "frozen holes", "layer off", "hidden hole", "point in the outline", "hatched hole",
    "solid hole", "line twice", "ray", "row of inserts", "uneven insert", "two plates", "island", "hole over the edge",
    "micrometres", "hole in a hole", "text for a hole", "no patch in its block", "hole twice", "viewport",
)  # fmt: skip
GAPS_MM = (0.0005, 0.002, 0.01, 0.03, 0.1)


def ordinary_dxf(rng: Random) -> ForeignFile:
    """A drawing without fault: nothing in it may be lost."""
    version = rng.choice(["R12", "R2000", "R2000", "R2010", "R2018"])
    unit, told = rng.choice(["mm", "mm", "cm", "m", "inch"]), version != "R12" and rng.random() < 0.8
    plate = random_plate(rng, curves=version != "R12")
    sheet = DxfSheet(rng, unit, told, version)
    inserts = rng.choice([0.0, 0.0, 0.5, 1.0])
    items = list(plate.items(rng))
    rng.shuffle(items)
    for layer, item in items:
        if rng.random() < inserts:
            sheet.insert(layer, item, levels=rng.randint(1, 3))
        else:
            sheet.draw(layer, item)
    besides(sheet, rng)
    said = f"DXF {version} in {unit}{'' if told else ' (not said)'}, {inserts:.0%} in blocks"
    return _file(sheet, plate, said, (plate.truth(),), ordinary=True, unit=None if told else unit)


def besides(sheet: DxfSheet, rng: Random) -> None:
    """What does not count: other layers, also frozen ones and such as are off, texts, another space."""
    layers = sheet.document.layers
    layers.add("dimensions").off()
    layers.add("frame").freeze()
    for layer in ("dimensions", "frame", "0", "centre lines"):
        if rng.random() < 0.7:
            sheet.draw(layer, rectangle(50 + 40j, 300.0, 200.0))
            sheet.draw(layer, 20j + 5.0)
    sheet.space.add_text("plate 7", dxfattribs={"layer": rng.choice(["outline", "text"])})
    if rng.random() < 0.3:
        sheet.document.layout("Layout1").add_line((0, 0), (9, 9), dxfattribs={"layer": "frame"})


def _file(
    sheet: DxfSheet,
    plate: DrawnPlate,
    said: str,
    truths: tuple[Truth, ...] | None,
    *,
    ordinary: bool = False,
    unit: str | None = None,
    slack_mm: float = 0.0,
) -> ForeignFile:
    return ForeignFile(
        sheet.bytes(), ".dxf", said, truths, ordinary=ordinary, slack_mm=slack_mm, unit=unit,
        patches=bool(plate.patches), feet=bool(plate.feet),
    )  # fmt: skip


def odd_dxf(rng: Random, odd: str) -> ForeignFile:
    """A drawing with one thing in it that is not as it should be."""
    plate = random_plate(rng, straight_only=odd in ("gap", "gap in a hole"))
    spot = polygon(plate.outline).centroid
    middle = complex(spot.x, spot.y)
    hole = rectangle(middle, 9.0, 7.0, 0.4)
    if odd != "text for a hole":
        plate = replace(plate, holes=(hole,), patches=plate.patches[:0], feet=plate.feet[:0])
    if odd in ("open patch", "no patch in its block"):
        plate = replace(plate, holes=(), patches=(hole,))
    sheet = DxfSheet(rng, "mm", True, "R2010")
    if odd not in ("gap", "misspelt outline"):
        sheet.draw("outline", plate.outline)
    truth, gap = plate.truth(), rng.choice(GAPS_MM)
    without = replace(plate, holes=()).truth()
    truths: tuple[Truth, ...] = (truth,)
    if odd.startswith("gap"):
        sheet.draw("outline", with_gap(plate.outline if odd == "gap" else hole, gap, rng), style="loose")
        if odd == "gap":
            sheet.draw("holes", hole)
    elif odd in ("frozen holes", "layer off", "hidden hole"):
        layer = sheet.document.layers.add("holes")
        if odd == "frozen holes":
            layer.freeze()
        elif odd == "layer off":
            layer.off()
        sheet.draw("holes", hole, invisible=int(odd == "hidden hole"))
        truths = (truth, without)
    elif odd in ("two plates", "island"):
        sheet.draw("outline", hole if odd == "island" else rectangle(middle + 500.0, 50.0, 50.0))
        sheet.draw("outline", rectangle(middle + (0.0 if odd == "island" else 500.0), 4.0, 3.0, 0.4))
        truths = ()
    elif odd == "hole over the edge":
        sheet.draw("holes", across := rectangle(plate.outline[0].begin, 9.0, 7.0))
        truths = (replace(plate, holes=(across,)).truth(),)
    elif odd == "text for a hole":
        sheet.space.add_text("hole", dxfattribs={"layer": "holes"})
        for layer_name, item in plate.items(rng):
            if layer_name != "outline" or item is not plate.outline:
                sheet.draw(layer_name, item)
    elif odd == "viewport":
        paper = sheet.document.layout("Layout1")
        paper.add_lwpolyline([(z.real, z.imag) for z in corners(hole)], close=True, dxfattribs={"layer": "holes"})
        truths = (truth, without)
    else:
        _oddity(sheet, rng, odd, plate, hole)
    if odd == "micrometres":
        truths = (Truth(shapely.affinity.scale(truth.plate, 0.001, 0.001, origin=(0, 0))),)
    said = f"DXF with {odd}" + (f" of {gap} mm" if odd.startswith("gap") else "")
    return _file(sheet, plate, said, truths, slack_mm=gap if odd.startswith("gap") else 0.0)


def _oddity(sheet: DxfSheet, rng: Random, odd: str, plate: DrawnPlate, hole: Ring) -> None:
    """What changes nothing of what is meant."""
    space, points = sheet.space, [(z.real, z.imag) for z in corners(hole)]
    middle = sum(corners(hole)) / 4
    layer = {"layer": "holes"}
    if odd in ("stray line", "line across", "point in the outline", "ray"):
        end = 400.0 if odd == "line across" else 3.0
        sheet.draw("holes", hole)
        if odd == "ray":
            space.add_xline(points[0], (1, 0), dxfattribs={"layer": "outline"})
        elif odd == "point in the outline":
            sheet.draw("outline", middle)
        else:
            at = middle + 20j
            space.add_line((at.real - end, at.imag), (at.real + end, at.imag), dxfattribs={"layer": "outline"})
    elif odd.startswith("misspelt"):
        sheet.draw("holes" if odd == "misspelt outline" else rng.choice(["hole", "Hole_s", "holes "]), hole)
        if odd == "misspelt outline":
            sheet.draw(rng.choice(["Outlines", "out line", "contour"]), plate.outline)
    elif odd in ("open patch", "open hole"):
        space.add_lwpolyline(points, dxfattribs={"layer": "patches"} if odd == "open patch" else layer)
    elif odd == "no patch in its block":
        sheet.document.blocks.new("EMPTY")
        space.add_blockref("EMPTY", points[0], dxfattribs={"layer": "patches"})
    elif odd == "hatched hole":
        space.add_hatch(dxfattribs=layer).paths.add_polyline_path(points, is_closed=True)
    elif odd == "solid hole":
        space.add_solid([points[0], points[1], points[3], points[2]], dxfattribs=layer)
    elif odd in ("row of inserts", "uneven insert"):
        block = sheet.document.blocks.new("B")
        half = [(x - middle.real, 0.5 * (y - middle.imag)) for x, y in points]
        block.add_lwpolyline(half, close=True, dxfattribs=layer)
        reference = space.add_blockref("B", (middle.real, middle.imag), dxfattribs={"yscale": 2.0})
        if odd == "row of inserts":
            reference.grid((1, 1), (12.0, 12.0))
    else:
        sheet.draw("holes", hole)
        if odd == "hole in a hole":
            sheet.draw("holes", ellipse(middle, 2.0, 2.0))
        elif odd == "hole twice":
            sheet.draw("outline", hole)
        elif odd == "line twice":
            sheet.draw("holes", hole, style="loose")
        elif odd == "micrometres":
            sheet.document.header["$INSUNITS"] = 13


def corners(ring: Ring) -> list[complex]:
    return [segment.begin for segment in ring]


def with_gap(ring: Ring, gap_mm: float, rng: Random) -> Ring:
    """One of its straight segments is too short by the gap."""
    i = rng.randrange(len(ring))
    begin, end = ring[i].begin, ring[i].end
    short = end + gap_mm * (begin - end) / abs(begin - end)
    return (*ring[:i], Line(begin, short), *ring[i + 1 :])


def hostile_dxf(rng: Random) -> ForeignFile:
    """A damaged drawing, or one that takes for ever."""
    kind = rng.choice(["damaged"] * 12 + ["blocks", "cycle", "array", "arc", "spline", "bulge", "many", "deep"])
    if kind == "damaged":
        return damaged(ordinary_dxf(rng) if rng.random() < 0.7 else odd_dxf(rng, rng.choice(ODD)), rng)
    sheet = DxfSheet(rng, "mm", True, "R2000")
    sheet.draw("outline", rectangle(0j, 100.0, 100.0))
    holes, space, big = {"layer": "holes"}, sheet.space, rng.choice([1e7, 1e9, 1e20, 1e150, 1e300])
    if kind in ("blocks", "deep", "cycle"):
        number, copies = {"blocks": (12, 8), "deep": (1500, 1), "cycle": (3, 1)}[kind]
        blocks = [sheet.document.blocks.new(f"B{i}") for i in range(number)]
        for i, block in enumerate(blocks):
            for _ in range(copies):
                after = (i + 1) % number if kind == "cycle" else i + 1
                if after < number:
                    block.add_blockref(f"B{after}", (0, 0), dxfattribs=holes)
        blocks[-1].add_circle((0, 0), 5.0, dxfattribs=holes)
        space.add_blockref("B0", (0, 0), dxfattribs=holes)
    elif kind == "array":
        sheet.document.blocks.new("B").add_circle((0, 0), 0.1, dxfattribs=holes)
        space.add_blockref("B", (0, 0), dxfattribs=holes).grid((30_000, 30_000), (0.001, 0.001))
    elif kind == "arc":
        space.add_arc((0, -big), big, 89.0, 91.0, dxfattribs=holes)
        space.add_ellipse((0, 0), (big, 0), 1e-9, dxfattribs=holes)
    elif kind == "spline":
        curve = space.add_spline(degree=rng.choice([3, 40]), dxfattribs=holes)
        curve.control_points = [(rng.uniform(-big, big), rng.uniform(-1, 1), 0) for _ in range(60)]
        curve.knots = [rng.choice([0.0, 1.0, big, float(i)]) for i in range(64)]
    elif kind == "bulge":
        space.add_lwpolyline([(0, 0, big), (1, 1, 1 / big), (2, 0, -big)], format="xyb", close=True, dxfattribs=holes)
    else:
        for _ in range(6_000):
            z = complex(rng.uniform(-40, 40), rng.uniform(-40, 40))
            space.add_line((z.real, z.imag), (-z.imag, z.real), dxfattribs=holes)
    return ForeignFile(sheet.bytes(), ".dxf", f"DXF, hostile: {kind} {big:g}", None, patches=False, feet=False)
