"""Sweeps: axes, how many seeds are run, journals, the table; with seeds that cost nothing."""

from __future__ import annotations

import csv
import json
import math
import zlib
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import strip_scenario
from scipy.special import ndtr

from feeder_sim import sweep
from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.jobs.cautions import cautions_over
from feeder_sim.jobs.identity import identity_of
from feeder_sim.jobs.journal import Journal, read_journal
from feeder_sim.jobs.runner import run_work
from feeder_sim.jobs.task import SeedValues, Task, run_task
from feeder_sim.jobs.workers import Workers, given_workers
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plots.figure import empty_figure
from feeder_sim.plots.sweep import draw_line
from feeder_sim.scenario import load_scenario
from feeder_sim.studies.sweep.case import Case, Effort
from feeder_sim.studies.sweep.cases import Cases, Sweep, SweepWork, run_cases, take_done
from feeder_sim.studies.sweep.design import grid, read_axis, side_by_side, sobol_sample
from feeder_sim.studies.sweep.folder import merged, sweep_folder
from feeder_sim.studies.sweep.question import Question, axis_texts
from feeder_sim.studies.sweep.table import Row, as_csv, as_parquet
from feeder_sim.studies.uncertainty.spread import interval_of, spread_of

AMPLITUDE = "drive[0].amplitude_um"


def test_axes() -> None:
    assert read_axis(f"{AMPLITUDE}=1:4:log3").values == pytest.approx((1.0, 2.0, 4.0))
    assert read_axis("stage[0].duration_s=1:2:3").key == "schedule.stage[0].duration_s"
    assert read_axis("a=x,2,[1, 2],{ b = 1, c = 2 }").values == ("x", 2, [1, 2], {"b": 1, "c": 2})
    assert read_axis("a=[1, 2]").values == (1, 2)
    assert read_axis("a=1,true").values == (1, True)
    axes = [read_axis("a=1,2"), read_axis("b=3,4")]
    assert grid(axes) == [{"a": 1, "b": 3}, {"a": 1, "b": 4}, {"a": 2, "b": 3}, {"a": 2, "b": 4}]
    assert side_by_side(axes) == [{"a": 1, "b": 3}, {"a": 2, "b": 4}]
    sample = sobol_sample([read_axis("a=1:4:log"), read_axis("b=x,y")], 64)
    assert sample == sobol_sample([read_axis("a=1:4:log"), read_axis("b=x,y")], 64)
    assert np.median([point["a"] for point in sample]) == pytest.approx(2.0, rel=0.05)
    assert sum(point["b"] == "x" for point in sample) == 32


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["a"], "allowed is KEY=LOW:HIGH:COUNT"),
        (["a=2:1:3"], "LOW below HIGH"),
        (["a=0:1:log3"], "above 0 on a logarithmic scale"),
        (["a=1:2:1"], "allowed are 2 to"),
        (["a=1,1"], "different values"),
        (["a=1,1.0"], "different values"),
        (["a={ b = [1] },{ b = [1.0] }"], "different values"),
        (["a=1:2"], "which only --sobol takes"),
        (["a=1,2", "a=3,4"], "varied twice"),
        (["stage[0].duration_s=1,2", "schedule.stage[0].duration_s=3,4"], "varied twice"),
        (["a[0].b=1,2", "a[0]={ b = 1 },{ b = 2 }"], r"--vary a\[0\]\.b: is varied, and so is a\[0\]"),
        (["a=1:2:1000", "b=1:2:1000"], "1000000 points"),
        ([], "--vary: is missing"),
        (["run.seeds=2,4"], "decides what a run does"),
        (["title=a,b"], "decides what a run does"),
    ],
)
def test_axes_that_are_refused(texts: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        grid([read_axis(text) for text in texts])


def test_axes_side_by_side_have_as_many_values() -> None:
    with pytest.raises(InputError, match="different numbers of values"):
        side_by_side([read_axis("a=1,2"), read_axis("b=1,2,3")])


class Pretended(Executor):
    """Runs tasks at once, with values made from amplitude and seed; breaks at some of them."""

    def __init__(self, break_at: tuple[int, ...] = ()) -> None:
        self.seeds: list[tuple[float, int]] = []
        self._break_at = break_at

    def submit(self, function: Any, task: Task, /) -> Future[Any]:  # type: ignore[override]
        future: Future[Any] = Future()
        amplitude = float(task.scenario.drive[0].amplitude_um or 0.0)
        if len(self.seeds) in self._break_at:
            self._break_at = tuple(n for n in self._break_at if n != len(self.seeds))
            from concurrent.futures.process import BrokenProcessPool

            future.set_exception(BrokenProcessPool("killed"))
            return future
        self.seeds += [(amplitude, seed) for seed in task.seeds]
        told = ("drive[0] is strong",) if amplitude > 3.0 else ()
        values = [SeedValues(seed, {"speed": speed_of(amplitude, seed)}, 0.1, "", told) for seed in task.seeds]
        future.set_result(tuple(values))
        return future


def speed_of(amplitude: float, seed: int) -> float:
    """No speed below 1 um; above, one that scatters the more, the stronger the drive."""
    if amplitude < 1.0:
        return math.nan
    return 10.0 + 0.5 * amplitude * float(np.random.default_rng(seed).normal())


def cases_at(question: Question) -> Cases:
    return Cases.of(strip_scenario(seeds=4), question, file=Path("scenario"))


def test_more_seeds_where_the_interval_is_wide_fewer_where_nothing_happens() -> None:
    question = Question((f"{AMPLITUDE}=0.5,1,4",), seeds=8, until_se=0.03, measure="speed")
    swept = run_cases(cases_at(question), Workers(Pretended(), 2))
    rows = {row.point[AMPLITUDE]: row for row in swept.of("speed")}
    assert rows[0.5].found.n == 0
    counts = [len(case.done) for case in swept.cases]
    assert counts[0] == 4  # nothing happens
    assert counts[1] == 8
    assert counts[2] > 30
    assert rows[4].found.se <= 0.03 * rows[4].found.mean
    assert rows[4].found.se > 0.01 * rows[4].found.mean  # and not many more than it takes


def test_a_broken_executor_loses_nothing() -> None:
    question = Question((f"{AMPLITUDE}=1:2:3",), seeds=5)
    whole = run_cases(cases_at(question), Workers(Pretended(), 2))
    second = Pretended()
    workers = Workers(Pretended(break_at=(3,)), 2, lambda: second)
    broken = run_cases(cases_at(question), workers)
    assert second.seeds
    assert broken.rows == whole.rows


def test_workers_that_end_again_and_again_end_the_sweep(monkeypatch: pytest.MonkeyPatch) -> None:
    cases = cases_at(Question((f"{AMPLITUDE}=1:2:3",), seeds=5))
    workers = Workers(Pretended(break_at=(0,)), 2, lambda: Pretended(break_at=(0,)))
    with pytest.raises(FeederSimError, match="again and again"):
        run_work(SweepWork(cases, lambda case, seed: None), workers)


def test_the_order_in_which_seeds_come_back_does_not_matter() -> None:
    effort = Effort(8, 0.02, 1000, "speed")
    wanted = []
    for order in (range(200), reversed(range(200))):
        case = Case(strip_scenario(), "")
        for seed in order:
            case.take((SeedValues(seed, {"speed": speed_of(4.0, seed)}, 0.1),))
        wanted.append(case.wanted(effort))
    assert wanted[0] == wanted[1] > 8


def test_a_journal_outlives_what_a_kill_leaves(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(path) as journal:
        journal.add({"seed": 1})
        journal.add({"seed": 2})
    whole = path.read_bytes()
    for cut in range(len(whole)):
        path.write_bytes(whole[:cut])
        with Journal(path) as journal:
            journal.add({"seed": 3})
        kept = [entry["seed"] for entry in read_journal(path)]
        assert kept[-1] == 3 and kept[:-1] == [1, 2][: len(kept) - 1]
        assert len(kept) - 1 >= whole[:cut].count(b"\n")
    path.write_bytes(whole.replace(b'"seed": 2', b'"seed": 7'))
    assert [entry["seed"] for entry in read_journal(path)] == [1]
    path.write_bytes(b"%08x 5\n%08x {}\n" % (zlib.crc32(b"5"), zlib.crc32(b"{}")))
    cases = cases_at(Question((f"{AMPLITUDE}=1,2",)))
    assert take_done(cases, [path]) == 0 and not any(case.done for case in cases)


def test_done_points_are_kept_and_others_added(tmp_path: Path) -> None:
    scenario, journal = strip_scenario(seeds=4), tmp_path / "journal.jsonl"
    run_cases(cases_at(Question((f"{AMPLITUDE}=1,2",))), Workers(Pretended(), 1), journal)
    again = Pretended()
    swept = run_cases(cases_at(Question((f"{AMPLITUDE}=2,3",), seeds=6)), Workers(again, 1), journal)
    assert sorted(again.seeds) == [(2.0, 4), (2.0, 5), *((3.0, seed) for seed in range(6))]
    assert [row.found.n for row in swept.of("speed")] == [6, 6]
    assert identity_of(scenario) == identity_of(scenario.changed({"title": "other", "run.seeds": 7}))
    assert identity_of(scenario) != identity_of(scenario.changed({"run.seed": 7}))


def test_tasks_of_a_job_array_merge_to_the_whole(tmp_path: Path) -> None:
    scenario, question = strip_scenario(seeds=3), Question((f"{AMPLITUDE}=1:2:5",))
    for number in (1, 2, 3):
        with sweep_folder(tmp_path / "s", "", scenario, question, (number, 3)) as folder:
            cases = Cases.of(scenario, question, file=Path("scenario")).part(number, 3)
            run_cases(cases, Workers(Pretended(), 1), folder.journal)
    assert len(list((tmp_path / "s").glob("journal-*-of-3.jsonl"))) == 3
    found, _ = merged(tmp_path / "s")
    assert found.complete
    assert found.rows == run_cases(cases_at(question.__class__(question.vary, seeds=3)), Workers(Pretended(), 1)).rows


def test_tasks_that_begin_at_once_share_a_folder(tmp_path: Path) -> None:
    scenario, question = strip_scenario(seeds=3), Question((f"{AMPLITUDE}=1:2:5",))

    def begin(number: int) -> str:
        with sweep_folder(tmp_path / "s", "", scenario, question, (number, 16)) as folder:
            return folder.journal.name

    with ThreadPoolExecutor(16) as pool:
        assert len(set(pool.map(begin, range(1, 17)))) == 16
    assert Question.of_toml(tmp_path / "s/sweep.toml") == question


def test_a_sweep_goes_on_elsewhere_without_the_files_it_began_with(repository: Path, tmp_path: Path) -> None:
    mode_file = tmp_path / "here/modes.h5"
    mode_file.parent.mkdir()
    mode_file.write_bytes((repository / "models/plate_180/modes.h5").read_bytes())
    changes = {"plate.mode_file": mode_file, AMPLITUDE: 1.0, "drive[0].voltage_vpp": None}
    scenario = load_scenario(repository / "scenarios/drift_2797hz_plate.toml").changed(changes)
    question = Question((f"{AMPLITUDE}=1,2",), seeds=2)
    with sweep_folder(tmp_path / "here/s", "", scenario, question) as folder:
        run_cases(Cases.of(scenario, question, file=Path("s")), Workers(Pretended(), 1), folder.journal)
    (tmp_path / "here").rename(tmp_path / "there")
    (tmp_path / "there/modes.h5").unlink()
    found, folder = merged(tmp_path / "there/s")
    assert found.complete and found.others == 0 and len(found.of("speed")) == 2
    with folder:
        assert "inputs/modes.h5" in (tmp_path / "there/s/scenario.toml").read_text()


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    scenario, question = strip_scenario(seeds=3), Question((f"{AMPLITUDE}=1:2:5",))
    (tmp_path / "own").mkdir()
    (tmp_path / "own/scenario.toml").write_text("# mine")
    with pytest.raises(InputError, match=r"holds scenario\.toml and no sweep\.toml"):
        sweep_folder(tmp_path / "own", "", scenario, question)
    with sweep_folder(tmp_path / "s", "", scenario, question):
        pass
    with sweep_folder(tmp_path / "s", "", scenario, replace(question, seeds=7, measure="speed")):
        pass  # more seeds are the same question
    for other in (replace(question, vary=(f"{AMPLITUDE}=1:3:5",)), replace(question, zipped=True)):
        with pytest.raises(InputError, match="holds another question"):
            sweep_folder(tmp_path / "s", "", scenario, other)
    with pytest.raises(InputError, match="holds another question"):
        sweep_folder(tmp_path / "s", "", scenario.changed({"contact.friction": 0.1}), question)
    (tmp_path / "s/sweep.png").symlink_to(tmp_path / "own/scenario.toml")
    with pytest.raises(InputError, match="is a link"), sweep_folder(tmp_path / "s", "", scenario, question):
        pass
    assert (tmp_path / "own/scenario.toml").read_text() == "# mine"


def test_a_single_arrival_does_not_end_a_sweep() -> None:
    """Of which no standard error is known."""
    effort, case = Effort(4, 0.03, 1000, "speed"), Case(strip_scenario(), "")
    case.take(tuple(SeedValues(seed, {"speed": math.nan if seed else 1.0}, 0.1) for seed in range(4)))
    assert case.wanted(effort) == 8
    case.take(tuple(SeedValues(seed, {"speed": (-1.0) ** seed}, 0.1) for seed in range(8)))  # mean 0
    assert case.wanted(effort) == 16


def done_with(values: list[float]) -> Case:
    """A case whose first seeds have come back."""
    case = Case(strip_scenario(), "")
    case.take(tuple(SeedValues(seed, {"speed": value}, 0.1) for seed, value in enumerate(values)))
    return case


@pytest.mark.parametrize("seeds", [1, 2, 5])
def test_few_values_that_happen_to_lie_together_do_not_end_a_point(seeds: int) -> None:
    effort = Effort(seeds, 0.03, 1000, "speed")
    assert done_with([10.0, 10.001]).wanted(effort) == 4  # the first look
    assert done_with([10.0, 10.001, 10.0, 10.001]).wanted(effort) == 8
    assert done_with([10.0, 10.001] * 4).wanted(effort) == 8
    few = [10.0, 10.001, *[math.nan] * 6]
    assert done_with(few).wanted(effort) == 16  # two values are not eight, whatever their standard error
    assert done_with([10.0, 10.0, math.nan, math.nan]).wanted(effort) == 8  # two of the same value are not all


def test_points_that_do_not_get_there_are_counted() -> None:
    question = Question((f"{AMPLITUDE}=0.5,1,4",), until_se=0.01, measure="speed", most_seeds=40)
    swept = run_cases(cases_at(question), Workers(Pretended(), 2))
    assert swept.complete and swept.short == 1
    nothing, sure, scattered = (len(case.done) for case in swept.cases)
    assert nothing == 4 and 8 < sure < 40 and scattered == 40
    assert replace(question, seeds=60).effort(strip_scenario()).most_seeds == 60
    for wrong in (replace(question, seeds=-1), replace(question, inputs=1), replace(question, most_seeds=7)):
        with pytest.raises(InputError, match="or more"):
            cases_at(wrong)


def test_fewer_seeds_keep_those_that_are_there(tmp_path: Path) -> None:
    journal = tmp_path / "journal.jsonl"
    run_cases(cases_at(Question((f"{AMPLITUDE}=1,2",), seeds=6)), Workers(Pretended(), 1), journal)
    again = Pretended()
    swept = run_cases(cases_at(Question((f"{AMPLITUDE}=1,2,3",), seeds=2)), Workers(again, 1), journal)
    assert sorted(again.seeds) == [(3.0, 0), (3.0, 1)]
    assert [row.seeds for row in swept.of("speed")] == [6, 6, 2] and swept.kept == 2 and swept.complete


def test_a_mode_takes_its_frequency_along(repository: Path) -> None:
    scenario = load_scenario(repository / "scenarios/drift_2797hz_plate.toml")
    both = Question(("drive[0].mode=1,12",)), Question(("drive[0].mode=1,12", "drive[0].frequency_hz=500,600"))
    alone, beside = (Cases.of(scenario, question, file=Path("scenario")) for question in both)
    frequencies = [case.scenario.drive[0].frequency_hz for case in alone]
    assert len(set(frequencies)) == 2 and scenario.drive[0].frequency_hz not in frequencies
    assert [case.scenario.drive[0].frequency_hz for case in beside] == [500, 600] * 2  # what is said counts
    uncertain = scenario.changed({"uncertain": {"drive[0].frequency_hz": {"uniform": [2700.0, 2800.0]}}})
    with pytest.raises(InputError, match=r"frequency_hz: is varied, but also \[uncertain\]"):
        Cases.of(uncertain, both[0], file=Path("scenario"))
    with pytest.raises(InputError, match=r"plate\.mode_file: is missing"):
        cases_at(both[0])


def test_draws_of_uncertain_inputs_have_seeds_of_their_own() -> None:
    held = {"contact.friction": {"uniform": [0.2, 0.4]}}
    scenario = strip_scenario(seeds=2).changed({"uncertain": held})
    question = Question((f"{AMPLITUDE}=1,2",), inputs=4)
    cases = Cases.of(scenario, question, file=Path("scenario"))
    executor = Pretended()
    swept = run_cases(cases, Workers(executor, 1))
    assert sorted(executor.seeds) == [(a, seed) for a in (1.0, 2.0) for seed in range(8)]
    assert [row.found.n for row in swept.of("speed")] == [8, 8] and swept.uncertain
    for vary in ("contact.friction=0.2,0.3", "contact={ friction = 0.2 },{ friction = 0.3 }"):
        with pytest.raises(InputError, match=r"is varied, but also \[uncertain\]"):
            Cases.of(scenario, Question((vary,)), file=Path("scenario"))
    with pytest.raises(InputError, match="more --inputs narrow"):
        Cases.of(scenario, replace(question, until_se=0.1, measure="speed"), file=Path("scenario"))


def test_a_worker_with_other_files_or_another_version_is_told() -> None:
    with pytest.raises(FeederSimError, match="another version of the package"):
        run_task(Task(strip_scenario(), "of another version", (0,)))


def test_columns_of_numbers_and_texts(tmp_path: Path) -> None:
    import pyarrow.parquet

    values = ([1.0, 0.0], 2.5, "x")
    rows = [Row({"a": value}, "m", Statistic.of([1.0, 2.0]), 2, 0) for value in values]
    (tmp_path / "t.parquet").write_bytes(as_parquet(["a"], rows, uncertain=False))
    assert pyarrow.parquet.read_table(tmp_path / "t.parquet")["a"].to_pylist() == ["[1.0, 0.0]", "2.5", "x"]


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
    assert known.is_told and not known.not_told
    assert not spread_of([[1.0], [2.0]]).not_told  # one seed each tells nothing
    rows = [
        Row({"a": place}, "m", Statistic.of([3.0, 3.5]), 2, 0, spread)
        for place, spread in enumerate((known, unknown, unknown, known))
    ]
    table = as_csv(["a"], rows, uncertain=True).splitlines()
    assert table[0].endswith("low,high,sd_inputs,sd_seeds") and ",,,0.0," in table[2]
    figure = empty_figure(3.0, 2.0)
    for axes, shown in zip(figure.subplots(1, 2), (rows, rows[1:3]), strict=True):
        draw_line(axes, shown, "a", joined=True)
    with_band, without = (axes.get_legend_handles_labels()[1] for axes in figure.axes)
    assert with_band == ["90 % over the inputs"] and without == []


def test_real_seeds_are_those_of_simulate() -> None:
    """A sweep in threads, with uncertain inputs, against `simulate` of the same scenarios."""
    from feeder_sim import simulate

    scenario = strip_scenario(seeds=2, duration_s=0.05)
    with ThreadPoolExecutor(1) as pool:
        swept = sweep(scenario, {AMPLITUDE: [0.5, 1.0]}, executor=pool, workers=1)
    for row in swept.of("drift_velocity_x_mm_s"):
        found = simulate(scenario.changed(row.point)).measures()["drift_velocity_x_mm_s"]
        assert (row.found.mean, row.found.se, row.found.n) == (found["mean"], found["se"], 2)


def test_a_task_that_cannot_be_run_says_why() -> None:
    scenario = strip_scenario().changed({"part[0].start.position_mm": [1e4, 0.0]})
    (seed,) = run_task(Task(scenario, identity_of(scenario), (0,)))
    assert "start.position_mm" in seed.failure and not seed.values
    entry = json.loads(json.dumps(seed.as_entry()))
    assert SeedValues.of_entry(entry) == seed


def test_cautions_come_with_the_seeds_of_a_task() -> None:
    scenario = strip_scenario(duration_s=0.02).changed({"run.in_plane_velocity": False})
    (seed,) = run_task(Task(scenario, identity_of(scenario), (0,)))
    assert [line.partition(" ")[0] for line in seed.cautions] == ["run.in_plane_velocity"]
    entry = json.loads(json.dumps(seed.as_entry()))
    assert SeedValues.of_entry(entry) == seed
    del entry["cautions"]  # as journals had it once
    assert SeedValues.of_entry(entry) == replace(seed, cautions=())


def test_a_caution_is_told_once_for_all_points() -> None:
    """Also where its numbers are those of each point."""
    lines = [
        ("run.planar is true: no",),
        ("run.planar is true: no", "drive[0]: by 3.2 um"),
        ("drive[0]: by 2.5e+03 um",),
    ]
    places = [[SeedValues(seed, {}, 0.1, "", told) for seed in range(2)] for told in lines]
    assert [caution.in_words() for caution in cautions_over([*places, []])] == [
        "run.planar is true: no (at 2 of 3 points)",
        "drive[0]: by 3.2 um (at 2 of 3 points, the numbers are those of the first)",
    ]
    assert [caution.in_words() for caution in cautions_over(places[:1])] == ["run.planar is true: no"]
    other = [SeedValues(0, {}, 0.1, "", ("drive[1]: by 3.2 um",))]
    assert len(cautions_over([places[1], other])) == 3  # of another drive


def test_command(repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("feeder_sim.jobs.workers.workers_of", lambda count, dask: given_workers(Pretended(), 2))
    scenario, out = repository / "scenarios/drift_4750hz.toml", tmp_path / "out"
    asked = ("sweep", scenario, "--vary", f"{AMPLITUDE}=1:4:log3", "--vary", "contact.friction=0.2,0.3", "--out", out)
    done = feeder_sim(*asked, "--seeds", 3)
    assert done.returncode == 0, done.stderr
    assert "speed" in done.stdout and "6 points" in done.stdout
    assert done.stderr == "feeder-sim: caution: drive[0] is strong (at 2 of 6 points)\n"
    with (out / "sweep.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [AMPLITUDE, "contact.friction", "measure", "mean", "se", "n", "seeds", "failed"]
    assert len(rows) == 6 and rows[0]["n"] == rows[0]["seeds"] == "3"
    assert (out / "sweep.png").stat().st_size > 1000
    import pyarrow.parquet

    assert pyarrow.parquet.read_table(out / "sweep.parquet").to_pylist()[0]["measure"] == "speed"
    told = json.loads(feeder_sim(*asked, "--json").stdout)
    assert told["complete"] and len(told["rows"]) == 6
    assert told["cautions"] == [{"caution": "drive[0] is strong", "at": 2, "of": 6, "numbers_differ": False}]
    assert feeder_sim("merge", out).returncode == 0
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    for refused in (feeder_sim(*asked, "--measure", "sped"), feeder_sim("merge", out, "--measure", "sped")):
        check_refused(refused, "--measure: is sped", "allowed are speed")
    (out / "journal.jsonl").unlink()
    check_refused(feeder_sim("merge", out), str(out), "holds no seed of the sweep")
    left = {file.name: file.read_bytes() for file in out.iterdir()}
    assert left == {name: content for name, content in before.items() if name != "journal.jsonl"}
    for options, said in (
        (("--vary", f"{AMPLITUDE}=-1,2"), ("drive[0].amplitude_um", "is -1")),
        (("--vary", f"{AMPLITUDE}=1,2", "--until-se", "x"), ("--until-se", "3%")),
        (("--vary", f"{AMPLITUDE}=1,2", "--until-se", "0"), ("--until-se", "3%")),
        (("--vary", f"{AMPLITUDE}=1,2", "--measure", "sped"), ("did you mean 'speed'",)),
        (("--vary", f"{AMPLITUDE}=1,2", "--until-se", "3%"), ("--measure", "missing")),
        (("--vary", f"{AMPLITUDE}=1,2", "--task", "3/2"), ("--task", "I/N")),
        (("--vary", f"{AMPLITUDE}=1,2", "--out", scenario.parent), ("allowed is a new folder",)),
        (("--vary", f"{AMPLITUDE}=1,2", "--zip", "--sobol", "4"), ("--zip",)),
    ):
        check_refused(feeder_sim("sweep", scenario, *options, cwd=tmp_path), *said)
    check_refused(feeder_sim("merge", tmp_path), "sweep.toml", "no such file")


def test_command_says_what_its_means_are_of(repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("feeder_sim.jobs.workers.workers_of", lambda count, dask: given_workers(Pretended(), 2))
    scenario, vary = repository / "scenarios/drift_4750hz.toml", f"{AMPLITUDE}=0.5,0.7,2"
    asked = ("sweep", scenario, "--out", tmp_path / "s", "--vary", vary, "--measure", "speed")
    done = feeder_sim(*asked, "--seeds", 4)
    assert [line.split()[0] for line in done.stdout.splitlines()[1:4]] == ["0.5", "0.7", "2"]
    assert "speed: at 2 of 3 points 8 of 8 seeds have no value" in done.stderr
    fewer = feeder_sim(*asked, "--seeds", 2)
    assert "3 points keep the seeds that they had" in fewer.stderr
    never = feeder_sim(*asked, "--until-se", "0.1%", "--most-seeds", 20)
    assert never.returncode == 0 and "1 of 3 points have not reached --until-se 0.1%" in never.stderr
    assert "--most-seeds allows, 20" in never.stderr


def test_points_without_any_value_have_a_row() -> None:
    cases = cases_at(Question((f"{AMPLITUDE}=1,2,3",), seeds=2))
    first, second, _ = cases
    first.take((SeedValues(0, {"speed": 1.0}, 0.1), SeedValues(1, {"speed": math.nan}, 0.1)))
    second.take((SeedValues(0, {}, 0.1, "no room"), SeedValues(1, {}, 0.1, "no room")))
    rows = Sweep(cases, complete=False).at_every_point("speed")
    assert [(row.found.n, row.seeds, row.failed, row.without_value) for row in rows] == [
        (1, 2, 0, 1),
        (0, 2, 2, 0),
        (0, 0, 0, 0),
    ]


def test_a_number_of_seeds_that_is_none_is_refused() -> None:
    for seeds in (0, -1):
        with pytest.raises(InputError, match=f"seeds: is {seeds}, allowed is a whole number from 1 on"):
            sweep(strip_scenario(), {AMPLITUDE: [1.0]}, seeds=seeds)


def test_a_question_is_kept_as_text(tmp_path: Path) -> None:
    question = Question(axis_texts({"a": [1, 2.5], "b": np.array([1.0, 2.0]), "c": "1:2:3"}), seeds=3, measure="m")
    (tmp_path / "q.toml").write_text(question.as_toml())
    assert Question.of_toml(tmp_path / "q.toml") == question
    assert question.axes[0].values == (1, 2.5)
    for text in ("vary = 3\nx = 1", "vary = [1]", "vary = []\nseeds = 'x'", "{"):
        (tmp_path / "q.toml").write_text(text)
        with pytest.raises(InputError, match="holds no sweep"):
            Question.of_toml(tmp_path / "q.toml")
    with pytest.raises(InputError, match="a: is 3, allowed is a sequence"):
        axis_texts({"a": 3})
