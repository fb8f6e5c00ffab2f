"""The chart: fronts, failures, tables of other simulators, bad input, and the quick variant as a whole."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from command_line import check_refused, feeder_sim
from conftest import refusal

from feeder_sim.cli.chart import PARTS, _print_case
from feeder_sim.measures.statistic import Statistic
from feeder_sim.studies.chart import ladder, points, stability_map, walker_maps
from feeder_sim.studies.chart.by_drift_map import NAME, NUMBERS
from feeder_sim.studies.chart.cases import CASES, ball_height
from feeder_sim.studies.chart.engine_maps import EngineMap
from feeder_sim.studies.chart.ladder import Rung, run_ladders
from feeder_sim.studies.chart.map_cells import Axis, MapCell, State
from feeder_sim.studies.chart.methods import EVERYTHING, METHODS
from feeder_sim.studies.chart.points import (
    PEER_COLUMNS,
    Point,
    fastest_within,
    front,
    is_default,
    measure,
    measure_all,
    read_peers,
    scenario_of,
    write_points,
)
from feeder_sim.studies.chart.shares import shares
from feeder_sim.studies.chart.stability_map import MAPS, fill
from feeder_sim.studies.chart.summary import CaseSummary
from feeder_sim.studies.chart.walker_maps import WalkerMap
from feeder_sim.studies.drift_map.comparison import Agreement

HEADER = ",".join(PEER_COLUMNS)


def point(error: float, cost: float, failure: str = "", method: str = "a", setting: int = 40) -> Point:
    return Point("drift_4750", method, setting, 1.0 + 0.01 * error, 0.0, 8, 1.0, 0.0, cost, failure)


def test_front_holds_what_nothing_beats() -> None:
    cheap, middle, exact = point(20.0, 0.1), point(5.0, 1.0), point(1.0, 10.0)
    beaten, failed = point(6.0, 2.0), point(0.2, 0.01, "exploded")
    assert front([exact, beaten, failed, cheap, middle]) == [cheap, middle, exact]
    assert front([failed]) == []


def test_costs_that_cannot_be_told_apart_count_as_equal() -> None:
    first, second, worse = point(1.0, 1.0), point(1.0, 1.05), point(2.0, 1.0)
    assert front([first, second, worse]) == [first, second]


def test_error_is_never_smaller_than_its_standard_error() -> None:
    lucky = Point("drift_4750", "a", 40, 1.001, 0.03, 8, 1.0, 0.04, 1.0)
    assert lucky.error_percent == pytest.approx(5.0)
    assert point(0.001, 1.0).error_percent == pytest.approx(0.1)


def test_fastest_within_counts_valid_points_alone() -> None:
    points = [point(1.0, 10.0), point(4.0, 1.0), point(8.0, 0.1), point(0.5, 0.01, "thrown off")]
    found = fastest_within(points, 5.0)
    assert found is not None and found.wall_s_per_simulated_s == 1.0
    assert fastest_within(points, 0.2) is None


def test_summary_names_the_front_the_default_and_the_next_best_simulator(capsys: pytest.CaptureFixture[str]) -> None:
    default, variant = point(4.0, 1.0, method="impulses"), point(4.5, 0.9, method="impulses, tangent plane")
    other, failed = point(1.0, 10.0, method="MuJoCo"), point(0.5, 0.01, "thrown off", method="Peer")
    found = CaseSummary.of("drift_4750", "Drift", [default, variant, other, failed])
    told = json.loads(json.dumps(found.as_json_object()))
    assert [p["method"] for p in told["front"]] == ["impulses", "MuJoCo"]
    assert told["default"]["on_front"] and told["default"]["cost"] == 1.0
    assert (told["fastest"]["method"], told["next"]["method"], told["next"]["cost"]) == ("impulses", "MuJoCo", 10.0)
    assert told["failed"] == [{"method": "Peer", "setting": 40, "failure": "thrown off"}]
    _print_case(found)
    assert capsys.readouterr().out.splitlines() == [
        "Drift",
        "  front  impulses, 40: error 4 %, cost 1",
        "  front  MuJoCo, 40: error 1 %, cost 10",
        "  default on the front: yes, error 4 %",
        "  fastest within 5 %: impulses, 40",
        "  next: MuJoCo, 40, 10 times its cost",
        "  failed  Peer, 40: thrown off",
    ]
    alone = CaseSummary.of("drift_4750", "Drift", [failed]).as_json_object()
    assert alone["front"] == [] and alone["default"] is None and alone["fastest"] is None and alone["next"] is None


def test_pieces_of_a_work_tell_their_share_of_it() -> None:
    told: list[float] = []
    first, nothing, last = shares(told.append, (3.0, 0.0, 1.0))
    for show, fraction in ((first, 0.5), (first, 1.0), (nothing, 1.0), (last, 0.5), (last, 1.0)):
        show(fraction)
    assert told == pytest.approx([0.375, 0.75, 0.75, 0.875, 1.0])


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("part", ["methods", "ladder", "stability"])
def test_progress_of_a_part_rises_to_its_end(part: str, quick: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever its pieces are; here they take no time."""

    def run(raw: object, number: int, progress: Callable[[float], None], *, quick: bool) -> object:
        progress(1.0)
        return [1.0, 1.1], 0.1

    steady = State.STABLE, Statistic(0.0, 0.0, 0.0, 2), ""
    monkeypatch.setattr(points, "_once", lambda case, method, setting: point(1.0, 1.0))
    monkeypatch.setattr(points, "_ensemble", lambda case, method, setting, seeds, progress: point(1.0, 1.0))
    monkeypatch.setattr(ladder, "_run", run)
    for kind in (EngineMap, WalkerMap):
        monkeypatch.setattr(kind, "judge", lambda self, x, y, *, quick: steady)
    monkeypatch.setitem(walker_maps._MADE, quick, None)
    told, notes = [0.0], list[str]()
    compute: dict[str, Callable[..., Sequence[object]]] = {
        "methods": lambda **how: measure_all(CASES, METHODS, **how),
        "ladder": run_ladders,
        "stability": fill,
    }
    found = compute[part](quick=quick, note=notes.append, progress=told.append)
    assert told == sorted(told) and told[-1] == pytest.approx(1.0)
    assert len(notes) == len(found) and len(set(told)) > len(found) / 2


def test_json_of_the_chart_is_one_object_and_notes_go_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rung = Rung("strip", "full", 1.5, math.nan, 1, 0.0, 0.0, 1.0, "1 of 1")
    cell = MapCell("impulses", 10, 0.2, State.UNCLEAR, math.nan, math.nan, "drift not known")

    def climb(*, quick: bool, note: Callable[[str], None], progress: Callable[[float], None]) -> list[Rung]:
        note("strip, full: 1.500 mm/s")
        progress(1.0)
        return [rung]

    monkeypatch.setattr(ladder, "run_ladders", climb)
    monkeypatch.setattr(stability_map, "fill", lambda **_: [cell])
    parts = ("--only", "stability", "--only", "ladder")
    done = feeder_sim("chart", *parts, "--quick", "--json", "--out", "c", cwd=tmp_path)
    assert done.returncode == 0 and done.stderr == "feeder-sim: strip, full: 1.500 mm/s\n"
    told = json.loads(done.stdout)
    assert (told["folder"], told["quick"], list(told)[3:]) == ("c", True, ["ladder", "stability"])
    files = [file for part in ("ladder", "stability") for file in told[part]["files"]]
    assert sorted(files) == sorted(f"c/{path.name}" for path in (tmp_path / "c").iterdir())
    (row,) = told["ladder"]["rungs"]
    assert row["speed_mm_s"] == 1.5 and row["se_mm_s"] is None
    assert told["ladder"]["rungs"] == json.loads((tmp_path / "c/ladder.json").read_text())
    assert told["stability"]["states"] == {"unclear": 1} and told["stability"]["cells"][0]["deviation"] is None
    in_words = feeder_sim("chart", *parts, "--quick", "--out", "d", cwd=tmp_path).stdout
    assert "saves 1.00" in in_words and "unclear: 1 of 1 cells" in in_words


def test_every_case_has_one_default_and_every_method_a_case() -> None:
    for case in CASES:
        methods = [method for method in METHODS if case.name in method.cases]
        points = {(m, n): Point(case.name, m.name, n, 1.0, 0.0, 1, 1.0, 0.0, 1.0) for m in methods for n in m.settings}
        ((method, _),) = (of for of, point in points.items() if is_default(point))
        scenario = scenario_of(case, method, 40)
        assert scenario.run.steps_per_period == 40 and not scenario.run.allow_unstable
    assert all(set(method.cases) <= set(EVERYTHING) and set(method.quick) <= set(method.settings) for method in METHODS)


def test_ball_height_is_that_of_a_flight_of_one_period() -> None:
    """The ball leaves with g T / 2 at the height at which it will land."""
    f, a, e, g = 50.0, 245e-6, 0.2, 9.81
    top = ball_height(f, a, e)
    sine = (top - g / (8.0 * f**2)) / a
    landing_rate = a * 2.0 * math.pi * f * math.sqrt(1.0 - sine**2)
    take_off = g / (2.0 * f)
    assert take_off - landing_rate == pytest.approx(e * (take_off + landing_rate), rel=1e-9)


@pytest.mark.parametrize(
    ("walked", "walked_se", "n", "expected"),
    [
        (1.1, 0.01, 8, State.STABLE),
        (0.8, 0.01, 8, State.BIASED),
        (1.3, 0.2, 8, State.UNCLEAR),  # within two standard errors
        (1.1, math.nan, 1, State.UNCLEAR),
        (1.3, math.nan, 1, State.UNCLEAR),  # of one seed the error is not known
        (math.nan, math.nan, 0, State.UNCLEAR),
    ],
)
def test_cells_of_walkers_are_judged_by_their_deviation_from_full_runs(
    walked: float, walked_se: float, n: int, expected: State
) -> None:
    asked = []

    def compared(x: float, y: float, quick: bool) -> Agreement:
        asked.append((x, y, quick))
        full, of_map = Statistic(1.0, 0.0, 0.0, 8), Statistic(walked, math.nan, walked_se, n)
        return Agreement("speed", full, of_map, 1.0, 1.0, 0.0)

    axis = Axis("V", (1.0, 2.0), (3.0,))
    (cell,) = fill([WalkerMap("m", "m", axis, axis, "speed", compared)], quick=True)
    assert asked == [(3.0, 3.0, True)] and (cell.map, cell.x, cell.y) == ("m", 3.0, 3.0)
    assert cell.state == expected and (cell.why == "") == (expected == State.STABLE)
    assert cell.deviation == pytest.approx(walked - 1.0, nan_ok=True)


@pytest.mark.slow
def test_methods_differ_on_a_case_without_chance() -> None:
    case = next(c for c in CASES if c.name == "sliding_impact")
    impulses, mujoco = (next(m for m in METHODS if m.name == name) for name in ("impulses", "MuJoCo"))
    assert measure(case, impulses, 40, (0.0, 0.0), quick=True).error_percent == pytest.approx(0.1)
    assert measure(case, mujoco, 40, (0.0, 0.0), quick=True).error_percent == pytest.approx(46.0, abs=3.0)


def test_what_fails_is_no_point() -> None:
    case = next(c for c in CASES if c.name == "flat_drop")
    discrete = next(m for m in METHODS if m.name == "MuJoCo, discrete integrator")
    assert "error of the velocity" in measure(case, discrete, 40, (0.0, 0.0), quick=True).failure


def test_peers_are_read_with_the_reference_of_the_chart(tmp_path: Path) -> None:
    table = tmp_path / "peers.csv"
    table.write_text(f"{HEADER}\ndrift_4750,Peer,40,1.4,0.1,6,2.5,,notes\ndrift_4750,Peer,20,,,0,1.0,thrown off,\n")
    good, bad = read_peers(table, {"drift_4750": (1.5, 0.0)})
    assert good.error_percent == pytest.approx(100 * 0.1 / 1.5) and good.details == "notes"
    assert not bad.valid and bad.failure == "thrown off"
    assert read_peers(table, {"flat_drop": (0.0, 0.0)}) == []


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("case,method\n", "has no column 'setting'"),
        (f"{HEADER}\ndrift_4750,Peer,fine,1.4,0.1,6,2.5,,\n", "drift_4750, Peer"),
        (f"{HEADER}\ndrift_4750,Peer\n", "drift_4750, Peer"),
        ("\xff\xfe", "cannot be read"),
    ],
)
def test_tables_of_peers_that_cannot_be_used(tmp_path: Path, text: str, complaint: str) -> None:
    table = tmp_path / "peers.csv"
    table.write_bytes(text.encode("latin-1"))
    message = refusal(read_peers, table, {"drift_4750": (1.5, 0.0)})
    assert complaint in message and "peers.csv" in message


def test_written_points_can_be_read_back(tmp_path: Path) -> None:
    points = [point(3.0, 1.0, method="impulses"), point(0.5, 9.0), point(0.1, 0.1, "thrown off")]
    write_points(points, tmp_path)
    rows = json.loads((tmp_path / "methods.json").read_text())
    assert [row["on_front"] for row in rows] == [True, True, False]
    assert [row["default"] for row in rows] == [True, False, False]
    with (tmp_path / "methods.csv").open(newline="") as file:
        assert [float(row["error_percent"]) for row in csv.DictReader(file)] == pytest.approx([3.0, 0.5, 0.1])


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ("--only laddr", "did you mean 'ladder'"),
        ("--case drift", "--case: is 'drift'"),
        ("--peers missing.csv", "no such file"),
        ("--out file", "is a file, allowed is a folder"),
    ],
)
def test_bad_arguments_get_one_line(tmp_path: Path, arguments: str, complaint: str) -> None:
    (tmp_path / "file").write_text("")
    check_refused(feeder_sim("chart", *arguments.split(), cwd=tmp_path), complaint)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file"]


@pytest.mark.slow(minutes=True)
def test_quick_chart(tmp_path: Path) -> None:
    """All of it with few seeds: every method that ought to work does, the others fail, the default is accurate."""
    done = feeder_sim("chart", "--quick", "--json", "--out", tmp_path / "chart")
    assert done.returncode == 0, done.stderr
    names = {f"{part}.{kind}" for part in ("methods", "ladder", "stability") for kind in ("csv", "json", "png", "svg")}
    assert {path.name for path in (tmp_path / "chart").iterdir()} == names
    rows = json.loads((tmp_path / "chart/methods.json").read_text())
    assert {row["case"] for row in rows} == {case.name for case in CASES}
    assert {row["case"] for row in rows if row["method"] == NAME} == set(NUMBERS)
    known = {method.name for method in METHODS if method.fails}
    discrete_slide = ("MuJoCo, discrete integrator", "sliding_impact")  # whose error is mostly that of the slide
    for row in rows:
        if row["method"] in known and (row["method"], row["case"]) != discrete_slide:
            assert row["failure"] or row["error_percent"] > 40.0, row
        elif row["default"] and not next(case for case in CASES if case.name == row["case"]).by_chance:
            assert row["error_percent"] < 0.5
        elif row["default"] and row["case"] != "crowd_20":
            assert abs(row["value"] / row["reference"] - 1.0) < 0.15
    cells = json.loads((tmp_path / "chart/stability.json").read_text())
    assert {"stable", "exploding", "tunnelling"} <= {cell["state"] for cell in cells}
    assert {cell["map"] for cell in cells} == {stability_map.name for stability_map in MAPS}
    told = json.loads(done.stdout)
    assert told["methods"]["points"] == rows and told["stability"]["cells"] == cells
    assert [case["case"] for case in told["methods"]["cases"]] == [case.name for case in CASES]
    assert all(case["default"] for case in told["methods"]["cases"])
    assert told["ladder"]["rungs"] == json.loads((tmp_path / "chart/ladder.json").read_text())
    assert [told[part]["files"][0] for part in PARTS] == [str(tmp_path / f"chart/{part}.csv") for part in PARTS]
