"""Outlets: what a scenario may say, what a seed's numbers are made of, warnings, and run folders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import refusal, resting, toml_of
from matplotlib.figure import Figure

import feeder_sim
from feeder_sim import prepare
from feeder_sim.measures.catalogue import values_of_seed
from feeder_sim.measures.outlets import jam_times
from feeder_sim.records.recording import PlateRecord
from feeder_sim.records.trajectory import Frames
from feeder_sim.report.run_pictures import parts_picture
from feeder_sim.run.recorded_run import RecordedRun
from feeder_sim.scenario import Scenario, parse_scenario
from feeder_sim.scene.outlet import build_outlets, outlet_numbers

SQUARE = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]
BOX = [[5.0, 5.0, 0.0], [20.0, 20.0, 10.0]]
SCENARIO: dict[str, Any] = {
    "plate": {"kind": "still", "length_mm": 200.0, "width_mm": 100.0},
    "part": [{"shape": "box", "size_mm": [10.0, 10.0, 5.0], "name": "block", "start": {"drop_height_mm": 0.0}}],
    "outlet": [{"name": "a", "outline_mm": SQUARE}, {"name": "b", "box_mm": BOX}],
    "run": {"duration_s": 0.5, "seeds": 1},
}
SECOND_KIND = [SCENARIO["part"][0], {"shape": "ball", "diameter_mm": 5.0, "start": {"kind": "scattered"}}]


def read(changes: dict[str, Any]) -> Scenario:
    return parse_scenario(toml_of(SCENARIO, changes), file=Path("case.toml"))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"outlet[0].name": "b"}, 'outlet[1].name is "b", must be a name of its own'),
        ({"outlet[0].name": "a b"}, "outlet[0].name: is 'a b'"),
        ({"outlet[0].box_mm": BOX}, "outlet[0]: exactly one of outline_mm, box_mm and drawing is needed"),
        ({"outlet[0].outline_mm": None}, "outlet[0]: exactly one of outline_mm, box_mm and drawing is needed"),
        ({"outlet[0].outline_mm": SQUARE[:2]}, "[[0.0, 0.0], [10.0, 0.0]], must be a list with at least 3"),
        (
            {"outlet[0].outline_mm": [SQUARE[k] for k in (0, 2, 1, 3)]},
            "outlet[0]: outline_mm crosses or touches itself",
        ),
        ({"outlet[1].box_mm": BOX[::-1]}, "outlet[1]: box_mm has a side without length"),
        ({"outlet[0].jam_after_s": 0.0}, "outlet[0].jam_after_s: is 0.0, must be greater than 0"),
        ({"outlet[0].part": "nut"}, 'outlet[0].part is "nut", must be block'),
        ({"outlet[0].up": ["+z"], "part": SECOND_KIND}, "outlet[0].up needs the kind whose poses are meant"),
        ({"refill": {}}, "refill.every_s is missing, must be a number from 0.01 on without a [schedule]"),
        ({"refill.every_s": 0.0}, "refill.every_s: is 0.0, must be"),
    ],
)
def test_bad_outlets_are_refused_in_one_line(changes: dict[str, Any], expected: str) -> None:
    assert expected in refusal(read, changes)


def test_a_side_that_no_part_has_is_refused() -> None:
    assert 'outlet[0].up: has "Q", must be' in refusal(prepare, read({"outlet[0].up": ["Q"]}))


def one_frame(place_mm: tuple[float, float, float]) -> Frames:
    return resting(np.zeros(1), 1e-3 * np.array([[place_mm]]))


@pytest.mark.parametrize(
    ("place_mm", "number"),
    [
        ((2.0, 2.0, 500.0), 0),
        ((7.0, 7.0, 5.0), 0),  # in both
        ((15.0, 15.0, 5.0), 1),
        ((15.0, 15.0, 10.0), 1),  # on a face
        ((15.0, 15.0, 11.0), -1),
        ((-1.0, 5.0, 5.0), -1),
    ],
)
def test_a_part_is_in_the_first_outlet_that_holds_its_centre(place_mm: tuple[float, float, float], number: int) -> None:
    assert outlet_numbers(build_outlets(read({})), one_frame(place_mm)).tolist() == [number]


def test_a_jam_is_a_span_without_parts_through_while_parts_are_there() -> None:
    time = np.arange(101) / 10.0
    frames = resting(time, np.zeros((101, 1, 3)))
    frames.present[(time > 4.95) & (time < 8.05)] = False
    assert jam_times(frames, np.array([3.0, 9.0]), 1.9) == pytest.approx([1.9, 4.9])
    assert jam_times(frames, np.array([0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 9.0]), 1.9).size == 0


def test_an_outlet_that_nothing_can_reach_is_a_warning() -> None:
    far = [[x + 150.0, y] for x, y in SQUARE]
    wall = {"shape": "box", "name": "wall", "size_mm": [40.0, 40.0, 20.0], "position_mm": [60.0, 0.0]}
    inside = [[50.0, -5.0, 1.0], [70.0, 5.0, 9.0]]
    changes = {"plate.rim": True, "outlet[0].outline_mm": far, "outlet[1].box_mm": inside, "fixture": [wall]}
    warnings = prepare(read(changes)).warnings
    assert [line for line in warnings if line.startswith("outlet")] == [
        "outlet[0]: lies beside the plate, whose rim no part passes: nothing reaches it",
        "outlet[1]: lies within wall: nothing reaches it",
    ]
    assert not any(line.startswith("outlet") for line in prepare(read({"outlet[0].outline_mm": far})).warnings)


def test_a_run_folder_has_outlets_what_went_through_and_its_numbers(tmp_path: Path) -> None:
    fast = {"kind": "state", "position_mm": [-20.0, 5.0, 2.5], "velocity_mm_s": [500.0, 0.0, 0.0]}
    scenario = read(
        {"part[0].start": fast, "outlet[0].up": ["+z"], "outlet[1].up": ["-z"], "outlet[0].jam_after_s": 0.01}
    )
    feeder_sim.record_run(scenario, tmp_path / "run")
    opened = feeder_sim.open(tmp_path / "run")
    plate: PlateRecord = opened.recording.plate
    assert {name: corners.tolist() for name, corners in plate.outlets.items()}["a"] == (
        1e-3 * np.array(SQUARE)
    ).tolist()
    findings = opened.outlets
    assert [each.parts_through.mean for each in findings.outlets] == [1.0, 0.0]
    assert findings.right_share.mean == 1.0
    assert findings.outlets[1].right_share.n == findings.outlets[1].jams.n == 0
    assert findings.jams.mean == 1.0
    assert opened.seeds[0].removals.outlet.tolist() == [0]
    assert values_of_seed(opened.prepared, opened.seeds[0])["outlets[a].parts_through"] == 1.0
    assert list((tmp_path / "run").glob("*.rrd"))


def test_the_report_shows_the_parts_as_they_first_jam(tmp_path: Path) -> None:
    blocks = [SCENARIO["part"][0] | {"count": 2, "start": {"kind": "scattered"}}]
    aside = [[80.0 + x, 30.0 + y] for x, y in SQUARE]
    changes = {"part": blocks, "outlet": [{"name": "exit", "outline_mm": aside, "jam_after_s": 0.2}]}
    feeder_sim.record_run(read(changes), tmp_path / "run", replay=False)
    picture, figure = parts_picture(RecordedRun.open(tmp_path / "run")), Figure()
    assert picture is not None
    picture.draw(figure)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[:3] == ["start", "jam of exit, 0.2 s", "end of the record, 0.5 s"]
