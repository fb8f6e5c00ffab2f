"""The drift map as a method of the chart: parts that walk as a table of their drift and diffusion says.

A setting is the number of runs behind each entry of the table; making it is not in the cost. The walkers know nothing
of each other, so the cost of a crowd is that of as many single ones.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Sequence
from functools import partial

import numpy as np

from feeder_sim.measures.stage_lines import stage_lines
from feeder_sim.measures.statistic import Statistic
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Scenario
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.start import start_poses
from feeder_sim.studies.chart.cases import CASES
from feeder_sim.studies.chart.methods import DEFAULT_STEPS, METHODS
from feeder_sim.studies.chart.points import Point, scenario_of
from feeder_sim.studies.chart.shares import Show, no_progress, shares
from feeder_sim.studies.drift_map.comparison import arrivals, map_error, passages, shares_near
from feeder_sim.studies.drift_map.drift_map import DriftMap
from feeder_sim.studies.drift_map.making import make_map, strip_of
from feeder_sim.studies.drift_map.walk import walk

NAME, DETAILS = "drift map", "runs behind each entry"
SETTINGS, QUICK = (100, 400), (40,)
WALKERS = 1000
AROUND = (0.25, 0.5, 0.75, 1.0, 1.4)  # velocity amplitudes of the table over that of the fastest drive
OF_CROWD = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.45)  # [m/s]
CROWD = "crowd_20"
TABLE_SEED_S, WALK_S = 0.03, 10.0  # what a map takes per run behind each entry, and what its walkers take, about [s]
Number = Callable[[DriftMap, Prepared], tuple[float, float, float]]


def maps_cost(cases: Collection[str], *, quick: bool) -> float:
    """How long the points of these cases take by drift maps, about [s]."""
    return sum(_costs_of(cases, quick=quick))


def _costs_of(cases: Collection[str], *, quick: bool) -> list[float]:
    settings = QUICK if quick else SETTINGS
    return [TABLE_SEED_S * seeds + WALK_S for name in NUMBERS if name in cases for seeds in settings]


def points_by_drift_map(
    references: dict[str, tuple[float, float]],
    *,
    quick: bool,
    note: Callable[[str], None] = lambda _: None,
    progress: Show = no_progress,
) -> list[Point]:
    """The points of the cases that a drift map can compute.

    Args:
        references: value and standard error by name of the case; other cases are left out.
        quick: one small map per case.
        note: called with a line about each finished point.
        progress: called with the fraction done.
    """
    points = []
    pieces = iter(shares(progress, _costs_of(references, quick=quick)))
    for case in CASES:
        if case.name not in references or case.name not in NUMBERS:
            continue
        scenario = scenario_of(case, METHODS[0], DEFAULT_STEPS)
        crowd = case.name == CROWD
        if crowd:  # the gathering is what counts
            assert scenario.schedule is not None
            gather = scenario.schedule.stage[:1]
            scenario = scenario.model_copy(update={"schedule": scenario.schedule.model_copy(update={"stage": gather})})
        prepared = prepare(scenario)
        for seeds in QUICK if quick else SETTINGS:
            show = next(pieces)
            of_table, _ = shares(show, (TABLE_SEED_S * seeds, WALK_S))
            table = map_around(prepared, seeds, OF_CROWD if crowd else None, progress=of_table)
            number = NUMBERS[case.name]
            value, own, cost = number(table, prepared)
            se = math.hypot(own, map_error(table, partial(_value, number, prepared)))
            failure = "" if math.isfinite(value) else "no walker arrived"
            points.append(
                Point(case.name, NAME, seeds, value, se, WALKERS, *references[case.name], cost, failure, DETAILS)
            )
            show(1.0)
            note(points[-1].line())
    return points


def map_around(
    prepared: Prepared, seeds: int, speeds: Sequence[float] | None = None, *, progress: Show = no_progress
) -> DriftMap:
    """A map of the part of a scene for the frequencies of its drives.

    Args:
        prepared: the scenario.
        seeds: runs behind each entry.
        speeds: velocity amplitudes of the table [m/s]; `AROUND` that of the fastest drive without them.
        progress: called with the fraction done.
    """
    drives = prepared.scene.drives
    fastest = max(2.0 * math.pi * drive.drive_frequency * drive.steady_amplitude for drive in drives)
    return make_map(
        _of_one(prepared.scenario),
        strip_of(prepared.scenario),
        frequencies_hz=sorted({drive.drive_frequency for drive in drives}),
        speeds_m_s=speeds or [share * fastest for share in AROUND],
        seeds=seeds,
        progress=progress,
    )


def _value(number: Number, prepared: Prepared, table: DriftMap, seed: int) -> float:
    return number(table, prepared)[0]


def _of_one(scenario: Scenario) -> Scenario:
    return scenario.model_copy(update={"part": scenario.part[:1]})


def _speed(table: DriftMap, prepared: Prepared) -> tuple[float, float, float]:
    """Transport speed [mm/s], its standard error, and wall time per simulated second of a part."""
    speed, cpu, walked_s = passages(table, prepared, WALKERS, 0)
    return speed.mean, speed.se, cpu / (WALKERS * walked_s)


def _gathered(table: DriftMap, prepared: Prepared) -> tuple[float, float, float]:
    """Parts near a nodal line at the end, standard error, and wall time per simulated second of all parts."""
    count = len(prepared.scene.parts)
    rng = np.random.default_rng(0)
    drawn = [start_poses(prepared.scene, rng) for _ in range(WALKERS // count)]
    starts = np.array([pose.position[:2] for poses in drawn for pose in poses])
    _, near, _ = shares_near(table, prepared, stage_lines(prepared.scene), starts, 0)
    began = time.process_time()
    walk(table, prepared, starts, np.random.default_rng(0))  # without looking, for its time
    cpu = time.process_time() - began
    shares = near[-1].reshape(-1, count).sum(axis=1)
    se = float(shares.std(ddof=1)) / math.sqrt(len(shares))
    return float(shares.mean()), se, cpu * count / (len(starts) * prepared.scene.times.duration)


def _arrival(table: DriftMap, prepared: Prepared) -> tuple[float, float, float]:
    """Time of arrival [s], its standard error, and wall time per simulated second of a part."""
    end, cpu, walked_s = arrivals(table, prepared, WALKERS, 0)
    return end.mean, end.se, cpu / (WALKERS * walked_s)


def _way(table: DriftMap, prepared: Prepared) -> tuple[float, float, float]:
    """Length of the way [mm], its standard error, and wall time per simulated second of a part."""
    (pose,) = start_poses(prepared.scene, np.random.default_rng(0))
    starts = np.tile(pose.position[:2], (WALKERS, 1))
    began = time.process_time()
    walked = walk(table, prepared, starts, np.random.default_rng(0))
    cpu = time.process_time() - began
    way = Statistic.of((1e3 * np.linalg.norm(walked.points - starts, axis=1)).tolist())
    return way.mean, way.se, cpu / (WALKERS * prepared.scene.times.duration)


NUMBERS: dict[str, Number] = {
    "drift_4750": _speed,
    "drift_8775": _speed,
    CROWD: _gathered,
    "transport_strip": _arrival,
    "chladni_plate": _way,
}
