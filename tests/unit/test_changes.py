"""Other values by dotted keys: what they do, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import NUT_ON_STRIP, amplitude_of, refusal, strip_scenario, toml_of
from hypothesis import given
from hypothesis import strategies as st

from feeder_sim.errors import InputError
from feeder_sim.scenario import Scenario, load_scenario, parse_scenario
from feeder_sim.scenario.changes import read_changes, read_value, value_at

UNCERTAIN = toml_of(NUT_ON_STRIP, {"run.duration_s": 0.1}) + "[uncertain]\n"


def uncertain(text: str) -> Scenario:
    return parse_scenario(UNCERTAIN + text, file=Path("u.toml"))


def test_changed_values_are_those_of_a_file(repository: Path) -> None:
    scenario = strip_scenario()
    changed = scenario.changed({"drive[0].amplitude_um": 2, "part[0].start.position_mm": [1, 0], "contact.friction": 0})
    assert amplitude_of(changed) == 2.0
    assert changed.contact.friction == 0.0
    assert amplitude_of(scenario) == 1.0
    raw = changed.model_dump()
    assert value_at(raw, "part[0].start.position_mm[0]") == 1.0
    assert value_at(raw, "schedule.stage") is None
    damped = scenario.changed({"drive[0].at_mm": None, "drive[0].damping_ratio": 0.01})
    assert damped.drive[0].damping_ratio == 0.01
    assert damped.changed({"drive[0].damping_ratio": None}).drive[0].damping_ratio is None  # taken out
    staged = load_scenario(repository / "scenarios/separation_100.toml")  # stages need no schedule before them
    shorter = staged.changed({"stage[1].duration_s": 0.2, "cycles": 2, "schedule.stage[0].duration_s": 0.5}).schedule
    assert shorter and shorter.cycles == 2 and [stage.duration_s for stage in shorter.stage] == [0.5, 0.2]


def test_values_may_come_from_numpy() -> None:
    changes: dict[str, Any] = {"run.seeds": np.int64(2), "run.in_plane_velocity": np.bool_(False)}
    changes |= {"drive[0].amplitude_um": np.float32(1.5)}
    changes |= {"part[0].start.position_mm": np.array([1, 0]), "part[0].start.drop_height_mm": [np.float64(0.1), 0.2]}
    plain: dict[str, Any] = {"run.seeds": 2, "run.in_plane_velocity": False, "drive[0].amplitude_um": 1.5}
    plain |= {"part[0].start.position_mm": [1, 0], "part[0].start.drop_height_mm": [0.1, 0.2]}
    assert strip_scenario().changed(changes) == strip_scenario().changed(plain)
    assert refusal(strip_scenario().changed, {"run.seeds": np.int64(-2)}).startswith("scenario: run.seeds: is -2, ")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"drive[1].amplitude_um": 1}, "drive[1].amplitude_um: has the number [1], must be 0 to 0"),
        ({"drvie[0].amplitude_um": 1}, "unknown key drvie (did you mean 'drive'?)"),
        ({"contact.frction": 1}, "contact.frction: unknown key (did you mean 'friction'?)"),
        ({"drive.amplitude_um": 1}, "drive.amplitude_um: drive is a list; write drive[0].amplitude_um"),
        ({"part.start.drop_height_mm": 1}, "part is a list; write part[0].start.drop_height_mm"),
        ({"part[0].start.position_mm.x": 1}, "position_mm.x: leads into a value that is no table"),
        ({"title.a": 1}, "title.a: leads into a value that is no table"),
        ({"contact[0].friction": 1}, "has the number [0] where there is no list"),
        ({"contact..friction": 1}, "is no key, must be for example"),
        ({"run.seeds": 2.5}, "run.seeds: is 2.5, must be a valid integer"),
    ],
)
def test_a_change_that_is_not_allowed_is_refused(changes: dict[str, Any], said: str) -> None:
    assert said in refusal(strip_scenario().changed, changes)


def test_values_on_the_command_line_are_those_of_toml() -> None:
    settings = ["drive[0].amplitude_um = 2", "run.engine=mujoco", "run.planar=true", "goal=", "a=[1, 2]"]
    read = read_changes(settings)
    assert read == {"drive[0].amplitude_um": 2, "run.engine": "mujoco", "run.planar": True, "goal": None, "a": [1, 2]}
    assert read_changes(["a=1\nb=2"]) == {"a": "1\nb=2"}  # a line after the value is not dropped
    for wrong in (["a"], ["=1"], ["a=1", "a=2"], ["stage[0].duration_s=1", "schedule.stage[0].duration_s=2"]):
        with pytest.raises(InputError, match=r"--set|given twice"):
            read_changes(wrong)


@given(st.text())
def test_any_text_is_a_value_or_none(text: str) -> None:
    value = read_value(text)
    assert value is None if not text.strip() else value is not None


def test_set_on_the_command_line(repository: Path) -> None:
    scenario = repository / "scenarios/drift_4750hz.toml"
    usual = json.loads(feeder_sim("check", scenario, "--json").stdout)
    changed = json.loads(feeder_sim("check", scenario, "--set", "drive[0].frequency_hz=9500", "--json").stdout)
    assert changed["timestep_us"] == pytest.approx(0.5 * usual["timestep_us"])
    check_refused(feeder_sim("check", scenario, "--set", "drive[0].amplitude_um=-2"), "drive[0].amplitude_um", "is -2")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("contact.restitution = { uniform = [0.2, 1.5] }", "may be 1.5: must be less than or equal to 1"),
        ("contact.restituton = { uniform = [0.2, 0.5] }", "there is no such key"),
        ("contact.restitution = { uniform = [0.5, 0.2] }", "must be [low, high] with low < high"),
        ("contact.restitution = { normal = [0.5, 0.3] }", "may be -0.4: must be greater"),
        ("contact.restitution = { uniform = [0, 1], choice = [0, 1] }", "exactly one of"),
        ("'drive[3].amplitude_um' = { uniform = [0, 1] }", "must be 0 to 0"),
        ("run.seed = { choice = [0, 1] }", "must be a key that decides what a run does"),
        ("'a..b' = { choice = [0, 1] }", "is no key"),
    ],
)
def test_uncertain_inputs_that_cannot_be_are_refused(text: str, said: str) -> None:
    message = refusal(uncertain, text)
    assert said in message and "uncertain" in message


@pytest.mark.parametrize(
    ("distribution", "quantiles"),
    [
        ("{ uniform = [1.0, 3.0], also = ['contact.friction'] }", (1.0, 2.0, 3.0)),
        ("{ log_uniform = [1.0, 4.0] }", (1.0, 2.0, 4.0)),
        ("{ normal = [2.0, 0.5] }", (0.5, 2.0, 3.5)),
        ("{ choice = [1.0, 2.0, 3.0] }", (1.0, 2.0, 3.0)),
    ],
)
def test_quantiles_of_uncertain_inputs(distribution: str, quantiles: tuple[float, ...]) -> None:
    held = uncertain(f'"drive[0].amplitude_um" = {distribution}').uncertain
    assert held is not None
    found = [held["drive[0].amplitude_um"].at(share) for share in (0.0, 0.5, 1.0)]
    assert found == pytest.approx(quantiles)
