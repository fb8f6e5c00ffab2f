"""A chart of a scenario: settings that suit it, a reference that checks itself, verdicts, what it recommends."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, strip_scenario
from pretended import Pretended, asked

from feeder_sim import InputError, chart, load_scenario, open_study
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.studies.ask import merged
from feeder_sim.studies.chart.chart import Chart, ChartQuestion
from feeder_sim.studies.chart.settings import METHODS, is_default, settings_of

SPEED = "transport_speed_mm_s"
NOISE = (-0.01, 0.0, 0.01, 0.0)  # of the seeds


def off(scenario: Scenario) -> float:
    """An error that falls with the step, or with the tolerance, as one of first order does."""
    if not scenario.run.in_plane_velocity:
        return -3.0
    if scenario.run.engine == "mujoco":
        return 8.0 / scenario.run.steps
    exact = choose_engine(scenario).method == "exact"
    return 0.01 * scenario.tolerance if exact else 4.0 / scenario.run.steps


def values(scenario: Scenario, seed: int) -> dict[str, float] | str:
    return {SPEED: 4.0 + off(scenario) + NOISE[seed % 4], "other": 1.0}


def charted(scenario: Scenario, folder: Path | None = None, **given: object) -> Chart:
    found = asked(ChartQuestion.of(**given), scenario, Pretended(values), folder)
    assert isinstance(found, Chart)
    return found


def by_name(found: Chart) -> dict[str, str]:
    return {row.setting: row.verdict for row in found.rows}


def test_verdicts_and_the_reference() -> None:
    found = charted(strip_scenario(seeds=8))
    verdicts = by_name(found)
    assert found.name == SPEED and found.holds
    assert [row.setting for row in found.rows if row.reference] == ["no step, 0.01 nm"]
    assert [row.setting for row in found.rows if row.default] == ["no step, 0.1 nm"]
    assert verdicts["no step, 0.1 nm"] == verdicts["160 steps"] == "good"
    assert verdicts["no in-plane velocity"] == "off"
    assert found.recommended is not None and found.recommended.default  # costs are alike
    assert not any(row.method == "mujoco" for row in found.rows)


def test_a_reference_that_moves_is_told() -> None:
    found = charted(strip_scenario(seeds=8), method=["steps"], within=0.001)
    assert found.holds is False and any("still moves" in remark.text for remark in found.remarks())


def test_a_known_value_takes_the_place_of_the_reference() -> None:
    found = charted(strip_scenario(seeds=8), known=4.0, measure=SPEED)
    assert found.holds is None and not any(row.reference for row in found.rows)
    (row,) = (row for row in found.rows if row.setting == "20 steps")
    assert row.error == pytest.approx(0.2) and row.error_se == pytest.approx(row.se)


def test_where_seeds_cannot_tell_nothing_is_recommended() -> None:
    found = asked(
        ChartQuestion.of(within=0.01),
        strip_scenario(seeds=4),
        Pretended(lambda scenario, seed: {SPEED: 4.0 + 0.5 * (-1) ** seed}),
    )
    assert {row.verdict for row in found.rows} == {"unclear"} and found.recommended is None
    assert "more seeds" in found.lines()[-1]


def test_a_mean_of_few_that_arrive_is_none() -> None:
    def few(scenario: Scenario, seed: int) -> dict[str, float]:
        return {SPEED: 4.0 if seed < 2 or scenario.run.in_plane_velocity else math.nan}

    found = asked(ChartQuestion.of(), strip_scenario(seeds=8), Pretended(few))
    assert by_name(found)["no in-plane velocity"] == "fails" and "nan" not in "".join(found.lines())


def test_settings_that_fail() -> None:
    def broken(scenario: Scenario, seed: int) -> dict[str, float] | str:
        return "exploded" if scenario.run.steps_per_period == 20 else values(scenario, seed)

    found = asked(ChartQuestion.of(), strip_scenario(seeds=4), Pretended(broken))
    assert by_name(found)["20 steps"] == "fails" and found.failures == ["at setting = 20 steps: exploded"]


@pytest.mark.parametrize(
    "name", ["drift_4750hz", "ball_50hz", "separation_100", "cylinder_558hz", "dimer", "chladni_plate"]
)
def test_settings_suit_any_scenario(name: str) -> None:
    """Each can be prepared, and one of them is the scenario as it is."""
    scenario = load_scenario(REPOSITORY / f"scenarios/{name}.toml")
    settings, left_out = settings_of(scenario, METHODS, Path(name))
    names = [setting.name for setting in settings]
    assert (
        len(settings) >= 3
        and sum(is_default(scenario, each, Path(name)) for each in settings) == 1
        and len(set(names)) == len(names)
    )
    assert all(": " in line for line in left_out)


def test_the_folder_is_the_chart_it_was(tmp_path: Path) -> None:
    scenario = strip_scenario(seeds=4)
    found = charted(scenario, tmp_path / "c")
    opened = open_study(tmp_path / "c")
    assert isinstance(opened, Chart) and opened.table() == found.table() and opened.as_json() == found.as_json()
    assert (tmp_path / "c/chart.png").is_file()
    assert feeder_sim("report", tmp_path / "c").returncode == 0
    assert "no step, 0.01 nm" in (tmp_path / "c/report.html").read_text(encoding="utf-8")
    more = charted(scenario, tmp_path / "c", seeds=8, method=["steps"])  # goes on in the same folder
    assert {row.seeds for row in more.rows if row.method == "steps"} == {8, 32}  # the reference has more
    assert math.isfinite(found.rows[0].cost) and opened.plot().get_ylabel().endswith("(%)")


def test_tasks_of_a_job_array_come_to_the_same_chart(tmp_path: Path) -> None:
    scenario, question, folder = strip_scenario(seeds=4), ChartQuestion.of(), tmp_path / "c"
    for number in (1, 2, 3):
        asked(question, scenario, Pretended(values), folder, share=(number, 3))
    assert merged(folder).table() == charted(scenario).table()


def test_wrong_measures_and_methods(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="measure: is 'speed', must be"):
        charted(strip_scenario(seeds=4), measure="speed")
    with pytest.raises(InputError, match="method"):
        chart(strip_scenario(), method="runge-kutta")
    check_refused(feeder_sim("chart", "drift_4750hz", "--within", "2", cwd=tmp_path), "within")


@pytest.mark.slow
def test_chart_command(tmp_path: Path) -> None:
    """Real seeds: the default is good on a drift, and without in-plane velocity it is lost."""
    done = feeder_sim("chart", "drift_8775hz", "--seeds", "16", "--out", tmp_path / "c", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = open_study(tmp_path / "c")
    assert isinstance(found, Chart) and found.holds
    verdicts = by_name(found)
    assert verdicts["no in-plane velocity"] == "off" and verdicts["no step, 0.1 nm"] in ("good", "unclear")
