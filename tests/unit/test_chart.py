"""What stays of the chart beside the package: closed forms, stability maps, the table of other simulators."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest
import stability_maps
from chart_cases import ball_height
from conftest import REPOSITORY
from run import HEADER
from stability_maps import MAPS, MapCell, State, by_deviation, fill, read_cells, write_cells

from feeder_sim.measures.statistic import Statistic


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
