"""What a sweep asks: axes, the points that they make, and the scenarios at them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import strip_scenario
from pretended import asked
from swept import AMPLITUDE, Pretended, over, plan_of

from feeder_sim import sweep
from feeder_sim.errors import InputError
from feeder_sim.scenario import load_scenario
from feeder_sim.studies.sweep.design import grid, read_axis, side_by_side, sobol_sample
from feeder_sim.studies.sweep.sweep import SweepQuestion, axis_texts


def test_axes() -> None:
    assert read_axis(f"{AMPLITUDE}=1:4:log3").values == pytest.approx((1.0, 2.0, 4.0))
    assert read_axis("stage[0].duration_s=1:2:3").key == "schedule.stage[0].duration_s"
    assert read_axis("a=x,2,[1, 2],{ b = 1, c = 2 }").values == ("x", 2, [1, 2], {"b": 1, "c": 2})
    assert read_axis("a=[1, 2]").values == (1, 2)
    assert read_axis("a=1,true").values == (1, True)
    axes = [read_axis("a=1,2"), read_axis("b=3,4")]
    assert grid(axes) == [{"a": 1, "b": 3}, {"a": 1, "b": 4}, {"a": 2, "b": 3}, {"a": 2, "b": 4}]
    assert side_by_side(axes) == [{"a": 1, "b": 3}, {"a": 2, "b": 4}]
    sample = sobol_sample([read_axis("a=1:4:log"), read_axis("b=x,y")], 64)
    assert sample == sobol_sample([read_axis("a=1:4:log"), read_axis("b=x,y")], 64)
    assert np.median([point["a"] for point in sample]) == pytest.approx(2.0, rel=0.05)
    assert sum(point["b"] == "x" for point in sample) == 32


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["a"], "allowed is KEY=LOW:HIGH:COUNT"),
        (["a=2:1:3"], "LOW below HIGH"),
        (["a=0:1:log3"], "above 0 on a logarithmic scale"),
        (["a=1:2:1"], "allowed are 2 to"),
        (["a=1:2:log1000000"], "a: has 1000000 values, allowed are 2 to 20000"),
        (["a=1,1"], "different values"),
        (["a=1,1.0"], "different values"),
        (["a={ b = [1] },{ b = [1.0] }"], "different values"),
        (["a=1:2"], "which only a Sobol sample takes"),
        (["a=1,2", "a=3,4"], "varied twice"),
        (["stage[0].duration_s=1,2", "schedule.stage[0].duration_s=3,4"], "varied twice"),
        (["a[0].b=1,2", "a[0]={ b = 1 },{ b = 2 }"], r"vary a\[0\]\.b: is varied, and so is a\[0\]"),
        (["a=1:2:1000", "b=1:2:1000"], "1000000 points"),
        ([], "^vary: is missing"),
        (["run.seeds=2,4"], "decides what a run does"),
        (["title=a,b"], "decides what a run does"),
    ],
)
def test_axes_that_are_refused(texts: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        grid([read_axis(text) for text in texts])


def test_axes_side_by_side_have_as_many_values() -> None:
    with pytest.raises(InputError, match="different numbers of values"):
        side_by_side([read_axis("a=1,2"), read_axis("b=1,2,3")])


def test_a_question_is_kept_as_text(tmp_path: Path) -> None:
    question = over(*axis_texts({"a": [1, 2.5], "b": np.array([1.0, 2.0]), "c": "1:2:3"}), seeds=3, measure="m")
    (tmp_path / "sweep.toml").write_text(question.as_toml())
    assert SweepQuestion.read(tmp_path) == question
    (tmp_path / "sweep.toml").write_text("vary = ['a=1,2']\nzipped = true\nsobol = 0\nmeasure = ''\nuntil_se = 0.0")
    assert SweepQuestion.read(tmp_path) == over("a=1,2", zip=True)  # as it was written once
    assert question.axes[0].values == (1, 2.5)
    for text in ("vary = 3\nx = 1", "vary = [1]", "vary = []\nseeds = 'x'", "{"):
        (tmp_path / "sweep.toml").write_text(text)
        with pytest.raises(InputError, match=r"sweep\.toml: "):
            SweepQuestion.read(tmp_path)
    with pytest.raises(InputError, match="a: is 3, allowed is a sequence"):
        axis_texts({"a": 3})


def test_a_number_of_seeds_that_is_none_is_refused() -> None:
    for seeds in (0, -1):
        with pytest.raises(InputError, match=f"seeds: is {seeds}, allowed is greater than or equal to 1"):
            sweep(strip_scenario(), {AMPLITUDE: [1.0]}, seeds=seeds)


def test_a_mode_takes_its_frequency_along(repository: Path) -> None:
    scenario = load_scenario(repository / "scenarios/drift_2797hz_plate.toml")
    both = over("drive[0].mode=1,12"), over("drive[0].mode=1,12", "drive[0].frequency_hz=500,600")
    alone, beside = (question.plan(scenario, Path("scenario")).cases for question in both)
    frequencies = [case.scenario.drive[0].frequency_hz for case in alone]
    assert len(set(frequencies)) == 2 and scenario.drive[0].frequency_hz not in frequencies
    assert [case.scenario.drive[0].frequency_hz for case in beside] == [500, 600] * 2  # what is said counts
    uncertain = scenario.changed({"uncertain": {"drive[0].frequency_hz": {"uniform": [2700.0, 2800.0]}}})
    with pytest.raises(InputError, match=r"frequency_hz: is varied, but also \[uncertain\]"):
        both[0].plan(uncertain, Path("scenario"))
    with pytest.raises(InputError, match=r"plate\.mode_file: is missing"):
        plan_of(both[0])


def test_draws_of_uncertain_inputs_have_seeds_of_their_own() -> None:
    held = {"contact.friction": {"uniform": [0.2, 0.4]}}
    scenario = strip_scenario(seeds=2).changed({"uncertain": held})
    executor = Pretended()
    swept = asked(over(f"{AMPLITUDE}=1,2", inputs=4), scenario, executor)
    assert sorted(executor.seeds) == [(a, seed) for a in (1.0, 2.0) for seed in range(8)]
    assert [row.found.n for row in swept.valued("speed")] == [8, 8] and swept.uncertain
    for vary in ("contact.friction=0.2,0.3", "contact={ friction = 0.2 },{ friction = 0.3 }"):
        with pytest.raises(InputError, match=r"is varied, but also \[uncertain\]"):
            over(vary).plan(scenario, Path("scenario"))
    with pytest.raises(InputError, match=r"^until_se: is given, .* more draws narrow"):
        over(f"{AMPLITUDE}=1,2", until_se=0.1, measure="speed").plan(scenario, Path("scenario"))
