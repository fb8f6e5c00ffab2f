"""The chart of docs/choosing.md: its files, its page, and whether the engines still give what it shows."""

from __future__ import annotations

import math
import shutil
import tomllib
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from chart_page import END, FRAGMENTS, better, default_of, draw, front, of, read_rows, reference, verdict, write_page
from chart_scenes import SCENES, Row, engine_values
from conftest import REPOSITORY

from feeder_sim.machine_code.library import fits

FOLDER, PAGE = REPOSITORY / "benchmarks/chart", REPOSITORY / "docs/choosing.md"
AGREE = 1e-9  # relative; the same machine code gives the same bits


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return read_rows(FOLDER)


@pytest.fixture(scope="module")
def record() -> dict[str, Any]:
    return tomllib.loads((FOLDER / "chart.toml").read_text(encoding="utf-8"))


def row(cost: float, error: float, error_se: float = 0.0, **names: Any) -> Row:
    return Row("scene", "steps", "20 steps", 1.0, 0.0, 1, error, error_se, cost, 1.0, **names)


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        (row(0.5, 1.0), row(1.0, 1.0), True),  # cheaper and as near
        (row(0.9, 1.0), row(1.0, 1.0), False),  # as cheap
        (row(0.5, 2.0), row(1.0, 1.0), False),  # cheaper and farther off
        (row(0.5, 2.0, 0.5), row(1.0, 1.0, 0.5), True),  # farther off, but the seeds cannot tell
        (row(1.1, 1.0), row(1.0, 3.0), True),  # as cheap and nearer
        (row(1.1, 2.9, 0.5), row(1.0, 3.0, 0.5), False),
        (row(2.0, 0.0), row(1.0, 3.0), False),  # nearer and dearer
    ],
)
def test_what_is_better(one: Row, other: Row, expected: bool) -> None:
    assert better(one, other) == expected
    assert (other in front([one, other])) != expected


def test_every_scene_has_a_default_a_right_value_and_a_verdict(rows: list[Row]) -> None:
    for scene in SCENES:
        default = default_of(scene, rows)
        assert default.cost == pytest.approx(1.0, rel=0.5), scene.name
        assert verdict(scene, rows)
        if "finest" in scene.right:
            assert reference(scene, rows).error == 0.0
        for each in of(scene, rows):
            assert each.error >= 0.0 and each.cost > 0.0


def test_rows_have_numbers_or_reasons(rows: list[Row]) -> None:
    for each in rows:
        assert each.failure or math.isfinite(each.error), each
        assert math.isfinite(each.cost) or each.failure, each


def test_references_are_surer_than_what_is_judged_by_them(rows: list[Row]) -> None:
    """What is charted is known at least as well as the right value beside it."""
    for scene in SCENES:
        if "finest" in scene.right:
            right = reference(scene, rows)
            coarse = next(r for r in rows if r.scene == scene.name and r.method == "steps")
            assert right.se <= 1.2 * coarse.se, scene.name


def test_the_page_is_that_of_the_files(rows: list[Row], tmp_path: Path) -> None:
    page = tmp_path / "choosing.md"
    shutil.copy(PAGE, page)
    write_page(rows, FOLDER, page)
    assert page.read_text(encoding="utf-8") == PAGE.read_text(encoding="utf-8"), "benchmarks/chart.py --only page"


def test_a_page_without_a_place_for_a_table_is_refused(rows: list[Row], tmp_path: Path) -> None:
    page = tmp_path / "choosing.md"
    name = next(iter(FRAGMENTS))
    page.write_text(f"<!-- {name} -->\n{END}\n", encoding="utf-8")
    with pytest.raises(ValueError, match="are missing"):
        write_page(rows, FOLDER, page)


def test_the_picture_is_drawn(rows: list[Row], tmp_path: Path) -> None:
    draw(rows, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"methods.png", "methods.svg"}


def test_the_chart_is_not_older_than_the_engines(record: dict[str, Any]) -> None:
    """Where an engine gives something else than when the chart was made, the chart has to be made again."""
    values = engine_values()
    if version("mujoco") != record["versions"]["mujoco"]:
        del values["mujoco"]
    if not fits():
        pytest.skip("engines compiled here may differ in the last bits, which chaos makes large")
    older = [name for name, value in values.items() if value != pytest.approx(record["values"][name], rel=AGREE)]
    assert not older, f"benchmarks/chart is older than {', '.join(older)}: make chart"
