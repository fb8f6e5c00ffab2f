"""The walk by a drift map against full runs: on plates that it was not made from, and where it begins to be wrong.

    passage     transport speed of a nut between an antinode and the nodal line around it
    transport   time that a sequence of modes takes to carry a nut along a strip
    gathering   share of nuts within 5 mm of the nodal lines over time, each alone on the plate or many together
    ways        how far a part has come over time

Processor time is that of one part: of the full run over that of the walk, in which a thousand parts go at once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.arrivals import arrival_time
from feeder_sim.measures.drift import first_passage, transport_speed
from feeder_sim.measures.separation import ON_LINE
from feeder_sim.measures.stage_lines import StageLines, stage_lines
from feeder_sim.measures.statistic import Statistic
from feeder_sim.run.compilation import compile_engine
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Drive, HexNut, ModePlate, Run, Scattered, Scenario, load_scenario, with_run
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.cell import PASSAGE_FROM, PASSAGE_TO
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.start import start_poses
from feeder_sim.studies.drift_map.drift_map import DriftMap, Floats
from feeder_sim.studies.drift_map.making import make_map, strip_of
from feeder_sim.studies.drift_map.walk import Walked, walk
from feeder_sim.studies.speed_map import at_point

WALKERS = 1000
PERTURBED, FEWER = 6, 5  # maps that show the error of the map itself, each with so many times fewer walkers
FRAMES_PER_S = 50.0  # of gathering
FAR = 1e6  # [m]
GATHERING_HZ = 2646.0
SPEEDS_M_S = (0.01, 0.03, 0.06, 0.1, 0.13, 0.16, 0.2, 0.25, 0.3)
VOLTS = (5.0, 10.0, 20.0, 40.0, 60.0, 80.0, 120.0)
COUNTS = (1, 10, 25, 50, 100, 200, 400)
CROWD_VOLTS = 40.0
GATHERING_S = 2.0
LEAST_SEEDS = 4  # of a crowd
TIMES_S = (0.5, 1.0, 2.0, 4.0, 8.0)
AROUND = (0.25, 0.5, 0.75, 1.0, 1.4)  # velocity amplitudes of a map over that of the fastest drive


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
        full = f"{self.full.mean:.3g} ± {self.full.se:.2g}"
        walked = f"{self.walked.mean:.3g} ± {math.hypot(self.walked.se, self.map_se):.2g}"
        error = f"{self.error_percent:+.1f} ± {self.error_se_percent:.1f} %"
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
    walked, cpu, _ = _passages(drift_map, prepared, walkers, 0)
    map_se = _map_error(drift_map, lambda of, seed: _passages(of, prepared, walkers // FEWER, seed)[0].mean)
    return Agreement("transport speed (mm/s)", full, walked, full_cpu / seeds, cpu / walkers, map_se)


def _passages(drift_map: DriftMap, prepared: Prepared, walkers: int, seed: int) -> tuple[Statistic, float, float]:
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

    walk(drift_map, prepared, places, np.random.default_rng(seed), observer=look)
    cpu = time.process_time() - began - looking
    way, at = np.array(ways), np.array(times)
    took = [first_passage(at, w, PASSAGE_TO) - first_passage(at, w, PASSAGE_FROM) for w in way.T]
    speeds = (1e3 * (PASSAGE_FROM - PASSAGE_TO) * cell.reach / t for t in took if t > 0.0)
    return Statistic.of(speeds), cpu, times[-1]


def compare_transport(drift_map: DriftMap, scenario: Scenario, seeds: int) -> Agreement:
    """Time [s] until the end of a sequence of modes, of parts that arrive."""
    prepared = prepare(with_run(scenario, seeds=seeds))
    result, full_cpu = _simulated(prepared)
    full = Statistic.of(arrival_time(prepared.scene, seed) for seed in result.seeds)
    walked, cpu, _ = _arrivals(drift_map, prepared, WALKERS, 0)
    map_se = _map_error(drift_map, lambda of, seed: _arrivals(of, prepared, WALKERS // FEWER, seed)[0].mean)
    what = f"time of arrival (s); {full.n} of {seeds} arrive, by the map {100.0 * walked.n / WALKERS:.1f} %"
    return Agreement(what, full, walked, full_cpu / seeds, cpu / WALKERS, map_se)


def _arrivals(drift_map: DriftMap, prepared: Prepared, walkers: int, seed: int) -> tuple[Statistic, float, float]:
    """Time [s] of walkers that arrive, processor time [s] that all took, and the mean time that they walked [s]."""
    places, began = np.repeat(_start(prepared), walkers, axis=0), time.process_time()
    walked = walk(drift_map, prepared, places, np.random.default_rng(seed))
    cpu = time.process_time() - began
    return Statistic.of(walked.total[_at_goal(prepared, walked)].tolist()), cpu, float(walked.total.mean())


def _map_error(drift_map: DriftMap, number: Callable[[DriftMap, int], float]) -> float:
    """Standard error of a number that comes from the drifts of the map: its spread over perturbed maps."""
    perturbed = (drift_map.perturbed(np.random.default_rng(k)) for k in range(PERTURBED))
    return float(np.std([number(of, 1 + k) for k, of in enumerate(perturbed)], ddof=1))


def _at_goal(prepared: Prepared, walked: Walked) -> NDArray[np.bool_]:
    goal = prepared.scenario.goal
    assert goal is not None
    away = np.abs(walked.points[:, 0] - 1e-3 * goal.x_mm) if goal.x_mm is not None else np.zeros(len(walked.points))
    return np.asarray(away < 1e-3 * goal.within_mm)


def gathering_scenario(mode_file: Path, drive: Drive, duration_s: float, count: int = 1) -> Scenario:
    """Parts scattered over a plate that one mode moves."""
    return Scenario(
        plate=ModePlate(kind="modes", mode_file=mode_file),
        drive=(drive,),
        part=(HexNut(size="M2.5", start=Scattered(kind="scattered"), count=count),),
        run=Run(duration_s=duration_s, frames_per_second=FRAMES_PER_S),
    )


def compare_gathering(drift_map: DriftMap, scenario: Scenario, seeds: int) -> Gathering:
    """Share of the parts near a nodal line over time, and how many are lost."""
    prepared = prepare(with_run(scenario, seeds=seeds))
    scene, lines = prepared.scene, stage_lines(prepared.scene)
    result, full_cpu = _simulated(prepared)
    at, count = scene.frame_interval * np.arange(scene.n_frames, dtype=float), len(scene.parts)
    shares, lost = np.zeros((seeds, len(at))), 0
    for seed, frames in enumerate(result.trajectories):
        on = scene.on_plate(frames)
        for k in range(len(frames)):
            shares[seed, k] = lines.near(0, frames.position[k, on[k], :2], ON_LINE).sum() / count
        lost += count - int(on[-1].sum()) if len(frames) == len(at) else count
    # The same starts, each for several walkers, so that the difference does not hang on where parts start.
    repeats = math.ceil(WALKERS / (seeds * count))
    starts = np.concatenate([frames.position[0, :, :2] for frames in result.trajectories]).repeat(repeats, axis=0)

    def share(of: DriftMap, seed: int) -> float:
        walked = walk(of, prepared, starts[:: max(1, repeats // 2)], np.random.default_rng(seed))
        return float(_near(lines, walked.points).mean())

    times, near, walked = _shares_near(drift_map, prepared, lines, starts, 1)
    map_se, by_start = _map_error(drift_map, share), near.reshape(len(near), seeds, -1).mean(axis=2)
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


def _shares_near(
    drift_map: DriftMap, prepared: Prepared, lines: StageLines, starts: Floats, seed: int
) -> tuple[Floats, Floats, Walked]:
    """Times (m,) [s], which walkers are near a nodal line then (m, n), 1 or 0, and where they end."""
    times, near = [0.0], [_near(lines, starts)]

    def look(now: float, points: Floats) -> bool:
        times.append(now)
        near.append(_near(lines, points))
        return False

    walked = walk(drift_map, prepared, starts, np.random.default_rng(seed), observer=look)
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
    note: Callable[[BorderPoint], None],
) -> list[BorderPoint]:
    """Transport speed on a strip over the velocity amplitude, at the frequency of the scenario."""
    found = []
    frequency = scenario.drive[0].frequency_hz
    for speed in SPEEDS_M_S:
        point = at_point(scenario, frequency, 1e6 * speed / (2.0 * math.pi * frequency), seeds)
        found.append(BorderPoint(speed, _hop(scenario, speed), compare_passage(drift_map, point, seeds)))
        note(found[-1])
    return found


def high_hops_on_plate(
    drift_map: DriftMap,
    mode_file: Path,
    seeds: int,
    note: Callable[[BorderPoint], None],
) -> list[BorderPoint]:
    """Gathering of single parts on a plate over the velocity amplitude of its highest antinode."""
    found = []
    for voltage in VOLTS:
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
    parts: int,
    note: Callable[[BorderPoint], None],
) -> list[BorderPoint]:
    """Gathering over the number of parts on the plate at once; the map lets each walk as if it were alone."""
    found = []
    drive = Drive(frequency_hz=GATHERING_HZ, voltage_vpp=CROWD_VOLTS)
    for count in COUNTS:
        scenario = gathering_scenario(mode_file, drive, GATHERING_S, count)
        gathering = compare_gathering(drift_map, scenario, max(LEAST_SEEDS, parts // count))
        found.append(BorderPoint(count, math.nan, gathering.agreement, gathering))
        note(found[-1])
    return found


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
        ways = f"{self.full.mean:.3g} ± {self.full.se:.1g} | {self.walked.mean:.3g} ± {self.walked.se:.1g}"
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

    walk(drift_map, prepared, starts, np.random.default_rng(0), observer=look)
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


def map_around(scenario: Scenario, seeds: int) -> DriftMap:
    """A map of the part of a scenario for the frequencies of its drives, with so many runs behind each entry."""
    drives = prepare(scenario).scene.drives
    fastest = max(2.0 * math.pi * drive.drive_frequency * drive.steady_amplitude for drive in drives)
    frequencies = sorted({drive.drive_frequency for drive in drives})
    speeds = [share * fastest for share in AROUND]
    return make_map(scenario, strip_of(scenario), frequencies_hz=frequencies, speeds_m_s=speeds, seeds=seeds)


def steered_ball() -> Scenario:
    """A solder ball that one note moves all the time on the plate of scenarios/chladni_plate.toml.

    It starts half way between an antinode and a nodal line. The plate is that which steers balls in Zhou et al., Nat.
    Commun. 7 (2016) 12764; the note is at resonance, and its voltage gives a way as in the experiment.
    """
    plate = load_scenario(Path(__file__).parents[1] / "scenarios" / "chladni_plate.toml")
    raw = plate.model_dump(exclude_unset=True)
    del raw["schedule"]
    start = {"position_mm": [5.0, 3.0], "drop_height_mm": [0.001, 0.003]}
    changes = {
        "drive": [{"frequency_hz": 12996.6, "mode": 19, "voltage_vpp": 1.0}],
        "part": [raw["part"][0] | {"count": 1, "start": start}],
        "run": {"duration_s": 0.5, "seeds": 1, "steps_per_period": 40, "engine": "impulse"},
    }
    return validated(raw | changes, Scenario, Path("steered_ball"))
