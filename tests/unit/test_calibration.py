"""Calibration: posteriors against closed forms, what the data cannot decide, the command, and files that are wrong."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, refusal
from numpy.typing import NDArray

from feeder_sim import calibrate, open_study, uncertainty
from feeder_sim.measures.statistic import Statistic
from feeder_sim.run.run_folder import scenario_toml
from feeder_sim.scenario import load_scenario, parse_scenario
from feeder_sim.scenario.uncertain import Uncertain
from feeder_sim.studies.calibration.emulator import Emulator
from feeder_sim.studies.calibration.posterior import Observed, Posterior, interval, within_correlation
from feeder_sim.studies.uncertainty.spread import draws_of

SCENARIO = REPOSITORY / "scenarios/drift_8775hz.toml"
MANY = 1_000_000  # measured runs: Student's t is a normal distribution


class Line:
    """An emulator of a measure that is a straight line in the constants, and known exactly."""

    def __init__(self, *slopes: float) -> None:
        self.slopes = np.array(slopes)

    def at(self, shares: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return shares @ self.slopes, np.zeros(len(shares))


def line(mean: float, sd: float, *slopes: float) -> Observed:
    return runs_of(mean, sd * math.sqrt(MANY), MANY, *slopes)


def runs_of(mean: float, sd: float, n: int, *slopes: float) -> Observed:
    emulator: Any = Line(*slopes)
    measured = {"measure": Statistic(mean, sd, sd / math.sqrt(n), n)}
    return Observed(measured, (emulator,), np.eye(1), tuple(range(len(slopes))))


def test_of_one_constant_the_posterior_is_a_normal_distribution() -> None:
    posterior = Posterior.of([line(1.0, 0.1, 2.0)], 1, 0, draws=20_000)
    of = interval(posterior.shares[:, 0])
    assert of["median"] == pytest.approx(0.5, abs=1e-3)
    assert of["high"] - of["low"] == pytest.approx(2.0 * 1.645 * 0.05, rel=0.02)
    assert posterior.left[0] == pytest.approx(0.05 * math.sqrt(12.0), rel=0.02)


def test_few_runs_are_worth_less_than_many() -> None:
    """Of three runs the standard deviation is hardly known: Student's t has longer tails."""
    few = Posterior.of([runs_of(1.0, 0.1, 3, 2.0)], 1, 0)
    known = Posterior.of([line(1.0, 0.1 / math.sqrt(3.0), 2.0)], 1, 0)
    assert few.left[0] > 1.3 * known.left[0]


def test_a_sum_alone_leaves_a_ridge() -> None:
    """Of x + y nothing is known about x - y, but that both are shares."""
    posterior, names = Posterior.of([line(1.0, 0.02, 1.0, 1.0)], 2, 0), ("restitution", "friction")
    left, directions = posterior.directions
    assert left[0] < 0.1 and left[1] > 0.9
    assert abs(directions[0] @ [1.0, 1.0]) == pytest.approx(math.sqrt(2.0), rel=1e-2)
    words = posterior.words(names)
    assert any(text.startswith("decided") and "+ 0.7" in text for text in words)
    assert any("a larger restitution goes with a smaller friction (correlation -" in text for text in words)
    # What measures x decides y, too: the ridge ends there. More of x + y decides nothing.
    assert max(posterior.narrowed_by(line(0.0, 0.02, 1.0, 0.0))) < 0.2
    assert min(posterior.narrowed_by(line(0.0, 0.02, 1.0, 1.0))) > 0.9


def test_what_no_prior_gives_is_known_to_be_far() -> None:
    posterior = Posterior.of([line(3.0, 0.1, 2.0)], 1, 0)
    assert posterior.nearest[0] == pytest.approx(10.0, rel=0.01)


def test_measures_of_the_same_runs_are_not_independent() -> None:
    """Two that always agree are worth one; two that are independent make the interval smaller by the root of two."""
    alone = line(1.0, 0.1, 2.0)
    widths = []
    for correlation in (0.0, 1.0 - 1e-6):
        both = Observed(
            dict.fromkeys(("a", "b"), alone.measured["measure"]),
            alone.emulators * 2,
            np.array([[1.0, correlation], [correlation, 1.0]]),
            (0,),
        )
        widths.append(Posterior.of([both], 1, 0).left[0])
    assert widths[1] == pytest.approx(Posterior.of([alone], 1, 0).left[0], rel=0.05)
    assert widths[0] == pytest.approx(widths[1] / math.sqrt(2.0), rel=0.05)
    runs = np.random.default_rng(0).normal(size=(40, 1)) @ np.array([[1.0, -2.0]])
    assert within_correlation([runs, runs + 5.0]) == pytest.approx(np.array([[1.0, -1.0], [-1.0, 1.0]]), abs=1e-5)


def test_an_emulator_goes_through_its_points_as_far_as_seeds_tell() -> None:
    pytest.importorskip("sklearn")
    rng = np.random.default_rng(0)
    shares = rng.random((40, 2))
    truth = np.sin(3.0 * shares[:, 0]) + shares[:, 1] ** 2
    values = (truth[:, None] + rng.normal(0.0, 0.05, (40, 8))).tolist()
    values[0] = [math.nan] * 8  # a point where no seed has a value
    emulator = Emulator.of(shares, values, "measure")
    assert emulator.scatter == pytest.approx(0.05, rel=0.15)
    inside = 0.1 + 0.8 * rng.random((200, 2))
    mean, sd = emulator.at(inside)
    off = (mean - np.sin(3.0 * inside[:, 0]) - inside[:, 1] ** 2) / sd
    assert np.abs(mean - np.sin(3.0 * inside[:, 0]) - inside[:, 1] ** 2).max() < 0.1
    assert (np.abs(off) < 2.0).mean() > 0.8
    assert "at 3 of 40 points" in refusal(Emulator.of, shares, values[1:4] + [[math.nan]] * 37, "measure")


def test_a_corner_where_runs_scatter_widely_does_not_blur_the_rest() -> None:
    """As where restitution is so high that parts fly off the plate."""
    pytest.importorskip("sklearn")
    rng = np.random.default_rng(1)
    shares = rng.random((64, 2))
    is_wild = shares[:, 0] > 0.85
    values = shares[:, :1] + rng.normal(0.0, 0.05, (64, 8)) * np.where(is_wild, 20.0, 1.0)[:, None]
    emulator = Emulator.of(shares, values.tolist(), "measure")
    assert emulator.scatter == pytest.approx(0.05, rel=0.2)
    inside = np.column_stack([0.7 * rng.random(200), rng.random(200)])
    mean, sd = emulator.at(inside)
    assert np.sqrt(((mean - inside[:, 0]) ** 2).mean()) < 0.02 and np.median(sd) < 0.02


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 1.0])
def test_log_normal_is_a_normal_distribution_of_logarithms(share: float) -> None:
    of = Uncertain(log_normal=(2.0, 0.1))
    assert math.log(of.at(share) / 2.0) == pytest.approx(Uncertain(normal=(0.0, 0.1)).at(share))
    assert of.ends == pytest.approx((2.0 * math.exp(-0.3), 2.0 * math.exp(0.3)))


def experiments(path: Path, text: str = "") -> Path:
    path.write_text(
        text
        or f"""
points = 16
seeds = 2
[[experiment]]
scenario = "{SCENARIO}"
measure = "transport_speed_mm_s"
mean = 4.0
sd = 0.3
n = 6
[[candidate]]
name = "faster"
scenario = "{SCENARIO}"
set = {{ "drive[0].amplitude_um" = 2.0 }}
measure = "transport_speed_mm_s"
sd = 0.3
[answer]
scenario = "{SCENARIO.with_name("drift_4750hz.toml")}"
measure = "transport_speed_mm_s"
[prior]
contact.restitution = {{ uniform = [0.1, 0.4], also = ["contact.part_restitution"] }}
"drive[0].amplitude_um" = {{ log_normal = [1.0, 0.1], only = ["drift_8775hz"] }}
""",
        encoding="utf-8",
    )
    return path


def test_the_command_tells_what_is_known_and_goes_on(tmp_path: Path) -> None:
    pytest.importorskip("sklearn")
    file, folder = experiments(tmp_path / "mine.toml"), tmp_path / "out"
    facts = json.loads(feeder_sim("calibrate", file, "--out", folder, "--json").stdout)
    assert set(facts["posterior"]) == {"contact.restitution", "drive[0].amplitude_um"}
    for row in facts["posterior"].values():
        assert row["low"] < row["median"] < row["high"] and 0.0 < row["left_of_prior"] < 1.3
    assert facts["experiments"][0]["posterior_low"] < 4.3 and facts["experiments"][0]["posterior_high"] > 3.7
    (candidate,) = facts["candidates"]
    assert candidate["candidate"] == "faster" and (candidate["parts"], candidate["minutes"]) == (1, 0.25)
    assert 0.0 <= candidate["answer"] <= 1.0  # of what is predicted for another plate it decides some
    assert facts["answer"]["low"] < facts["answer"]["median"] < facts["answer"]["high"]
    assert {path.name for path in folder.iterdir()} >= {"posterior.csv", "experiments.csv", "calibrate.png"}
    draws = np.genfromtxt(folder / "draws.csv", delimiter=",", names=True)
    assert len(draws) == 1000
    columns, *lines = (folder / "posterior.csv").read_text(encoding="utf-8").splitlines()
    assert columns == "contact.restitution,contact.part_restitution" and len(lines) == 1000
    assert all(line.split(",")[0] == line.split(",")[1] for line in lines)
    again = calibrate(file, out=folder)
    assert again.as_json() == {key: value for key, value in facts.items() if key != "folder"}
    assert open_study(folder).lines() == again.lines()


UNCERTAIN = """
[plate]
kind = "strip"
thickness_mm = 3.0
[[drive]]
frequency_hz = 8775.0
amplitude_um = 1.0
[[part]]
shape = "hex_nut"
size = "M2.5"
[uncertain]
draws = "posterior.csv"
contact.part_restitution = { uniform = [0.1, 0.2] }
[run]
duration_s = 0.1
"""


def test_draws_of_a_posterior_are_uncertain_inputs_that_belong_together(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(UNCERTAIN, encoding="utf-8")
    table = "contact.restitution,contact.friction\n" + "".join(f"{0.1 + k / 100},{0.6 - k / 100}\n" for k in range(40))
    (tmp_path / "posterior.csv").write_text(table, encoding="utf-8")
    scenario = load_scenario(file)
    draws = draws_of(scenario, 64)
    sums = {round(draw["contact.restitution"] + draw["contact.friction"], 9) for draw in draws}
    assert sums == {0.7}
    assert len({draw["contact.restitution"] for draw in draws}) > 30
    free = [draw["contact.part_restitution"] for draw in draws]
    assert abs(np.corrcoef(free, [draw["contact.friction"] for draw in draws])[0, 1]) < 0.3
    assert parse_scenario(scenario_toml(scenario), file=tmp_path / "again.toml").uncertain == scenario.uncertain
    study = uncertainty(scenario, inputs=4, seeds=1)
    assert study.linear_shares(study.main()) is None
    assert "independent inputs" in refusal(uncertainty, scenario, inputs=4, seeds=2, indices=True)


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ("contact.restitution\n0.2\n", "has 1 draws, must have two and more"),
        ("contact.restitution\n0.2\nx\n", "line 3, contact.restitution"),
        ("contact.restitution,contact.friction\n0.2,0.3\n0.2\n", "has 1 values, must be 2"),
        ("contact.restitution;contact.friction\n0.2;0.3\n0.2;0.1\n", "semicolons"),
        ("contact.restitution\n0.2\n1.5\n", "may be 1.5"),
        ("contact.bounce\n0.2\n0.5\n", "contact.bounce"),
    ],
)
def test_draws_that_cannot_be_are_refused(table: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(UNCERTAIN, encoding="utf-8")
    (tmp_path / "posterior.csv").write_text(table, encoding="utf-8")
    check_refused(feeder_sim("check", tmp_path / "mine.toml"), expected)


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        (("mean = 4.0", "mean = nan"), "experiment[0].mean"),
        (("sd = 0.3\nn = 6", "sd = 0.0"), "experiment[0].sd"),
        (("transport_speed_mm_s", "speed"), "speed"),
        (("contact.restitution", "contact.restitutions"), "restitutions"),
        (("[0.1, 0.4]", "[0.1, 1.4]"), "1.4"),
        (('only = ["drift_8775hz"]', 'only = ["other"]'), "must be one of drift_8775hz, faster"),
        (("[1.0, 0.1]", "[-1.0, 0.1]"), "a median above 0"),
        ((f'scenario = "{SCENARIO}"', 'scenario = "none.toml"'), "none.toml"),
        (("[[experiment]]", "[experiment]"), "must be tables, [[experiment]]"),
    ],
)
def test_what_is_wrong_is_one_line(changed: tuple[str, str], expected: str, tmp_path: Path) -> None:
    file = experiments(tmp_path / "mine.toml")
    text = file.read_text(encoding="utf-8")
    assert changed[0] in text
    file.write_text(text.replace(changed[0], changed[1], 1), encoding="utf-8")
    check_refused(feeder_sim("calibrate", file, "--out", tmp_path / "out"), expected)


def test_a_measurement_beyond_the_priors_is_a_failure(tmp_path: Path) -> None:
    pytest.importorskip("sklearn")
    file = experiments(tmp_path / "mine.toml")
    file.write_text(file.read_text(encoding="utf-8").replace("mean = 4.0", "mean = 40.0"), encoding="utf-8")
    done = feeder_sim("calibrate", file, "--out", tmp_path / "out")
    assert done.returncode == 1 and "standard errors away" in done.stderr
