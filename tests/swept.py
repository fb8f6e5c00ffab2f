"""Sweeps of a nut on a strip over the amplitude, with seeds that cost nothing."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pretended
from conftest import amplitude_of, strip_scenario

from feeder_sim.jobs.runner import Runner
from feeder_sim.pool.workers import Workers
from feeder_sim.scenario import Scenario
from feeder_sim.studies.sweep.cases import CasesPlan
from feeder_sim.studies.sweep.sweep import SweepQuestion

AMPLITUDE = "drive[0].amplitude_um"


def speed_of(amplitude: float, seed: int) -> float:
    """No speed below 1 um; above, one that scatters the more, the stronger the drive."""
    if amplitude < 1.0:
        return math.nan
    return 10.0 + 0.5 * amplitude * float(np.random.default_rng(seed).normal())


def values_of(scenario: Scenario, seed: int) -> dict[str, float]:
    return {"speed": speed_of(amplitude_of(scenario), seed)}


def Pretended(**how: Any) -> pretended.Pretended:
    """Makes values from amplitude and seed."""
    return pretended.Pretended(values_of, strong=3.0, **how)


def over(*vary: str, **words: Any) -> SweepQuestion:
    return SweepQuestion.of(vary=vary, **words)


def plan_of(question: SweepQuestion, executor: pretended.Pretended | None = None) -> CasesPlan:
    """The cases of a nut of four seeds; run, where there is somebody to run them."""
    plan = question.plan(strip_scenario(seeds=4), Path("scenario"))
    if executor is not None:
        assert plan.run(Runner(Workers(executor, 2)))
    return plan
