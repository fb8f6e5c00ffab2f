"""Pages of sweeps, from journals that are written by hand."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from command_line import feeder_sim, one_line
from pages import checked

from feeder_sim.document import figure
from feeder_sim.document.figure import empty_figure
from feeder_sim.document.words import number, with_error
from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.task import SeedValues
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plots.sweep import Mean, colour_limits, draw_line
from feeder_sim.scenario import load_scenario
from feeder_sim.studies.ask import open_study
from feeder_sim.studies.sweep.sweep import SweepQuestion, axis_texts
from feeder_sim.studies.uncertainty.spread import draws_of

AMPLITUDE, FRICTION, SIZE = "drive[0].amplitude_um", "contact.friction", "part[0].size"
SPEED, RISE = "transport_speed_mm_s", "highest_rise_mm"
SCENARIO = """
title = "<b>Nut</b>"
plate = { kind = "strip", thickness_mm = 3.0 }
drive = [{ frequency_hz = 4750.0, amplitude_um = 1.0 }]
part = [{ shape = "hex_nut", size = "M2.5" }]
run = { duration_s = 0.1, seeds = 4 }
"""

Entry = tuple[Mapping[str, Any], Sequence[SeedValues]]  # a point, and its seeds


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of few pixels: they take most of the time."""
    monkeypatch.setattr(figure, "PIXELS_PER_INCH", 40)


def write_folder(folder: Path, question: str, entries: Iterable[Entry], scenario: str = SCENARIO) -> Path:
    """The folder of a sweep, written by hand."""
    folder.mkdir(exist_ok=True)
    (folder / "sweep.toml").write_text(question)
    (folder / "scenario.toml").write_text(scenario)
    (folder / "journal.jsonl").unlink(missing_ok=True)
    with Ledger(path=folder / "journal.jsonl") as ledger:
        for number, (point, seeds) in enumerate(entries):
            for seed in seeds:
                ledger.add(str(number), point, seed)
    return folder


def around(mean: float, se: float, n: int) -> list[float]:
    """An even number of values, or three, with this mean and standard error."""
    far = se * math.sqrt(n - 1) if n != 3 else se * math.sqrt(3.0)
    return [mean + far * side for side in ((-1, 0, 1) if n == 3 else (-1, 1) * (n // 2))]


def seeds_of(values: Mapping[str, Sequence[float]], failed: int = 0, n: int = 4) -> list[SeedValues]:
    """Seeds with these values of measures, the last ones without; `failed` more that have failed."""
    padded = {name: [*row, *[math.nan] * (n - failed - len(row))] for name, row in values.items()}
    seeds = [SeedValues(i, {name: row[i] for name, row in padded.items()}, 0.1) for i in range(n - failed)]
    return [*seeds, *(SeedValues(n - failed + i, {}, 0.1, "it broke") for i in range(failed))]


ENTRIES = [
    ({AMPLITUDE: 0.5}, seeds_of({SPEED: around(0.75, 0.02, 4), RISE: [0.5] * 4})),
    ({AMPLITUDE: 1.0}, seeds_of({SPEED: around(1.53, 0.05, 2), RISE: [0.5] * 3}, failed=1)),
    ({AMPLITUDE: 2.0}, seeds_of({SPEED: around(3.2, 0.1, 4), RISE: [0.5] * 4})),
]


@pytest.fixture
def sweep(tmp_path: Path) -> Path:
    """The folder of a sweep over one key."""
    return write_folder(tmp_path / "sweep", f'vary = ["{AMPLITUDE}=0.5,1,2,4"]\nseeds = 4\n', ENTRIES)


def test_page_of_a_sweep(sweep: Path, coarse: None) -> None:
    done = feeder_sim("report", sweep, "--json")
    assert done.returncode == 0, done.stderr
    made = json.loads(done.stdout)
    assert made["kind"] == "sweep" and made["pictures"] == 1  # the other measure is the same everywhere
    page = checked((sweep / "report.html").read_text(encoding="utf-8"))
    for expected in (
        "Sweep: <b>Nut</b>",
        "largest transport speed",
        "3.20 mm/s ± 0.32 (95 %), at amplitude 2 µm",
        "1 seed failed, at 1 of 4 points",
        "3 of 4 points are there: the sweep has not ended.",
        "--vary 'drive[0].amplitude_um=0.5,1,2,4' --seeds 4 --out repeated",
        "Transport speed (mm/s): at 1 of 3 points 1 of 4 seeds have no value",
    ):
        assert expected in page.text, expected
    assert "seeds are missing" not in page.text
    assert "<b>" not in (sweep / "report.html").read_text(encoding="utf-8")


def test_page_of_a_sweep_that_has_not_ended(tmp_path: Path, coarse: None) -> None:
    warned = [SeedValues(0, {SPEED: 1.0}, 0.1, warnings=("run.planar is true: no",)), *ENTRIES[0][1][1:]]
    question = f'vary = ["{AMPLITUDE}=0.5,1,2"]\nseeds = 6\n'
    folder = write_folder(tmp_path / "sweep", question, [(ENTRIES[0][0], warned), *ENTRIES[1:]])
    assert feeder_sim("report", folder).returncode == 0
    text = checked((folder / "report.html").read_text(encoding="utf-8")).text
    assert "6 seeds are missing, at 3 of 3 points: the sweep has not ended." in text
    assert "Run.planar is true: no (at 1 of 3 points)." in text


def test_a_folder_whose_sweep_has_no_seed_is_refused(sweep: Path) -> None:
    (sweep / "journal.jsonl").write_text("no entry\n")
    refused = feeder_sim("report", sweep)
    assert refused.returncode == 2 and "holds no seed of the sweep yet" in one_line(refused)
    assert not (sweep / "report.html").exists()


def rows_of(*values: float, n: int = 4) -> list[Mean]:
    """Means at points of one key, with a standard error of 1."""
    return [Mean({"contact.friction": 0.1 * i}, Statistic(value, 2.0, 1.0, n)) for i, value in enumerate(values)]


def test_a_few_far_values_do_not_take_all_colours() -> None:
    near = [float(i) for i in range(60)]
    assert colour_limits(rows_of(*near))[1:] == ((0.0, 59.0), "")
    _, (low, high), extend = colour_limits(rows_of(*near, 1e4))
    assert (low, high, extend) == (0.0, 59.0, "max")
    assert colour_limits(rows_of(0.0, 0.0, 0.0, 0.0, 7.0))[1:] == ((0.0, 7.0), "")
    assert colour_limits(rows_of(-1e4, *near, 1e4))[2] == "both"
    scale, limits, extend = colour_limits(rows_of(0.1, 1.0, 50.0))
    assert scale.__name__ == "LogNorm" and (limits, extend) == ((0.1, 50.0), "")


@pytest.mark.parametrize(("n", "height"), [(2, 0.0), (3, 8.6)])
def test_means_of_two_values_have_no_bars(n: int, height: float) -> None:
    axes = empty_figure(4.0, 3.0).add_subplot()
    draw_line(axes, rows_of(1.0, 2.0, n=n), "contact.friction", joined=True)
    bar = axes.containers[0].lines[2][0].get_segments()[0]
    assert bar[1, 1] - bar[0, 1] == pytest.approx(height, rel=1e-2)


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        ({AMPLITUDE: [1, 2], FRICTION: [0.1, 0.2]}, "bars are 95 % intervals"),
        ({AMPLITUDE: [*range(1, 9)], FRICTION: [0.1 * i for i in range(8)]}, "Half the 95 %"),
        ({SIZE: ["M2", "M2.5", "M3"]}, "bars are 95 % intervals"),
        ({AMPLITUDE: [1, 2], FRICTION: [0.1, 0.3], SIZE: ["M2", "M3"]}, "Every panel"),
    ],
)
def test_sweeps_over_more_keys_and_other_values(
    axes: dict[str, list[Any]], said: str, tmp_path: Path, coarse: None
) -> None:
    question = SweepQuestion.of(vary=axis_texts(axes), seeds=4)
    points = question.points(load_scenario(write_folder(tmp_path / "sweep", question.as_toml(), []) / "scenario.toml"))
    entries = [(point, seeds_of({SPEED: around(1.5 + 0.1 * i, 0.1, 4)})) for i, point in enumerate(points)]
    folder = write_folder(tmp_path / "sweep", question.as_toml(), entries)
    assert feeder_sim("report", folder, "--json").returncode == 0
    page = checked((folder / "report.html").read_text(encoding="utf-8"))
    assert len(page.all("img")) == 1 and said in page.text


def test_sweep_with_uncertain_inputs_counts_draws(tmp_path: Path, coarse: None) -> None:
    question = f'vary = ["{AMPLITUDE}=1,2"]\nseeds = 4\ninputs = 3\n'
    uncertain = f'{SCENARIO}uncertain = {{ "{FRICTION}" = {{ uniform = [0.2, 0.4] }} }}\n'
    folder = write_folder(tmp_path / "sweep", question, [], uncertain)
    draws = draws_of(load_scenario(folder / "scenario.toml"), 3)
    means = {1.0: (1.7, 2.0, 2.3), 2.0: (3.0, 3.0, 3.0)}  # of each draw; at the second point only seeds differ
    entries = [
        (
            {AMPLITUDE: amplitude, **draw},
            [SeedValues(n + 3 * i, {SPEED: means[amplitude][n] + far * (-1) ** i}, 0.1) for i in range(4)],
        )
        for amplitude, far in ((1.0, 0.05), (2.0, 0.3))
        for n, draw in enumerate(draws)
    ]
    folder = write_folder(tmp_path / "sweep", question, entries, uncertain)
    study: Any = open_study(folder)
    assert study.complete
    assert feeder_sim("report", folder).returncode == 0
    text = checked((folder / "report.html").read_text(encoding="utf-8")).text
    row = study.rows[0]
    mean, se = with_error(row.statistic.mean, row.statistic.se)
    over = f"{number(row.spread.inputs_low)} to {number(row.spread.inputs_high)} {number(row.spread.sd_inputs, 2)}"
    assert f"1 {mean} {se}" in text and f"{over} {number(row.spread.sd_seeds, 2)} 12 12 0" in text
    assert "The band is the 90 % interval over the inputs" in text and "--inputs 3" in text
    assert "not told apart from the seeds 0" in text and "At 1 of 2 points the inputs are not told" in text


def test_links_in_the_folder_of_a_sweep_are_refused(sweep: Path, tmp_path: Path) -> None:
    (sweep / "scenario.toml").rename(tmp_path / "secret.toml")
    (sweep / "scenario.toml").symlink_to(tmp_path / "secret.toml")
    refused = feeder_sim("report", sweep)
    assert refused.returncode == 2 and "is a link" in one_line(refused)
