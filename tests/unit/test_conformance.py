"""What stays beside the package: the judge of the conformance set, closed forms and maps of the chart, its peers."""

from __future__ import annotations

import ast
import json
import math
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import judge
import numpy as np
import pytest
import right_values
import run_conformance
import stability_maps
from case_files import (
    CASES,
    COMMON,
    FOLDER,
    GRAVITY,
    ConformanceError,
    Result,
    Row,
    case,
    part,
    read_results,
    read_set,
    write_results,
)
from conftest import REPOSITORY
from judge import OFF, PASS, UNDECIDED, judged, passes, table
from motions import OBSERVERS, Motion, after_impact, attitudes, motions_of, slide_to_rest, starts_of, way_at
from own_engines import NAMES, once, own_results, raw_of, remade_rows
from own_engines import motions_in as own_motions
from right_values import ball_height, differences, fast_way, throw_height
from scipy.spatial.transform import Rotation
from stability_maps import MAPS, MapCell, State, by_deviation, fill, read_cells, write_cells

from feeder_sim import constants
from feeder_sim.measures.statistic import Statistic
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.scene import build_scene

COLUMNS = "case,quantity,value,se\n"


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return read_set()


def right(rows: list[Row]) -> list[Result]:
    """The right values, as an engine would have them."""
    found = {
        (r.case, r.quantity): Result(r.case, r.quantity, r.right, 0.01 * r.scale if r.chance else math.nan, "mine")
        for r in rows
        if r.basis != "measurement" or r.case == "blocks"
    }
    return list(found.values())


def test_the_stored_set_is_that_of_the_closed_forms(rows: list[Row]) -> None:
    assert {row.case for row in rows} == set(CASES)
    assert right_values.main([]) == 0
    assert differences(rows, rows[1:]) == ["rebound, upward_velocity, closed"]
    assert differences([replace(rows[0], right=rows[0].right + 1e-4), *rows[1:]], rows)


def test_cases_have_a_file_each_whose_quantities_are_those_of_the_set(rows: list[Row]) -> None:
    assert {path.stem for path in (FOLDER / "cases").glob("*.toml")} == set(CASES)
    for name in CASES:
        assert set(case(name)["quantities"]) == {row.quantity for row in rows if row.case == name}
        assert {start["part"] for start in case(name)["start"]} <= {*COMMON["parts"], "block"}
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert [line.split("`")[1] for line in readme.splitlines() if line.startswith("| `")] == list(CASES)


def test_parts_are_those_that_the_package_makes() -> None:
    assert GRAVITY == constants.GRAVITY
    for name in ("slide", "rebound", "energy_at_edge", "mesh_cube"):
        made = run_scene(name)
        stated = part(case(name)["start"][0]["part"])
        assert made.mass == pytest.approx(stated.mass, rel=1e-5)
        np.testing.assert_allclose(made.inertia, stated.inertia, rtol=1e-5)
        if not stated.radius:
            of_made, of_stated = (
                np.array(sorted(np.round(1e6 * corners).tolist())) for corners in (made.corners, stated.corners)
            )
            np.testing.assert_allclose(of_made, of_stated, atol=1.0)


def run_scene(name: str) -> RigidPart:
    return build_scene(validated(raw_of(name), Scenario, Path(name))).parts[0]


def test_right_values_pass_and_each_wrong_one_shows(rows: list[Row]) -> None:
    results = right(rows)
    assert passes(rows, results, "mine")
    assert "**" not in table(rows, results)
    for i, result in enumerate(results):
        of_quantity = [r for r in rows if (r.case, r.quantity) == (result.case, result.quantity)]
        row = of_quantity[0]
        limits = min(r.low for r in of_quantity), max(r.high for r in of_quantity)
        for sign, limit in zip((-1.0, 1.0), limits, strict=True):
            value = limit + sign * (0.2 * row.scale + 3.0 * (0.0 if math.isnan(result.se) else result.se))
            wrong = [*results[:i], replace(result, value=value), *results[i + 1 :]]
            assert not passes(rows, wrong, "mine")
            assert any(f"`{row.case}`" in line for line in table(rows, wrong).splitlines() if "**" in line)


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
    with pytest.raises(ConformanceError) as error:
        read_results(path, rows)
    message = str(error.value)
    assert str(path) in message and named in message and len(message.splitlines()) == 1


def test_numbers_from_a_motion() -> None:
    """A flight that began at height 1 mm with 0.3 m/s, and a slide that follows Coulomb's law."""
    t = np.linspace(0.003, 0.02, 20)
    zero = np.zeros((20, 3))
    place, velocity = zero.copy(), zero.copy()
    place[:, 2], velocity[:, 2] = 1e-3 + 0.3 * t - 0.5 * GRAVITY * t**2, 0.3 - GRAVITY * t
    assert after_impact(Motion(t, place, velocity, zero), 1e-3)[0] == pytest.approx(0.3, rel=1e-12)
    t, speed, stopped = np.linspace(0.0, 0.5, 501), 0.2, case("slide_to_rest")["looks"]["stopped_s"]
    sliding = np.minimum(t, speed / (0.3 * GRAVITY))
    x = speed * sliding - 0.5 * 0.3 * GRAVITY * sliding**2 + 1e-3 * np.maximum(t - stopped, 0.0)
    zero = np.zeros((len(t), 3))
    found = slide_to_rest(Motion(t, np.outer(x, [1.0, 0.0, 0.0]), zero, zero))
    assert found == pytest.approx({"distance": 1e3 * speed**2 / (2 * 0.3 * GRAVITY), "creep": 1.0}, rel=1e-9)


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
    raw = raw_of("mesh_cube")
    assert raw["part"][0]["shape"] == "mesh"
    box = raw | {"part": [{"shape": "box", "size_mm": [4.0] * 3, "start": raw["part"][0]["start"]}]}
    of_box, of_mesh = (
        OBSERVERS["mesh_cube"](*own_motions(validated(tables, Scenario, Path("cube")))) for tables in (box, raw)
    )
    assert of_mesh == pytest.approx(of_box, rel=1e-6)


@pytest.mark.parametrize("factor", [0.125, 1.0, 2.5])
def test_fast_slip_is_averaged_friction_at_any_frequency(factor: float) -> None:
    """What counts is the speed of the tray. Slip that turns once or twice in the time of forces was lost in it."""
    raw, end = raw_of("fast_slip"), case("fast_slip")["duration_s"]
    drive = raw["drive"][0]
    raw["drive"] = [drive | {"frequency_hz": factor * drive["frequency_hz"], "stroke_um": drive["stroke_um"] / factor}]
    (motion,) = own_motions(validated(raw, Scenario, Path("tray")))
    assert way_at(motion, end) == pytest.approx(1e3 * fast_way(end), rel=3e-3)


@pytest.mark.parametrize("name", ["two_parts_meet", "two_parts_slide", "two_parts_stick", "heap_at_rest"])
def test_parts_that_meet_pass_without_a_step(name: str, rows: list[Row]) -> None:
    numbers = once(name, "exact", 0)
    assert passes(rows, [Result(name, q, value, engine="mine") for q, value in numbers.items()], "mine")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["energy_at_edge", "energy_at_corner", "energy_of_bounces"])
def test_impacts_give_no_energy_without_a_step(name: str, rows: list[Row]) -> None:
    value = once(name, "exact", 0)["energy_gain"]
    assert passes(rows, [Result(name, "energy_gain", value, engine="mine")], "mine")


def test_an_impact_by_newtons_law_gains_energy(rows: list[Row]) -> None:
    """A restitution of normal velocities, with friction against the first slip: Kane's paradox."""
    gain = OBSERVERS["energy_of_bounces"](*by_newton("energy_of_bounces"))["energy_gain"]
    (row,) = (row for row in rows if row.case == "energy_of_bounces")
    assert gain > 0.1 and judged(row, Result(row.case, row.quantity, gain)).outcome == OFF


def by_newton(name: str) -> list[Motion]:
    """A cube before and after an impact at its lowest edge, without gravity, for each attitude at the start."""
    contact, cube, motions = case(name)["contact"], part("cube"), []
    for _, position, turned, velocity, spin in starts_of(name):
        corners = Rotation.from_quat(turned, scalar_first=True).apply(cube.corners)
        arm = corners[corners[:, 2] < corners[:, 2].min() + 1e-9].mean(axis=0)
        slip = velocity + np.cross(spin, arm)
        responses = [unit / cube.mass + np.cross(np.cross(arm, unit) / cube.inertia[0], arm) for unit in np.eye(3)]
        inverse_mass = np.array(responses).T
        push = np.linalg.solve(inverse_mass, [-slip[0], -slip[1], -(1.0 + contact["restitution"]) * slip[2]])
        if math.hypot(*push[:2]) > contact["friction"] * push[2]:
            along = np.array([-contact["friction"] * np.sign(slip[0]), 0.0, 1.0])
            push = along * -(1.0 + contact["restitution"]) * slip[2] / (inverse_mass @ along)[2]
        after = velocity + push / cube.mass, spin + np.cross(arm, push) / cube.inertia[0]
        velocities, spins = (np.array([begin, end]) for begin, end in zip((velocity, spin), after, strict=True))
        motions.append(Motion(np.array([0.0, 1e-3]), np.array([position, position]), velocities, spins))
    return motions


def test_a_heap_that_gains_sinks_or_does_not_rest_is_seen(rows: list[Row]) -> None:
    """Twelve cubes side by side on the plate, at rest; then one that rises, one in the plate, one in another."""
    place = np.array([[[5e-3 * i, 0.0, 2e-3]] * 3 for i in range(12)])

    def failing(change: Callable[[np.ndarray, np.ndarray], None]) -> set[str]:
        places, velocities, zero = place.copy(), np.zeros_like(place), np.zeros((3, 3))
        change(places, velocities)
        upright = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))
        time = np.arange(3.0)
        motions = [Motion(time, p, v, zero, attitude=upright) for p, v in zip(places, velocities, strict=True)]
        numbers = OBSERVERS["heap_at_rest"](*motions)
        limits = {row.quantity: row for row in rows if row.case == "heap_at_rest"}
        return {q for q, v in numbers.items() if judged(limits[q], Result("heap_at_rest", q, v)).outcome == OFF}

    assert failing(lambda p, v: None) == set()
    assert failing(lambda p, v: p.__setitem__((0, 1, 2), 3e-3)) == {"energy_gain"}
    assert failing(lambda p, v: v.__setitem__((0, 2, 0), 0.1)) == {"energy_gain", "kinetic_energy"}
    assert failing(lambda p, v: p.__setitem__((0, slice(None), 2), 1.9e-3)) == {"depth"}
    assert failing(lambda p, v: p.__setitem__((0, slice(None), 0), 1.2e-3)) == {"overlap"}


def test_the_stored_table_is_that_of_the_stored_results(rows: list[Row]) -> None:
    results = [result for path in sorted((FOLDER / "results").glob("*.csv")) for result in read_results(path, rows)]
    assert table(rows, results) == (FOLDER / "verdicts.md").read_text(encoding="utf-8")
    assert {result.engine for result in results} > set(NAMES.values())


def test_the_command_judges_a_file(rows: list[Row], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results, target = right(rows), tmp_path / "table.md"
    write_results(results, tmp_path / "right.csv")
    assert judge.main([str(tmp_path / "right.csv"), "--table", str(target)]) == 0
    assert target.read_text(encoding="utf-8") == capsys.readouterr().out == table(rows, results)
    write_results([replace(results[0], value=1.0)], tmp_path / "wrong.csv")
    assert judge.main([str(tmp_path / "wrong.csv")]) == 1
    assert judge.main([str(tmp_path / "right.csv"), "--table", str(tmp_path)]) == 2
    capsys.readouterr()
    assert judge.main([str(tmp_path / "none.csv")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_command_runs_an_engine_and_judges_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--run", str(tmp_path / "r.csv"), "--only", "no step", "--case", "rebound", "two_parts_meet"]
    assert run_conformance.main(arguments) == 0
    assert "| `two_parts_meet` | pass |" in capsys.readouterr().out


MOTION = "time,x,y,z,vx,vy,vz,wx,wy,wz\n"
BODIES = MOTION.replace("\n", ",body\n")


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("throws", MOTION, "--motion: is 'throws', must be rebound"),
        ("slide", MOTION.replace(",wz", "") + "0" + ",0" * 8 + "\n", "wz: is missing"),
        ("slide", MOTION + "0,0,0,fast" + ",0" * 6 + "\n", "line 2, column z: is 'fast', must be a finite number"),
        ("slide", MOTION + 2 * ("0" + ",0" * 9 + "\n"), "line 3, column time: is 0, must be above 0, the time before"),
        ("two_parts_meet", MOTION + "0" + ",0" * 9 + "\n", "column body: has 1 motions, must have 2"),
        ("throw", MOTION + "0" + ",0" * 9 + "\n", "column time: ends at 0 s, must reach 3 s"),
        ("slide_to_rest", MOTION + "0.5" + ",0" * 9 + "\n", "has too few rows for slide_to_rest"),
        ("two_parts_meet", BODIES + "0.02,0\n0.03,1\n".replace(",", ",0" * 9 + ","), "column time: differs between"),
        ("heap_at_rest", BODIES + "".join(f"1{',0' * 9},{i}\n" for i in range(12)), "attitudes: are missing"),
        ("slide", MOTION.strip() + ",qw\n0" + ",0" * 10 + "\n", "attitudes: are incomplete, needed are all of qw"),
    ],
)
def test_malformed_motions_are_refused_in_one_line(
    name: str, text: str, named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "motion.csv"
    path.write_text(text, encoding="utf-8")
    assert judge.main(["--motion", name, str(path)]) == 2
    message = capsys.readouterr().err
    assert named in message and message.count("\n") == 1


def test_a_ball_that_is_thrown_off_has_no_top(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rows: list[Row]
) -> None:
    lines = "\n".join(f"{0.01 * i},0,0,{i},0,0,1,0,0,0" for i in range(301))
    (tmp_path / "motion.csv").write_text(f"{MOTION}{lines}\n", encoding="utf-8")
    assert judge.main(["--motion", "throw", str(tmp_path / "motion.csv")]) == 0
    (tmp_path / "mine.csv").write_text(capsys.readouterr().out, encoding="utf-8")
    (result,) = read_results(tmp_path / "mine.csv", rows)
    assert result.failure == "thrown off" and math.isnan(result.value)


def test_every_case_has_its_starts() -> None:
    for name in OBSERVERS:
        assert len(starts_of(name)) == len(attitudes(name)) == motions_of(name)


# --- the folder by itself ---------------------------------------------------------------------------------------------


def test_the_folder_imports_numpy_and_scipy_alone() -> None:
    files = list(FOLDER.glob("*.py"))
    allowed = {path.stem for path in files} | {"numpy", "scipy"} | sys.stdlib_module_names
    names = {
        name.split(".")[0]
        for path in files
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    assert names - allowed == set()


def test_the_folder_works_wherever_it_is_taken(rows: list[Row], tmp_path: Path) -> None:
    """Under another name, from elsewhere, without the package."""
    taken = tmp_path / "taken"
    shutil.copytree(FOLDER, taken, ignore=shutil.ignore_patterns("__pycache__"))
    (motion,) = own_motions(validated(raw_of("slide"), Scenario, Path("slide")))
    states = np.column_stack([motion.time, motion.position, motion.velocity, motion.spin])
    lines = "\n".join(",".join(map(str, state)) for state in states.tolist())
    (tmp_path / "motion.csv").write_text(f"{MOTION}{lines}\n", encoding="utf-8")
    results = run_alone(taken / "judge.py", "--motion", "slide", str(tmp_path / "motion.csv"))
    (tmp_path / "mine.csv").write_text(results.stdout, encoding="utf-8")
    judged = run_alone(taken / "judge.py", str(tmp_path / "mine.csv"))
    assert (judged.returncode, judged.stderr) == (0, "")
    assert "| `slide` | pass |" in judged.stdout and judged.stdout.startswith("| case | mine |")
    assert run_alone(taken / "right_values.py").returncode == 0
    refused = run_alone(taken / "judge.py", str(tmp_path / "none.csv"))
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1


def run_alone(script: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A script of the folder where nothing of this repository can be imported."""
    without = "import runpy, sys; sys.modules['feeder_sim'] = None; sys.argv = sys.argv[1:]; "
    code = without + "runpy.run_path(sys.argv[0], run_name='__main__')"
    command = [sys.executable, "-I", "-c", code, str(script), *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=script.anchor, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["impulse", "exact", "slide"])
def test_own_engines_pass(engine: str, rows: list[Row]) -> None:
    results = own_results(engine, [name for name in CASES if not name.startswith("energy")], quick=True)
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


def test_pictures_of_the_docs_have_every_cell(tmp_path: Path) -> None:
    cells = read_cells(REPOSITORY / "benchmarks/chart")
    assert [(cell.map, cell.x, cell.y) for cell in cells] == [
        (of.name, *at) for of in MAPS for at in of.settings(quick=False)
    ]
    stability_maps.draw_stability(cells, tmp_path)
    names = [engine.replace(" ", "_").lower() for engine in stability_maps.ENGINES]
    assert {path.name for path in tmp_path.glob("*.png")} == {f"stability_{name}.png" for name in names}


@pytest.mark.slow
def test_quick_stability_maps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stability_maps.main(quick=True, out=tmp_path)
    cells = read_cells(tmp_path)
    assert {State.STABLE, State.EXPLODING, State.TUNNELLING} <= {cell.state for cell in cells}
    assert f"of {len(cells)} cells" in capsys.readouterr().out
