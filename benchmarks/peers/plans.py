"""Settings and seeds of each case of the conformance set, by what a step of an engine costs."""

from __future__ import annotations

import cases
from case_files import case as conformance_case
from cases import DRIFTS, Method

SLOW_US = 50.0  # a step; from there on there is time for few seeds, and for none in a quick run
SLOWEST_US = 1000.0  # a step; from there on there is none for any seeds
PER_MS, BY_CHANCE = (20, 40, 80, 160, 320), (20, 40)  # steps per millisecond or per slow period; per fast period
LONG, PERIODIC = "slide_to_rest", ("throw", "bouncing_ball")  # ten times as long as the impacts; thousands of steps
SECONDS = 20.0  # of processor time that the seeds of one setting may take
MOST_SEEDS = 16
FEWEST = {"piston_zero": 4, "drift_4750": 2, "drift_8775": 4}  # that the judge can decide with
SHAKEN = ("two_axes", "fast_slip")
ONE_BODY = (  # cases that a peer has a world for: one part, one run
    "rebound",
    "slide",
    "oblique_sticking",
    "slide_to_rest",
    "rising_plate",
    "throw",
    "bouncing_ball",
    "mesh_cube",
    *SHAKEN,
    "piston_zero",
    *DRIFTS,
)
QUICK_SECONDS = 4.0
NO_VELOCITY = (
    "rising_plate",
    "throw",
    "bouncing_ball",
    "two_axes",
    "fast_slip",
    "drift_8775",
)  # what a plate without velocity is asked


def plan(case: str, method: Method, *, quick: bool) -> list[tuple[int, int]]:
    """Settings and seeds."""
    slow = method.us_per_step > SLOW_US
    if case not in ONE_BODY:
        return []
    if case in SHAKEN and not method.shakes:
        return []
    if not method.arrives and case not in NO_VELOCITY:
        return []
    if case not in (*DRIFTS, "piston_zero"):
        return [(steps, 1) for steps in _settings(case, method.us_per_step, quick=quick)]
    if method.us_per_step > SLOWEST_US:
        return []
    if quick and (slow or not method.arrives or case == "drift_4750"):
        return []
    if not method.arrives:
        return [(BY_CHANCE[0], 2)]
    tables = conformance_case(case)
    frequency = tables["plate"]["frequency_hz"]
    seed_s = cases.EXPECTED_S.get(case, tables["duration_s"])
    chosen = []
    for steps in BY_CHANCE[: 1 if slow or quick else 2]:
        wall = seed_s * frequency * steps * method.us_per_step * 1e-6
        seconds = QUICK_SECONDS if quick else SECONDS
        chosen.append((steps, min(MOST_SEEDS, max(2 if quick else FEWEST[case], round(seconds / wall)))))
    return chosen


def _settings(case: str, us_per_step: float, *, quick: bool) -> tuple[int, ...]:
    """Steps per period, or per millisecond, of a case without chance."""
    if us_per_step > SLOWEST_US:
        return (20,) if quick or case == LONG else (20, 80) if case in PERIODIC else (20, 80, 160)
    if case == LONG:
        return (20,) if quick else PER_MS[: 2 if us_per_step > SLOW_US else 4]
    return (20, 80) if quick else PER_MS
