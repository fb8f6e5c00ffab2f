"""A DXF or SVG drawing in place of an outline: what is read of it, and what is refused."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, toml_of
from ezdxf.filemanagement import new

from feeder_sim.errors import InputError
from feeder_sim.scenario import PlateFile, load_plate_file, load_scenario
from feeder_sim.scene.plate_modes import compute_modes

Raw = dict[str, Any]
PATCH: Raw = {"name": "piezo", "thickness_mm": 1.0, "d31_pm_per_v": 180.0}
FOOT: Raw = {"stiffness_n_per_mm": 20.0, "loss_factor": 0.2}
PLATE: Raw = {"drawing": "plate.dxf", "thickness_mm": 2.0, "damping_ratio": 0.002, "highest_frequency_hz": 3000.0}
FILE: Raw = {"plate": PLATE, "actuator": [PATCH], "support": [FOOT]}


def draw(path: Path, *, units: int = 4, scale: float = 1.0, without: str = "") -> Path:
    """An L of 120 x 90 with a rounded corner, two holes, two patches, three feet; lines and arcs are loose pieces."""
    document = new(units=units)
    space = document.modelspace()

    def points(*corners: tuple[float, float]) -> list[tuple[float, float]]:
        return [(scale * x, scale * y) for x, y in corners]

    def layer(name: str) -> dict[str, str]:
        return {"layer": "0" if name == without else name}

    begin, end = points((0, 0), (110, 0))
    space.add_line(begin, end, dxfattribs=layer("OUTLINE"))
    space.add_arc((110 * scale, 10 * scale), 10 * scale, -90, 0, dxfattribs=layer("OUTLINE"))
    rest = points((120, 10), (120, 40), (50, 40), (50, 90), (0, 90), (0, 0))
    space.add_lwpolyline(rest, dxfattribs=layer("OUTLINE"))
    space.add_circle(points((25, 75))[0], 4 * scale, dxfattribs=layer("OUTLINE"))
    space.add_circle(points((105, 25))[0], 3 * scale, dxfattribs=layer("holes"))
    square = points((15, 30), (30, 30), (30, 45), (15, 45))
    space.add_lwpolyline(square, close=True, dxfattribs=layer("patches"))
    turned = points((70, 10), (80, 15), (77.5, 20), (67.5, 15))
    space.add_lwpolyline(turned, close=True, dxfattribs=layer("patches"))
    for place in points((8, 8), (8, 82)):
        space.add_circle(place, 3 * scale, dxfattribs=layer("feet"))
    space.add_point(points((100, 8))[0], dxfattribs=layer("feet"))
    space.add_text("L", dxfattribs=layer("OUTLINE"))
    space.add_circle(points((60, 20))[0], 5 * scale, dxfattribs={"layer": "dimensions"})
    document.saveas(path)
    return path


def file_in(folder: Path, **changes: Any) -> PlateFile:
    (folder / "plate.toml").write_text(toml_of(FILE, changes))
    return load_plate_file(folder / "plate.toml")


def whole(file: PlateFile) -> shapely.Polygon:
    """The plate without its holes [mm]."""
    assert file.plate.outline is not None
    return shapely.Polygon(file.plate.outline.points_mm or (), [hole.points_mm or () for hole in file.hole])


def test_outline_holes_patches_and_feet_are_where_they_are_drawn(tmp_path: Path) -> None:
    draw(tmp_path / "plate.dxf")
    file = file_in(tmp_path)
    assert file.plate.outline is not None and file.plate.outline.points_mm is not None
    corners = np.array(file.plate.outline.points_mm)
    assert {(0.0, 0.0), (120.0, 40.0), (50.0, 40.0), (50.0, 90.0), (0.0, 90.0)} <= set(map(tuple, corners.round(9)))
    on_arc = corners[(corners[:, 0] > 110.5) & (corners[:, 1] < 9.5)]
    assert len(on_arc) > 10 and np.hypot(*(on_arc - [110, 10]).T) == pytest.approx(10.0, abs=0.01)
    centres = sorted(tuple(np.mean(hole.points_mm or (), axis=0).round(2).tolist()) for hole in file.hole)
    assert centres == [(25.0, 75.0), (105.0, 25.0)]
    assert [actuator.name for actuator in file.actuator] == ["piezo_1", "piezo_2"]
    assert file.actuator[0].at_mm == pytest.approx((22.5, 37.5)) and file.actuator[0].angle_deg == 0.0
    assert file.actuator[1].at_mm == pytest.approx((73.75, 15.0), abs=0.01)
    assert file.actuator[1].size_mm == pytest.approx((11.18, 5.59), abs=0.01)
    assert file.actuator[1].angle_deg == pytest.approx(26.565, abs=0.01)
    feet = sorted((round(x, 2), round(y, 2)) for x, y in (support.at_mm for support in file.support))
    assert feet == [(8.0, 8.0), (8.0, 82.0), (100.0, 8.0)]
    assert len(compute_modes(file).modes) > 5


def test_units_of_the_drawing_are_those_it_says_or_those_that_are_given(tmp_path: Path) -> None:
    draw(tmp_path / "plate.dxf", units=1, scale=1.0 / 25.4)
    inches = file_in(tmp_path)
    draw(tmp_path / "plate.dxf", units=0)
    given = file_in(tmp_path, **{"plate.drawing_unit": "mm"})
    assert inches.actuator[0].at_mm == pytest.approx(given.actuator[0].at_mm, abs=0.01)
    with pytest.raises(InputError, match="does not say its unit"):
        file_in(tmp_path)


SVG = """<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"
    {size} viewBox="0 0 120 90">
  <path id="outline" d="M 0 90 H 110 A 10 10 0 0 0 120 80 V 50 H 50 V 0 H 0 Z
    M 29 15 a 4 4 0 1 0 -8 0 a 4 4 0 1 0 8 0"/>
  <g inkscape:label="Holes"><circle cx="105" cy="65" r="3"/></g>
  <g id="patches"><rect x="15" y="45" width="15" height="15"/>
    <g transform="translate(70 80) rotate(-26.565051)">
      <rect width="11.18034" height="5.5901699" y="-5.5901699"/></g></g>
  <g id="feet"><circle cx="8" cy="82" r="3"/><circle cx="8" cy="8" r="3"/><circle cx="100" cy="82" r="3"/></g>
  <text>L</text><circle id="dimension" cx="60" cy="70" r="5"/>
</svg>"""


@pytest.mark.parametrize("size", ['width="120mm" height="90mm"', 'width="4.72440945in" height="3.54330709in"', ""])
def test_an_svg_says_the_same_as_a_dxf(size: str, tmp_path: Path) -> None:
    draw(tmp_path / "plate.dxf")
    expected = file_in(tmp_path)
    (tmp_path / "plate.svg").write_text(SVG.format(size=size))
    unit = {} if size else {"plate.drawing_unit": "mm"}
    found = file_in(tmp_path, **{"plate.drawing": "plate.svg"}, **unit)
    one, other = whole(found), whole(expected)
    assert one.symmetric_difference(other).area < 1e-4 * other.area
    for patch, patch_of_dxf in zip(found.actuator, expected.actuator, strict=True):
        assert (*patch.at_mm, *patch.size_mm, patch.angle_deg) == pytest.approx(
            (*patch_of_dxf.at_mm, *patch_of_dxf.size_mm, patch_of_dxf.angle_deg), abs=0.01
        )
    feet = sorted((round(x, 2), round(y, 2)) for x, y in (support.at_mm for support in found.support))
    assert feet == [(8.0, 8.0), (8.0, 82.0), (100.0, 8.0)]


def test_the_two_drawings_of_the_tutorial_are_the_same(tmp_path: Path) -> None:
    folder = REPOSITORY / "docs/tutorial"
    as_dxf = (folder / "l_plate.toml").read_text()
    (tmp_path / "svg.toml").write_text(as_dxf.replace("l_plate.dxf", str(folder / "l_plate.svg")))
    one, other = (load_plate_file(path) for path in (folder / "l_plate.toml", tmp_path / "svg.toml"))
    assert whole(one).symmetric_difference(whole(other)).area < 0.1
    assert (one.actuator, len(one.support)) == (other.actuator, len(other.support))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (SVG.format(size=""), "plate.svg ... unit ... drawing_unit"),
        (SVG.format(size='width="100%"'), "plate.svg ... unit"),
        ("<svg", "plate.svg ... not a readable SVG"),
        ("<html></html>", "plate.svg"),
        ('<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm"><rect width="9"/></svg>', "layer outline"),
    ],
)
def test_an_svg_that_cannot_be_meant_is_refused(text: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "plate.svg").write_text(text)
    (tmp_path / "plate.toml").write_text(toml_of(FILE, {"plate.drawing": "plate.svg"}))
    check_refused(feeder_sim("modes", tmp_path / "plate.toml"), expected)


def test_tables_may_have_a_place_of_their_own(tmp_path: Path) -> None:
    draw(tmp_path / "plate.dxf")
    own = PATCH | {"name": "own", "at_mm": [60.0, 30.0], "size_mm": [8.0, 8.0]}
    file = file_in(tmp_path, actuator=[own, PATCH | {"name": "a"}, PATCH | {"name": "b"}])
    assert [actuator.name for actuator in file.actuator] == ["own", "a", "b"]
    assert file.actuator[1].at_mm == pytest.approx((22.5, 37.5))


def test_a_scenario_goes_from_a_drawing_to_a_drift(tmp_path: Path) -> None:
    draw(tmp_path / "plate.dxf")
    plate = {"kind": "plate", **PLATE, "actuator": [PATCH], "support": [FOOT]}
    raw = {
        "plate": plate,
        "drive": [{"frequency_hz": 1500.0, "voltage_vpp": 60.0, "actuator": ["piezo_1"]}],
        "part": [{"shape": "hex_nut", "size": "M2", "start": {"kind": "point", "position_mm": [-35.0, -20.0]}}],
        "run": {"duration_s": 0.2, "seeds": 1},
    }
    (tmp_path / "scenario.toml").write_text(toml_of(raw))
    done = feeder_sim("run", tmp_path / "scenario.toml", "--out", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    (tmp_path / "plate.dxf").unlink()
    recorded = load_scenario(tmp_path / "run/scenario.toml")  # which needs no drawing any more
    assert recorded.plate.drawing is None and len(recorded.plate.actuator) == 2  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("without", "change", "expected"),
    [
        ("OUTLINE", {}, "plate.dxf ... layer outline"),
        ("patches", {}, "plate.dxf ... 0 in the layer patches ... 1"),
        ("", {"actuator": [PATCH, PATCH | {"name": "b"}, PATCH | {"name": "c"}]}, "2 in the layer patches ... 3"),
        ("", {"plate.drawing": "no.dxf"}, "no.dxf ... DXF"),
        ("", {"plate.drawing": "plate.toml"}, "plate.toml ... not a readable DXF"),
        ("", {"plate.length_mm": 50.0}, "plate.length_mm ... beside a drawing"),
        ("", {"plate.drawing_unit": "yard"}, "drawing_unit"),
    ],
)
def test_drawings_that_cannot_be_meant_are_refused(without: str, change: Raw, expected: str, tmp_path: Path) -> None:
    draw(tmp_path / "plate.dxf", without=without)
    (tmp_path / "plate.toml").write_text(toml_of(FILE, change))
    check_refused(feeder_sim("modes", tmp_path / "plate.toml"), expected)


@pytest.mark.parametrize(("name", "library"), [("plate.dxf", "ezdxf.filemanagement"), ("plate.svg", "svgelements")])
def test_without_the_library_the_extra_is_named(
    name: str, library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / name).touch()
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError, match=r"plate\.toml: plate\.drawing: .*feeder_sim\[drawing\]"):
        file_in(tmp_path, **{"plate.drawing": name})
