"""A scenario with uncertain inputs, run from the command line."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from command_line import check_refused, feeder_sim
from conftest import BALL_ON_SLIDE, toml_of

from feeder_sim.document.figure import empty_figure
from feeder_sim.plots.uncertainty import draw_values
from feeder_sim.pool import workers
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import Workers, workers_of
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


def test_a_run_takes_the_values_of_the_scenario_and_says_so(ball: Path, tmp_path: Path) -> None:
    done = feeder_sim("run", ball, "--out", tmp_path / "run", "--json")
    assert done.returncode == 0 and NOT_DRAWN in done.stderr
    assert any(NOT_DRAWN in warning for warning in json.loads(done.stdout)["warnings"])
    assert any(NOT_DRAWN in warning for warning in json.loads(feeder_sim("check", ball, "--json").stdout)["warnings"])


def test_each_draw_has_seeds_of_its_own(ball: Path, tmp_path: Path) -> None:
    done = feeder_sim("uncertainty", ball, "--inputs", 3, "--seeds", 2, "--out", tmp_path / "u", "--json")
    assert done.returncode == 0, done.stderr
    speed = json.loads(done.stdout)["measures"]["highest_rise_mm"]
    assert speed["draws"] == 3 and speed["low"] < speed["median"] < speed["high"] and speed["sd_seeds"] > 0.0
    with (tmp_path / "u/draws.csv").open(newline="") as file:
        assert sorted(int(row["seed"]) for row in csv.DictReader(file)) == [*range(6)]
    assert (tmp_path / "u/uncertainty.png").is_file()


def test_draws_that_have_more_seeds_than_asked_for_keep_them(ball: Path, tmp_path: Path) -> None:
    asked = ("uncertainty", ball, "--inputs", 3, "--out", tmp_path / "u")
    assert "keep the seeds" not in feeder_sim(*asked).stderr
    assert "draws keep the seeds that they had" in feeder_sim(*asked, "--seeds", 1).stderr


def test_an_interrupted_study_is_resumed_with_its_question(ball: Path, tmp_path: Path) -> None:
    words = ("uncertainty", ball, "--inputs", 3, "--seeds", 2, "--json")
    whole = json.loads(feeder_sim(*words, "--out", tmp_path / "whole").stdout)
    feeder_sim(*words, "--out", tmp_path / "cut")
    journal = tmp_path / "cut/journal.jsonl"
    journal.write_text("".join(journal.read_text().splitlines(keepends=True)[:2]))
    (tmp_path / "cut/draws.csv").unlink()
    resumed = feeder_sim("resume", tmp_path / "cut", "--json")
    assert resumed.returncode == 0, resumed.stderr
    assert json.loads(resumed.stdout)["measures"] == whole["measures"]
    assert (tmp_path / "cut/draws.csv").read_bytes() == (tmp_path / "whole/draws.csv").read_bytes()
    check_refused(feeder_sim("resume", tmp_path / "cut", "--replay"), "--replay: is the folder of a study")


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
