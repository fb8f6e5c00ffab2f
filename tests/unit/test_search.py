"""The search for the best recipe, with seeds that cost nothing: what it finds, what it stops, how it goes on."""

from __future__ import annotations

import csv
import json
import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, amplitude_of, strip_scenario
from pretended import Pretended, asked
from speeds import AMPLITUDE, FRICTION, OVER, SEARCH, speed_of, values_of

from feeder_sim.errors import InputError
from feeder_sim.jobs.task import SeedValues
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import workers_of
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.studies.search.optimise import OptimiseQuestion, Search
from feeder_sim.studies.search.proposals import LOG, RANDOM_TRIALS, Proposals, Sampler
from feeder_sim.studies.search.search import FRESH, Checked
from feeder_sim.studies.search.space import Parameter, Space
from feeder_sim.studies.search.trials import Aim, Trial, is_worse
from feeder_sim.studies.sweep.cases import Case

AIM = Aim("speed", True, 8)


def searched(folder: Path, scenario: Scenario | None = None, **words: Any) -> tuple[Search, Pretended]:
    executor, question = Pretended(values_of), OptimiseQuestion.of(**SEARCH | words)
    return asked(question, scenario or strip_scenario(amplitude_um=1.0), executor, folder), executor


def test_the_best_is_found_and_checked_with_fresh_seeds_and_losers_are_stopped_early(tmp_path: Path) -> None:
    found, executor = searched(tmp_path)
    assert found.complete and found.best is not None and found.best.point is not None
    assert found.best.point[FRICTION] == 0.2
    assert found.best.point[AMPLITUDE] == pytest.approx(3.0, abs=0.5)
    assert found.trials[0].point == {AMPLITUDE: 1.0, FRICTION: 0.3}  # as it is, first of all
    assert found.present is not None and len(found.present.values) == 16
    mean, (low, high) = found.gain.mean, found.gain.interval
    assert low < 5.0 < high and mean == pytest.approx(5.0, abs=0.7)  # the true difference, 10 - 5
    scenario = found.space.scenario.changed({"run.seed": FRESH})
    assert found.present.values == tuple(speed_of(scenario, seed) for seed in range(16))
    stopped = [trial for trial in found.trials if trial.stopped]
    assert len(stopped) >= len(found.trials) // 3
    assert all(trial.seeds < AIM.seeds for trial in stopped)
    best = max(trial.statistic.mean for trial in found.trials if trial.is_whole(AIM))
    assert not [t for t in stopped if not math.isnan(t.statistic.mean) and 10 - (t.point[AMPLITUDE] - 3.0) ** 2 > best]
    assert executor.count < 0.8 * (8 * 48 + 32 + 4 * 8)


def use(executor: Pretended, patch: pytest.MonkeyPatch) -> None:
    """Let commands run their seeds there."""
    patch.setattr("feeder_sim.studies.ask.workers_of", lambda work: workers_of(Work(2, work.executor or executor)))


ASKED = ("optimise", REPOSITORY / "scenarios/drift_4750hz.toml", "--maximise", "speed", "--over", OVER[0])


def test_a_best_recipe_without_a_value_in_some_fresh_seeds_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def values_of(scenario: Scenario, seed: int) -> dict[str, float]:
        fresh = scenario.run.seed == FRESH - 1  # after 2^63 - 1 comes 0
        return {"speed": math.nan if fresh and seed % 4 == 0 else 1.0 + seed}

    executor = Pretended(values_of)
    use(executor, monkeypatch)
    done = feeder_sim(*ASKED, "--trials", 4, "--seed", 2**63 - 1, "--json", "--out", tmp_path / "out")
    told = json.loads(done.stdout)
    assert done.returncode == 1 and "has no speed in 4 of 16 fresh seeds" in done.stderr
    assert (told["best"]["n"], told["best"]["seeds"], told["gain"]["n"]) == (12, 16, 12)


@pytest.mark.slow
def test_every_sampler_goes_on_after_its_random_trials(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Optuna loads the package of CMA-ES when it first asks it for a recipe."""
    words: dict[str, Any] = {"over": (OVER[0], f"{FRICTION}=0.1:0.3"), "trials": RANDOM_TRIALS + 16, "check_seeds": 4}
    found = {name: searched(tmp_path / name, **words, sampler=name)[0] for name in get_args(Sampler)}
    points = {name: [trial.point for trial in one.trials] for name, one in found.items()}
    assert all(len(tried) == RANDOM_TRIALS + 16 for tried in points.values())
    assert points["cmaes"][:RANDOM_TRIALS] == points["tpe"][:RANDOM_TRIALS]  # the same random draws
    assert points["cmaes"][RANDOM_TRIALS:] != points["tpe"][RANDOM_TRIALS:]
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match="sampler: needs the extra `search`"):
        searched(tmp_path / "without", **words, sampler="cmaes")
    assert not (tmp_path / "without/optuna.log").exists()  # refused before any work


@pytest.mark.parametrize("values", [0, 1])
@pytest.mark.parametrize("number", [0, 1, 5, RANDOM_TRIALS + 3])
def test_a_kill_while_a_trial_takes_its_values_changes_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, values: int
) -> None:
    """At the scenario itself, at a start, at random, and where the sampler has learnt."""
    space = Space.of(strip_scenario(amplitude_um=1.0), OVER)
    trials, start = RANDOM_TRIALS + 6, {AMPLITUDE: 2.0, FRICTION: 0.2}

    def search(log: Path) -> list[tuple[int, Any]]:
        proposals = Proposals(log, space, AIM, "tpe", [start])
        points: list[tuple[int, Any]] = []
        while len(points) < trials:
            ((trial, point),) = proposals.next(1)
            points.append((trial, point))
            done = {0: SeedValues(0, {"speed": point[AMPLITUDE]}, 0.0)}
            proposals.tell([Trial(trial, point, Case(lambda: space.scenario, done=done))])
        return points

    whole, suggest, left = search(tmp_path / "whole"), Parameter.suggest, [2 * number + values]

    def killed(parameter: Parameter, trial: Any) -> Any:
        if not left[0]:
            raise KeyboardInterrupt
        left[0] -= 1
        return suggest(parameter, trial)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Parameter, "suggest", killed)
        search(tmp_path / LOG)
    assert search(tmp_path / LOG) == whole and whole[1][1] == start


def test_values_that_are_not_allowed_together_do_not_end_a_search(tmp_path: Path) -> None:
    scenario = strip_scenario().changed({"contact.restitution_exponent": 0.25})
    over = ["contact.restitution_exponent=0.0,0.25", "contact.restitution_speed_m_s=1.0,2.0", f"{AMPLITUDE}=1:4"]
    found, _ = searched(tmp_path, scenario=scenario, over=tuple(over), trials=24, check_seeds=4)
    refused = [trial for trial in found.trials if trial.refused]
    assert found.complete and refused
    assert all("restitution_speed_m_s belongs to" in trial.refused for trial in refused)


@pytest.mark.parametrize(
    ("largest", "gain", "said"),
    [
        (True, -1.0, r"is worse, difference -1 \(95 %: -1.005 to -0.995\)"),
        (True, 0.0, "is not told apart"),
        (True, 1.0, ""),
        (False, 1.0, "is worse, difference"),
        (False, 0.0, "is not told apart"),
        (False, -1.0, ""),
    ],
)
def test_a_best_recipe_that_is_not_surely_better_has_a_warning(largest: bool, gain: float, said: str) -> None:
    space = Space.of(strip_scenario(amplitude_um=1.0), OVER[:1])
    present = Checked({AMPLITUDE: 1.0}, (5.0, 6.0, 7.0, 8.0))
    scatter = (0.003, -0.001, -0.004, 0.002)
    best = Checked({AMPLITUDE: 2.0}, tuple(value + gain + e for value, e in zip(present.values, scatter, strict=True)))
    question, aim = OptimiseQuestion.of(over=OVER[:1], maximise="speed"), Aim("speed", largest, 4)
    found = Search(question, space, aim, (), present, best, complete=True)
    assert re.search(said, found.doubt) if said else found.doubt == ""
    assert [warning.text for warning in found.warnings] == ([found.doubt] if said else [])
    same = replace(found, best=present)
    assert "no recipe was found that is better than that of the file, which is the one in" in same.doubt
    assert replace(found, best=None).doubt == ""


def test_a_search_whose_best_recipe_is_worse_with_fresh_seeds_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def values_of(scenario: Scenario, seed: int) -> dict[str, float] | str:
        """More with more amplitude in the search, and less with fresh seeds; from 4 um on the drive is too weak."""
        amplitude = amplitude_of(scenario)
        if amplitude > 4.0:
            return f"drive[0]: asks for {amplitude} um"
        return {"speed": seed + (amplitude if scenario.run.seed < FRESH else -amplitude)}

    use(Pretended(values_of), monkeypatch)
    asked = (*ASKED, "--trials", 16, "--out", tmp_path)
    done = feeder_sim(*asked)
    assert done.returncode == 0 and "feeder-sim: warning: no recipe was found that is better" in done.stderr
    rows = list(csv.DictReader((tmp_path / "trials.csv").read_text().splitlines()))
    none = [row for row in rows if not row["mean"]]
    assert none and all(row["refused"] == f"drive[0]: asks for {row[AMPLITUDE]} um" for row in none)
    assert not any(row["refused"] for row in rows if row["mean"])
    assert f"without a value  {len(none)}, mostly: {none[0]['refused']}" in done.stdout
    told = json.loads(feeder_sim(*asked, "--json").stdout)
    assert len(told["warnings"]) == 1
    assert told["without_value"] == {"trials": len(none), "mostly": none[0]["refused"]}


def trial_of(values: list[float]) -> Trial:
    case = Case(strip_scenario)
    case.take(tuple(SeedValues(seed, {"speed": value}, 0.0) for seed, value in enumerate(values)))
    return Trial(0, {}, case)


def test_when_a_trial_is_given_up() -> None:
    best = trial_of([10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0])
    worse = trial_of([9.0, 18.9, 29.1, 38.9])  # every seed by about one, though seeds differ by ten
    assert is_worse(worse.values(AIM), best.values(AIM), AIM)
    assert not is_worse(worse.values(AIM), best.values(AIM), Aim("speed", False, 8))
    assert worse.judge(AIM, best) <= 4 and worse.stopped
    even = trial_of([11.0, 19.0, 31.0, 39.0])
    assert even.judge(AIM, best) == 8 and not even.stopped
    none = trial_of([math.nan, 1.0])
    assert none.judge(AIM, None) == 2 and none.stopped and math.isnan(none.mean(AIM))


def test_a_mode_takes_its_frequency_along(repository: Path) -> None:
    scenario = load_scenario(repository / "scenarios/separation_100.toml")
    space = Space.of(scenario, ["stage[0].drive[0].mode=1,12,13,14", "stage[1].duration_s=0.05:0.5"])
    key = "schedule.stage[0].drive[0].mode"
    assert space.present is not None and space.present[key] in (12, 13, 14)
    changed = space.changed({key: space.present[key], "schedule.stage[1].duration_s": 0.1})
    assert changed.schedule is not None and scenario.schedule is not None
    assert changed.schedule.stage[0].drive[0].frequency_hz == scenario.schedule.stage[0].drive[0].frequency_hz
    with pytest.raises(InputError, match=r"drive\[0\]\.mode: is 999, must be 1 to"):
        Space.of(scenario, ["stage[0].drive[0].mode=1,999"])
    (whole,) = Space.of(scenario, ["stage[0].drive[0].mode=12:14"]).parameters  # also where the file has no mode
    assert [whole.at(share) for share in (0.0, 0.5, 1.0)] == [12, 13, 14]


@pytest.mark.parametrize(
    ("over", "said"),
    [
        ([f"{AMPLITUDE}=0.5:5:7"], "must be LOW:HIGH"),
        ([f"{AMPLITUDE}=-1:5"], "is -1"),
        ([f"{FRICTION}=0.1:0.5", f"{FRICTION}=1,2"], "each key once"),
        ([], "each key once"),
        (["part[0].count=1.5:3"], "whole numbers"),
        (["drive[0].mode=1,2"], "plate.mode_file: is missing"),
        (["contact.frction=0:1"], "did you mean 'friction'"),
    ],
)
def test_a_space_that_is_refused(over: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Space.of(strip_scenario(), over)


def test_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(Pretended(values_of), monkeypatch)
    scenario, out = ASKED[1], tmp_path / "out"
    asked = (*ASKED, "--trials", 24, "--out", out)
    done = feeder_sim(*asked)
    assert done.returncode == 0, done.stderr
    assert "fresh seeds" in done.stdout and "95 % interval" in done.stdout
    best = tomllib.loads((out / "best.toml").read_text())
    assert 2.0 < best["drive"][0]["amplitude_um"] < 4.0
    assert load_scenario(out / "best.toml").run.seed == 0
    assert len((out / "trials.csv").read_text().splitlines()) == 1 + 24
    assert (out / "history.png").stat().st_size > 1000
    told = json.loads(feeder_sim(*asked, "--json").stdout)
    assert told["complete"] and told["gain"]["low"] < told["gain"]["mean"]
    with monkeypatch.context() as newer:
        newer.setattr("feeder_sim.run.provenance.library_versions", lambda: {"numpy": "another"})
        fewer = (*asked[:6], "--check-seeds", 2, "--trials", 2, *asked[-2:])
        assert re.search(r": \d+ seeds in the folder do not count: they are of other", feeder_sim(*fewer).stderr)
        assert "do not count" not in feeder_sim(*fewer).stderr
    failing = Pretended(lambda scenario, seed: values_of(scenario, seed) if seed else "no room")  # which is journalled
    for executor in (Pretended(values_of), failing):
        use(executor, monkeypatch)
        told = feeder_sim(*asked[:2], "--maximise", "sped", *asked[4:-1], tmp_path / "none")
        check_refused(told, "--maximise: is 'sped' (did you mean 'speed'?), must be speed")
        assert not (tmp_path / "none").exists()  # so that the corrected command has its folder
    (out / "optuna.log").write_text("{")
    check_refused(feeder_sim(*asked), "optuna.log", "is no record of a search")
    for options, said in (
        (f"--over {OVER[0]}", "--maximise, --minimise: "),
        (f"--maximise speed --over {AMPLITUDE}=-1:2", f"{AMPLITUDE}: is -1"),
        (f"--over {OVER[0]} --maximise a --budget soon", "--budget"),
        ("--maximise a --over contact.friction=0.2:0.3:5", "--over contact.friction: "),
        (f"--over {OVER[0]} --maximise a --sampler x", "--sampler"),
    ):
        check_refused(feeder_sim("optimise", scenario, *options.split(), cwd=tmp_path), said)
