"""The walk by a drift map against full runs, on plates that the map was not made from.

    passage     transport speed of a nut between an antinode and the nodal line around it
    transport   time that a sequence of modes takes to carry a nut along a strip
    gathering   share of nuts within 5 mm of the nodal lines over time, each alone on the plate or many together

Processor time is that of one part: of the full run over that of the walk, in which a thousand parts go at once.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.arrivals import arrived
from feeder_sim.measures.drift import first_passage, transport_speed
from feeder_sim.measures.separation import ON_LINE
from feeder_sim.measures.stage_lines import StageLines, stage_lines
from feeder_sim.measures.statistic import Statistic
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import Result, compile_engine, simulate
from feeder_sim.scenario import Drive, HexNut, PartSpec, Rectangle, Run, Scattered, Scenario, with_run
from feeder_sim.scene.cell import PASSAGE_FROM, PASSAGE_TO
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.start import start_poses
from feeder_sim.studies.drift_map.drift_map import DriftMap, Floats
from feeder_sim.studies.drift_map.walk import Walked, walk

WALKERS = 1000
FRAMES_PER_S = 50.0  # of gathering


@dataclass(frozen=True)
class Agreement:
    """One number by full runs and by the map.

    Attributes:
        what: the scene and the number, with its unit.
        full, walked: over seeds, and over walkers.
        full_cpu_s, walked_cpu_s: processor time of one part [s].
        difference_se: standard error of the difference, where both have the same starts; else that of two independent
            means.
    """

    what: str
    full: Statistic
    walked: Statistic
    full_cpu_s: float
    walked_cpu_s: float
    difference_se: float = math.nan

    @property
    def error_percent(self) -> float:
        """Of the map against full runs [%]."""
        return 100.0 * (self.walked.mean / self.full.mean - 1.0)

    @property
    def error_se_percent(self) -> float:
        """Standard error of that [%]."""
        if math.isfinite(self.difference_se):
            return 100.0 * self.difference_se / self.full.mean
        relative = math.hypot(self.full.se / self.full.mean, self.walked.se / self.walked.mean)
        return 100.0 * relative * self.walked.mean / self.full.mean

    @property
    def speed_up(self) -> float:
        return self.full_cpu_s / self.walked_cpu_s

    def line(self) -> str:
        """A row of the table in the docs."""
        full, walked = (f"{s.mean:.3g} +- {s.se:.2g}" for s in (self.full, self.walked))
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
    times, ways = [0.0], [np.full(walkers, cell.lines.distance(_start(prepared))[0] / cell.reach)]

    def look(now: float, points: Floats) -> None:
        times.append(now)
        ways.append(cell.lines.distance(points) / cell.reach)

    began = time.process_time()
    walk(drift_map, prepared, np.repeat(_start(prepared), walkers, axis=0), np.random.default_rng(0), look=look)
    cpu = time.process_time() - began
    way, at = np.array(ways), np.array(times)
    took = [first_passage(at, w, PASSAGE_TO) - first_passage(at, w, PASSAGE_FROM) for w in way.T]
    walked = Statistic.of(1e3 * (PASSAGE_FROM - PASSAGE_TO) * cell.reach / t for t in took if t > 0.0)
    arrival = np.nanmean([first_passage(at, w, PASSAGE_TO) for w in way.T])
    per_walker = cpu / walkers * float(arrival) / prepared.scene.times.duration  # a full run ends at its passage
    return Agreement("transport speed (mm/s)", full, walked, full_cpu / seeds, per_walker)


def compare_transport(drift_map: DriftMap, scenario: Scenario, seeds: int, walkers: int = WALKERS) -> Agreement:
    """Time [s] until the end of a sequence of modes, of parts that arrive."""
    prepared = prepare(with_run(scenario, seeds=seeds))
    result, full_cpu = _simulated(prepared)
    ends = [prepared.scene.stages(seed.stops.tolist())[-1].end for seed in result.seeds]
    there = [bool(arrived(prepared.scene, seed.frames).all()) for seed in result.seeds]
    full = Statistic.of(end for end, came in zip(ends, there, strict=True) if came)
    began = time.process_time()
    walked = walk(drift_map, prepared, np.repeat(_start(prepared), walkers, axis=0), np.random.default_rng(0))
    cpu = time.process_time() - began
    came = _at_goal(prepared, walked)
    what = f"time of arrival (s); {sum(there)} of {seeds} arrive, by the map {100.0 * came.mean():.1f} %"
    return Agreement(what, full, Statistic.of(walked.total[came].tolist()), full_cpu / seeds, cpu / walkers)


def _at_goal(prepared: Prepared, walked: Walked) -> NDArray[np.bool_]:
    goal = prepared.scenario.goal
    assert goal is not None
    away = np.abs(walked.points[:, 0] - 1e-3 * goal.x_mm) if goal.x_mm is not None else np.zeros(len(walked.points))
    return np.asarray(away < 1e-3 * goal.within_mm)


def gathering_scenario(
    mode_file: Path, frequency_hz: float, volts: float, duration_s: float, count: int = 1, part: PartSpec | None = None
) -> Scenario:
    """Parts scattered over a plate that one mode moves."""
    start = Scattered(kind="scattered")
    return Scenario(
        plate=Rectangle(kind="rectangle", mode_file=mode_file),
        drive=(Drive(frequency_hz=frequency_hz, voltage_vpp=volts),),
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
    times, by_start = [0.0], [_near(lines, starts).reshape(seeds, -1).mean(axis=1)]

    def look(now: float, points: Floats) -> None:
        times.append(now)
        by_start.append(_near(lines, points).reshape(seeds, -1).mean(axis=1))

    walked = walk(drift_map, prepared, starts, np.random.default_rng(1), look=look)
    began = time.process_time()
    walk(drift_map, prepared, starts, np.random.default_rng(0))  # without looking, for its time
    cpu = time.process_time() - began
    walked_shares = np.array([np.interp(at, times, share) for share in np.array(by_start).T])
    difference = Statistic.of((walked_shares - shares)[:, -1].tolist())
    agreement = Agreement(
        f"share near nodal lines after {at[-1]:.2g} s",
        Statistic.of(shares[:, -1].tolist()),
        Statistic.of(walked_shares[:, -1].tolist()),
        full_cpu / (seeds * count),
        cpu / len(starts),
        difference.se,
    )
    error = (walked_shares - shares).std(axis=0, ddof=1) / math.sqrt(seeds)
    curves = at, shares.mean(axis=0), walked_shares.mean(axis=0), error
    return Gathering(*curves, lost / (seeds * count), float(walked.lost.mean()), agreement)


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
