"""Pages of runs and sweeps: whole, self-contained, escaped, with the numbers of the run."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import feeder_sim, one_line
from conftest import StopsAfter, strip_scenario
from pages import Checked, checked
from test_screenshot import drawn

from feeder_sim.document import figure
from feeder_sim.document.document import Document, Folded, Section, Table, Text
from feeder_sim.document.figure import Figure, Picture, empty_figure
from feeder_sim.document.words import key_words, number, split_unit, with_error
from feeder_sim.errors import Divergence, FeederSimError, SimulationDiverged
from feeder_sim.measures.statistic import Statistic, half_interval
from feeder_sim.plots.intervals import draw_over_time
from feeder_sim.pool.work import Work
from feeder_sim.records.files import locked
from feeder_sim.records.trajectory import Frames
from feeder_sim.report import run_pictures
from feeder_sim.report.document_of import document_of
from feeder_sim.report.measure_tables import interval_text, measure_blocks
from feeder_sim.report.run_report import run_document
from feeder_sim.run.guard import Guard
from feeder_sim.run.run_folder import record_run, resume_run
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.uncertain import Uncertain

TITLE = """<script>alert("x")</script> & 'so' \u202e\x1b[31m"""


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of few pixels: they take most of the time."""
    monkeypatch.setattr(figure, "PIXELS_PER_INCH", 40)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages of runs without pictures, where only words are looked at."""
    monkeypatch.setattr(Figure, "picture", property(lambda of: Picture(b"", (800, 400), of.alt, of.caption)))


def titled(title: str, **run: object) -> Scenario:
    return strip_scenario(**run).model_copy(update={"title": title})  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded") / "run"
    record_run(titled(TITLE, seeds=3, duration_s=0.3), folder, replay=False)
    return folder


def test_page_of_a_run_is_whole_and_escaped(recorded: Path, tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    done = feeder_sim("report", recorded, "--out", out, "--json", "--no-replay")
    assert done.returncode == 0, done.stderr
    made = json.loads(done.stdout)
    assert made["file"] == str(out) and made["bytes"] == out.stat().st_size and made["kind"] == "run"
    page = checked(out.read_text(encoding="utf-8"))
    assert len(page.all("img")) == made["pictures"] == 3  # plate, paths, distance over time
    shown = """<script>alert("x")</script> & 'so' \\u202e\\x1b[31m"""
    assert page.text.count(shown) >= 2  # heading and title; in the TOML its quotes are escaped
    assert "<script" not in out.read_text(encoding="utf-8")


def test_page_plays_the_replay_and_runs_nothing_else(recorded: Path, tmp_path: Path, coarse: None) -> None:
    done = feeder_sim("report", recorded, "--out", tmp_path / "page.html")
    assert done.returncode == 0, done.stderr
    page = Checked((tmp_path / "page.html").read_text(encoding="utf-8"))
    (frame,) = page.all("iframe")
    assert frame["sandbox"] == "allow-scripts" and frame["title"] == "Replay" and not page.all("script")
    (policy,) = [meta["content"] for meta in page.all("meta") if meta.get("http-equiv") == "Content-Security-Policy"]
    assert policy is not None and policy.startswith("default-src 'none'; ") and "http" not in policy
    scripts = re.findall(r"<script[^>]*>(.*?)</script>", frame["srcdoc"] or "", re.DOTALL)
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    assert len(hashes) == 2 and all(f"'sha256-{found}'" in policy for found in hashes)
    assert "'unsafe-inline'" not in policy.partition("script-src")[2]


def test_page_has_the_numbers_of_the_run(recorded: Path, undrawn: None) -> None:
    summary = json.loads((recorded / "summary.json").read_text())
    page = run_document(recorded)
    (table,) = [b for s in page.sections if s.title == "All measures" for b in s.blocks if isinstance(b, Table)]
    found = {row[0]: row[1:] for row in table.rows}
    drift = summary["drift_velocity_x_mm_s"]
    mean, se = with_error(drift["mean"], drift["se"])
    assert found["drift velocity x"] == ("mm/s", mean, se, interval_text(drift), "3")
    low, high = map(float, interval_text(drift).split(" to "))
    assert high - low == pytest.approx(2.0 * 4.303 * drift["se"], rel=0.05)  # t for two degrees of freedom
    text = checked(page.html()).text
    for expected in (
        *("4750", "hex_nut", "M2.5", "restitution", "duration 0.3 s", "3 ran to their end"),
        *(
            summary["libraries"]["numpy"],
            summary["libraries"]["feeder_sim"],
            f"feeder-sim run {recorded}/scenario.toml",
        ),
        (recorded / "scenario.toml").read_text().split("\n")[3].strip(),
    ):
        assert expected in text


def test_page_is_not_replaced_unasked(recorded: Path, tmp_path: Path, undrawn: None) -> None:
    out = tmp_path / "page.html"
    out.write_text("mine")
    again = feeder_sim("report", recorded, "--out", out)
    assert again.returncode == 2 and "exists already, --force replaces it" in one_line(again)
    assert out.read_text() == "mine"
    done = feeder_sim("report", recorded, "--out", out, "--force", "--no-replay")
    assert (done.returncode, done.stdout) == (0, f"{out}\n")
    checked(out.read_text(encoding="utf-8"))


def test_what_is_no_run_is_refused_in_one_line(recorded: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.h5").write_text("no run")
    for folder, out, said in (
        (tmp_path, "a.html", "is no run and no question of many runs, must be a folder that holds scene.h5"),
        (tmp_path, "a.html", "scene.h5, sweep.toml, uncertainty.toml, search.toml"),
        (tmp_path / "missing", "a.html", "missing: no such folder"),
        (tmp_path / "notes.h5", "a.html", "not a readable recording"),
        (recorded, "a.pdf", "is '.pdf', must be .html or .htm"),
        (recorded, "missing/a.html", "must be a file in a folder that exists"),
    ):
        refused = feeder_sim("report", folder, "--out", tmp_path / out)
        assert refused.returncode == 2 and said in one_line(refused)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.h5"]


def test_interrupted_run_says_so_and_can_go_on(tmp_path: Path, coarse: None) -> None:
    scenario = titled("short", seeds=3, duration_s=6.0)
    result = record_run(scenario, tmp_path / "run", work=Work(stop=StopsAfter(2)), replay=False)
    assert result.interrupted
    done = feeder_sim("report", tmp_path / "run", "--no-replay")
    assert done.returncode == 0, done.stderr
    text = checked((tmp_path / "run/report.html").read_text(encoding="utf-8")).text
    assert "The run was interrupted: 0 of 3 seeds have ended." in text
    assert f"feeder-sim resume {tmp_path / 'run'}" in text
    with locked(tmp_path / "run"):
        assert "The run is still going on: 0 of 3" in checked(run_document(tmp_path / "run").html()).text
    assert not resume_run(tmp_path / "run", replay=False).interrupted  # the page in its folder does no harm


def test_run_that_was_killed_before_its_summary_has_a_page(recorded: Path, tmp_path: Path, undrawn: None) -> None:
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    (tmp_path / "summary.json").unlink()
    text = checked(run_document(tmp_path).html()).text
    assert "3 ran to their end" in text and "interrupted" not in text


def test_failed_seeds_are_named_and_do_not_count(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, undrawn: None
) -> None:
    check = Guard.check

    def spoilt(self: Guard, frames: Frames, seed: int) -> tuple[int, SimulationDiverged | None]:
        if seed != 1:
            return check(self, frames, seed)
        failure = SimulationDiverged(Divergence.TOO_DEEP, time_s=0.01, part="<b>", seed=1, detail="spoilt <i>")
        return len(frames) // 2, failure

    monkeypatch.setattr(Guard, "check", spoilt)
    result = record_run(titled("failed", seeds=3, duration_s=0.3), tmp_path / "run", replay=False)
    assert len(result.failures) == 1
    done = feeder_sim("report", tmp_path / "run", "--no-replay")
    assert done.returncode == 0, done.stderr
    text = checked((tmp_path / "run/report.html").read_text(encoding="utf-8")).text
    assert "1 of 3 seeds failed" in text and "2 ran to their end, 1 stopped" in text
    assert str(result.failures[0])[1:] in text


def test_page_without_a_graphics_driver_says_why(
    recorded: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None
) -> None:
    def no_driver(*_: object, **__: object) -> None:
        raise FeederSimError("the rerun viewer drew no picture")

    monkeypatch.setattr(run_pictures, "take_screenshot", no_driver)
    said: list[str] = []
    page = run_document(recorded, with_screenshot=True, notify=said.append)
    assert said == ["no picture of the replay: the rerun viewer drew no picture"]
    assert "No picture of the replay could be drawn" in checked(page.html()).text


@drawn
@pytest.mark.slow
def test_picture_of_the_replay_is_embedded(recorded: Path, tmp_path: Path) -> None:
    done = feeder_sim("report", recorded, "--out", tmp_path / "page.html", "--screenshot", "--no-replay")
    assert done.returncode == 0 and done.stderr == ""
    images = checked((tmp_path / "page.html").read_text(encoding="utf-8")).all("img")
    assert sum((image["src"] or "").startswith("data:image/jpeg") for image in images) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "cut", "expected"),
    [
        (
            "separation_100",
            ("cycles = 10", "cycles = 2"),
            ("parts from cycle to cycle", "picks per minute", "isolated"),
        ),
        ("mixture", ("cycles = 10", "cycles = 2"), ("bracket", "pose kinds", "where the time goes")),
        ("transport_strip", ("duration_s = 60.0", "duration_s = 3.0"), ("the way of the parts", "to -44 mm")),
        ("ball_500hz", ("duration_s = 2.0", "duration_s = 1.0"), ("flights of the part", "bounce interval")),
        ("wave_gather", ("duration_s = 24.0", "duration_s = 2.0"), ("waves, one by one", "circulation")),
    ],
)
def test_pages_of_all_kinds_of_runs(
    name: str, cut: tuple[str, str], expected: tuple[str, ...], tmp_path: Path, repository: Path
) -> None:
    text = (repository / f"scenarios/{name}.toml").read_text().replace(*cut)
    (tmp_path / "a.toml").write_text(text.replace("../models", str(repository / "models")))
    assert feeder_sim("run", tmp_path / "a.toml", "--seeds", 2, "--out", tmp_path / "run").returncode == 0
    assert feeder_sim("report", tmp_path / "run", "--no-replay").returncode == 0
    page = checked((tmp_path / "run/report.html").read_text(encoding="utf-8"))
    assert len(page.all("img")) >= 1
    for words in expected:
        assert words in page.text.lower()
    assert feeder_sim("replay", tmp_path / "run", "--html", tmp_path / "replay.html").returncode == 0


def test_long_schedules_do_not_make_the_page_too_large() -> None:
    stage = {name: Statistic(1.0, 0.1, 0.05, 4).as_dict() for name in "abcdefgh"}
    (folded,) = [b for b in measure_blocks({"stages": [stage] * 5000}) if isinstance(b, Folded)]
    table, note = folded.blocks
    assert isinstance(table, Table) and len(table.rows) == 200
    assert isinstance(note, Text) and note.text.startswith("4800 more are not listed here")


def test_uncertain_inputs_of_a_run_are_said(tmp_path: Path, undrawn: None) -> None:
    uncertain = {"contact.restitution": Uncertain(uniform=(0.1, 0.3))}
    scenario = titled("unsure").model_copy(update={"uncertain": uncertain})
    record_run(scenario, tmp_path / "run", replay=False)
    text = checked(run_document(tmp_path / "run").html()).text
    assert (
        "uncertain inputs, which have the values of the scenario here" in text.lower()
        and "uncertain contact.restitution uniform 0.1, 0.3" in text
    )


def test_everything_in_a_page_is_escaped() -> None:
    bad = "</td><script>alert(1)</script>\x00\u202e"
    table = Table(bad, (bad, bad), ((bad, bad),))
    page = Document(bad, bad, (), (Text(bad, "warning"),), (Section(bad, (Text(bad, "code"), table)),), bad)
    text = page.html()
    assert "<script" not in text and "\x00" not in text and "\u202e" not in text
    assert checked(text).text.count("</td><script>alert(1)</script>\\x00\\u202e") == 12


@pytest.mark.parametrize(
    ("key", "words", "unit"),
    [
        ("transport_speed_mm_s", "transport speed", "mm/s"),
        ("frames_per_second", "frames per second", ""),
        ("duration_s", "duration", "s"),
        ("ring_up", "ring up", ""),
        ("amplitude_um_per_vpp", "amplitude", "µm per V peak to peak"),
        ("stiffness_n_per_mm", "stiffness", "N/mm"),
        ("circular_conveying_deg_s", "circular conveying", "degrees/s"),
        ("tolerance_nm", "tolerance", "nm"),
        ("turn_mrad", "turn", "mrad"),
    ],
)
def test_units_are_read_from_keys(key: str, words: str, unit: str) -> None:
    assert split_unit(key) == (words, unit)


def test_numbers_have_as_many_digits_as_their_error() -> None:
    assert with_error(1.53456, 0.0149) == ("1.535", "0.015")
    assert with_error(126.4, 4.87) == ("126.4", "4.9")
    assert with_error(1234.5, 120.0) == ("1234", "120")
    assert with_error(3.0, 0.0) == ("3", "0") and with_error(3.25, float("nan")) == ("3.25", "")
    assert [number(x) for x in (12345.6, 0.000123456, 100.0, float("nan"))] == ["12346", "0.0001235", "100", ""]


def test_interval_is_that_of_student() -> None:
    assert half_interval(1.0, 12) == pytest.approx(2.200985, rel=1e-6)
    assert half_interval(0.5, 2) == pytest.approx(6.353102, rel=1e-6)
    assert np.isnan(half_interval(1.0, 1))
    assert interval_text(Statistic(2.0, 0.0, 0.0, 4).as_dict()) == "all alike"


def test_axes_are_labelled_in_words() -> None:
    assert key_words("drive[0].amplitude_um") == "amplitude of drive 0 (µm)"
    assert key_words("schedule.stage[1].drive[0].frequency_hz") == "frequency of drive 0 of stage 1 (Hz)"
    assert key_words("part[0].start.position_mm[1]") == "position 1 of start of part 0 (mm)"
    assert key_words("contact.friction") == "friction of contact"


def test_mean_over_time_ends_with_the_first_seed_that_counts() -> None:
    def seed(n: int, slope: float) -> Frames:
        time = np.arange(n) / 10.0
        position = np.zeros((n, 1, 3))
        position[:, 0, 0] = slope * time
        zero = np.zeros((n, 1, 3))
        return Frames(time, position, np.zeros((n, 1, 4)), zero, zero, np.ones((n, 1), bool))

    axes = empty_figure(4.0, 3.0).add_subplot()
    seeds = [seed(31, 1.0), seed(51, 2.0), seed(11, 9.0)]
    draw_over_time(axes, seeds, lambda frames: frames.position[:, 0, 0], counted=[True, True, False])
    (mean,) = [line for line in axes.lines if str(line.get_label()).startswith("mean of 2 seeds")]
    assert mean.get_xdata()[-1] == pytest.approx(3.0)
    assert mean.get_ydata() == pytest.approx(1.5 * mean.get_xdata())
    assert len(axes.lines) == 5 and axes.lines[2].get_linestyle() == "--"


def test_a_document_is_text_for_a_terminal_and_html_for_a_notebook(recorded: Path) -> None:
    printed = feeder_sim("report", recorded, "--text")
    assert printed.returncode == 0 and not (recorded / "report.html").exists()
    document = document_of(recorded)
    assert (
        "\x1b" not in printed.stdout and "All measures" in printed.stdout and "drift velocity x  mm/s" in printed.stdout
    )
    assert document.text().splitlines()[:-1] == printed.stdout.splitlines()[:-1]  # the last line has the time
    shown = document._repr_html_()
    assert "<script" not in shown and "<html" not in shown and shown.count("<table>") > 3 and "<img" in shown
