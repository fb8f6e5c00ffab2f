"""`feeder-sim modes import`: what is brought in comes out as it was, and what cannot be used is refused in one line."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Done, check_refused, feeder_sim, said
from conftest import REPOSITORY, toml_of
from numpy.typing import NDArray
from own_modes import nodes_2411, places, plate_180, shape_55, units_164, values_at, write_table, write_universal

from feeder_sim.plate.imported.measured_shapes import real_mode
from feeder_sim.plate.imported.scattered_fit import slopes
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.plate.modes import PlateModes

WHICH = [0, 7, 12, 13]  # of the 180 mm plate: 299, 1418, 2639, 2776 Hz


def imported(source: Path, *options: object) -> tuple[PlateModes, dict[str, Any], list[str]]:
    """The modes in the file that comes out, what is printed about them, and lines on stderr."""
    out = source.with_suffix(".h5")
    done = feeder_sim("modes", "import", source, "--thickness", 3, "--out", out, "--json", *options)
    assert done.returncode == 0, done.stderr
    return read_mode_file(out).modes, json.loads(done.stdout), said(done)


def errors(found: PlateModes, k: int, expected: PlateModes, i: int) -> tuple[float, float]:
    """Largest error of the deflection over the antinode, and root mean square error of the slopes over the largest."""
    x = np.linspace(-0.5, 0.5, 91) * expected.plate.length
    px, py = expected._polynomials(x, x)
    size = (expected.plate.length, expected.plate.width)
    grad = [slopes(modes.coefficients[[index], 0], size)[0] for modes, index in ((found, k), (expected, i))]
    error, slope = (px @ field @ py.T for field in (grad[0] - grad[1], grad[1]))
    difference = found.evaluate_grid(k, x, x)[0] - expected.evaluate_grid(i, x, x)[0]
    return float(np.abs(difference).max()), float(np.sqrt((error**2).mean()) / np.abs(slope).max())


@pytest.fixture(scope="module")
def grid() -> NDArray[np.float64]:
    return places()


def test_table_gives_the_package_s_own_modes_back(tmp_path: Path, grid: NDArray[np.float64]) -> None:
    held = plate_180()
    modes = held.modes
    w = -3.0 * values_at(modes, WHICH, grid)[:, 0]  # any sign and scale
    frequencies = modes.natural_frequency[WHICH].tolist()
    file = write_table(tmp_path / "own.csv", frequencies, grid, w, "# damping_ratio, 0.002,,0.001,", "# a word")
    found, report, lines = imported(file)
    assert lines == [] and found.outline is None
    np.testing.assert_allclose(found.natural_frequency, modes.natural_frequency[WHICH])
    for k, i in enumerate(WHICH):
        deflection, slope = errors(found, k, modes, i)
        assert deflection < 1e-4 and slope < 1e-3
        row = report["modes"][k]
        assert row["mac"] > 0.999 and i + 1 in row["resembles"] and row["residual"] < 1e-6
        # The rotations come from the slopes: of a free plate's wave those are proportional, but not along its edges.
        assert found.modal_mass[k] == pytest.approx(modes.modal_mass[i], rel=2e-3)
    np.testing.assert_allclose(report["shift_mm"], [-90.0, -90.0], atol=1e-9)
    read = read_mode_file(file.with_suffix(".h5"))
    assert [(r.mode, r.damping_ratio) for r in read.resonances] == [(0, 0.002), (2, 0.001)]
    assert read.origin is not None and read.origin.imported_from == "own.csv"
    np.testing.assert_allclose(read.origin.shift, [-0.09, -0.09])


def test_universal_file_gives_them_back(tmp_path: Path, grid: NDArray[np.float64]) -> None:
    modes = plate_180().modes
    w, bx, by = np.moveaxis(values_at(modes, WHICH, grid), 1, 0)
    zero = np.zeros_like(w[0])
    # In millimetres, with rotations; a number that is no length stays as it is. Modal masses are in tonnes then.
    shapes = []
    for k, i in enumerate(WHICH):
        motion = np.stack([zero, zero, 2.0 * w[k], 2e-3 * by[k], -2e-3 * bx[k], zero])
        mass = 4.0 * 1e-3 * float(modes.modal_mass[i])
        shapes.append(shape_55(float(modes.natural_frequency[i]), motion, modal_m=mass, modal_damp_vis=0.002))
    file = write_universal(tmp_path / "own.unv", units_164(), nodes_2411(grid), *shapes)
    found, report, lines = imported(file)
    assert lines == [] and found.outline is None and found.plate.length == pytest.approx(0.18)
    x = np.linspace(-0.5, 0.5, 61) * modes.plate.length
    for k, i in enumerate(WHICH):
        deflection, slope = errors(found, k, modes, i)
        assert deflection < 5e-4 and slope < 1e-3  # six digits
        rotation, expected = found.evaluate_grid(k, x, x)[1:], modes.evaluate_grid(i, x, x)[1:]
        assert np.sqrt(((rotation - expected) ** 2).mean()) < 1e-3 * np.abs(expected).max()
        row = report["modes"][k]
        assert row["rotations_of_file"] and row["modal_mass_of_file"] and row["damping_ratio"] == pytest.approx(0.002)
        assert row["modal_mass_g"] == pytest.approx(1e3 * modes.modal_mass[i], rel=1e-3)


def test_units_by_option_and_modes_by_frequency(tmp_path: Path, grid: NDArray[np.float64]) -> None:
    modes = plate_180().modes
    w = values_at(modes, [0, 13], grid)[:, 0]
    shapes = [
        shape_55(float(modes.natural_frequency[i]), np.stack([0 * v, 0 * v, v]))
        for i, v in zip((13, 0), w[::-1], strict=True)
    ]
    file = write_universal(tmp_path / "own.uff", nodes_2411(grid, 1.0), *shapes)
    found, report, _ = imported(file, "--unit", "m")
    assert found.plate.length == pytest.approx(0.18) and [row["resembles"] for row in report["modes"]] == [[1], [14]]
    check_import_refused(file, "own.uff", "--unit")


def test_complex_modes_become_real(tmp_path: Path, grid: NDArray[np.float64]) -> None:
    modes = plate_180().modes
    w, other = values_at(modes, [13, 12], grid)[:, 0]
    shape = np.exp(0.7j) * (w + 0.1j * other)
    real, _, collinearity = real_mode(shape)
    assert abs(np.corrcoef(real, w)[0, 1]) > 0.9999 and 0.9 < collinearity < 1.0
    assert real_mode(np.exp(1.9j) * w)[2] == pytest.approx(1.0)
    of_complex: dict[str, Any] = {"analysis_type": 3, "eig": complex(-35.0, 17442.0), "modal_a": 1j, "modal_b": 1j}
    mode = shape_55(0.0, np.stack([0 * shape, 0 * shape, shape]), **of_complex)
    found, report, _ = imported(write_universal(tmp_path / "c.unv", units_164(), nodes_2411(grid), mode))
    row = report["modes"][0]
    assert row["frequency_hz"] == pytest.approx(2776.0, abs=1.0)
    assert row["damping_ratio"] == pytest.approx(0.002, rel=0.01)
    assert row["collinearity"] == pytest.approx(collinearity, abs=1e-4)
    assert errors(found, 0, modes, 13)[0] < 2e-3


def test_noise_is_smoothed(tmp_path: Path, grid: NDArray[np.float64]) -> None:
    modes = plate_180().modes
    w = values_at(modes, [13], grid)[:, 0]
    noise = 0.02 * np.random.default_rng(0).standard_normal(w.shape)
    found, report, _ = imported(write_table(tmp_path / "noisy.csv", [2776.0], grid, w + noise))
    assert report["modes"][0]["residual"] == pytest.approx(0.02, rel=0.2)
    x = np.linspace(-0.5, 0.5, 61) * modes.plate.length
    off = found.evaluate_grid(0, x, x)[0] - modes.evaluate_grid(13, x, x)[0]
    assert np.sqrt((off**2).mean()) < 0.01  # less than half of the noise


def test_a_hole_is_found_in_the_points_or_given(tmp_path: Path, grid: NDArray[np.float64]) -> None:
    w = values_at(plate_180().modes, [0], grid)[:, 0]
    kept = np.hypot(*(grid - 0.03).T) > 0.02
    file = write_table(tmp_path / "hole.csv", [298.9], grid[kept], w[:, kept])
    found, report, lines = imported(file)
    assert report["holes"] == 1 and found.outline is not None and "--picture" in lines[0]
    hole = found.outline.holes[0]
    np.testing.assert_allclose(hole.mean(axis=0), [0.03, 0.03], atol=2e-3)
    assert np.hypot(*(hole - 0.03).T).max() < 0.02 + 0.006  # the spacing of the points
    outline = tmp_path / "outline.toml"
    square = {"size_mm": [180, 180], "centre_mm": [90, 90]}
    outline.write_text(toml_of({"exterior": square, "hole": [{"centre_mm": [120, 120], "diameter_mm": 40}]}))
    found, report, lines = imported(file, "--outline", outline, "--force")
    assert lines == [] and found.outline is not None
    assert report["area_mm2"] == pytest.approx(180.0**2 - np.pi * 20.0**2, rel=1e-6)
    np.testing.assert_allclose(found.outline.holes[0].mean(axis=0), [0.03, 0.03], atol=1e-9)


PLACES = [(x, y) for x in range(0, 60, 4) for y in range(0, 60, 4)]
HEADER = ["# frequency_hz, 299.0", "x_mm, y_mm, mode_1"]
SQUARE = {"size_mm": [60, 60]}
TABLE = [*HEADER, *(f"{x}, {y}, {x * y}" for x, y in PLACES)]


def check_import_refused(file: Path, *expected: str, options: tuple[object, ...] = ()) -> None:
    check_refused(feeder_sim("modes", "import", file, "--thickness", 3, *options), *expected)


def points(*values: str) -> list[str]:
    """A table with these values at every place."""
    return [*HEADER, *(f"{x}, {y}, {value}" for x, y in PLACES for value in values)]


@pytest.mark.parametrize(
    ("line", "text", "expected"),
    [
        (0, "# frequency_hz, fast", "line 1 ... frequency_hz ... 'fast'"),
        (0, "# frequency_hz, 299, 300", "frequency_hz ... 2 values ... 1"),
        (0, "# nothing", "frequency_hz ... is missing"),
        (0, "# frequency_hz, 59000", "points per half wave ... 4"),
        (1, "x_mm, y_mm, w_1", "line 2 ... 'w_1' ... mode_1"),
        (1, "x_mm, y_mm, mode_2", "line 2 ... mode_1 is missing"),
        (1, "x_mm, y_mm, mode_1, slope_x_1_per_mm", "slope_x_1_per_mm needs slope_y_1_per_mm"),
        (5, "0, 12", "line 6 ... 2 values"),
        (5, "0, 12, nan", "line 6 ... mode_1 ... 'nan'"),
        (5, "0, 12, inf", "line 6 ... mode_1 ... 'inf'"),
        (5, "0, twelve, 1", "line 6 ... y_mm ... 'twelve'"),
        (5, "0, 1e9, 1", "line 6 ... y_mm"),
        (5, "0, 500, 1", "gap"),
        ([], "", "broken.csv"),
        (HEADER[:1], "", "names of columns"),
        (HEADER, "", "0 points"),
        (TABLE[:4], "", "2 points"),
        ([*HEADER, *(f"{x}, 0, 1" for x in range(50))], "", "not on a line"),
        (points("0"), "", "mode 1 does not move"),
        (points("1e-200"), "", "mode 1 does not move"),
        (points("1", "-1"), "", "mode 1 is no smooth shape"),  # two points at one place contradict each other
        (["".join(map(chr, range(256)))], "", "broken.csv"),
    ],
)
def test_tables_that_are_refused(tmp_path: Path, line: int | list[str], text: str, expected: str) -> None:
    lines = [*TABLE[:line], text, *TABLE[line + 1 :]] if isinstance(line, int) else line
    (tmp_path / "broken.csv").write_bytes("\n".join(lines).encode("latin-1"))
    check_import_refused(tmp_path / "broken.csv", "broken.csv", expected)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("own.csv", "--thickness ... is missing"),
        ("own.csv --thickness 0", "--thickness"),
        ("own.csv --thickness 3 --material alu", "--material"),
        ("own.csv --thickness 3 --unit mm", "--unit"),
        ("own.csv --thickness 3 --out own.csv", "exists already, --force replaces it"),
        ("own.csv --thickness 3 --picture a.xyz", "--picture"),
        ("own.csv --thickness 3 --outline none.toml", "none.toml"),
        ("own.csv --thickness 80000", "thickness right"),
        ("own.txt --thickness 3", "own.txt ... .unv"),
        ("no.unv --thickness 3", "no.unv"),
    ],
)
def test_options_that_are_refused(tmp_path: Path, line: str, expected: str) -> None:
    (tmp_path / "own.csv").write_text("\n".join(TABLE))
    check_refused(feeder_sim("modes", "import", *line.split(), cwd=tmp_path), expected)


@pytest.mark.parametrize(
    ("exterior", "holes", "expected"),
    [
        ({"points_mm": [[0, 0], [60, 60], [60, 0], [0, 60]]}, [], "crosses itself"),
        ({"points_mm": [[0, 0], [60, 60]]}, [], "points_mm"),
        (SQUARE | {"centre_mm": [300, 30]}, [], "beside the outline"),
        (SQUARE | {"diameter_mm": 3}, [], "size_mm"),
        (SQUARE, [{"diameter_mm": 10, "centre_mm": [30, 0]}], "hole 1 is not within"),
        (SQUARE, [{"diameter_mm": 9}, {"diameter_mm": 8}], "hole 2 meets hole 1"),
        (None, [{"diameter_mm": 10}], "exterior"),
    ],
)
def test_outlines_that_are_refused(tmp_path: Path, exterior: Any, holes: Any, expected: str) -> None:
    file, outline = tmp_path / "own.csv", tmp_path / "outline.toml"
    file.write_text("\n".join(TABLE))
    outline.write_text(toml_of({"exterior": exterior, "hole": holes}))
    check_import_refused(file, expected, options=("--outline", outline))


def test_universal_files_that_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    grid = places(9, 0.05)
    w = np.stack([0 * grid[:, 0], 0 * grid[:, 0], grid[:, 0] * grid[:, 1]])
    shape, nodes, unit = shape_55(299.0, w), nodes_2411(grid), units_164()
    other = nodes | {"z": [30.0 * i for i in range(len(grid))]}
    cases = [
        ([unit, shape], "no nodes"),
        ([unit, nodes], "no dataset 55"),
        ([nodes, shape], "does not say its units"),
        ([unit, units_164(1.0), nodes, shape], "mixes units"),
        ([unit, nodes, shape_55(299.0, w, nodes=range(100, 100 + len(grid)))], "node 100"),
        ([unit, nodes, shape, shape_55(300.0, w[:, :-1])], "other nodes"),
        ([unit, nodes, shape_55(0.0, w)], "frequency of 0 Hz"),
        ([unit, nodes, shape_55(299.0, w[[2, 0, 1]])], "does not move along z"),
        ([unit, other, shape], "over a height"),
    ]
    for i, (datasets, expected) in enumerate(cases):
        file = write_universal(tmp_path / f"{i}.unv", *datasets)
        check_import_refused(file, f"{i}.unv", expected)
    good = write_universal(tmp_path / "good.unv", unit, nodes, shape)
    assert feeder_sim("modes", "import", good, "--thickness", 3).returncode == 0
    check_import_refused(good, "--unit", "dataset 164", options=("--unit", "m"))
    check_import_refused(good, "--unit", "mm", options=("--unit", "km"))
    text = good.read_text()
    for i, broken in enumerate((text[: len(text) // 2], text.replace("299", "abc"), "no universal file", "")):
        file = tmp_path / f"broken_{i}.unv"
        file.write_text(broken)
        check_import_refused(file, f"broken_{i}.unv")
    monkeypatch.setitem(sys.modules, "pyuff", None)
    check_import_refused(good, "feeder_sim[unv]")


ACTUATOR: dict[str, Any] = {"name": "left", "at_mm": [40.0, 60.0], "size_mm": [12.0, 12.0], "thickness_mm": 1.0}
ACTUATOR |= {"moment_per_volt_n": 0.05}


def with_actuators(folder: Path, changes: dict[str, Any], *options: object) -> Done:
    """Import the plate with a hole and an actuator."""
    (folder / "actuators.toml").write_text(toml_of({"actuator": [ACTUATOR]}, changes))
    hole = REPOSITORY / "models/plate_hole"
    given = ("--thickness", 3, "--outline", hole / "outline.toml", "--actuators", folder / "actuators.toml")
    return feeder_sim("modes", "import", hole / "modes.csv", *given, *options)


@pytest.mark.slow
def test_imported_modes_take_actuators_in_the_coordinates_of_their_file(tmp_path: Path) -> None:
    done = with_actuators(tmp_path, {}, "--out", tmp_path / "modes.h5")
    assert done.returncode == 0, done.stderr
    held = read_mode_file(tmp_path / "modes.h5")
    assert held.actuators[0].layer.centre == pytest.approx((-0.04, 0.0))
    np.testing.assert_allclose(held.force_per_volt[:, 0], held.actuators[0].force_per_volt(held.modes), rtol=1e-12)
    response = feeder_sim("response", tmp_path / "modes.h5", "--json")
    assert response.returncode == 0 and json.loads(response.stdout)["peaks"], response.stderr
    for changes, expected in (
        ({"actuator[0].at_mm": [110.0, 60.0]}, "actuator[0].at_mm ... [110, 60] ... beyond the plate ... [80, 60]"),
        ({"actuator[0].name": None, "actuator[0].nam": "left"}, "actuator[0].nam ... unknown key"),
        ({"actuator": None, "actuators": [ACTUATOR]}, "actuators ... unknown key"),
    ):
        check_refused(with_actuators(tmp_path, changes), "actuators.toml", expected)
