"""Pages of searches, from values that are made up."""

from __future__ import annotations

import json
import math
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import feeder_sim, one_line
from conftest import amplitude_of, strip_scenario
from pages import checked
from pretended import Pretended, asked

from feeder_sim.document import figure
from feeder_sim.document.words import with_error
from feeder_sim.errors import InputError
from feeder_sim.scenario import Scenario
from feeder_sim.studies.ask import open_study
from feeder_sim.studies.search.optimise import OptimiseQuestion, Search

AMPLITUDE, FRICTION = "drive[0].amplitude_um", "contact.friction"
OVER = (f"{AMPLITUDE}=0.5:5:log", f"{FRICTION}=0.1,0.2,0.3")
TIME = "arrival_time_s"


def values_of(scenario: Scenario, seed: int) -> dict[str, float]:
    """A time that is shortest at the middle friction and the largest amplitude; below 0.7 um seed 1 does not arrive."""
    amplitude, friction = amplitude_of(scenario), scenario.contact.friction
    chance = float(np.random.default_rng([seed, scenario.run.seed]).normal())
    time = 20.0 / amplitude + 30.0 * abs(friction - 0.2) + 0.5 * chance * amplitude
    return {TIME: math.nan if amplitude < 0.7 and seed == 1 else time}


def searched(
    path: Path, trials: int = 20, stop: threading.Event | None = None, after: int = 0, over: tuple[str, ...] = OVER
) -> Search:
    """A folder as the command leaves it."""
    scenario = strip_scenario(amplitude_um=1.0).changed({"title": "<b>Nut</b>"})
    question = OptimiseQuestion.of(over=over, minimise=TIME, seeds=4, trials=trials, check_seeds=8)
    found: Search = asked(question, scenario, Pretended(values_of, stop, after), path, stop=stop)
    return found


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of few pixels: they take most of the time."""
    monkeypatch.setattr(figure, "PIXELS_PER_INCH", 40)


def test_page_of_a_search(tmp_path: Path, coarse: None) -> None:
    found = searched(tmp_path / "s")
    assert found.best is not None and found.best.point is not None and found.present is not None
    made = feeder_sim("report", tmp_path / "s", "--json")
    assert made.returncode == 0, made.stderr
    told = json.loads(made.stdout)
    assert told["kind"] == "optimise" and told["pictures"] == 2
    text = (tmp_path / "s/report.html").read_text(encoding="utf-8")
    page = checked(text)
    mean, (low, _), present = found.gain.mean, found.gain.interval, found.present.statistic
    amplitude = found.best.point[AMPLITUDE]
    winner = next(trial.number for trial in found.trials if trial.point == found.best.point)
    for expected in (
        "Best recipe: <b>Nut</b>",
        "Search for the smallest arrival time (s): 20 recipes tried over 2 keys.",
        f"difference {mean:.2f} s ± {mean - low:.2f} (95 %), seed by seed",
        f"{AMPLITUDE} µm 0.5 to 5, by ratios",
        f"{FRICTION} one of 0.1, 0.2, 0.3",
        f"{AMPLITUDE} µm 1 {amplitude:.4g} {FRICTION} 0.3 {found.best.point[FRICTION]:.4g}",
        f"recipe of the file {' '.join(with_error(present.mean, present.se))}",
        "The best recipe is better than that of the file",
        f"In the search it was trial {winner}, with a mean of",
        f"recipes have a seed without a value and do not count, mostly: a seed has no {TIME}.",
        f"--over '{OVER[0]}' --over {OVER[1]} --minimise {TIME} --trials 20 --seeds 4 --check-seeds 8 --out repeated",
    ):
        assert expected in page.text, expected
    assert "<b>" not in text


def test_what_is_read_is_what_was_found(tmp_path: Path) -> None:
    found = searched(tmp_path)
    read: Any = open_study(tmp_path)
    assert read.gain == found.gain and read.aim == found.aim and read.complete
    assert read.best == found.best and read.present == found.present
    assert [(row.number, row.seeds, row.stopped, row.refused, row.point) for row in read.trials] == [
        (row.number, row.seeds, row.stopped, row.refused, row.point) for row in found.trials
    ]
    means = [row.statistic.mean for row in found.trials]
    assert [row.statistic.mean for row in read.trials] == pytest.approx(means, nan_ok=True)
    assert read.leader is not None and found.best is not None and read.leader.point == found.best.point
    assert read.warnings == found.warnings


def test_a_search_that_was_killed_as_it_wrote_goes_on(tmp_path: Path) -> None:
    """Optuna locks its journal by a link, which a kill leaves; another link is refused."""
    found = searched(tmp_path, trials=4)
    (tmp_path / "optuna.log.lock").symlink_to("nowhere")
    assert searched(tmp_path, trials=4).table() == found.table()
    (tmp_path / "draws.csv").symlink_to("nowhere")
    with pytest.raises(InputError, match="is a link"):
        searched(tmp_path, trials=4)


def test_page_of_a_search_that_has_not_ended(tmp_path: Path, coarse: None) -> None:
    found = searched(tmp_path, stop=threading.Event(), after=40)
    assert not found.complete and found.trials
    assert feeder_sim("report", tmp_path).returncode == 0
    page = checked((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "no recipe has been checked with fresh seeds" in page.text and "best trial, not checked" in page.text
    assert "difference" not in page.text and "--check-seeds" not in page.text


def test_recipe_of_the_file_may_be_the_best_or_none(tmp_path: Path, coarse: None) -> None:
    found = searched(tmp_path / "same", trials=4, over=(f"{AMPLITUDE}=0.9:1.0",))
    assert found.best is not None and found.best.point == {AMPLITUDE: 1.0}
    assert feeder_sim("report", tmp_path / "same").returncode == 0
    text = checked((tmp_path / "same/report.html").read_text(encoding="utf-8")).text
    assert "No recipe that was tried came out better" in text and "at the upper end of its range" in text
    found = searched(tmp_path / "none", trials=4, over=(f"{AMPLITUDE}=0.5:0.6",))
    assert found.complete and found.best is None
    assert feeder_sim("report", tmp_path / "none").returncode == 0
    text = checked((tmp_path / "none/report.html").read_text(encoding="utf-8")).text
    assert "No recipe has arrival time (s) in all its seeds" in text and "4 recipes have a seed without a value" in text


def test_damaged_folder_is_refused(tmp_path: Path) -> None:
    searched(tmp_path, trials=2)
    question = (tmp_path / "search.toml").read_text()
    for text, said in (
        (question.replace("seeds = 4", "seeds = true"), "search.toml: seeds: is True"),
        (question.replace("friction", "frction"), "did you mean 'friction'"),
    ):
        (tmp_path / "search.toml").write_text(text)
        refused = feeder_sim("report", tmp_path)
        assert refused.returncode == 2 and said in one_line(refused), refused.stderr
    assert not (tmp_path / "report.html").exists()
