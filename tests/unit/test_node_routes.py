"""Nodes of a strip against the free beam, and the sequences of modes found on it against plain enumeration."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY
from scipy.optimize import brentq

from feeder_sim.plate.materials import Material
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.sequences import LineNodes, Route, Search, find_routes, follow, nodes_on_line
from feeder_sim.scenario import load_plate_file
from feeder_sim.scene.plate_modes import compute_modes

LENGTH, START = 0.16, -0.075
SOURCE = (1, 4, 3, 5, 2)  # 402, 3546, 2242, 4756, 1154 Hz of the source's plate
STRIP = REPOSITORY / "models/strip_160/plate.toml"
RECTANGLE = REPOSITORY / "models/plate_160_120/plate.toml"


def strip(thickness: float = 0.003) -> PlateModes:
    plate = RectangularPlate(LENGTH, 0.12, thickness, Material(2770.0, 71e9, 0.33))
    return plate_modes(plate, highest_frequency=9000.0 * thickness / 0.003, uniform_width=True)


@pytest.fixture(scope="module")
def nodes() -> list[LineNodes]:
    return nodes_on_line(strip())


def beam_nodes(kl: float) -> np.ndarray:
    """Nodes of a free beam, as fractions of its length (Blevins, Formulas for Natural Frequency and Mode Shape)."""
    sigma = (np.cosh(kl) - np.cos(kl)) / (np.sinh(kl) - np.sin(kl))

    def shape(s: float) -> float:
        return float(np.cosh(kl * s) + np.cos(kl * s) - sigma * (np.sinh(kl * s) + np.sin(kl * s)))

    at = np.linspace(0.0, 1.0, 1002)
    return np.array([brentq(shape, a, b) for a, b in itertools.pairwise(at) if shape(a) * shape(b) < 0.0])


def test_nodes_of_a_thin_strip_are_those_of_a_free_beam() -> None:
    found = nodes_on_line(strip(thickness=0.0003))
    for mode, kl in enumerate((4.730041, 7.853205, 10.995608, 14.137165)):
        assert found[mode].position / LENGTH + 0.5 == pytest.approx(beam_nodes(kl), abs=2e-4)
        assert found[mode].quarter_wavelength == pytest.approx(0.5 * np.pi / kl * LENGTH, rel=2e-3)


def test_modes_of_a_strip_do_not_vary_across_it() -> None:
    modes = strip()
    for index in range(len(modes)):
        w, _, beta_y = modes.evaluate(index, 0.03, np.linspace(-0.06, 0.06, 7))
        assert w == pytest.approx(np.full(7, w[0])) and (beta_y == 0.0).all()


def test_every_node_lies_in_its_cell(nodes: list[LineNodes]) -> None:
    for of in nodes:
        assert (of.cell[:, 0] < of.position).all() and (of.position < of.cell[:, 1]).all()
        assert [of.reached_from(x) for x in of.position] == list(range(len(of.position)))
        assert of.reached_from(-0.081) is None


def test_the_sequence_of_the_source_carries_a_part_to_the_middle(nodes: list[LineNodes]) -> None:
    route = follow(nodes, [mode - 1 for mode in SOURCE], START)
    assert route.end - START == pytest.approx(0.075, abs=1e-6)
    assert route.largest_k <= 0.67
    assert [step.end for step in route.steps] == sorted(step.end for step in route.steps)
    assert route.growth == pytest.approx(1.0, abs=1e-6)  # nothing leaves the line of a strip
    best = find_routes(nodes, START, 0.0, Search())[0]  # finds it and nothing better
    assert best.modes == tuple(mode - 1 for mode in SOURCE)


@pytest.mark.parametrize("end", [0.0, 0.02, -0.03])
@pytest.mark.parametrize("limit", [0.6, 1.0])
def test_routes_are_the_best_of_all_orders(nodes: list[LineNodes], end: float, limit: float) -> None:
    best: dict[int, float] = {}
    for length in range(1, 5):
        for order in itertools.product(range(len(nodes)), repeat=length):
            if any(a == b for a, b in itertools.pairwise(order)):
                continue
            try:
                route = follow(nodes, order, START)
            except ValueError:
                continue
            if abs(route.end - end) <= 2e-3 and route.largest_k < limit:
                best[length] = min(best.get(length, np.inf), route.largest_k)
    falling = [k for length, k in best.items() if k < min((best[m] for m in best if m < length), default=np.inf)]
    found = find_routes(nodes, START, end, Search(limit=limit, most_modes=4))
    assert [route.largest_k for route in found] == pytest.approx(sorted(falling))
    assert all(_connected(route, START) for route in found)


def _connected(route: Route, start: float) -> bool:
    return [step.start for step in route.steps] == [start, *(step.end for step in route.steps)][:-1]


def test_growth_is_what_the_slope_of_the_square_makes_of_an_offset() -> None:
    """Against an integration of the drift down the slope of w^2, a little beside the line."""
    modes = compute_modes(load_plate_file(RECTANGLE)).modes
    nodes = nodes_on_line(modes)
    for mode, start, grows in ((4, -0.0228, True), (5, -0.0158, False)):
        step = follow(nodes, [mode], start).steps[0]
        assert (step.growth > 2.0) == grows
        point = np.array([start, 1e-4])
        for _ in range(20_000):
            if abs(point[0] - step.end) < 0.01 * abs(start - step.end):
                break
            h = 1e-6
            around = point + h * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
            square = modes.evaluate(mode, around[:, 0], around[:, 1])[0] ** 2
            slope = np.array([square[0] - square[1], square[2] - square[3]])
            point = point - 5e-6 * slope / np.linalg.norm(slope)
        assert point[1] / 1e-4 == pytest.approx(step.growth, rel=0.03)


def test_plates_of_other_widths_are_compared() -> None:
    place = ("sequence", RECTANGLE, "--from", "-75", "--to", "0", "--most", "4", "--growth", "1.5")
    rows = json.loads(feeder_sim(*place, "--ratios", "1.3333:1.5:2", "--json").stdout)
    best = json.loads(feeder_sim(*place, "--json").stdout)[0]
    assert rows[0]["largest_k"] == pytest.approx(best["largest_k"], rel=1e-3) and rows[0]["modes"] == best["modes"]
    assert rows[1]["ratio"] == 1.5 and rows[1]["largest_k"] < 1.0
    text = feeder_sim("sequence", STRIP, *place[2:6], "--modes", "1,4,3").stdout
    assert "modes 1, 4, 3" in text and "5696.9" in text


@pytest.mark.slow
def test_growth_is_not_told_off_the_middle() -> None:
    rows = json.loads(feeder_sim("sequence", RECTANGLE, "--from", "-75", "--to", "0", "--y", "20", "--json").stdout)
    assert rows and all(growth is None for row in rows for growth in row["growth"])


@pytest.mark.parametrize(
    ("source", "options", "says"),
    [
        (STRIP, "--from -81", "--from: is -81, must be within +-80 mm"),
        (STRIP, "--y 70", "--y: is 70, must be within +-60 mm"),
        (STRIP, "--modes 1,9", "--modes: is 1,9, must be numbers from 1 to 5"),
        (STRIP, "--modes one", "--modes: is one, must be numbers from 1 to 5"),
        (STRIP, "--limit 0.3", "no sequence of up to 6 modes reaches 0 mm"),
        (RECTANGLE, "--y 20 --growth 1.5", "--growth: belongs to the middle of the plate"),
        (RECTANGLE, "--modes 2,10 --ratios 1:2:3", "--modes: follows one plate's modes"),
        (STRIP, "--ratios 1:2:3", "plate.uniform_width: says that modes do not vary with the width"),
        (STRIP.with_name("modes.h5"), "--ratios 1:2:3", "holds the modes of one plate"),
        (RECTANGLE, "--growth 0.05", "with every k below 1 and an offset that grows by less than 0.05"),
        *(
            (RECTANGLE, f"--ratios {wrong}", f"--ratios: is {wrong}, must be LEAST:LARGEST:NUMBER")
            for wrong in ("1:2", "2:1:5", "1:2:1", "a:b:c", "0:2:5", "1:nan:5")
        ),
    ],
)
def test_what_cannot_be_meant_is_one_line(source: Path, options: str, says: str) -> None:
    check_refused(feeder_sim("sequence", source, "--from", "-75", "--to", "0", *options.split()), says)
