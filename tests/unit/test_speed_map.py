"""The map of the transport speed over frequency and amplitude: its points, its journal, and what it refuses."""

from __future__ import annotations

import json
import math
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, refusal
from pretended import Pretended, asked
from speeds import MAP, of_map

from feeder_sim.errors import InputError
from feeder_sim.measures.statistic import LARGEST_OF_MANY
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import workers_of
from feeder_sim.run.batch import measure_drift
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Scenario, Start, load_scenario
from feeder_sim.studies.speed_map import (
    MapPoint,
    MapQuestion,
    SpeedMap,
    at_point,
    check_mapped,
    mark_of,
    throw_number,
    values_of,
)

SCENARIO = REPOSITORY / "scenarios/drift_4750hz.toml"


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario(SCENARIO)


def test_a_point_starts_at_the_same_fraction_of_the_way(scenario: Scenario) -> None:
    old = prepare(scenario).cell
    for frequency, amplitude in ((2000.0, 3.0), (9000.0, 0.4)):
        point = at_point(scenario, frequency, amplitude, 3)
        new = prepare(point).cell
        assert old is not None and new is not None
        start = point.part[0].start
        assert isinstance(start, Start)
        assert start.position_mm[0] / new.reach == pytest.approx(1.95 / old.reach, rel=1e-3)
        assert point.run.seeds == 3
        longer = new.reach / old.reach
        expected = 30.0 * longer**2 * 4750.0 / (frequency * amplitude)
        assert point.run.duration_s == pytest.approx(expected, rel=2e-3)
    assert at_point(scenario, 4750.0, 1.0, 12) == scenario


def test_lists_of_values() -> None:
    assert values_of("1:3:5", "frequencies_hz") == [1.0, 1.5, 2.0, 2.5, 3.0]
    assert values_of("1:100:log3", "frequencies_hz") == [1.0, 10.0, 100.0]
    assert values_of("5,2", "frequencies_hz") == [2.0, 5.0]
    assert mark_of("4750,1.0,1.44") == (4750.0, 1.0, 1.44)


@pytest.mark.parametrize("text", ["", "a", "1:2", "2:1:3", "0:1:3", "1:2:2000", "1:inf:3", "nan", "1,1", "-1,2"])
def test_lists_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^amplitudes_um: "):
        values_of(text, "amplitudes_um")
    with pytest.raises(InputError, match=r"mark: is .*, must be a mark of three numbers"):
        mark_of(text)


def test_what_cannot_be_mapped_is_refused(scenario: Scenario, tmp_path: Path) -> None:
    for changes, said in (
        ({"run.stop": "time"}, "run.stop: "),
        ({"drive[0].amplitude_um": 0.0}, "drive[0].amplitude_um: "),
        ({"part[0].start": {"kind": "scattered"}, "run.stop": "time"}, "part[0].start.kind: "),
    ):
        assert said in refusal(check_mapped, scenario.changed(changes))
    for arguments, said in (
        ("scenarios/separation_100.toml", "separation_100.toml: plate.kind: "),
        (f"{SCENARIO} --frequency 1000:1e7:3", "drive[0].frequency_hz: is 1e+07"),
        (f"{SCENARIO} --amplitude 1:0:4", "--amplitude: is 1:0"),
        (f"{SCENARIO} --mark 1,2", "--mark: is '1,2'"),
        (f"{SCENARIO} --out {REPOSITORY}", "--out: holds "),
    ):
        check_refused(feeder_sim("map", "--out", tmp_path / "map", *arguments.split(), cwd=REPOSITORY), said)


def test_points_where_nothing_moves_are_given_up_after_a_probe(scenario: Scenario) -> None:
    slow = MapQuestion(frequencies_hz="2000", amplitudes_um="0.5,0.61", seeds=4)
    assert all(throw_number(*point) < 10.0 for point in slow.points)
    executor = Pretended(of_map)
    still, moving = asked(slow, scenario, executor).points
    assert (still.seeds, still.n) == (2, 0) and moving.seeds == 4 and executor.count == 2 + 2 + 4


def test_an_interrupted_map_has_a_table_and_a_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C keeps what there is."""

    class Interrupted(Pretended):
        asked = False

        def submit(self, function: Any, task: Any, /, *_: Any) -> Any:  # type: ignore[override]
            if self.count >= 8 and not self.asked:
                self.asked = True
                signal.raise_signal(signal.SIGINT)
            return super().submit(function, task)

    out, points = tmp_path / "m", 0
    for _ in range(2):
        executor = Interrupted(of_map)
        monkeypatch.setattr("feeder_sim.studies.ask.workers_of", lambda _, on=executor: workers_of(Work(1, on)))
        done = feeder_sim(
            *("map", SCENARIO, "--frequency", "4000,5000,6000", "--amplitude", "1:6:14", "--seeds", 1, "--out", out)
        )
        assert done.returncode == 130 and "the same command goes on" in done.stderr
        before, points = points, len((out / "map.csv").read_text().splitlines())
        assert points > before
        (out / "map.png").unlink()
    page = feeder_sim("report", out)
    assert page.returncode == 0 and "not complete" in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("command", [pytest.param("map", marks=pytest.mark.slow), "drift-map"])
def test_uncertain_inputs_that_are_not_drawn_are_said(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any, **__: Any) -> Any:
        raise InputError("refused here")

    monkeypatch.setattr("feeder_sim.studies.ask.workers_of", lambda _: workers_of(Work(1, Pretended(of_map))))
    monkeypatch.setattr("feeder_sim.studies.drift_map.making.make_map", refused)
    friction = "contact.friction = { uniform = [0.2, 0.4] }"
    (tmp_path / "u.toml").write_text(f"{SCENARIO.read_text()}\n[uncertain]\n{friction}\n")
    done = feeder_sim(command, str(tmp_path / "u.toml"), "--out", str(tmp_path / "made.npz"))
    assert "feeder-sim: warning: contact.friction: uncertain inputs, which have the values of the" in done.stderr
    assert feeder_sim(command, str(SCENARIO), "--out", str(tmp_path / "known.npz")).stderr.count("warning") == 0


def point(mean: float, n: int, seeds: int = 12, se: float = 0.1) -> MapPoint:
    return MapPoint(5000.0, 10.0 * mean, 1.0, mean, se, n, 0, seeds)


def test_the_fastest_point_is_one_where_most_parts_arrive(scenario: Scenario) -> None:
    """The mean of a few survivors is no speed of the part."""
    slow, few, none = point(2.0, 6), point(9.0, 5), point(math.nan, 0, 2, math.nan)
    found = SpeedMap(MAP, scenario, (none, few, slow), complete=True)
    assert found.fastest == slow and replace(found, points=(none, few)).fastest is None
    told = "\n".join(found.lines())
    assert "2.000 +- 0.100 mm/s at 5000 Hz, 20 um, n = 6 of 12" in told and LARGEST_OF_MANY in told
    assert any("fastest: not told" in line for line in replace(found, points=(few,)).lines())
    told = "\n".join(replace(found, points=(point(1.0, 1, 1, math.nan),)).lines())
    assert "1.000 mm/s at" in told and "nan" not in told and LARGEST_OF_MANY not in told


@pytest.mark.slow
def test_a_map_is_what_the_scenario_gives_at_each_of_its_points(tmp_path: Path) -> None:
    """And where nothing moves, two seeds are run and none arrives."""
    folder = tmp_path / "map"
    line = ["map", str(SCENARIO), "--frequency", "2000,8775", "--amplitude", "0.065,1", "--seeds", "4"]
    done = feeder_sim(*line, "--mark", "8775,1,4.17", "--out", str(folder), "--json")
    assert done.returncode == 0, done.stderr
    points = {(p["frequency_hz"], p["amplitude_um"]): p for p in json.loads(done.stdout)["points"]}
    still = points[2000.0, 0.065]
    assert still["throw_number"] < 1.1 and still["n"] == 0 and still["seeds"] == 2 and still["mean"] is None
    drift = points[8775.0, 1.0]
    assert drift["n"] == drift["seeds"] == 4
    (one,) = measure_drift([at_point(load_scenario(SCENARIO), 8775.0, 1.0, 4)])
    assert drift["mean"] == one.findings.transport_speed_mm_s.mean
    assert drift["mean"] == pytest.approx(4.0, rel=0.15)
    assert (folder / "map.png").stat().st_size > 10_000
    assert (
        (folder / "map.csv").read_text().startswith("frequency_hz,amplitude_um,throw_number,mean,se,n,failed,seeds\n")
    )
    assert feeder_sim(*line, "--out", str(folder)).returncode == 0  # all of it from the journal
