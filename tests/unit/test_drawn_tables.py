"""Fixtures and outlets of a drawing: where they stand, which table takes which ring, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from conftest import refusal, toml_of
from ezdxf.filemanagement import new

from feeder_sim import prepare
from feeder_sim.run.plan import plan_run
from feeder_sim.scenario import Scenario, load_scenario

Raw = dict[str, Any]
Rings = dict[str, list[tuple[float, float]]]  # by layer [mm]
FENCE: Raw = {"shape": "extrusion", "drawing": "feeder.dxf", "height_mm": 20.0}
CHUTE: Raw = {"name": "chute", "drawing": "feeder.dxf"}
SCENARIO: Raw = {
    "plate": {"kind": "still", "length_mm": 200.0, "width_mm": 100.0},
    "part": [{"shape": "ball", "diameter_mm": 4.0, "start": {"position_mm": [40.0, -40.0]}}],
    "fixture": [FENCE],
    "outlet": [CHUTE],
    "run": {"duration_s": 0.1, "seeds": 1},
}
PLATE: Raw = {"kind": "plate", "drawing": "feeder.dxf", "thickness_mm": 2.0, "damping_ratio": 0.002}
POST, BENT = (60.0, 30.0), [(120, 20), (150, 20), (150, 25), (125, 25), (125, 60), (120, 60)]


def draw(path: Path, unit_mm: float = 1.0, more: Rings | None = None) -> Path:
    """A plate whose corner is the origin, a round post, a bent fence, and a chute at the right; `more` are rings."""
    document = new(units={1.0: 4, 10.0: 5}[unit_mm])
    space = document.modelspace()
    rings = {"outline": [(0, 0), (200, 0), (200, 100), (0, 100)], "fixtures": BENT} | (more or {})
    rings |= {"outlets": [(185, 40), (195, 40), (195, 60), (185, 60)]}
    for layer, ring in rings.items():
        corners = [(x / unit_mm, y / unit_mm) for x, y in ring]
        space.add_lwpolyline(corners, close=True, dxfattribs={"layer": layer})
    x, y = POST
    space.add_circle((x / unit_mm, y / unit_mm), 5.0 / unit_mm, dxfattribs={"layer": "fixtures"})
    document.saveas(path)
    return path


def read(folder: Path, changes: Raw | None = None) -> Scenario:
    (folder / "case.toml").write_text(toml_of(SCENARIO, changes or {}))
    return load_scenario(folder / "case.toml")


@pytest.mark.parametrize("unit_mm", [1.0, 10.0])
def test_one_table_stands_for_all_that_are_drawn(unit_mm: float, tmp_path: Path) -> None:
    draw(tmp_path / "feeder.dxf", unit_mm)
    scenario = read(tmp_path, {"fixture[0].name": "fence"})
    post, bent = scenario.fixtures
    assert (post.name, bent.name) == ("fence_1", "fence_2")
    round_one, other = (shapely.Polygon(fixture.footprints()[0]) for fixture in (post, bent))
    assert round_one.centroid.coords[0] == pytest.approx((POST[0] - 100.0, POST[1] - 50.0), abs=1e-3)
    assert round_one.area == pytest.approx(25.0 * math.pi, rel=0.005)
    assert round_one.exterior.hausdorff_distance(shapely.Point(round_one.centroid).buffer(5.0, 64).exterior) < 0.03
    whole = shapely.union_all([shapely.Polygon(body) for body in bent.footprints()])
    assert whole.symmetric_difference(shapely.Polygon(np.subtract(BENT, (100.0, 50.0)))).area < 1e-9
    assert other.area < whole.area  # of two convex bodies
    assert scenario.outlets[0].name == "chute"
    assert np.min(scenario.outlets[0].outline_mm or (), axis=0) == pytest.approx((85.0, -10.0))
    account = "feeder.dxf: 3 taken (fixtures 2, outlets 1), ignored 1 outline"
    assert scenario.drawing_account == account and plan_run(prepare(scenario))["drawing"] == account


def test_tables_take_rings_from_left_to_right_each_with_its_own_height(tmp_path: Path) -> None:
    draw(tmp_path / "feeder.dxf")
    wiper = FENCE | {"height_mm": 8.0, "position_mm": [0.0, -5.0, 3.0], "name": "wiper"}
    wall = {"shape": "box", "size_mm": [4.0, 50.0, 10.0], "position_mm": [-90.0, 0.0]}
    fixtures = read(tmp_path, {"fixture": [FENCE, wall, wiper]}).fixtures
    assert [fixture.shape for fixture in fixtures] == ["extrusion", "box", "extrusion"]
    assert fixtures[0].foot_mm == pytest.approx((-40.0, -20.0, 0.0), abs=1e-3)
    assert fixtures[2].foot_mm == pytest.approx((35.0, -15.0, 3.0)) and fixtures[2].name == "wiper"


def test_what_is_drawn_stands_where_its_plate_has_it(tmp_path: Path) -> None:
    """A post in a hole of the same drawing is in the middle of it in the scene, too."""
    hole = [(POST[0] + 8.0 * math.cos(a), POST[1] + 8.0 * math.sin(a)) for a in np.linspace(0.0, 6.0, 40)]
    draw(tmp_path / "feeder.dxf", more={"holes": hole})
    drive = [{"mode": 3, "frequency_hz": 697.8, "amplitude_um": 1.0}]
    scenario = read(tmp_path, {"plate": PLATE | {"highest_frequency_hz": 3000.0}, "drive": drive})
    scene = prepare(scenario).scene
    assert scene.surface.outline is not None
    _, ring = scene.surface.outline.rings
    post = next(fixture for fixture in scene.fixtures if len(fixture.bodies) == 1)
    inner = shapely.Polygon(post.in_space[0][:, :2]).convex_hull
    assert shapely.Polygon(ring).contains(inner)
    assert np.hypot(*(post.centre[:2] - 1e-3 * np.subtract(POST, (100.0, 50.0)))) < 1e-6


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"fixture": [FENCE] * 3},
            "has 2 in the layer fixtures, must be as many as there are [[fixture]] of it, 3, or",
        ),
        ({"fixture[0].points_mm": BENT}, "fixture[0].drawing: is given beside a shape in numbers, must be one of both"),
        ({"outlet[0].box_mm": [[0.0] * 3, [1.0] * 3]}, "outlet[0].drawing: is given beside a shape in numbers"),
        ({"fixture[0].shape": "box"}, "fixture[0].drawing: is of a shape that is not drawn, must be extrusion"),
        ({"fixture[0].drawing": "none.dxf"}, "none.dxf: is no file of up to 4 MB, must be a DXF or SVG drawing"),
        ({"fixture[0].drawing_unit": "ell"}, "fixture.drawing_unit: is 'ell', must be mm, cm, m, inch"),
        ({"fixture[0].drawing": None}, "fixture[0]: points_mm is missing, must be the corners of an outline"),
        ({"fixture[0].position_mm": "left"}, "fixture[0].position_mm: is 'left'"),
    ],
)
def test_a_table_that_does_not_go_with_its_drawing_is_refused(changes: Raw, expected: str, tmp_path: Path) -> None:
    draw(tmp_path / "feeder.dxf")
    assert expected in refusal(lambda: read(tmp_path, changes))


@pytest.mark.parametrize(
    ("layer", "ring", "expected"),
    [
        ("fixture", BENT, "did you mean 'fixtures'?"),
        ("outlet_1", BENT, "did you mean 'outlets'?"),
        ("fixtures", [(55, 25), (80, 25), (80, 35), (55, 35)], "has two rings over each other at (60,"),
        (
            "fixtures",
            [(0, 0), (9, 9), (9, 0), (0, 9)],
            "has a ring in the layer fixtures that meets itself at (4.5, 4.5)",
        ),
    ],
)
def test_a_drawing_that_would_lose_something_is_refused(
    layer: str, ring: list[tuple[float, float]], expected: str, tmp_path: Path
) -> None:
    draw(tmp_path / "feeder.dxf", more={layer: ring})
    assert expected in refusal(lambda: read(tmp_path))
