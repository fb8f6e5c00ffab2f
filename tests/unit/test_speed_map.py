"""The map of the transport speed over frequency and amplitude: its points, its journal, and what it refuses."""

from __future__ import annotations

import json
import math
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from command_line import feeder_sim
from conftest import REPOSITORY

from feeder_sim.cli.map import _print, mark_of
from feeder_sim.errors import InputError
from feeder_sim.measures.statistic import LARGEST_OF_MANY
from feeder_sim.run.batch import measure_drift
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Scenario, Start, load_scenario
from feeder_sim.studies import speed_map as studied
from feeder_sim.studies.map_folder import values_of
from feeder_sim.studies.speed_map import MapPoint, at_point, fastest_of, speed_map, throw_number

SCENARIO = REPOSITORY / "scenarios/drift_4750hz.toml"
FREQUENCIES, AMPLITUDES = (4000.0, 5000.0, 6000.0), (0.5, 1.0, 2.0, 4.0, 5.0, 6.0)


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


@pytest.mark.parametrize(
    "text", ["", "a", "1:2", "2:1:3", "0:1:3", "1:2:1", "1:2:2000", "1:inf:3", "nan", "1,1", "-1,2", "1:2:3:4"]
)
def test_lists_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^amplitudes_um: "):
        values_of(text, "amplitudes_um")
    with pytest.raises(InputError, match=r"--mark: is .*, allowed are three numbers"):
        mark_of(text)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"run.stop": "time"}, 'run.stop: is "time", allowed is "passage" for a map'),
        ({"drive[0].amplitude_um": 0.0}, "drive\\[0\\].amplitude_um: is 0"),
        ({"part[0].start": {"kind": "scattered"}, "run.stop": "time"}, "part\\[0\\].start.kind"),
    ],
)
def test_scenarios_that_cannot_be_mapped_are_refused(scenario: Scenario, changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        speed_map(scenario.changed(changes), FREQUENCIES, AMPLITUDES)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["scenarios/separation_100.toml"], 'separation_100.toml: plate.kind: is "rectangle", allowed is "strip"'),
        ([str(SCENARIO), "--frequency", "1000:1e7:3"], "drive[0].frequency_hz: is 1e+07, bending waves of this plate"),
        ([str(SCENARIO), "--amplitude", "1:0:4"], "--amplitude: is 1:0, allowed is LOW:HIGH with LOW below HIGH"),
        ([str(SCENARIO), "--mark", "1,2"], "--mark: is '1,2', allowed are three numbers"),
        ([str(SCENARIO), "--out", "."], "--out: holds "),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], said: str, tmp_path: Path) -> None:
    out = [] if "--out" in arguments else ["--out", str(tmp_path / "map")]
    done = feeder_sim("map", *arguments, *out)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1


def made_up(scenario: Scenario, batch: list[tuple[float, float]], seeds: int, **_: Any) -> Iterator[MapPoint]:
    for f, a in batch:
        none = a < 1.0
        yield MapPoint(f, a, throw_number(f, a), math.nan if none else a, math.nan, 0 if none else 1, 0, seeds)


def test_done_points_are_kept(scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A map that is killed within a line of its journal goes on, and ends with the same points."""
    batches: list[int] = []

    def counted(scenario: Scenario, batch: list[tuple[float, float]], seeds: int, **how: Any) -> Iterator[MapPoint]:
        batches.append(len(batch))
        return made_up(scenario, batch, seeds)

    monkeypatch.setattr(studied, "_measured", counted)
    journal = tmp_path / "journal.jsonl"
    whole = speed_map(scenario, FREQUENCIES, AMPLITUDES, seeds=2, journal=journal)
    n = len(FREQUENCIES) * len(AMPLITUDES)
    assert [(p.frequency_hz, p.amplitude_um) for p in whole] == [(f, a) for f in FREQUENCIES for a in AMPLITUDES]
    assert sum(batches) == n
    lines = journal.read_text().splitlines(keepends=True)
    assert len(lines) == n
    journal.write_text("".join(lines[:8]) + lines[8][:20])
    again = speed_map(scenario, FREQUENCIES, AMPLITUDES, seeds=2, journal=journal)
    assert sum(batches) == n + n - 8
    assert str(again) == str(whole)  # NaN is no equal of itself
    speed_map(scenario, FREQUENCIES, AMPLITUDES, seeds=3, journal=journal)
    assert sum(batches) == 3 * n - 8  # points of two seeds are others


def test_an_interrupted_map_has_a_table_and_a_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C keeps what there is once a first ensemble is done, and from the start where points were done before."""
    ensembles = iter((1, 0))

    def interrupted(
        scenario: Scenario, batch: list[tuple[float, float]], seeds: int, *, progress: Any, **_: Any
    ) -> Iterator[MapPoint]:
        for n in range(next(ensembles)):
            progress(n + 1)
        signal.raise_signal(signal.SIGINT)
        yield from made_up(scenario, batch[:4], seeds)

    monkeypatch.setattr(studied, "_measured", interrupted)
    out = tmp_path / "m"
    for points in (4, 8):
        done = feeder_sim("map", SCENARIO, "--frequency", "4000,5000,6000", "--amplitude", "1:6:14", "--out", out)
        assert done.returncode == 130 and "the same command goes on" in done.stderr
        assert len((out / "map.csv").read_text().splitlines()) == 1 + points
        (out / "map.png").unlink()


@pytest.mark.parametrize("command", ["map", "drift-map"])
def test_uncertain_inputs_that_are_not_drawn_are_said(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any, **__: Any) -> Any:
        raise InputError("refused here")

    monkeypatch.setattr(studied, "_measured", refused)
    monkeypatch.setattr("feeder_sim.studies.drift_map.making.make_map", refused)
    friction = "contact.friction = { uniform = [0.2, 0.4] }"
    (tmp_path / "u.toml").write_text(f"{SCENARIO.read_text()}\n[uncertain]\n{friction}\n")
    done = feeder_sim(command, str(tmp_path / "u.toml"), "--out", str(tmp_path / "made.npz"))
    assert "feeder-sim: caution: contact.friction: uncertain inputs, which have the values of the" in done.stderr
    assert feeder_sim(command, str(SCENARIO), "--out", str(tmp_path / "known.npz")).stderr.count("caution") == 0


def point(mean: float, n: int, seeds: int = 12, se: float = 0.1) -> MapPoint:
    return MapPoint(5000.0, 10.0 * mean, 1.0, mean, se, n, 0, seeds)


def test_the_fastest_point_is_one_where_most_parts_arrive(capsys: pytest.CaptureFixture[str]) -> None:
    """The mean of a few survivors is no speed of the part."""
    slow, few, none = point(2.0, 6), point(9.0, 5), point(math.nan, 0, 2, math.nan)
    assert fastest_of([none, few, slow]) == slow and fastest_of([none, few]) is None
    _print([none, few, slow], Path("m"), False)
    told = capsys.readouterr().out
    assert "2.000 +- 0.100 mm/s at 5000 Hz, 20 um, n = 6 of 12" in told and LARGEST_OF_MANY in told
    _print([few], Path("m"), False)
    assert "fastest: not told" in capsys.readouterr().out
    _print([point(1.0, 1, 1, math.nan)], Path("m"), False)
    told = capsys.readouterr().out
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
