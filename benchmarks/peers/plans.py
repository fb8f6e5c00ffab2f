"""Settings and seeds of each case of the conformance set, by what a step of an engine costs."""

from __future__ import annotations

import cases
from cases import DRIFTS, Method

from feeder_sim.studies.conformance.cases import PISTON_HZ, PISTON_S

SLOW_US = 50.0  # a step; from there on there is time for few seeds, and for none in a quick run
PER_MS, PER_PERIOD, BY_CHANCE = (20, 40, 80, 160, 320), (20, 40, 80, 160, 320), (20, 40)
LONG = "slide_to_rest"  # ten times as long as the impacts
SECONDS = 25.0  # of wall time that the seeds of one setting may take
MOST_SEEDS, FEWEST = 16, 4
QUICK_SECONDS = 4.0
NO_VELOCITY = ("rising_plate", "throw", "bouncing_ball", "drift_8775")  # what a plate without velocity is asked


def plan(case: str, method: Method, *, quick: bool) -> list[tuple[int, int]]:
    """Settings and seeds."""
    slow = method.us_per_step > SLOW_US
    if not method.arrives and case not in NO_VELOCITY:
        return []
    if case not in (*DRIFTS, "piston_zero"):
        if case == LONG:
            return [(steps, 1) for steps in ((20,) if quick else PER_MS[: 2 if slow else 4])]
        return [(steps, 1) for steps in ((20, 80) if quick else PER_MS[: 4 if slow else 5])]
    if quick and (slow or not method.arrives or case == "drift_4750"):
        return []
    if not method.arrives:
        return [(BY_CHANCE[0], 2)]
    frequency = float(case.split("_")[1]) if case in DRIFTS else PISTON_HZ
    seed_s = cases.EXPECTED_S.get(case, PISTON_S)
    chosen = []
    for steps in BY_CHANCE[: 1 if slow or quick else 2]:
        wall = seed_s * frequency * steps * method.us_per_step * 1e-6
        seconds = QUICK_SECONDS if quick else SECONDS
        chosen.append((steps, min(MOST_SEEDS, max(2 if quick else FEWEST, round(seconds / wall)))))
    return chosen
