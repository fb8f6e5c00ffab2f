"""Where a drift map begins to be wrong: high hops, parts that meet each other, balls that roll on."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feeder_sim.measures.statistic import Statistic
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Drive, Scenario, with_run
from feeder_sim.scene.scene import GRAVITY
from feeder_sim.scene.start import start_poses
from feeder_sim.studies.drift_map.comparison import (
    WALKERS,
    Agreement,
    Gathering,
    compare_gathering,
    compare_passage,
    gathering_scenario,
)
from feeder_sim.studies.drift_map.drift_map import DriftMap, Floats
from feeder_sim.studies.drift_map.walk import walk
from feeder_sim.studies.speed_map import at_point

GATHERING_HZ = 2646.0
SPEEDS_M_S = (0.01, 0.03, 0.06, 0.1, 0.13, 0.16, 0.2, 0.25, 0.3)
VOLTS = (5.0, 10.0, 20.0, 40.0, 60.0, 80.0, 120.0)
COUNTS = (1, 10, 25, 50, 100, 200, 400)
CROWD_VOLTS = 40.0
GATHERING_S = 2.0
PARTS, LEAST_SEEDS = 400, 4  # of all seeds of a crowd together
TIMES_S = (0.5, 1.0, 2.0, 4.0, 8.0)


@dataclass(frozen=True)
class BorderPoint:
    """How well the map does at one setting.

    Attributes:
        setting: velocity amplitude of the highest antinode [m/s], or number of parts.
        hop: V^2 / g, the height scale of hops, over the radius of the part [1].
        agreement: with full runs.
        gathering: over time, where that is what is compared.
    """

    setting: float
    hop: float
    agreement: Agreement
    gathering: Gathering | None = None


def high_hops_on_strip(
    drift_map: DriftMap,
    scenario: Scenario,
    seeds: int,
    speeds: Sequence[float] = SPEEDS_M_S,
    note: Callable[[BorderPoint], None] = lambda _: None,
) -> list[BorderPoint]:
    """Transport speed on a strip over the velocity amplitude, at the frequency of the scenario."""
    found = []
    frequency = scenario.drive[0].frequency_hz
    for speed in speeds:
        agreement = passage_at(drift_map, scenario, frequency, speed, seeds)
        found.append(BorderPoint(speed, _hop(scenario, speed), agreement))
        note(found[-1])
    return found


def passage_at(drift_map: DriftMap, scenario: Scenario, frequency: float, speed: float, seeds: int) -> Agreement:
    """Transport speed on a strip at another frequency [Hz] and velocity amplitude [m/s] than the scenario has."""
    point = at_point(scenario, frequency, 1e6 * speed / (2.0 * math.pi * frequency), seeds)
    return compare_passage(drift_map, point, seeds)


def high_hops_on_plate(
    drift_map: DriftMap,
    mode_file: Path,
    seeds: int,
    volts: Sequence[float] = VOLTS,
    note: Callable[[BorderPoint], None] = lambda _: None,
) -> list[BorderPoint]:
    """Gathering of single parts on a plate over the velocity amplitude of its highest antinode."""
    found = []
    for voltage in volts:
        drive = Drive(frequency_hz=GATHERING_HZ, voltage_vpp=voltage)
        scenario = gathering_scenario(mode_file, drive, GATHERING_S)
        speed = prepare(scenario).scene.drives[0].steady_amplitude * 2.0 * math.pi * GATHERING_HZ
        gathering = compare_gathering(drift_map, scenario, seeds)
        found.append(BorderPoint(speed, _hop(scenario, speed), gathering.agreement, gathering))
        note(found[-1])
    return found


def crowds(
    drift_map: DriftMap,
    mode_file: Path,
    parts: int = PARTS,
    counts: Sequence[int] = COUNTS,
    note: Callable[[BorderPoint], None] = lambda _: None,
) -> list[BorderPoint]:
    """Gathering over the number of parts on the plate at once; the map lets each walk as if it were alone."""
    found = []
    drive = Drive(frequency_hz=GATHERING_HZ, voltage_vpp=CROWD_VOLTS)
    for count in counts:
        gathering = crowd_at(drift_map, mode_file, drive, count, parts)
        found.append(BorderPoint(count, math.nan, gathering.agreement, gathering))
        note(found[-1])
    return found


def crowd_at(drift_map: DriftMap, mode_file: Path, drive: Drive, count: int, parts: int) -> Gathering:
    """Gathering of so many parts at once under a drive; `parts` of all seeds together, of which there are a few."""
    scenario = gathering_scenario(mode_file, drive, GATHERING_S, count)
    return compare_gathering(drift_map, scenario, max(LEAST_SEEDS, parts // count))


@dataclass(frozen=True)
class WaysAt:
    """How far parts have come at a time, by full runs and by the map.

    Attributes:
        time: since the start [s].
        full, walked: length of the way, over seeds and over walkers [mm].
    """

    time: float
    full: Statistic
    walked: Statistic

    def line(self) -> str:
        """A row of the table in the docs."""
        ways = f"{self.full.mean:.3g} +- {self.full.se:.1g} | {self.walked.mean:.3g} +- {self.walked.se:.1g}"
        return f"| {self.time:g} | {ways} | {self.full.sd:.2g} | {self.walked.sd:.2g} |"


def ways(drift_map: DriftMap, scenario: Scenario, seeds: int, times: Sequence[float] = TIMES_S) -> list[WaysAt]:
    """How far the only part of a scenario comes from its place over time.

    Args:
        drift_map: of the part.
        scenario: one part at one place, under drives that last as long as the times.
        seeds: of full runs.
        times: [s], rising.
    """
    prepared = prepare(with_run(scenario, seeds=seeds, duration_s=times[-1]))
    starts = np.tile(start_poses(prepared.scene, np.random.default_rng(0))[0].position[:2], (WALKERS, 1))
    at, places = [0.0], [starts]

    def look(now: float, points: Floats) -> bool:
        at.append(now)
        places.append(points.copy())
        return False

    walk(drift_map, prepared, starts, np.random.default_rng(0), look=look)
    frames = [f for f in simulate(prepared).trajectories if len(f) == prepared.scene.n_frames]
    full = [np.linalg.norm(f.position[:, 0, :2] - starts[0], axis=1) for f in frames]
    walked = np.linalg.norm(np.array(places) - starts, axis=2)
    return [
        WaysAt(
            time,
            Statistic.of(1e3 * float(np.interp(time, f.time, way)) for f, way in zip(frames, full, strict=True)),
            Statistic.of((1e3 * walked[int(np.argmin(np.abs(np.array(at) - time)))]).tolist()),
        )
        for time in times
    ]


def _hop(scenario: Scenario, speed: float) -> float:
    kind = prepare(scenario).scene.kinds[0]
    return speed**2 / GRAVITY / kind.size
