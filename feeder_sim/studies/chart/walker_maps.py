"""Where the drift map fails: stability maps whose cells compare walkers with full runs of the impulses.

    passage    transport speed on a strip, over the velocity amplitude V of the antinode and the frequency
    gathering  share of nuts near the nodal lines of a plate after 2 s, over V of the highest antinode and their number

One drift map, made for the frequencies of both, serves all cells.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from feeder_sim.example_files import example_file
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario import Drive, Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.studies.chart.cases import strip
from feeder_sim.studies.chart.engine_maps import FREQUENCY
from feeder_sim.studies.chart.map_cells import Axis, StabilityMap, Verdict, by_deviation
from feeder_sim.studies.chart.shares import CROWDED_S, SEED_S, Show, no_progress
from feeder_sim.studies.drift_map.borders import GATHERING_HZ, GATHERING_S, LEAST_SEEDS, crowd_at, passage_at
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
WALKERS_S = 3.0  # what the walkers of a cell take, about [s]
TABLE_SEED_S = 0.004  # what a run of the drift map takes, about [s]
SLOW_WAY_M = 0.7  # speed of the plate times the simulated time of a passage, about [m]


@dataclass(frozen=True)
class WalkerMap(StabilityMap):
    """A map whose cells compare walkers with full runs.

    Attributes:
        number: names what is compared.
        compared: compares it at x and y; with few seeds where the third argument says so.
        cell_s: how long a cell at x and y takes, about [s].
        table: makes what all cells walk by, for few seeds or not, and tells the fraction done.
    """

    number: str
    compared: Callable[[float, float, bool], Agreement]
    cell_s: Callable[[float, float, bool], float] = lambda x, y, quick: 1.0
    table: Callable[[bool, Show], object] | None = None

    def cost(self, x: float, y: float, *, quick: bool) -> float:
        return self.cell_s(x, y, quick)

    def judge(self, x: float, y: float, *, quick: bool) -> Verdict:
        found = self.compared(x, y, quick)
        error, se = 0.01 * found.error_percent, 0.01 * found.error_se_percent
        return by_deviation(Statistic(error, math.nan, se, found.full.n), self.number)


def _nut() -> Scenario:
    return validated(strip(4750.0, 1.0, 1.95), Scenario, Path("stability"))


_MADE: dict[bool, DriftMap] = {}  # by whether it is that of the quick variant


def _drift_map(quick: bool, progress: Show = no_progress) -> DriftMap:
    """The drift map of all cells, made when it is first asked for."""
    if quick not in _MADE:
        _MADE[quick] = make_map(
            _nut(),
            strip_of(_nut()),
            frequencies_hz=_frequencies(quick=quick),
            speeds_m_s=TABLE_M_S,
            seeds=QUICK_TABLE_SEEDS if quick else TABLE_SEEDS,
            progress=progress,
        )
    progress(1.0)
    return _MADE[quick]


def _frequencies(*, quick: bool) -> list[float]:
    """Of the drift map [Hz]."""
    return sorted({*(FREQUENCY.quick if quick else FREQUENCY.values), GATHERING_HZ})


def table_cost(*, quick: bool) -> float:
    """How long the drift map takes, about [s]."""
    entries = len(_frequencies(quick=quick)) * len(TABLE_M_S)
    return TABLE_SEED_S * entries * (QUICK_TABLE_SEEDS if quick else TABLE_SEEDS)


def _passage(speed: float, frequency: float, quick: bool) -> Agreement:
    return passage_at(_drift_map(quick), _nut(), frequency, speed, QUICK_SEEDS if quick else SEEDS)


def _gathering(speed: float, nuts: float, quick: bool) -> Agreement:
    drive = Drive(frequency_hz=GATHERING_HZ, amplitude_um=1e6 * speed / (2.0 * math.pi * GATHERING_HZ))
    parts = QUICK_PARTS if quick else PARTS
    return crowd_at(_drift_map(quick), example_file(PLATE), drive, round(nuts), parts).agreement


def _passage_s(speed: float, frequency: float, quick: bool) -> float:
    return WALKERS_S + (QUICK_SEEDS if quick else SEEDS) * SEED_S * SLOW_WAY_M / speed


def _gathering_s(speed: float, nuts: float, quick: bool) -> float:
    parts = max(QUICK_PARTS if quick else PARTS, LEAST_SEEDS * nuts)
    return WALKERS_S + parts * GATHERING_S * (CROWDED_S if nuts > 1 else SEED_S)


WALKER_MAPS = (
    WalkerMap(
        "drift_map_passage",
        "drift map, passage on a strip of 3 mm",
        SPEED,
        FREQUENCY,
        "transport speed",
        _passage,
        _passage_s,
        _drift_map,
    ),
    WalkerMap(
        "drift_map_gathering",
        f"drift map, gathering on a plate of 180 mm, {GATHERING_HZ:g} Hz",
        SPEED,
        NUTS,
        "share near nodal lines",
        _gathering,
        _gathering_s,
        _drift_map,
    ),
)
