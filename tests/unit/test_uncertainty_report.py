"""Pages of uncertain inputs, from values that are made up."""

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
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.studies.ask import open_study
from feeder_sim.studies.uncertainty.uncertainty import Uncertainty, UncertaintyQuestion

AMPLITUDE, FRICTION = "drive[0].amplitude_um", "contact.friction"
INPUTS = {
    AMPLITUDE: {"log_uniform": [1.0, 2.0]},
    FRICTION: {"normal": [0.3, 0.03], "also": ["contact.part_friction"]},
    "part[0].material": {"choice": ["steel", "aluminium"]},
}
SPEED = "transport_speed_mm_s"


def values_of(scenario: Scenario, seed: int) -> dict[str, float] | str:
    """A speed that goes with the amplitude, a rise that is chance alone; seed 3 fails, seed 5 does not arrive."""
    if seed == 3:
        return "seed 3: <b>a part</b> lies too deep"
    chance = float(np.random.default_rng(seed).normal())
    speed = 4.0 * amplitude_of(scenario) + 0.2 * chance
    return {SPEED: math.nan if seed == 5 else speed, "highest_rise_mm": 0.5 + 0.1 * chance}


def studied(folder: Path, stop: threading.Event | None = None, after: int = 0, **words: Any) -> Uncertainty:
    """A folder as the command leaves it."""
    scenario = strip_scenario().changed({"title": "<b>Nut</b>", "uncertain": INPUTS})
    question, executor = UncertaintyQuestion.of(**words), Pretended(values_of, stop, after)
    found: Uncertainty = asked(question, scenario, executor, folder, stop=stop)
    return found


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of few pixels: they take most of the time."""
    monkeypatch.setattr(figure, "PIXELS_PER_INCH", 40)


@pytest.mark.filterwarnings("default")  # of SALib
def test_page_with_indices(tmp_path: Path, coarse: None) -> None:
    done = studied(tmp_path / "u", inputs=8, seeds=2, indices=True, measure=SPEED, measured=6.5)
    made = feeder_sim("report", tmp_path / "u", "--json")
    assert made.returncode == 0, made.stderr
    told = json.loads(made.stdout)
    # All draws have a value of the speed, though two seeds do not: a histogram, the inputs, the indices.
    assert told["kind"] == "uncertainty" and told["pictures"] == 3
    text = (tmp_path / "u/report.html").read_text(encoding="utf-8")
    page, spread = checked(text), done.spread(SPEED)
    below = sum(value < 6.5 for row in done.values(SPEED) for value in row)
    linear = done.linear_shares(SPEED)
    assert linear
    line = next(share for share in linear.inputs if share.key == AMPLITUDE)
    amplitude = next(index for index in done.indices(SPEED) if index.key == AMPLITUDE)
    for expected in (
        "Uncertain inputs: <b>Nut</b>",
        "40 draws of 3 uncertain inputs, 2 seeds of each.",
        f"median transport speed {spread.median:.2f} mm/s 90 % of runs {spread.low:.1f} to {spread.high:.1f}",
        f"{AMPLITUDE} µm 1 to 2, every ratio equally likely",
        "0.3 ± 0.03 (normal, one standard deviation) contact.part_friction",
        "one of steel, aluminium",
        f"The measured value, 6.5 mm/s, lies within the 90 % of runs, {spread.low:.1f} to {spread.high:.1f}; "
        f"{below} of 78 runs are below it.",
        f"{AMPLITUDE} {line.share:.2f} ± {line.interval:.2f} {amplitude.first:.2f} ± {amplitude.first_interval:.2f}",
        "1 of 80 runs failed: seed 3: <b>a part</b> lies too deep.",
        "Transport speed (mm/s): 1 of 79 runs have no value",
        "Few draws",
        f"--inputs 8 --indices --measure {SPEED} --measured 6.5 --out repeated",
    ):
        assert expected in page.text, expected
    assert "<b>" not in text


def test_what_is_read_is_what_was_found(tmp_path: Path) -> None:
    done = studied(tmp_path, inputs=4, seeds=3)
    read: Any = open_study(tmp_path)
    assert read.question == done.question
    assert read.table() == done.table() and read.main() == done.main() == SPEED
    assert [dict(draw) for draw in read.draws] == list(done.draws)
    assert [seed.seed for seed in read.failed] == [3]
    assert read.complete
    assert read.warnings == done.warnings


def test_page_of_a_study_that_has_not_ended(tmp_path: Path, coarse: None) -> None:
    done = studied(tmp_path, threading.Event(), after=6, inputs=16, seeds=1)
    runs = sum(len(case.done) for case in done.cases)
    assert runs < 16
    assert feeder_sim("report", tmp_path).returncode == 0
    page = checked((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert f"{runs} of 16 runs are there: the study has not ended." in page.text
    assert "cannot be told apart" in page.text and "The measured value" not in page.text
    assert len(page.all("img")) == 2 and "First order" not in page.text


def test_damaged_folder_is_refused(tmp_path: Path) -> None:
    studied(tmp_path, inputs=4, seeds=1)
    journal = (tmp_path / "journal.jsonl").read_text()
    for name, text, said in (
        ("journal.jsonl", journal.splitlines()[0][:-1], "holds no seed of the uncertainty yet"),
        ("uncertainty.toml", "inputs = 'many'\nseeds = 1\n", "uncertainty.toml: inputs: is 'many'"),
    ):
        (tmp_path / "journal.jsonl").write_text(journal)
        (tmp_path / name).write_text(text)
        refused = feeder_sim("report", tmp_path)
        assert refused.returncode == 2 and said in one_line(refused), refused.stderr
    assert feeder_sim("report", tmp_path, "--screenshot").returncode == 2
    assert not (tmp_path / "report.html").exists()
    assert load_scenario(tmp_path / "scenario.toml").uncertain
