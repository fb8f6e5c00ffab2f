"""What stays beside the package: the judge of the conformance set, closed forms and maps of the chart, its peers."""

from __future__ import annotations

import csv
import importlib.util
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import stability_maps
from chart_cases import ball_height
from conformance_set.cases import (
    CASES,
    CREEP_S,
    FAST_HZ,
    FAST_S,
    FAST_UM,
    MEASURED,
    REST_S,
    REST_SPEED,
    Row,
    closed_rows,
    fast_way,
    measured_rows,
    throw_height,
    zero_rows,
)
from conformance_set.files import read_results, read_set, write_results
from conformance_set.judge import OFF, PASS, UNDECIDED, Result, judged, passes, table
from conformance_set.motions import OBSERVERS, Motion, after_impact, slide_to_rest, way_at
from conformance_set.own import SCENARIOS, cube_falls, motion_of, own_results, remade_rows
from conftest import REPOSITORY, refusal
from run import HEADER
from stability_maps import MAPS, MapCell, State, by_deviation, fill, read_cells, write_cells

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated

SET = Path(__file__).parents[2] / "benchmarks" / "peers" / "conformance.csv"
COLUMNS = "case,quantity,value,se\n"


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return read_set(SET)


def right(rows: list[Row]) -> list[Result]:
    """The right values, as an engine would have them."""
    found = {
        (r.case, r.quantity): Result(r.case, r.quantity, r.right, 0.01 * r.scale if r.chance else math.nan, "mine")
        for r in rows
        if r.basis != "measurement"
    }
    return list(found.values())


def test_the_stored_set_is_that_of_the_code(rows: list[Row]) -> None:
    assert {row.case for row in rows} == set(CASES)
    stored = {(row.case, row.quantity, row.basis): row for row in rows}
    for row in closed_rows() + zero_rows(0.0) + measured_rows(dict.fromkeys(MEASURED, 0.0)):
        kept = stored[row.case, row.quantity, row.basis]
        kept_numbers, numbers = (kept.right, kept.low, kept.high), (row.right, row.low, row.high)
        assert kept_numbers == pytest.approx(numbers, rel=1e-5, abs=1e-5 * row.scale)
        assert (kept.unit, kept.chance, kept.source, kept.rule) == (row.unit, row.chance, row.source, row.rule)


def test_right_values_pass_and_each_wrong_one_shows(rows: list[Row]) -> None:
    results = right(rows)
    assert passes(rows, results, "mine")
    assert "**" not in table(rows, results)
    for i, result in enumerate(results):
        row = next(r for r in rows if (r.case, r.quantity) == (result.case, result.quantity))
        for sign in (-1.0, 1.0):
            wrong = [*results[:i], replace(result, value=row.right + sign * 0.2 * row.scale), *results[i + 1 :]]
            assert not passes(rows, wrong, "mine")
            (line,) = (line for line in table(rows, wrong).splitlines() if "**" in line and "measured" not in line)
            assert result.case in line and f"{20 * sign:+.0f} %" in line


def test_chance_needs_a_standard_error_small_enough() -> None:
    row = Row("drift_4750", "transport_speed", "mm/s", 1.5, 1.45, 1.55, 1.5, True, 0.08, "ensemble", "")
    of = lambda value, se=math.nan, n=0: judged(row, Result(row.case, row.quantity, value, se, n=n)).outcome  # noqa: E731
    assert of(1.5, 0.02) == PASS
    assert of(1.5) == of(2.0) == of(1.5, 0.2) == UNDECIDED
    assert of(1.60, 0.02) == PASS and of(1.62, 0.02) == OFF
    assert of(1.62, 0.001, n=2) == PASS  # two seeds that happen to be alike: 0.08/sqrt(2) counts
    assert of(3.0, 0.2) == OFF and of(math.nan) == OFF


def test_an_engine_passes_from_the_setting_after_its_last_failure(rows: list[Row]) -> None:
    row = next(r for r in rows if r.case == "throw")
    values = {20: 1.0, 40: 1.1, 80: 0.99, 160: 1.0}
    results = [Result("throw", "top", factor * row.right, engine="mine", setting=s) for s, factor in values.items()]
    assert "| `throw` | pass from 80 |" in table(rows, results)
    assert "| `rebound` | - |" in table(rows, results)
    assert "**+10 %** top at 40" in table(rows, results[:2])


def test_a_quantity_that_is_left_out_does_not_pass(rows: list[Row]) -> None:
    results = [r for r in right(rows) if r.quantity != "spin"]
    assert "| `slide` | **incomplete** |" in table(rows, results)


def test_results_are_read_as_they_were_written(rows: list[Row], tmp_path: Path) -> None:
    results = [
        Result("throw", "top", 0.25, engine="mine", setting=20),
        Result("drift_8775", "transport_speed", math.nan, engine="mine", setting=20, n=2, failure="did not arrive"),
    ]
    write_results(results, tmp_path / "r.csv")
    assert str(read_results(tmp_path / "r.csv", rows)) == str(results)
    (tmp_path / "My engine.csv").write_text(COLUMNS + "throw,top,0.25,\n", encoding="utf-8")
    (read,) = read_results(tmp_path / "My engine.csv", rows)
    assert read.engine == "My engine" and math.isnan(read.se)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (None, "cannot be read"),
        ("\xff\xfe\x00case", "cannot be read"),
        ("", "case: is missing, needed are the columns case, quantity, value, se"),
        ("case,quantity,value\nthrow,top,1\n", "se: is missing"),
        ("case,quantity,value,se,note\n", "column 'note': is unknown"),
        ("case,quantity,value,se,se\n", "column 'se': stands there twice"),
        (COLUMNS, "has no rows"),
        (COLUMNS + "throw,top,1\n", "line 2: has not as many fields as the 4 columns"),
        (COLUMNS + "throw,top,1,,2\n", "line 2: has not as many fields"),
        (COLUMNS + "throws,top,1,\n", "line 2, column case: is 'throws', must be rebound"),
        (COLUMNS + "throw,height,1,\n", "line 2, column quantity: is 'height', must be top"),
        (COLUMNS + "throw,top,1 mm,\n", "line 2, column value: is '1 mm', must be a finite number"),
        (COLUMNS + "throw,top,inf,\n", "line 2, column value: is 'inf'"),
        (COLUMNS + "throw,top,,\n", "line 2, column value: is ''"),
        (COLUMNS + "throw,top,1,-0.1\n", "line 2, column se: is -0.1, must be 0 and more"),
        (COLUMNS + "throw,top,1,\nthrow,top,1,\n", "line 3: stands there twice"),
        ("case,quantity,value,se,setting\nthrow,top,1,,2.5\n", "line 2, column setting: is '2.5', must be a whole"),
    ],
)
def test_malformed_files_are_refused_in_one_line(text: str | None, named: str, rows: list[Row], tmp_path: Path) -> None:
    path = tmp_path / "results.csv"
    if text is not None:
        path.write_text(text, encoding="latin-1")
    message = refusal(read_results, path, rows)
    assert str(path) in message and named in message


def test_numbers_from_a_motion() -> None:
    """A flight that began at height 1 mm with 0.3 m/s, and a slide that follows Coulomb's law."""
    t = np.linspace(0.003, 0.02, 20)
    zero = np.zeros((20, 3))
    place, velocity = zero.copy(), zero.copy()
    place[:, 2], velocity[:, 2] = 1e-3 + 0.3 * t - 0.5 * GRAVITY * t**2, 0.3 - GRAVITY * t
    assert after_impact(Motion(t, place, velocity, zero), 1e-3)[0] == pytest.approx(0.3, rel=1e-12)
    t = np.linspace(0.0, CREEP_S, 501)
    sliding = np.minimum(t, REST_SPEED / (0.3 * GRAVITY))
    x = REST_SPEED * sliding - 0.5 * 0.3 * GRAVITY * sliding**2 + 1e-3 * np.maximum(t - REST_S, 0.0)
    zero = np.zeros((len(t), 3))
    found = slide_to_rest(Motion(t, np.outer(x, [1.0, 0.0, 0.0]), zero, zero))
    assert found == pytest.approx({"distance": 1e3 * REST_SPEED**2 / (2 * 0.3 * GRAVITY), "creep": 1.0}, rel=1e-9)


def test_height_of_a_throw_is_that_of_the_motion() -> None:
    """The highest point of the parabola that leaves the plate where the plate falls away from it."""
    frequency, amplitude = 50.0, 2e-4
    omega = 2.0 * math.pi * frequency
    t = np.linspace(0.0, 0.25 / frequency, 100_001)
    leaves = t[np.argmax(amplitude * omega**2 * np.sin(omega * t) >= GRAVITY)]
    speed = amplitude * omega * math.cos(omega * leaves)
    top = amplitude * math.sin(omega * leaves) + speed**2 / (2.0 * GRAVITY)
    assert throw_height(frequency, amplitude) == pytest.approx(top, rel=1e-4)


def test_a_cube_given_as_a_mesh_moves_as_a_box_does() -> None:
    box = validated(cube_falls({"shape": "box", "size_mm": [4.0, 4.0, 4.0]}), Scenario, Path("box"))
    mesh = validated(SCENARIOS["mesh_cube"](), Scenario, Path("mesh"))
    of_box, of_mesh = (OBSERVERS["mesh_cube"](motion_of(scenario)) for scenario in (box, mesh))
    assert of_mesh == pytest.approx(of_box, rel=1e-6)


@pytest.mark.parametrize("frequency", [500.0, FAST_HZ, 10_000.0])
def test_fast_slip_is_averaged_friction_at_any_frequency(frequency: float) -> None:
    """What counts is the speed of the tray. Slip that turns once or twice in the time of forces was lost in it."""
    raw = SCENARIOS["fast_slip"]()
    raw["drive"][0] |= {"frequency_hz": frequency, "stroke_um": FAST_UM * FAST_HZ / frequency}
    way = way_at(motion_of(validated(raw, Scenario, Path("tray"))), FAST_S)
    assert way == pytest.approx(1e3 * fast_way(FAST_S), rel=3e-3)


def test_the_stored_table_is_that_of_the_stored_results(rows: list[Row]) -> None:
    verdicts = table(rows, read_results(SET.with_name("results.csv"), rows))
    assert verdicts == SET.with_name("conformance_table.md").read_text(encoding="utf-8")


def test_the_command_judges_a_file(rows: list[Row], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = importlib.util.spec_from_file_location("conformance_command", SET.with_name("conformance.py"))
    assert spec and spec.loader
    command = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(command)
    results, target = right(rows), tmp_path / "table.md"
    write_results(results, tmp_path / "right.csv")
    assert command.main(["--results", str(tmp_path / "right.csv"), "--table", str(target)]) == 0
    assert target.read_text(encoding="utf-8") == capsys.readouterr().out == table(rows, results)
    write_results([replace(results[0], value=1.0)], tmp_path / "wrong.csv")
    assert command.main(["--results", str(tmp_path / "wrong.csv")]) == 1
    assert command.main(["--results", str(tmp_path / "none.csv")]) == 2
    assert command.main(["--check"]) == 0


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["impulse", "exact", "slide"])
def test_own_engines_pass(engine: str, rows: list[Row]) -> None:
    results = own_results(engine, CASES, quick=True)
    lines = table(rows, results)
    assert "**" not in lines and "undecided" not in lines, lines
    assert passes(rows, results, results[0].engine)


@pytest.mark.slow
def test_the_ensembles_are_made_again_within_their_errors(rows: list[Row]) -> None:
    stored = {row.case: row for row in rows if row.basis == "ensemble"}
    for row in (row for row in remade_rows() if row.basis == "ensemble"):
        assert abs(row.right - stored[row.case].right) < 0.5 * (row.high - row.low)


def test_ball_height_is_that_of_a_flight_of_one_period() -> None:
    """The ball leaves with g T / 2 at the height at which it will land."""
    f, a, e, g = 50.0, 245e-6, 0.2, 9.81
    top = ball_height(f, a, e)
    sine = (top - g / (8.0 * f**2)) / a
    landing_rate = a * 2.0 * math.pi * f * math.sqrt(1.0 - sine**2)
    take_off = g / (2.0 * f)
    assert take_off - landing_rate == pytest.approx(e * (take_off + landing_rate), rel=1e-9)


@pytest.mark.parametrize(
    ("deviation", "se", "expected"),
    [
        (0.1, 0.01, State.STABLE),
        (-0.2, 0.01, State.BIASED),
        (0.3, 0.2, State.UNCLEAR),  # within two standard errors
        (0.1, math.nan, State.UNCLEAR),
        (0.3, math.nan, State.UNCLEAR),  # of one seed the error is not known
        (math.nan, math.nan, State.UNCLEAR),
    ],
)
def test_cells_are_judged_by_their_deviation(deviation: float, se: float, expected: State) -> None:
    state, of, why = by_deviation(Statistic(deviation, math.nan, se, 8))
    assert state == expected and (why == "") == (expected == State.STABLE)
    assert of.mean == pytest.approx(deviation, nan_ok=True)


def test_maps_fill_all_their_cells_which_files_give_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    verdict = State.UNCLEAR, Statistic(0.3, math.nan, math.nan, 1), "drift not known"
    monkeypatch.setattr(stability_maps.StabilityMap, "judge", lambda self, x, y, *, quick: verdict)
    cells = fill(quick=True)
    assert [(cell.map, cell.x, cell.y) for cell in cells] == [
        (of.name, *at) for of in MAPS for at in of.settings(quick=True)
    ]
    assert set(cells[0].__dict__.items()) >= {("deviation", 0.3), ("se", None), ("why", "drift not known")}
    assert len(capsys.readouterr().err.splitlines()) == len(cells)
    write_cells(cells, tmp_path)
    assert read_cells(tmp_path) == cells
    assert [MapCell(**row) for row in json.loads((tmp_path / "stability.json").read_text())] == cells


def test_picture_of_the_docs_has_every_cell(tmp_path: Path) -> None:
    cells = read_cells(REPOSITORY / "benchmarks/chart")
    assert [(cell.map, cell.x, cell.y) for cell in cells] == [
        (of.name, *at) for of in MAPS for at in of.settings(quick=False)
    ]
    stability_maps.draw_stability(cells, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["stability.png", "stability.svg"]


@pytest.mark.slow
def test_quick_stability_maps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stability_maps.main(quick=True, out=tmp_path)
    cells = read_cells(tmp_path)
    assert {State.STABLE, State.EXPLODING, State.TUNNELLING} <= {cell.state for cell in cells}
    assert f"of {len(cells)} cells" in capsys.readouterr().out


def test_table_of_other_simulators_has_numbers_or_reasons() -> None:
    with (REPOSITORY / "benchmarks/chart/peers.csv").open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        rows = list(reader)
    assert tuple(reader.fieldnames or ()) == HEADER
    assert {row["case"] for row in rows} == {"bouncing_ball", "flat_drop", "sliding_impact", "drift_4750", "drift_8775"}
    for row in rows:
        assert row["failure"] or math.isfinite(float(row["value"])), row
        assert int(row["setting"]) > 0 and float(row["wall_s_per_simulated_s"]) > 0.0
