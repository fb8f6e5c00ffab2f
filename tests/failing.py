"""Runs that fail, by themselves or because they are made to, and their last states."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from conftest import strip_scenario

from feeder_sim.errors import Divergence, SimulationDiverged
from feeder_sim.records.seed import LastStates, Seed
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.guard import Guard
from feeder_sim.run.one_seed import run_one_seed
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Contact, Scenario


def exploding(**run: Any) -> Scenario:
    """A nut on springs so hard and so little damped that the step is too long for them."""
    step_us = 1e6 / (8775.0 * 40)
    contact = Contact(model="compliant", time_constant_us=step_us, damping_ratio=0.1)
    scenario = strip_scenario(frequency_hz=8775.0, **({"duration_s": 1.0} | run))
    return scenario.model_copy(update={"contact": contact})


def fail_at(monkeypatch: pytest.MonkeyPatch, time_s: float, seed: int | None = None) -> None:
    """Let the guard take the first frame from that time [s] on for invalid, of one seed or of all."""
    check = Guard.check

    def spoilt(self: Guard, frames: Frames, seed_index: int) -> tuple[int, SimulationDiverged | None]:
        found = check(self, frames, seed_index)
        late = np.flatnonzero(frames.time >= time_s)
        if not len(late) or seed not in (None, seed_index):
            return found
        at = float(frames.time[late[0]])
        return int(late[0]), SimulationDiverged(
            Divergence.TOO_DEEP, time_s=at, part="part_0", seed=seed_index, detail="spoilt"
        )

    monkeypatch.setattr(Guard, "check", spoilt)


def same(one: LastStates, two: LastStates) -> bool:
    frames = (getattr(one.frames, f.name).tobytes() == getattr(two.frames, f.name).tobytes() for f in fields(Frames))
    return all(frames) and one.valid == two.valid


def check_runs_again(scenario: Scenario, seed: Seed, index: int = 0) -> None:
    """The seed by itself, from its start, comes to the same last states."""
    again = run_one_seed(prepare(scenario), index)
    assert again.last is not None and seed.last is not None and same(again.last, seed.last)
