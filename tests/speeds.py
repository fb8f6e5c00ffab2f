"""Speeds of made-up parts, for searches and maps with seeds that cost nothing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from conftest import amplitude_of

from feeder_sim.scenario import Scenario
from feeder_sim.studies.speed_map import MapQuestion

AMPLITUDE, FRICTION = "drive[0].amplitude_um", "contact.friction"
OVER = (f"{AMPLITUDE}=0.5:5", f"{FRICTION}=0.1,0.2,0.3")
SEARCH: dict[str, Any] = {"over": OVER, "maximise": "speed", "seeds": 8, "trials": 48}
MAP = MapQuestion(frequencies_hz="4000,5000,6000", amplitudes_um="0.5,1,2,4,5,6", seeds=2)


def speed_of(scenario: Scenario, seed: int) -> float:
    """Largest at 3 um and the middle friction; without a value above 4.5 um."""
    amplitude, friction = amplitude_of(scenario), scenario.contact.friction
    if amplitude > 4.5:
        return math.nan
    of_seed, own = (np.random.default_rng([seed, scenario.run.seed, n]).normal() for n in (0, int(1e6 * amplitude)))
    return float(10.0 - (amplitude - 3.0) ** 2 - 10.0 * abs(friction - 0.2) + 1.0 * of_seed + 0.3 * own)


def values_of(scenario: Scenario, seed: int) -> dict[str, float]:
    return {"speed": speed_of(scenario, seed)}


def of_map(scenario: Scenario, seed: int) -> dict[str, float]:
    """Parts move at 0.6 um and more; from 1 um on they arrive."""
    amplitude = amplitude_of(scenario)
    speed = amplitude if amplitude >= 1.0 else math.nan
    return {"transport_speed_mm_s": speed, "drift_velocity_x_mm_s": 1.0 if amplitude > 0.6 else 0.0}
