"""The walk by a drift map against full runs, on plates that the map was not made from.

    passage     transport speed of a nut between an antinode and the nodal line around it
    transport   time that a sequence of modes takes to carry a nut along a strip
    gathering   share of nuts within 5 mm of the nodal lines over time, each alone on the plate or many together

Processor time is that of one part: of the full run over that of the walk, in which a thousand parts go at once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.arrivals import arrival_time
from feeder_sim.measures.drift import first_passage, transport_speed
from feeder_sim.measures.separation import ON_LINE
from feeder_sim.measures.stage_lines import StageLines, stage_lines
from feeder_sim.measures.statistic import Statistic
from feeder_sim.run.compilation import compile_engine
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Drive, HexNut, PartSpec, Rectangle, Run, Scattered, Scenario, with_run
from feeder_sim.scene.cell import PASSAGE_FROM, PASSAGE_TO
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.start import start_poses
from feeder_sim.studies.drift_map.drift_map import DriftMap, Floats
from feeder_sim.studies.drift_map.walk import Walked, walk

WALKERS = 1000
PERTURBED, FEWER = 6, 5  # maps that show the error of the map itself, each with so many times fewer walkers
FRAMES_PER_S = 50.0  # of gathering
FAR = 1e6  # [m]


@dataclass(frozen=True)
class Agreement:
    """One number by full runs and by the map.

    Attributes:
        what: the scene and the number, with its unit.
        full, walked: over seeds, and over walkers.
        full_cpu_s, walked_cpu_s: processor time of one part [s].
        map_se: standard error of the map's number that comes from the drifts of the map itself.
        difference_se: standard error of the difference of seeds and walkers, where both have the same starts; else it
            is that of two independent means.
    """

    what: str
    full: Statistic
    walked: Statistic
    full_cpu_s: float
    walked_cpu_s: float
    map_se: float
    difference_se: float = math.nan

    @property
    def error_percent(self) -> float:
        """Of the map against full runs [%]."""
        return 100.0 * (self.walked.mean / self.full.mean - 1.0)

    @property
    def error_se_percent(self) -> float:
        """Standard error of that [%]."""
        ratio = self.walked.mean / self.full.mean
        apart = self.difference_se / self.full.mean
        if math.isnan(apart):
            apart = ratio * math.hypot(self.full.se / self.full.mean, self.walked.se / self.walked.mean)
        return 100.0 * math.hypot(apart, self.map_se / self.full.mean)

    @property
    def speed_up(self) -> float:
        return self.full_cpu_s / self.walked_cpu_s

    def line(self) -> str:
        """A row of the table in the docs."""
        full = f"{self.full.mean:.3g} +- {self.full.se:.2g}"
        walked = f"{self.walked.mean:.3g} +- {math.hypot(self.walked.se, self.map_se):.2g}"
        error = f"{self.error_percent:+.1f} +- {self.error_se_percent:.1f} %"
        return f"| {self.what} | {full} | {walked} | {error} | {self.speed_up:.0f} |"


@dataclass(frozen=True)
class Gathering:
    """Share of the parts within 5 mm of a nodal line over time.

    Attributes:
        time: (m,) [s].
        full, walked: share of all parts (m,), from the same starts; lost parts count as not gathered.
        difference_se: standard error of their difference, between seeds (m,).
        full_lost, walked_lost: share lost at the end.
        agreement: of the share at the end.
    """

    time: Floats
    full: Floats
    walked: Floats
    difference_se: Floats
    full_lost: float
    walked_lost: float
    agreement: Agreement


def compare_passage(drift_map: DriftMap, scenario: Scenario, seeds: int, walkers: int = WALKERS) -> Agreement:
    """Transport speed [mm/s] of a part in the cell that it starts in."""
    prepared = prepare(with_run(scenario, seeds=seeds))
    result, full_cpu = _simulated(prepared)
    cell = prepared.cell
    assert cell is not None
    full = Statistic.of(1e3 * transport_speed(frames, cell) for frames in result.trajectories)
    walked, cpu, _ = passages(drift_map, prepared, walkers, 0)
    map_se = map_error(drift_map, lambda of, seed: passages(of, prepared, walkers // FEWER, seed)[0].mean)
    return Agreement("transport speed (mm/s)", full, walked, full_cpu / seeds, cpu / walkers, map_se)


def passages(drift_map: DriftMap, prepared: Prepared, walkers: int, seed: int) -> tuple[Statistic, float, float]:
    """Transport speed [mm/s] of walkers, processor time [s] that they took, and the time that they walked [s]."""
    cell = prepared.cell
    assert cell is not None
    places, began = np.repeat(_start(prepared), walkers, axis=0), time.process_time()
    times, ways, looking = [0.0], [cell.lines.distance(places) / cell.reach], 0.0

    def look(now: float, points: Floats) -> bool:
        nonlocal looking
        start = time.process_time()
        times.append(now)
        # The nearest so far, as passages go; lost parts come no nearer.
        ways.append(np.minimum(cell.lines.distance(np.nan_to_num(points, nan=FAR)) / cell.reach, ways[-1]))
        looking += time.process_time() - start
        return bool((np.isnan(points[:, 0]) | (ways[-1] < PASSAGE_TO)).all())

    walk(drift_map, prepared, places, np.random.default_rng(seed), look=look)
    cpu = time.process_time() - began - looking
    way, at = np.array(ways), np.array(times)
    took = [first_passage(at, w, PASSAGE_TO) - first_passage(at, w, PASSAGE_FROM) for w in way.T]
    speeds = (1e3 * (PASSAGE_FROM - PASSAGE_TO) * cell.reach / t for t in took if t > 0.0)
    return Statistic.of(speeds), cpu, times[-1]


def compare_transport(drift_map: DriftMap, scenario: Scenario, seeds: int, walkers: int = WALKERS) -> Agreement:
    """Time [s] until the end of a sequence of modes, of parts that arrive."""
    prepared = prepare(with_run(scenario, seeds=seeds))
    result, full_cpu = _simulated(prepared)
    full = Statistic.of(arrival_time(prepared.scene, seed) for seed in result.seeds)
    walked, cpu, _ = arrivals(drift_map, prepared, walkers, 0)
    map_se = map_error(drift_map, lambda of, seed: arrivals(of, prepared, walkers // FEWER, seed)[0].mean)
    what = f"time of arrival (s); {full.n} of {seeds} arrive, by the map {100.0 * walked.n / walkers:.1f} %"
    return Agreement(what, full, walked, full_cpu / seeds, cpu / walkers, map_se)


def arrivals(drift_map: DriftMap, prepared: Prepared, walkers: int, seed: int) -> tuple[Statistic, float, float]:
    """Time [s] of walkers that arrive, processor time [s] that all took, and the mean time that they walked [s]."""
    places, began = np.repeat(_start(prepared), walkers, axis=0), time.process_time()
    walked = walk(drift_map, prepared, places, np.random.default_rng(seed))
    cpu = time.process_time() - began
    return Statistic.of(walked.total[_at_goal(prepared, walked)].tolist()), cpu, float(walked.total.mean())


def map_error(drift_map: DriftMap, number: Callable[[DriftMap, int], float]) -> float:
    """Standard error of a number that comes from the drifts of the map: its spread over perturbed maps."""
    perturbed = (drift_map.perturbed(np.random.default_rng(k)) for k in range(PERTURBED))
    return float(np.std([number(of, 1 + k) for k, of in enumerate(perturbed)], ddof=1))


def _at_goal(prepared: Prepared, walked: Walked) -> NDArray[np.bool_]:
    goal = prepared.scenario.goal
    assert goal is not None
    away = np.abs(walked.points[:, 0] - 1e-3 * goal.x_mm) if goal.x_mm is not None else np.zeros(len(walked.points))
    return np.asarray(away < 1e-3 * goal.within_mm)


def gathering_scenario(
    mode_file: Path, drive: Drive, duration_s: float, count: int = 1, part: PartSpec | None = None
) -> Scenario:
    """Parts scattered over a plate that one mode moves."""
    start = Scattered(kind="scattered")
    return Scenario(
        plate=Rectangle(kind="rectangle", mode_file=mode_file),
        drive=(drive,),
        part=((part or HexNut(size="M2.5")).model_copy(update={"start": start, "count": count}),),
        run=Run(duration_s=duration_s, frames_per_second=FRAMES_PER_S),
    )


def compare_gathering(drift_map: DriftMap, scenario: Scenario, seeds: int, walkers: int = WALKERS) -> Gathering:
    """Share of the parts near a nodal line over time, and how many are lost."""
    prepared = prepare(with_run(scenario, seeds=seeds))
    scene, lines = prepared.scene, stage_lines(prepared.scene)
    result, full_cpu = _simulated(prepared)
    at, count = scene.frame_interval * np.arange(scene.n_frames, dtype=float), len(scene.parts)
    shares, lost = np.zeros((seeds, len(at))), 0
    for seed, frames in enumerate(result.trajectories):
        on = frames.on_plate(scene.surface)
        for k in range(len(frames)):
            shares[seed, k] = lines.near(0, frames.position[k, on[k], :2], ON_LINE).sum() / count
        lost += count - int(on[-1].sum()) if len(frames) == len(at) else count
    # The same starts, each for several walkers, so that the difference does not hang on where parts start.
    repeats = math.ceil(walkers / (seeds * count))
    starts = np.concatenate([frames.position[0, :, :2] for frames in result.trajectories]).repeat(repeats, axis=0)

    def share(of: DriftMap, seed: int) -> float:
        walked = walk(of, prepared, starts[:: max(1, repeats // 2)], np.random.default_rng(seed))
        return float(_near(lines, walked.points).mean())

    times, near, walked = shares_near(drift_map, prepared, lines, starts, 1)
    map_se, by_start = map_error(drift_map, share), near.reshape(len(near), seeds, -1).mean(axis=2)
    began = time.process_time()
    walk(drift_map, prepared, starts, np.random.default_rng(0))  # without looking, for its time
    cpu = time.process_time() - began
    walked_shares = np.array([np.interp(at, times, of_seed) for of_seed in by_start.T])
    difference = Statistic.of((walked_shares - shares)[:, -1].tolist())
    agreement = Agreement(
        f"share near nodal lines after {at[-1]:.2g} s",
        Statistic.of(shares[:, -1].tolist()),
        Statistic.of(walked_shares[:, -1].tolist()),
        full_cpu / (seeds * count),
        cpu / len(starts),
        map_se,
        difference.se,
    )
    error = (walked_shares - shares).std(axis=0, ddof=1) / math.sqrt(seeds)
    curves = at, shares.mean(axis=0), walked_shares.mean(axis=0), error
    return Gathering(*curves, lost / (seeds * count), float(walked.lost.mean()), agreement)


def shares_near(
    drift_map: DriftMap, prepared: Prepared, lines: StageLines, starts: Floats, seed: int
) -> tuple[Floats, Floats, Walked]:
    """Times (m,) [s], which walkers are near a nodal line then (m, n), 1 or 0, and where they end."""
    times, near = [0.0], [_near(lines, starts)]

    def look(now: float, points: Floats) -> bool:
        times.append(now)
        near.append(_near(lines, points))
        return False

    walked = walk(drift_map, prepared, starts, np.random.default_rng(seed), look=look)
    return np.array(times), np.array(near), walked


def _near(lines: StageLines, points: Floats) -> Floats:
    """1 for points (n, 2) [m] near a nodal line, 0 for others and for lost ones, (n,)."""
    near, there = np.zeros(len(points)), ~np.isnan(points[:, 0])
    near[there] = lines.near(0, points[there], ON_LINE)
    return near


def _simulated(prepared: Prepared) -> tuple[Result, float]:
    """The result of all seeds, and the processor time [s] that they took once the engine was compiled."""
    compile_engine(prepared)
    began = time.process_time()
    result = simulate(prepared)
    return result, time.process_time() - began


def _start(prepared: Prepared) -> Floats:
    """Place of the only part at the start (1, 2) [m]."""
    return np.array([pose.position[:2] for pose in start_poses(prepared.scene, np.random.default_rng(0))])
