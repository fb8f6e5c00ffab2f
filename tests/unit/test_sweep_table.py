"""The table of a sweep: its columns, and its intervals over inputs and seeds."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtr
from swept import AMPLITUDE, over, plan_of

from feeder_sim.document.figure import empty_figure
from feeder_sim.jobs.task import SeedValues
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plots.sweep import draw_line
from feeder_sim.studies.study import csv_bytes
from feeder_sim.studies.sweep.table import COLUMNS, UNCERTAIN_COLUMNS, Row, as_parquet
from feeder_sim.studies.uncertainty.spread import interval_of, spread_of


def test_columns_of_numbers_and_texts(tmp_path: Path) -> None:
    import pyarrow.parquet

    values = ([1.0, 0.0], 2.5, "x")
    rows = [Row({"a": value}, "m", Statistic.of([1.0, 2.0]), 2, 0) for value in values]
    (tmp_path / "t.parquet").write_bytes(as_parquet(["a", *COLUMNS], [row.as_dict() for row in rows]))
    assert pyarrow.parquet.read_table(tmp_path / "t.parquet")["a"].to_pylist() == ["[1.0, 0.0]", "2.5", "x"]


def test_points_without_any_value_have_a_row() -> None:
    plan = plan_of(over(f"{AMPLITUDE}=1,2,3", seeds=2))
    first, second, _ = plan.cases
    first.take((SeedValues(0, {"speed": 1.0}, 0.1), SeedValues(1, {"speed": math.nan}, 0.1)))
    second.take((SeedValues(0, {}, 0.1, "no room"), SeedValues(1, {}, 0.1, "no room")))
    rows = plan.study(False, 0).at_every_point("speed")  # type: ignore[attr-defined]
    assert [(row.found.n, row.seeds, row.failed, row.without_value) for row in rows] == [
        (1, 2, 0, 1),
        (0, 2, 2, 0),
        (0, 0, 0, 0),
    ]


def test_a_failure_is_told_with_its_point() -> None:
    plan = plan_of(over(f"{AMPLITUDE}=1:2:4", "part[0].material=steel,aluminium", seeds=2))
    whys = {1: ("", "no room"), 2: ("asks for 1.3 um", "no room")}
    for number, case in enumerate(plan.cases):
        case.take(tuple(SeedValues(seed, {}, 0.1, why) for seed, why in enumerate(whys.get(number, ("", "")))))
    assert plan.study(True, 0).failures == [
        f"at {AMPLITUDE} = 1, part[0].material = aluminium: no room",
        f"at {AMPLITUDE} = 1.33333, part[0].material = steel: asks for 1.3 um",
    ]


def test_spread_over_inputs_and_seeds_apart() -> None:
    random = np.random.default_rng(0)
    inputs = random.normal(0.0, 2.0, 400)
    spread = spread_of([(10.0 + value + random.normal(0.0, 3.0, 4)).tolist() for value in inputs])
    assert spread.sd_inputs == pytest.approx(2.0, rel=0.12)
    assert spread.sd_seeds == pytest.approx(3.0, rel=0.06)
    assert spread.inputs_high - spread.inputs_low == pytest.approx(2 * 1.645 * 2.0, rel=0.1)
    assert spread.high - spread.low == pytest.approx(2 * 1.645 * math.hypot(2.0, 3.0), rel=0.1)
    alone = spread_of([[value] for value in inputs.tolist()])
    assert math.isnan(alone.sd_inputs) and alone.low < alone.median < alone.high
    assert spread_of([[math.nan], []]).draws == 0


def test_intervals_hold_what_they_say() -> None:
    """The chance of another run, and of the mean at other inputs, to lie inside; the mean over many samples."""
    random = np.random.default_rng(0)
    of_inputs, of_seeds = 2.0, 1.0
    held = []
    for _ in range(300):
        values = random.normal(0.0, of_inputs, (32, 1)) + random.normal(0.0, of_seeds, (32, 2))
        spread = spread_of(values.tolist())
        run = np.array([spread.low, spread.high]) / math.hypot(of_inputs, of_seeds)
        mean = np.array([spread.inputs_low, spread.inputs_high]) / of_inputs
        held.append([np.ptp(ndtr(run)), np.ptp(ndtr(mean))])
    assert np.mean(held, axis=0) == pytest.approx([0.9, 0.9], abs=0.02)


def test_an_interval_of_few_values_is_from_the_least_to_the_largest() -> None:
    assert interval_of([3.0]) == (3.0, 3.0)
    assert interval_of(np.arange(16.0)) == (0.0, 15.0)
    assert interval_of(np.arange(1.0, 40.0)) == (2.0, 38.0)  # the second of 39, and the last but one


def test_inputs_that_are_not_told_apart_from_the_seeds_have_no_interval() -> None:
    """Means of draws that scatter less than their seeds let them; not so where nothing scatters at all."""
    unknown = spread_of([[1.0, 5.0], [2.0, 4.5], [0.5, 5.5]])
    assert unknown.sd_inputs == 0.0 and unknown.sd_seeds > 1.0 and unknown.not_told
    assert math.isnan(unknown.inputs_low) and math.isnan(unknown.inputs_high)
    constant = spread_of([[0.1] * 3] * 4)
    assert constant.inputs_low == constant.inputs_high == pytest.approx(0.1) and not constant.not_told
    known = spread_of([[1.0, 1.1], [2.0, 2.1], [3.0, 3.1]])
    assert (known.of_runs, known.of_means) == (
        "71 % of runs",
        "50 % of means",
    )  # 5/7 and 2/4: the least and the largest
    assert known.is_told and not known.not_told
    assert not spread_of([[1.0], [2.0]]).not_told  # one seed each tells nothing
    rows = [
        Row({"a": place}, "m", Statistic.of([3.0, 3.5]), 2, 0, spread)
        for place, spread in enumerate((known, unknown, unknown, known))
    ]
    table = csv_bytes(["a", *COLUMNS, *UNCERTAIN_COLUMNS], [row.as_dict() for row in rows]).decode().splitlines()
    assert table[0].endswith("low,high,sd_inputs,sd_seeds") and ",,,0.0," in table[2]
    figure = empty_figure(3.0, 2.0)
    for axes, shown in zip(figure.subplots(1, 2), (rows, rows[1:3]), strict=True):
        draw_line(axes, shown, "a", joined=True)
    with_band, without = (axes.get_legend_handles_labels()[1] for axes in figure.axes)
    assert with_band == ["90 % over the inputs"] and without == []
