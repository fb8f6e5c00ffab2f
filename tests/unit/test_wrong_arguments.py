"""What a user of Python gives in place of something else is refused in one line, by every public call."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest
from conftest import strip_scenario
from test_feeder import scenario as feeder_scenario
from test_feeder import with_refill

import feeder_sim
from feeder_sim.errors import check_whole

DRIFT = strip_scenario()
CALLS: dict[str, tuple[Callable[..., Any], str]] = {
    "simulate": (lambda: feeder_sim.simulate("x"), "scenario: is 'x', must be a Scenario"),  # type: ignore[arg-type]
    "workers": (lambda: feeder_sim.simulate(DRIFT, workers=0), "workers: is 0, must be a whole number from 1 on"),
    "progress": (lambda: feeder_sim.simulate(DRIFT, progress=3), "progress: is 3, must be True, or a function"),  # type: ignore[arg-type]
    "record_run": (lambda: feeder_sim.record_run("x", "y"), "scenario: is 'x', must be"),  # type: ignore[arg-type]
    "folder": (lambda: feeder_sim.record_run(DRIFT, 3), "folder: is 3, must be a path"),  # type: ignore[arg-type]
    "prepare": (lambda: feeder_sim.prepare(None), "scenario: is None, must be"),  # type: ignore[arg-type]
    "measure_drift": (lambda: feeder_sim.measure_drift(3), "measure_drift: is 3, must be a list"),  # type: ignore[arg-type]
    "an element": (lambda: feeder_sim.measure_drift([3]), "scenario: is 3, must be a Scenario"),  # type: ignore[list-item]
    "changed": (lambda: DRIFT.changed([1]), r"changed: is \[1\], must be a dictionary"),  # type: ignore[arg-type]
    "open": (lambda: feeder_sim.open(3), "open: is 3, must be a path"),  # type: ignore[arg-type]
    "load_scenario": (lambda: feeder_sim.load_scenario(3), "load_scenario: is 3, must be a path"),  # type: ignore[arg-type]
    "read_recording": (
        lambda: feeder_sim.read_recording("no.h5"),
        "no.h5: no run here, must be a folder that holds scene.h5",
    ),
    "open_study": (lambda: feeder_sim.open_study(3), "open_study: is 3, must be a path"),  # type: ignore[arg-type]
    "a folder": (lambda: feeder_sim.open_study("none"), "none: holds no question of many runs"),
    "build_replay": (lambda: feeder_sim.build_replay(3, "x"), "run: is 3, must be a path"),  # type: ignore[arg-type]
    "Feeder": (lambda: feeder_sim.Feeder("x"), "scenario: is 'x', must be a Scenario"),  # type: ignore[arg-type]
    "stages": (lambda: feeder_sim.Feeder(feeder_scenario(), stages=3), "stages: is 3, must be a list"),  # type: ignore[arg-type]
    "a stage": (lambda: feeder_sim.Feeder(feeder_scenario(), stages=[3]), "stage: is 3, must be a Stage"),  # type: ignore[list-item]
}


@pytest.mark.parametrize("name", CALLS)
def test_a_call_with_something_else_is_refused_in_one_line(name: str) -> None:
    call, said = CALLS[name]
    with pytest.raises(feeder_sim.InputError, match=f"^{said}[^\n]*$"):
        call()


def test_a_feeder_refuses_something_else_and_goes_on() -> None:
    feeder = feeder_sim.Feeder(with_refill())
    calls: list[tuple[Callable[[Any], Any], Any, str]] = [
        (feeder.pick_by, 3, "pick: is 3, must be a Pick, or a table"),
        (feeder.pick, [[1], [1, 2]], "pick: is .*, must be the number of a part"),
        (feeder.refill, 1.5, "refill: is 1.5, must be a whole number from 1 to 4"),
        (feeder.record, 3, "folder: is 3, must be a path"),
        (feeder.vibrate, True, "stage: is True, must be a stage"),
    ]
    for call, value, said in calls:
        with pytest.raises(feeder_sim.InputError, match=f"^{said}"):
            call(value)
    assert len(feeder.vibrate(0)) == 0


def test_what_runs_hand_to_each_other_is_no_argument() -> None:
    for call in (feeder_sim.simulate, feeder_sim.record_run, feeder_sim.measure_drift):
        assert not {"recorder", "begun", "left", "notify"} & {*inspect.signature(call).parameters}


def test_whole_numbers() -> None:
    import numpy as np

    assert check_whole(np.int64(3), "n") == 3 and check_whole(0, "n", 0, 0) == 0
    for value in (True, 1.0, "1", None, 0, 5):
        with pytest.raises(feeder_sim.InputError, match=r"n: is .*, must be a whole number from 1 to 4$"):
            check_whole(value, "n", 1, 4)
