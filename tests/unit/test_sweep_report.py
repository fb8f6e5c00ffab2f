"""Pages of sweeps, from tables that are written by hand."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import feeder_sim, one_line
from pages import checked

from feeder_sim.document import figure
from feeder_sim.document.figure import empty_figure
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plots.sweep import Mean, colour_limits, draw_line

SWEEP = Path(__file__).parent / "sweep_by_hand"


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of few pixels: they take most of the time."""
    monkeypatch.setattr(figure, "PIXELS_PER_INCH", 40)


@pytest.fixture
def sweep(tmp_path: Path) -> Path:
    """The folder of a sweep over one key, written by hand."""
    folder = tmp_path / "sweep"
    folder.mkdir()
    for file in SWEEP.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    return folder


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
        "1 seeds failed, at 1 of 3 points",
        "3 of 4 points are there: the sweep has not ended.",
        "--vary 'drive[0].amplitude_um=0.5,1,2,4' --seeds 4 --out repeated",
        "Transport speed (mm/s): at 1 of 3 points 1 of 4 seeds have no value",
    ):
        assert expected in page.text
    assert "seeds are missing" not in page.text
    assert "<b>" not in (sweep / "report.html").read_text(encoding="utf-8")


def test_page_of_a_sweep_that_has_not_ended(sweep: Path, coarse: None) -> None:
    warning = {"warning": "run.planar is true: no", "at": 1, "of": 3, "numbers_differ": False}
    state = {"complete": False, "missing_seeds": 9, "points_short_of_se": 2, "warnings": [warning]}
    (sweep / "sweep.json").write_text(json.dumps(state))
    question = (sweep / "sweep.toml").read_text().replace("seeds = 4", "seeds = 6").replace(",4", "")
    (sweep / "sweep.toml").write_text(question)
    assert feeder_sim("report", sweep).returncode == 0
    text = checked((sweep / "report.html").read_text(encoding="utf-8")).text
    assert "6 seeds are missing, at 3 of 3 points: the sweep has not ended." in text
    assert "2 of 3 points have as many seeds as --most-seeds allows, 1000" in text
    assert "Run.planar is true: no (at 1 of 3 points)." in text
    (sweep / "sweep.toml").write_text(question.replace("seeds = 6", "seeds = 4"))
    assert feeder_sim("report", sweep, "--force").returncode == 0
    text = checked((sweep / "report.html").read_text(encoding="utf-8")).text
    assert "seeds are missing" not in text and "More seeds are to be run: the sweep has not ended." in text
    (sweep / "sweep.json").write_text("[]")
    refused = feeder_sim("report", sweep, "--force")
    assert refused.returncode == 2 and "holds no state of a sweep" in one_line(refused)


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
    ("keys", "points", "said"),
    [
        ("drive[0].amplitude_um,contact.friction", ["1,0.1", "1,0.2", "2,0.1", "2,0.2"], "bars are 95 % intervals"),
        ("drive[0].amplitude_um,contact.friction", [f"{a},{b}" for a in range(8) for b in range(8)], "Half the 95 %"),
        ("part[0].size", ["M2", "M2.5", "M3"], "bars are 95 % intervals"),
        ("drive[0].amplitude_um,contact.friction,part[0].size", ["1,0.1,M2", "2,0.3,M3", "3,0.2,M2"], "Every panel"),
    ],
)
def test_sweeps_over_more_keys_and_other_values(
    keys: str, points: list[str], said: str, sweep: Path, coarse: None
) -> None:
    values = [f"{p},speed_mm_s,{1.5 + 0.1 * i},0.1,4,4,0" for i, p in enumerate(points)]
    (sweep / "sweep.csv").write_text("\n".join([f"{keys},measure,mean,se,n,seeds,failed", *values]))
    assert feeder_sim("report", sweep, "--json").returncode == 0
    page = checked((sweep / "report.html").read_text(encoding="utf-8"))
    assert len(page.all("img")) == 1 and said in page.text


def test_sweep_with_uncertain_inputs_counts_draws(sweep: Path, coarse: None) -> None:
    asked = (sweep / "sweep.toml").read_text()
    (sweep / "sweep.toml").write_text(f"{asked}inputs = 3\n")
    columns = "drive[0].amplitude_um,measure,mean,se,n,seeds,failed,low,high,sd_inputs,sd_seeds"
    rows = ["1,speed_mm_s,2.0,0.1,12,12,0,1.5,2.6,0.3,0.05", "2,speed_mm_s,3.0,,12,12,0,,,,"]
    rows.append("4,speed_mm_s,4.0,0.1,12,12,0,,,0.0,0.3")
    (sweep / "sweep.csv").write_text("\n".join([columns, *rows]))
    assert feeder_sim("report", sweep).returncode == 0
    text = checked((sweep / "report.html").read_text(encoding="utf-8")).text
    assert "1 2.00 0.10 1.57 to 2.43 1.5 to 2.6 0.3 0.05 12 12 0" in text  # t for two degrees of freedom, 3 draws
    assert "The band is the 90 % interval over the inputs" in text and "--inputs 3" in text
    assert "not told apart from the seeds 0 0.3 12 12 0" in text and "At 1 of 3 points the inputs are not told" in text


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("", "must be a column per varied key"),
        ("a,b,c\n1,2,3\n", "has the columns 'a, b, c', must be a column per varied key"),
        ("a,measure,mean,se,n,seeds,failed\n", "holds no point"),
        ("a,measure,mean,se,n,seeds,failed\n1,speed,fast,,3,3,0\n", "line 2 is ['1', 'speed', 'fast'"),
        ("a,measure,mean,se,n,seeds,failed\n1,speed,2.0\n", "line 2 is ['1', 'speed', '2.0'"),
        (f"a,measure,mean,se,n,seeds,failed\n{'1' * 200_000},speed,2.0,0.1,3,3,0\n", "is no table: field larger"),
    ],
)
def test_damaged_table_of_a_sweep_is_refused(table: str, said: str, sweep: Path) -> None:
    (sweep / "sweep.csv").write_text(table)
    refused = feeder_sim("report", sweep)
    assert refused.returncode == 2 and said in one_line(refused)
    assert not (sweep / "report.html").exists()


def test_links_in_the_folder_of_a_sweep_are_refused(sweep: Path, tmp_path: Path) -> None:
    (sweep / "scenario.toml").rename(tmp_path / "secret.toml")
    (sweep / "scenario.toml").symlink_to(tmp_path / "secret.toml")
    refused = feeder_sim("report", sweep)
    assert refused.returncode == 2 and "is a link" in one_line(refused)
