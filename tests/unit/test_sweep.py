"""A sweep and its command: axes, how many seeds a point gets, and the table with its intervals."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, strip_scenario
from pretended import asked
from scipy.special import ndtr
from swept import AMPLITUDE, Pretended, over, plan_of

from feeder_sim.document.figure import empty_figure
from feeder_sim.errors import InputError
from feeder_sim.jobs.task import SeedValues
from feeder_sim.measures.effort import Effort
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plots.sweep import draw_line
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import workers_of
from feeder_sim.scenario import load_scenario
from feeder_sim.studies.study import csv_bytes
from feeder_sim.studies.sweep.cases import Case
from feeder_sim.studies.sweep.design import grid, read_axis, side_by_side, sobol_sample
from feeder_sim.studies.sweep.sweep import SweepQuestion, axis_texts
from feeder_sim.studies.sweep.table import COLUMNS, UNCERTAIN_COLUMNS, Row, as_parquet
from feeder_sim.studies.uncertainty.spread import interval_of, spread_of


def test_axes() -> None:
    assert read_axis(f"{AMPLITUDE}=1:4:log3").values == pytest.approx((1.0, 2.0, 4.0))
    assert read_axis("stage[0].duration_s=1:2:3").key == "schedule.stage[0].duration_s"
    assert read_axis("a=x,2,[1, 2],{ b = 1, c = 2 }").values == ("x", 2, [1, 2], {"b": 1, "c": 2})
    assert read_axis("a=[1, 2]").values == (1, 2)
    assert read_axis("a=1,true").values == (1, True)
    axes = [read_axis("a=1,2"), read_axis("b=3,4")]
    assert grid(axes) == [{"a": 1, "b": 3}, {"a": 1, "b": 4}, {"a": 2, "b": 3}, {"a": 2, "b": 4}]
    assert side_by_side(axes) == [{"a": 1, "b": 3}, {"a": 2, "b": 4}]
    with pytest.raises(InputError, match="different numbers of values"):
        side_by_side([*axes, read_axis("c=1,2,3")])
    sample = sobol_sample([read_axis("a=1:4:log"), read_axis("b=x,y")], 64)
    assert sample == sobol_sample([read_axis("a=1:4:log"), read_axis("b=x,y")], 64)
    assert np.median([point["a"] for point in sample]) == pytest.approx(2.0, rel=0.05)
    assert sum(point["b"] == "x" for point in sample) == 32


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["a"], "must be KEY=LOW:HIGH:COUNT"),
        (["a=2:1:3"], "LOW below HIGH"),
        (["a=0:1:log3"], "above 0 on a logarithmic scale"),
        (["a=1:2:1"], "must be 2 to"),
        (["a=1:2:log1000000"], "a: has 1000000 values, must be 2 to 20000"),
        (["a=1,1"], "different values"),
        (["a=1,1.0"], "different values"),
        (["a={ b = [1] },{ b = [1.0] }"], "different values"),
        (["a=1:2"], "which only a Sobol sample takes"),
        (["a=1,2", "a=3,4"], "varied twice"),
        (["stage[0].duration_s=1,2", "schedule.stage[0].duration_s=3,4"], "varied twice"),
        (["a[0].b=1,2", "a[0]={ b = 1 },{ b = 2 }"], r"vary a\[0\]\.b: is varied, and so is a\[0\]"),
        (["a=1:2:1000", "b=1:2:1000"], "1000000 points"),
        ([], "^vary: is missing"),
        (["title=a,b"], "decides what a run does"),
    ],
)
def test_axes_that_are_refused(texts: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        grid([read_axis(text) for text in texts])


def test_a_question_is_kept_as_text(tmp_path: Path) -> None:
    question = over(*axis_texts({"a": [1, 2.5], "b": np.array([1.0, 2.0]), "c": "1:2:3"}), seeds=3, measure="m")
    (tmp_path / "sweep.toml").write_text(question.as_toml())
    assert SweepQuestion.read(tmp_path) == question
    assert question.axes[0].values == (1, 2.5)
    for text in ("vary = 3\nx = 1", "vary = [1]", "vary = []\nseeds = 'x'", "{"):
        (tmp_path / "sweep.toml").write_text(text)
        with pytest.raises(InputError, match=r"sweep\.toml: "):
            SweepQuestion.read(tmp_path)
    with pytest.raises(InputError, match="a: is 3, must be a sequence"):
        axis_texts({"a": 3})


def test_a_mode_takes_its_frequency_along(repository: Path) -> None:
    scenario = load_scenario(repository / "scenarios/drift_2797hz_plate.toml")
    both = over("drive[0].mode=1,12"), over("drive[0].mode=1,12", "drive[0].frequency_hz=500,600")
    alone, beside = (question.plan(scenario, Path("scenario")).cases for question in both)
    frequencies = [case.scenario.drive[0].frequency_hz for case in alone]
    assert len(set(frequencies)) == 2 and scenario.drive[0].frequency_hz not in frequencies
    assert [case.scenario.drive[0].frequency_hz for case in beside] == [500, 600] * 2  # what is said counts
    uncertain = scenario.changed({"uncertain": {"drive[0].frequency_hz": {"uniform": [2700.0, 2800.0]}}})
    with pytest.raises(InputError, match=r"frequency_hz: is varied, but also \[uncertain\]"):
        both[0].plan(uncertain, Path("scenario"))
    with pytest.raises(InputError, match=r"plate\.mode_file: is missing"):
        plan_of(both[0])


def test_draws_of_uncertain_inputs_have_seeds_of_their_own() -> None:
    held = {"contact.friction": {"uniform": [0.2, 0.4]}}
    scenario = strip_scenario(seeds=2).changed({"uncertain": held})
    executor = Pretended()
    swept = asked(over(f"{AMPLITUDE}=1,2", inputs=4), scenario, executor)
    assert sorted(executor.seeds) == [(a, seed) for a in (1.0, 2.0) for seed in range(8)]
    assert [row.statistic.n for row in swept.valued("speed")] == [8, 8] and swept.uncertain
    for vary in ("contact.friction=0.2,0.3", "contact={ friction = 0.2 },{ friction = 0.3 }"):
        with pytest.raises(InputError, match=r"is varied, but also \[uncertain\]"):
            over(vary).plan(scenario, Path("scenario"))
    with pytest.raises(InputError, match=r"^until_se: is given, .* more draws narrow"):
        over(f"{AMPLITUDE}=1,2", until_se=0.1, measure="speed").plan(scenario, Path("scenario"))


def test_more_seeds_where_the_interval_is_wide_fewer_where_nothing_happens() -> None:
    plan = plan_of(over(f"{AMPLITUDE}=0.5,1,4", seeds=8, until_se=0.03, measure="speed"), Pretended())
    rows = {rows[0].point[AMPLITUDE]: rows[0] for rows in plan.cases.rows}
    assert rows[0.5].statistic.n == 0
    nothing, sure, scattered = [len(case.done) for case in plan.cases]
    assert (nothing, sure) == (4, 8) and scattered > 30
    assert 0.01 < rows[4].statistic.se / rows[4].statistic.mean <= 0.03  # and not many more than it takes


@pytest.mark.parametrize("seeds", [1, 2, 5])
@pytest.mark.parametrize(
    ("values", "wanted"),
    [
        ([10.0, 10.001], 4),  # the first look
        ([10.0, 10.001] * 2, 8),
        ([10.0, 10.001] * 4, 8),
        ([10.0, 10.001, *[math.nan] * 6], 16),  # two values are not eight, whatever their standard error
        ([10.0, 10.0, math.nan, math.nan], 8),  # two of the same value are not all
        ([1.0, math.nan, math.nan, math.nan], 8),  # of a single one no standard error is known
        ([1.0, -1.0] * 4, 16),  # mean 0
    ],
)
def test_few_values_that_happen_to_lie_together_do_not_end_a_point(
    seeds: int, values: list[float], wanted: int
) -> None:
    case = Case(strip_scenario)
    for seed in reversed(range(len(values))):  # the order in which seeds come back does not matter
        case.take((SeedValues(seed, {"speed": values[seed]}, 0.1),))
    assert case.target(Effort(seeds, 0.03, 1000, "speed")) == wanted


def test_points_that_do_not_get_there_are_counted() -> None:
    asked: dict[str, Any] = {"until_se": 0.01, "measure": "speed", "most_seeds": 40}
    plan = plan_of(over(f"{AMPLITUDE}=0.5,1,4", **asked), Pretended())
    assert plan.all_done and plan.cases.short == 1
    nothing, sure, scattered = (len(case.done) for case in plan.cases)
    assert nothing == 4 and 8 < sure < 40 and scattered == 40
    assert over(f"{AMPLITUDE}=1,2", **asked, seeds=60).effort(strip_scenario()).most_seeds == 60
    for wrong in ({"seeds": -1}, {"inputs": 1}, {"most_seeds": 7}):
        with pytest.raises(InputError, match=f"{next(iter(wrong))}: is .*, must be greater than or equal to"):
            over(f"{AMPLITUDE}=1,2", **asked | wrong)


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
    counts = [(row.statistic.n, row.seeds, row.failed, row.without_value) for row in rows]
    assert counts == [(1, 2, 0, 1), (0, 2, 2, 0), (0, 0, 0, 0)]


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
    assert interval_of([3.0]) == (3.0, 3.0)
    assert interval_of(np.arange(16.0)) == (0.0, 15.0)
    assert interval_of(np.arange(1.0, 40.0)) == (2.0, 38.0)  # the second of 39, and the last but one


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


def test_inputs_that_are_not_told_apart_from_the_seeds_have_no_interval() -> None:
    """Means of draws that scatter less than their seeds let them; not so where nothing scatters at all."""
    unknown = spread_of([[1.0, 5.0], [2.0, 4.5], [0.5, 5.5]])
    assert unknown.sd_inputs == 0.0 and unknown.sd_seeds > 1.0 and unknown.separation_reason
    assert math.isnan(unknown.inputs_low) and math.isnan(unknown.inputs_high)
    constant = spread_of([[0.1] * 3] * 4)
    assert constant.inputs_low == constant.inputs_high == pytest.approx(0.1) and not constant.separation_reason
    known = spread_of([[1.0, 1.1], [2.0, 2.1], [3.0, 3.1]])
    words = known.of_runs, known.of_means  # 5/7 and 2/4: the least and the largest
    assert words == ("71 % of runs", "50 % of means")
    assert known.is_separated and not known.separation_reason
    assert not spread_of([[1.0], [2.0]]).separation_reason  # one seed each tells nothing
    spreads = enumerate((known, unknown, unknown, known))
    rows = [Row({"a": place}, "m", Statistic.of([3.0, 3.5]), 2, 0, spread) for place, spread in spreads]
    table = csv_bytes(["a", *COLUMNS, *UNCERTAIN_COLUMNS], [row.as_dict() for row in rows]).decode().splitlines()
    assert table[0].endswith("low,high,sd_inputs,sd_seeds") and ",,,0.0," in table[2]
    figure = empty_figure(3.0, 2.0)
    for axes, shown in zip(figure.subplots(1, 2), (rows, rows[1:3]), strict=True):
        draw_line(axes, shown, "a", joined=True)
    with_band, without = (axes.get_legend_handles_labels()[1] for axes in figure.axes)
    assert with_band == ["90 % over the inputs"] and without == []


ASKED = ("sweep", REPOSITORY / "scenarios/drift_4750hz.toml")


@pytest.fixture(autouse=True)
def pretended_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "feeder_sim.studies.ask.workers_of", lambda work: workers_of(Work(2, work.executor or Pretended()))
    )


def test_command(tmp_path: Path) -> None:
    scenario, out = ASKED[1], tmp_path / "out"
    asked = (*ASKED, "--vary", f"{AMPLITUDE}=1:4:log3", "--vary", "contact.friction=0.2,0.3", "--out", out)
    done = feeder_sim(*asked, "--seeds", 3)
    assert done.returncode == 0, done.stderr
    assert "speed" in done.stdout and "6 points" in done.stdout
    assert done.stderr == "feeder-sim: warning: drive[0] is strong (at 2 of 6 points)\n"
    rows = list(csv.DictReader((out / "sweep.csv").read_text().splitlines()))
    assert list(rows[0]) == [AMPLITUDE, "contact.friction", "measure", "mean", "se", "n", "seeds", "failed"]
    assert len(rows) == 6 and rows[0]["n"] == rows[0]["seeds"] == "3"
    assert (out / "sweep.png").stat().st_size > 1000
    import pyarrow.parquet

    assert pyarrow.parquet.read_table(out / "sweep.parquet").to_pylist()[0]["measure"] == "speed"
    told = json.loads(feeder_sim(*asked, "--json").stdout)
    assert told["complete"] and len(told["rows"]) == 6
    assert told["warnings"] == [{"warning": "drive[0] is strong", "at": 2, "of": 6, "numbers_differ": False}]
    assert feeder_sim("merge", out).returncode == 0
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    for refused in (feeder_sim(*asked, "--measure", "sped"), feeder_sim("merge", out, "--measure", "sped")):
        check_refused(refused, "--measure: is 'sped'", "must be speed")
    (out / "journal.jsonl").unlink()
    check_refused(feeder_sim("merge", out), str(out), "holds no seed of the sweep")
    left = {file.name: file.read_bytes() for file in out.iterdir()}
    assert left == {name: content for name, content in before.items() if name != "journal.jsonl"}
    for options, said in (
        (f"--vary {AMPLITUDE}=-1,2", "drive[0].amplitude_um: is -1"),
        (f"--vary {AMPLITUDE}=1,1", f"{scenario}: --vary {AMPLITUDE}: "),
        (f"--vary {AMPLITUDE}=1,2 --until-se x", "--until-se: "),
        (f"--vary {AMPLITUDE}=1,2 --until-se 3%", "--measure: is missing"),
        (f"--vary {AMPLITUDE}=1,2 --task 3/2", "--task ... I/N"),
        (f"--vary {AMPLITUDE}=1,2 --out {scenario.parent}", "--out: holds"),
        (f"--vary {AMPLITUDE}=1,2 --zip --sobol 4", "--zip, --sobol: "),
    ):
        check_refused(feeder_sim("sweep", scenario, *options.split(), cwd=tmp_path), said)
    check_refused(feeder_sim("merge", tmp_path), "sweep.toml", "no such file")


def test_command_says_what_its_means_are_of(tmp_path: Path) -> None:
    vary = f"{AMPLITUDE}=0.5,0.7,2"
    asked = (*ASKED, "--out", tmp_path / "s", "--vary", vary, "--measure", "speed")
    done = feeder_sim(*asked, "--seeds", 4)
    assert [line.split()[0] for line in done.stdout.splitlines()[1:4]] == ["0.5", "0.7", "2"]
    assert "speed: at 2 of 3 points 8 of 8 seeds have no value" in done.stderr
    fewer = feeder_sim(*asked, "--seeds", 2)
    assert "3 points keep the seeds that they had" in fewer.stderr
    never = feeder_sim(*asked, "--until-se", "0.1%", "--most-seeds", 20)
    assert never.returncode == 0 and "1 of 3 points have as many seeds as" in never.stderr
    assert "--most-seeds allows, 20" in never.stderr


def test_tasks_of_a_job_array_are_merged(tmp_path: Path) -> None:
    """A task that is missing is no interruption: what was asked of `merge` is done, and not whole."""
    asked = (*ASKED, "--vary", f"{AMPLITUDE}=1,2", "--out", tmp_path / "s")
    assert feeder_sim(*asked, "--task", "2/2").returncode == 0
    assert feeder_sim("report", tmp_path / "s").returncode == 0  # of what is there
    half = feeder_sim("merge", tmp_path / "s")
    assert half.returncode == 1 and "the tasks that are missing can be run again" in half.stderr
    assert feeder_sim(*asked, "--task", "1/2").returncode == 0
    assert feeder_sim("merge", tmp_path / "s").returncode == 0


def test_command_says_what_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    line = "seeds in the folder do not count: they are of other"
    asked = (*ASKED, "--out", tmp_path / "s", "--vary", f"{AMPLITUDE}=1,2,3", "--seeds", 2)
    for task in ("1/2", "2/2"):
        assert feeder_sim(*asked, "--task", task).stderr == ""  # what the other task has done is of this sweep
    monkeypatch.setattr("feeder_sim.run.provenance.library_versions", lambda: {"numpy": "another"})
    assert f"6 {line}" in feeder_sim(*asked).stderr
    assert feeder_sim(*asked).stderr == ""  # nothing is run anew
