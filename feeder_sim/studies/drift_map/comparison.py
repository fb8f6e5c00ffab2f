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
from feeder_sim.measures.stage_lines import stage_lines
from feeder_sim.measures.statistic import Statistic
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import Result, compile_engine, simulate
from feeder_sim.scenario import Drive, HexNut, PartSpec, Rectangle, Run, Scattered, Scenario, with_run
from feeder_sim.scene.cell import PASSAGE_FROM, PASSAGE_TO
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.start import start_poses
from feeder_sim.studies.drift_map.drift_map import DriftMap, Floats
from feeder_sim.studies.drift_map.walk import STEP_S, Walked, walk

WALKERS = 1000
FRAMES_PER_S = 50.0  # of gathering


@dataclass(frozen=True)
class Agreement:
    """One number by full runs and by the map.

    Attributes:
        what: the scene and the number, with its unit.
        full, walked: over seeds, and over walkers.
        full_cpu_s, walked_cpu_s: processor time of one part [s].
    """

    what: str
    full: Statistic
    walked: Statistic
    full_cpu_s: float
    walked_cpu_s: float

    @property
    def error_percent(self) -> float:
        """Of the map against full runs [%]."""
        return 100.0 * (self.walked.mean / self.full.mean - 1.0)

    @property
    def error_se_percent(self) -> float:
        """Standard error of that [%]."""
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
        full, walked: share of all parts (m,); lost parts count as not gathered.
        full_se, walked_se: their standard errors, between seeds and between walkers (m,).
        full_lost, walked_lost: share lost at the end.
        agreement: of the share at the end.
    """

    time: Floats
    full: Floats
    full_se: Floats
    walked: Floats
    walked_se: Floats
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
    times, ways = [0.0], [np.full(walkers, cell.lines.distance(_start(prepared, 1))[0] / cell.reach)]

    def look(now: float, points: Floats) -> None:
        times.append(now)
        ways.append(cell.lines.distance(points) / cell.reach)

    began = time.process_time()
    walk(drift_map, prepared, np.repeat(_start(prepared, 1), walkers, axis=0), np.random.default_rng(0), look=look)
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
    walked = walk(drift_map, prepared, np.repeat(_start(prepared, 1), walkers, axis=0), np.random.default_rng(0))
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


def compare_gathering(
    drift_map: DriftMap, scenario: Scenario, seeds: int, walkers: int = WALKERS, step: float = STEP_S
) -> Gathering:
    """Share of the parts near a nodal line over time, and how many are lost."""
    prepared = prepare(with_run(scenario, seeds=seeds))
    scene, lines = prepared.scene, stage_lines(prepared.scene)
    result, full_cpu = _simulated(prepared)
    interval, count = scene.frame_interval, len(scene.parts)
    at = interval * np.arange(scene.n_frames, dtype=float)
    shares = np.zeros((seeds, len(at)))
    lost = 0
    for seed, of_seed in enumerate(result.trajectories):
        on = of_seed.on_plate(scene.surface)
        for frame in range(len(of_seed)):
            near = lines.near(0, of_seed.position[frame, on[frame], :2], ON_LINE)
            shares[seed, frame] = near.sum() / count
        lost += count - int(on[-1].sum()) if len(of_seed) == len(at) else count
    starts = _start(prepared, -(-walkers // count))[:walkers]
    times, near_lines = [0.0], [lines.near(0, starts, ON_LINE)]

    def look(now: float, points: Floats) -> None:
        times.append(now)
        there = np.zeros(len(points), bool)
        kept = ~np.isnan(points[:, 0])
        there[kept] = lines.near(0, points[kept], ON_LINE)
        near_lines.append(there)

    walk(drift_map, prepared, starts, np.random.default_rng(1), step=step, look=look)
    began = time.process_time()
    walked = walk(drift_map, prepared, starts, np.random.default_rng(0), step=step)  # without looking, for its time
    cpu = time.process_time() - began
    share = np.array(near_lines).mean(axis=1)
    walked_share = np.interp(at, times, share)
    full, full_se = shares.mean(axis=0), shares.std(axis=0, ddof=1) / math.sqrt(seeds)
    walked_se = np.sqrt(np.maximum(walked_share * (1.0 - walked_share), 1.0 / walkers) / walkers)
    agreement = Agreement(
        f"share near nodal lines after {at[-1]:.2g} s",
        Statistic.of(shares[:, -1].tolist()),
        Statistic.of(near_lines[-1].astype(float).tolist()),
        full_cpu / (seeds * count),
        cpu / walkers,
    )
    lost_share = lost / (seeds * count)
    return Gathering(at, full, full_se, walked_share, walked_se, lost_share, float(walked.lost.mean()), agreement)


def _simulated(prepared: Prepared) -> tuple[Result, float]:
    """The result of all seeds, and the processor time [s] that they took once the engine was compiled."""
    compile_engine(prepared)
    began = time.process_time()
    result = simulate(prepared)
    return result, time.process_time() - began


def _start(prepared: Prepared, draws: int) -> Floats:
    """Places of all parts at the start (draws * parts, 2) [m], of random numbers that no seed has."""
    rng = np.random.default_rng(2**40)
    poses = [start_poses(prepared.scene, rng) for _ in range(draws)]
    return np.array([pose.position[:2] for drawn in poses for pose in drawn])
