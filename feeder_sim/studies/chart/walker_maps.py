"""Where the drift map fails: stability maps whose cells compare walkers with full runs of the impulses.

    passage    transport speed on a strip, over the velocity amplitude V of the antinode and the frequency
    gathering  share of nuts near the nodal lines of a plate after 2 s, over V of the highest antinode and their number

One drift map, made for the frequencies of both, serves all cells.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from feeder_sim.example_files import example_file
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario import Drive, Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.studies.chart.cases import strip
from feeder_sim.studies.chart.engine_maps import FREQUENCY
from feeder_sim.studies.chart.map_cells import Axis, StabilityMap, Verdict, by_deviation
from feeder_sim.studies.drift_map.borders import GATHERING_HZ, crowd_at, passage_at
from feeder_sim.studies.drift_map.comparison import Agreement
from feeder_sim.studies.drift_map.drift_map import DriftMap
from feeder_sim.studies.drift_map.making import make_map, strip_of

SPEED = Axis("velocity amplitude V (m/s)", (0.02, 0.05, 0.1, 0.16, 0.25, 0.4), (0.05, 0.4))
NUTS = Axis("nuts on the plate", (1, 10, 50, 100, 200), (10,))
PLATE = "models/plate_180/modes.h5"
TABLE_M_S = (0.01, 0.02, 0.035, 0.06, 0.1, 0.16, 0.25, 0.45)  # of the drift map, to beyond the largest V
TABLE_SEEDS, QUICK_TABLE_SEEDS = 300, 20
SEEDS, QUICK_SEEDS = 48, 4  # of passages
PARTS, QUICK_PARTS = 100, 20  # that gather, of all seeds together; more in crowds


@dataclass(frozen=True)
class WalkerMap(StabilityMap):
    """A map whose cells compare walkers with full runs.

    Attributes:
        number: names what is compared.
        compared: compares it at x and y; with few seeds where the third argument says so.
    """

    number: str
    compared: Callable[[float, float, bool], Agreement]

    def judge(self, x: float, y: float, *, quick: bool) -> Verdict:
        found = self.compared(x, y, quick)
        error, se = 0.01 * found.error_percent, 0.01 * found.error_se_percent
        return by_deviation(Statistic(error, math.nan, se, found.full.n), self.number)


def _nut() -> Scenario:
    return validated(strip(4750.0, 1.0, 1.95), Scenario, Path("stability"))


@cache
def _drift_map(quick: bool) -> DriftMap:
    frequencies = {*(FREQUENCY.quick if quick else FREQUENCY.values), GATHERING_HZ}
    return make_map(
        _nut(),
        strip_of(_nut()),
        frequencies_hz=sorted(frequencies),
        speeds_m_s=TABLE_M_S,
        seeds=QUICK_TABLE_SEEDS if quick else TABLE_SEEDS,
    )


def _passage(speed: float, frequency: float, quick: bool) -> Agreement:
    return passage_at(_drift_map(quick), _nut(), frequency, speed, QUICK_SEEDS if quick else SEEDS)


def _gathering(speed: float, nuts: float, quick: bool) -> Agreement:
    drive = Drive(frequency_hz=GATHERING_HZ, amplitude_um=1e6 * speed / (2.0 * math.pi * GATHERING_HZ))
    parts = QUICK_PARTS if quick else PARTS
    return crowd_at(_drift_map(quick), example_file(PLATE), drive, round(nuts), parts).agreement


WALKER_MAPS = (
    WalkerMap(
        "drift_map_passage", "drift map, passage on a strip of 3 mm", SPEED, FREQUENCY, "transport speed", _passage
    ),
    WalkerMap(
        "drift_map_gathering",
        f"drift map, gathering on a plate of 180 mm, {GATHERING_HZ:g} Hz",
        SPEED,
        NUTS,
        "share near nodal lines",
        _gathering,
    ),
)
