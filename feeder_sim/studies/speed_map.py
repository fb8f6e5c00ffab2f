"""Transport speed of a part on a standing wave over drive frequency and amplitude.

The drift is about proportional to the amplitude times frequency times wavenumber, which is the speed at which the top
surface moves to and fro. So a point starts its part at the same fraction of the way as the scenario does, and gets the
duration of the scenario times the wavelength and divided by that speed. Nothing moves where the throw number is small.
There two seeds go first, for a small part of the duration; where they have hardly moved, the point is given up.
"""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError
from feeder_sim.jobs.identity import identity_of
from feeder_sim.jobs.journal import Journal, read_journal
from feeder_sim.measures.statistic import finite_or_none
from feeder_sim.plate.mode_shapes import StandingWave, standing_wave
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.records.seed import Status
from feeder_sim.run.batch import Ensemble, check_drifting, measure_drift
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Scenario, Start, Strip, resolve_material, with_run
from feeder_sim.scene.scene import GRAVITY

BATCH = 16  # points between two entries into the journal
LEAST_DURATION_S = 2.0  # of a point: at high amplitudes a single hop takes a tenth of a second
LONGEST_DURATION_S = 1e5  # what a scenario allows
PROBED = 10.0  # throw number up to which a few seeds go first
PROBE_SEEDS, PROBE_SHARE, LONGEST_PROBE_S = 2, 0.05, 5.0  # share of the duration; parts that ride the plate are costly
STILL_M = 1e-4  # that a part may move as it settles; one that has moved less by the end of the probe does not move
HARDLY = 0.1  # of the way that has to be covered on average to arrive in time; a part that comes so far goes on
MOST_ARRIVE = 0.5  # of the seeds of a point; where fewer do, its mean is that of the fast ones alone
WAY = 0.7  # of the distance from antinode to node, from the start to the end of the passage, about


@dataclass(frozen=True)
class MapPoint:
    """One point of the map.

    Attributes:
        frequency_hz, amplitude_um: of the drive.
        throw_number: peak acceleration of the antinode over gravity.
        mean, se: transport speed and its standard error [mm/s]; NaN without arrivals, the error of one arrival too.
        n: seeds that arrived at the end of the measured way.
        failed: seeds that fell off the plate or were stopped by the guard.
        seeds: that were run; fewer than asked for where the point was given up.
    """

    frequency_hz: float
    amplitude_um: float
    throw_number: float
    mean: float
    se: float
    n: int
    failed: int
    seeds: int


def check_mapped(scenario: Scenario) -> None:
    """Refuse what cannot be mapped over frequency and amplitude.

    Raises:
        InputError: the plate is no strip, there is not one drive by an amplitude, the part does not start at a point,
            or there is a schedule.
    """
    if not isinstance(scenario.plate, Strip):
        problem = f'is "{scenario.plate.kind}", allowed is "strip" for a map: a standing wave of any frequency'
        raise InputError(problem, key="plate.kind")
    if len(scenario.drive) != 1:
        raise InputError(f"is given {len(scenario.drive)} times, allowed is once for a map", key="drive")
    if not isinstance(scenario.part[0].start, Start):
        raise InputError(f'is "{scenario.part[0].start.kind}", allowed is "point" for a map', key="part[0].start.kind")
    if scenario.run.stop != "passage":
        raise InputError(f'is "{scenario.run.stop}", allowed is "passage" for a map', key="run.stop")
    if not scenario.drive[0].amplitude_um:
        raise InputError("is 0, allowed is above 0 for a map, whose durations go by it", key="drive[0].amplitude_um")
    check_drifting(prepare(with_run(scenario, seeds=1)))


def at_point(scenario: Scenario, frequency_hz: float, amplitude_um: float, seeds: int) -> Scenario:
    """The scenario at another frequency and amplitude; start and duration go with them as the module says.

    Raises:
        InputError: the strip has no standing wave of that frequency, or a value is not allowed.
    """
    old, new = _wave(scenario, scenario.drive[0].frequency_hz), _wave(scenario, frequency_hz)
    longer = new.wavelength / old.wavelength
    before, start = scenario.drive[0], scenario.part[0].start
    assert isinstance(start, Start) and before.amplitude_um and scenario.run.duration_s
    faster = frequency_hz * amplitude_um / (before.frequency_hz * before.amplitude_um * longer)
    return scenario.changed(
        {
            "drive[0].frequency_hz": frequency_hz,
            "drive[0].amplitude_um": amplitude_um,
            "part[0].start.position_mm": [start.position_mm[0] * longer, start.position_mm[1]],
            "run.duration_s": min(max(LEAST_DURATION_S, scenario.run.duration_s * longer / faster), LONGEST_DURATION_S),
            "run.seeds": seeds,
        }
    )


def _wave(scenario: Scenario, frequency_hz: float) -> StandingWave:
    assert isinstance(scenario.plate, Strip)
    material = resolve_material(scenario.plate.material)
    try:
        return standing_wave(RectangularPlate(1.0, 1.0, 1e-3 * scenario.plate.thickness_mm, material), frequency_hz)
    except ValueError as error:
        raise InputError(f"is {frequency_hz:g}, {error}", key="drive[0].frequency_hz") from error


def speed_map(
    scenario: Scenario,
    frequencies_hz: Sequence[float],
    amplitudes_um: Sequence[float],
    *,
    seeds: int = 12,
    journal: Path | None = None,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
    stop: threading.Event | None = None,
    notify: Callable[[str], None] | None = None,
) -> list[MapPoint]:
    """Measure the transport speed at every pair of a frequency and an amplitude.

    Args:
        scenario: one part on a strip, with `run.stop = "passage"`.
        frequencies_hz: of the points.
        amplitudes_um: of the points.
        seeds: of every point.
        journal: file that keeps the points that are done; those in it are not computed again, if they are of the same
            scenario, number of seeds, files and version.
        workers: threads. Default: all cores.
        progress: called with the fraction done, from this thread; first when there is something to keep.
        stop: set it to end within a second; the points done so far are returned.
        notify: takes a line for the user.

    Raises:
        InputError: a scenario that cannot be mapped.
        RecordingFailed: the journal cannot be written.
    """
    check_mapped(scenario)
    wanted = [(float(f), float(a)) for f in frequencies_hz for a in amplitudes_um]
    for f in (min(frequencies_hz), max(frequencies_hz)):
        at_point(scenario, float(f), max(amplitudes_um), seeds)  # refuses what is not allowed before anything is run
    stop = stop or threading.Event()
    whose = _whose(scenario, seeds)
    done = _done(whose, journal)
    # Slow points take longest: spread over all of the map, so that the time left can be told.
    left = _strided([point for point in wanted if point not in done])

    def tell(*_: int) -> None:
        if progress:
            progress(sum(point in done for point in wanted) / len(wanted))

    if done:
        tell()  # there is something to keep, whenever it ends
    with contextlib.ExitStack() as held:
        written = held.enter_context(Journal(journal)) if journal and left else None
        while left and not stop.is_set():
            batch, left = left[:BATCH], left[BATCH:]
            for point in _measured(scenario, batch, seeds, workers=workers, progress=tell, stop=stop, notify=notify):
                done[point.frequency_hz, point.amplitude_um] = point
                if written:
                    written.add({"map": whose, "point": without_nan(asdict(point))})
            tell()
    return [done[point] for point in wanted if point in done]


def fastest_of(points: Sequence[MapPoint]) -> MapPoint | None:
    """The point with the largest mean among those where at least half of the seeds arrive; None where there is none."""
    believed = [point for point in points if point.n and point.n >= MOST_ARRIVE * point.seeds]
    return max(believed, key=lambda point: point.mean, default=None)


def _strided(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The same points in an order in which neighbours lie far apart."""
    n = len(points)
    step = next((s for s in range(int(0.618 * n) + 1, n) if math.gcd(s, n) == 1), 1)
    return [points[i * step % n] for i in range(n)]


def _measured(
    scenario: Scenario,
    batch: Sequence[tuple[float, float]],
    seeds: int,
    *,
    workers: int | None,
    progress: Callable[[int], None],
    stop: threading.Event,
    notify: Callable[[str], None] | None,
) -> Iterator[MapPoint]:
    """The points of a batch that are done when `stop` is set, or all of them; `progress` is called as they come."""
    how: dict[str, Any] = {"workers": workers, "progress": progress, "stop": stop, "notify": notify}
    slow = [point for point in batch if throw_number(*point) < PROBED]
    probes = measure_drift((_probe(scenario, *point) for point in slow), **how)
    given_up = {point: probe for point, probe in zip(slow, probes, strict=False) if not _moves(scenario, point, probe)}
    whole = [point for point in batch if point not in given_up]
    ensembles = measure_drift((at_point(scenario, *point, seeds) for point in whole), **how)
    if len(probes) == len(slow):  # else it was stopped, and which points move is not known
        yield from (_point(*of) for of in given_up.items())
        yield from (_point(*of) for of in zip(whole, ensembles, strict=False))


def _probe(scenario: Scenario, frequency_hz: float, amplitude_um: float) -> Scenario:
    """The first seeds of a point for a small part of its duration."""
    whole = at_point(scenario, frequency_hz, amplitude_um, PROBE_SEEDS)
    assert whole.run.duration_s
    return with_run(whole, duration_s=min(PROBE_SHARE * whole.run.duration_s, LONGEST_PROBE_S))


def _moves(scenario: Scenario, point: tuple[float, float], probe: Ensemble) -> bool:
    """Whether the first seeds move so fast that some may arrive in time; those that fell off count as moving."""
    whole = at_point(scenario, *point, PROBE_SEEDS).run.duration_s
    assert probe.prepared.cell is not None and whole
    speed = 1e-3 * abs(probe.findings.drift_velocity_x_mm_s.mean)
    took = probe.prepared.scene.times.duration
    return not (speed * took < STILL_M or speed * whole < HARDLY * WAY * probe.prepared.cell.reach)


def throw_number(frequency_hz: float, amplitude_um: float) -> float:
    """Peak acceleration over gravity."""
    return 1e-6 * amplitude_um * (2.0 * math.pi * frequency_hz) ** 2 / GRAVITY


def _point(point: tuple[float, float], ensemble: Ensemble) -> MapPoint:
    speed = ensemble.findings.transport_speed_mm_s
    failed = sum(status != Status.DONE for status in ensemble.status)
    seeds = len(ensemble.status)
    return MapPoint(*point, throw_number(*point), speed.mean, speed.se, speed.n, failed, seeds)


def _done(whose: str, journal: Path | None) -> dict[tuple[float, float], MapPoint]:
    """The points in a journal that are of this map."""
    found = [entry for entry in read_journal(journal) if entry["map"] == whose] if journal else []
    points = [MapPoint(**_with_nan(entry["point"])) for entry in found]
    return {(point.frequency_hz, point.amplitude_um): point for point in points}


def _whose(scenario: Scenario, seeds: int) -> str:
    """What a point of a map depends on, besides its frequency and amplitude."""
    return f"{identity_of(scenario)} {seeds}"


def without_nan(row: dict[str, float]) -> dict[str, float | None]:
    """As JSON and CSV take it: None for a number that is not there."""
    return {name: finite_or_none(value) for name, value in row.items()}


def _with_nan(row: dict[str, Any]) -> dict[str, Any]:
    return {name: math.nan if value is None else value for name, value in row.items()}
