"""A scenario with uncertain inputs, run from the command line."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from command_line import check_refused, feeder_sim
from conftest import BALL_ON_SLIDE, REPOSITORY, StopsAfter, toml_of

from feeder_sim.document.figure import empty_figure
from feeder_sim.jobs import workers
from feeder_sim.jobs.workers import Workers, workers_of
from feeder_sim.plots.uncertainty import draw_values
from feeder_sim.run import run_folder
from feeder_sim.run.run_folder import record_run
from feeder_sim.run.work import Work
from feeder_sim.studies.uncertainty.spread import spread_of
from feeder_sim.studies.uncertainty.uncertainty import Uncertainty, UncertaintyQuestion

NOT_DRAWN = "contact.restitution: uncertain inputs, which have the values of the scenario here"


@pytest.fixture
def ball(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scenario whose draws take next to nothing, in a thread of this process."""

    @contextmanager
    def in_a_thread(_: int | None = None) -> Iterator[Workers]:
        with ThreadPoolExecutor(1) as pool, workers_of(Work(executor=pool)) as found:
            yield found

    monkeypatch.setattr(workers, "local_workers", in_a_thread)
    uncertain = {"uncertain": {"contact": {"restitution": {"uniform": [0.1, 0.5]}}}}
    (tmp_path / "ball.toml").write_text(toml_of(BALL_ON_SLIDE | uncertain), encoding="utf-8")
    return tmp_path / "ball.toml"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("drift_8775hz", "[uncertain]: is missing"),
        ("ball.toml --indices --inputs 6", "--inputs: is 6, must be a power of two"),
        ("ball.toml --indices --seeds 1", "--seeds: is 1, must be 2 or more with indices"),
    ],
)
def test_what_cannot_be_asked_is_refused_before_anything_is_written(
    words: str, said: str, ball: Path, tmp_path: Path
) -> None:
    check_refused(feeder_sim("uncertainty", *words.split(), "--out", "u", cwd=tmp_path), said)
    assert [*tmp_path.iterdir()] == [ball]


def test_a_run_goes_on_with_as_many_draws_as_it_was_begun_with(ball: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    done = feeder_sim("run", ball, "--inputs", 3, "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    assert NOT_DRAWN not in done.stderr  # beside what the draws have come to
    assert any(NOT_DRAWN in warning for warning in json.loads(done.stdout)["warnings"])
    speed = json.loads(done.stdout)["uncertainty"]["measures"]["highest_rise_mm"]
    assert speed["draws"] == 3 and speed["low"] < speed["median"] < speed["high"] and speed["sd_seeds"] > 0.0
    with (out / "uncertainty/draws.csv").open(newline="") as file:
        assert sorted(int(row["seed"]) for row in csv.DictReader(file)) == [*range(6)]  # each draw has its own
    assert (out / "uncertainty/uncertainty.png").is_file()
    for anew in ((), ("--inputs", 3)):
        again = feeder_sim("run", "--resume", out, "--json", *anew)
        assert again.returncode == 0 and NOT_DRAWN not in again.stderr
        assert json.loads(again.stdout)["uncertainty"] == json.loads(done.stdout)["uncertainty"]
        shutil.move(out / "uncertainty", tmp_path / f"before{len(anew)}")
    shutil.move(tmp_path / "before2", out / "uncertainty")
    check_refused(feeder_sim("run", "--resume", out, "--inputs", 4), "--inputs: is 4, must be 3, which the run")
    (out / "uncertainty/uncertainty.toml").write_text("inputs = true")
    check_refused(feeder_sim("run", "--resume", out), "uncertainty.toml: inputs: is True, must be a whole number")


def test_the_plan_counts_the_draws(ball: Path) -> None:
    many = json.loads(feeder_sim("run", ball, "--inputs", 1000, "--dry-run", "--json").stdout)
    usual = json.loads(feeder_sim("check", ball, "--json").stdout)
    assert many["input_runs"] == 2000 and usual["input_runs"] == 32 and usual["seeds"] == 2
    assert many["estimated_inputs_wall_s"] > 10.0 * many["estimated_wall_s"] > 0.0  # a thousand times on two cores
    known = json.loads(feeder_sim("check", REPOSITORY / "scenarios/ball_50hz.toml", "--json").stdout)
    assert known["input_runs"] == known["estimated_inputs_wall_s"] == 0
    assert feeder_sim("run", ball, "--inputs", 5000, "--dry-run").returncode == 2


def test_draws_that_have_more_seeds_than_asked_for_keep_them(ball: Path, tmp_path: Path) -> None:
    asked = ("uncertainty", ball, "--inputs", 3, "--out", tmp_path / "u")
    assert "keep the seeds" not in feeder_sim(*asked).stderr
    assert "draws keep the seeds that they had" in feeder_sim(*asked, "--seeds", 1).stderr


def test_an_interrupted_run_keeps_how_many_draws_were_asked_for(
    ball: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*given: Any, work: Work, **named: Any) -> Any:
        return record_run(*given, work=replace(work, stop=StopsAfter(1)), **named)

    monkeypatch.setattr(run_folder, "record_run", interrupted)
    out = tmp_path / "run"
    begun = feeder_sim("run", ball, "--inputs", 3, "--out", out)
    assert begun.returncode == 130 and NOT_DRAWN in begun.stderr
    done = feeder_sim("run", "--resume", out, "--json")
    assert done.returncode == 0, done.stderr
    measures = json.loads(done.stdout)["uncertainty"]["measures"]
    assert {found["draws"] for found in measures.values()} == {3}


def test_inputs_that_are_not_told_apart_from_the_seeds_are_said_to_be_so() -> None:
    values = [[1.0, 5.0], [2.0, 4.5], [0.5, 5.5]]
    found: Any = SimpleNamespace(spread=lambda _: spread_of(values), values=lambda _: values, measure=lambda name: name)
    found.linear_shares, found.indices = lambda _: None, lambda _: []
    found.question = UncertaintyQuestion(measured=5.2)
    lines = Uncertainty.lines(found, "picked")
    assert lines[-1].split(maxsplit=1)[1] == "5.2 is within the 71 % of runs; 5 of 6 runs are below it"
    assert lines[1].split(maxsplit=2)[2] == "not told apart from the seeds" and "over seeds" in lines[2]
    axes = empty_figure(3.0, 2.0).subplots()
    draw_values(axes, found, "picked", None)
    assert "means, inputs alone:\nnot told apart from the seeds" in axes.get_legend_handles_labels()[1]
