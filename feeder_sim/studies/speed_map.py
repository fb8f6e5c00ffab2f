"""Transport speed of a part on a standing wave over drive frequency and amplitude.

The drift is about proportional to the amplitude times frequency times wavenumber, which is the speed at which the top
surface moves to and fro. So a point starts its part at the same fraction of the way as the scenario does, and gets the
duration of the scenario times the wavelength and divided by that speed. Nothing moves where the throw number is small.
There two seeds go first, for a small part of the duration; where they have hardly moved, the point is given up.

The folder holds

    map.toml        what was asked
    scenario.toml   the scenario that was mapped, with all its defaults
    journal.jsonl   measures of every seed that is done
    map.csv         one row per point, see `MapPoint`
    map.png         the picture
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from feeder_sim.constants import GRAVITY
from feeder_sim.document.figure import Figure
from feeder_sim.errors import InputError, NotAllowed
from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import Runner
from feeder_sim.jobs.task import RepeatedWarning, SeedValues, Task
from feeder_sim.measures.effort import Effort
from feeder_sim.measures.statistic import LARGEST_OF_MANY, Statistic, finite_or_none
from feeder_sim.notebook import axes_for, counted
from feeder_sim.plate.mode_shapes import StandingWave, standing_wave
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.run.batch import check_drifting
from feeder_sim.run.prepare import ignored_uncertainty, prepare
from feeder_sim.run.provenance import identity_of
from feeder_sim.scenario import Drive, Scenario, Start, Strip, resolve_material, with_run
from feeder_sim.studies.question import Plan, Question
from feeder_sim.studies.study import Record, Study, csv_bytes
from feeder_sim.studies.sweep.cases import Case
from feeder_sim.studies.sweep.design import read_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DATA, PICTURE = "map.csv", "map.png"
MOST_VALUES = 1000  # of a list
SPEED, DRIFT = "transport_speed_mm_s", "drift_velocity_x_mm_s"
LEAST_DURATION_S = 2.0  # of a point: at high amplitudes a single hop takes a tenth of a second
LONGEST_DURATION_S = 1e5  # what a scenario allows
PROBED = 10.0  # throw number up to which a few seeds go first
PROBE_SEEDS, PROBE_SHARE, LONGEST_PROBE_S = 2, 0.05, 5.0  # share of the duration; parts that ride the plate are costly
STILL_M = 1e-4  # that a part may move as it settles; one that has moved less by the end of the probe does not move
HARDLY = 0.1  # of the way that has to be covered on average to arrive in time; a part that comes so far goes on
MOST_ARRIVE = 0.5  # of the seeds of a point; where fewer do, its mean is that of the fast ones alone
PASSAGE_SHARE = 0.7  # of the distance from antinode to node, from the start to the end of the passage, about


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


class MapQuestion(Question):
    """What is asked of a map."""

    kind = "map"
    file = "map.toml"
    base = "maps"

    frequencies_hz: Annotated[
        str, Field(strict=True, description="Drive frequencies [Hz]: LOW:HIGH:COUNT, LOW:HIGH:logCOUNT or A,B,C.")
    ] = "2500:10000:40"
    amplitudes_um: Annotated[str, Field(strict=True, description="Amplitudes [um], likewise.")] = "0.3:6:log40"
    seeds: Annotated[int, Field(strict=True, ge=1, le=10_000, description="Seeds of every point.")] = 12
    mark: Annotated[
        tuple[str, ...], Field(description="Measured point to draw: frequency [Hz], amplitude [um], speed [mm/s].")
    ] = ()

    @property
    def same(self) -> str:
        return f"{self.frequencies_hz} {self.amplitudes_um}"

    @property
    def points(self) -> list[tuple[float, float]]:
        """Every frequency with every amplitude.

        Raises:
            InputError: they are not written as an axis of a sweep is, or not above 0.
        """
        frequencies = values_of(self.frequencies_hz, "frequencies_hz")
        amplitudes = values_of(self.amplitudes_um, "amplitudes_um")
        return [(f, a) for f in frequencies for a in amplitudes]

    @property
    def marks(self) -> list[tuple[float, float, float]]:
        return [mark_of(text) for text in self.mark]

    def plan(self, scenario: Scenario, file: Path) -> MapPlan:
        points, _ = self.points, self.marks
        check_mapped(scenario)
        for point in (points[0], points[-1]):
            at_point(scenario, *point, self.seeds)  # refuses what is not allowed before anything is run
        return MapPlan(self, scenario, points)


def values_of(text: str, argument: str) -> list[float]:
    """Numbers above 0, written as an axis of a sweep is; `argument` is the one that holds them.

    Raises:
        InputError: it is written otherwise, or a value is not above 0.
    """
    try:
        values = read_axis(f"{argument}={text}").values
    except InputError as error:
        raise InputError(error.problem, argument=argument) from None
    if not values or len(values) > MOST_VALUES or not all(isinstance(v, int | float) and v > 0 for v in values):
        raise NotAllowed(text, "LOW:HIGH:COUNT, LOW:HIGH:logCOUNT or A,B,C, all above 0", argument=argument)
    return sorted(float(f"{value:.6g}") if ":" in text else float(value) for value in values)


def mark_of(text: str) -> tuple[float, float, float]:
    """A measured point: frequency [Hz], amplitude [um] and speed [mm/s].

    Raises:
        InputError: not three numbers above 0.
    """
    try:
        frequency, amplitude, speed = (float(part) for part in text.split(","))
        if not all(0.0 < value < math.inf for value in (frequency, amplitude, speed)):
            raise ValueError
    except ValueError:
        raise NotAllowed(text, "a mark of three numbers above 0 such as 4750,1.0,1.44", argument="mark") from None
    return frequency, amplitude, speed


class MapPlan(Plan):
    """What there is to run for a map, point by point; slow points take longest, and are spread over all of it.

    Args:
        question: what is asked.
        scenario: that is mapped.
        points: frequency [Hz] and amplitude [um] of each.
    """

    identities = None  # of those points alone that have begun

    def __init__(self, question: MapQuestion, scenario: Scenario, points: list[tuple[float, float]]) -> None:
        self._question, self._scenario, self._points = question, scenario, points
        self._map_points: dict[tuple[float, float], MapPoint] = {}
        self._ledger = Ledger()

    @property
    def all_done(self) -> bool:
        self._settle_all()
        return len(self._map_points) == len(self._points)

    def take(self, ledger: Ledger, *, recorded: bool = False) -> None:
        self._ledger = ledger  # which is looked at point by point: to make the scenarios of a thousand takes long
        if recorded:
            settled = [note["settled"] for note in ledger.notes if "settled" in note]
            for point in self._points:
                if _label(point) in settled:
                    self._map_points[point] = _point(point, list(ledger.recorded_at(_label(point)).values()))

    def _settle_all(self) -> None:
        for point in self._points if len(self._ledger) else ():
            if point not in self._map_points:
                self.settle(self.attempt_at(point, self._ledger), self._ledger)

    def part(self, number: int, of: int) -> MapPlan:
        return MapPlan(self._question, self._scenario, self._points[number - 1 :: of])

    def run(self, runner: Runner) -> bool:
        if len(self._ledger):
            runner.work.progress(0.0)  # there is something to keep, whenever it ends
        return runner.run(MapTasks(self, _strided(self._points), runner.ledger))

    def study(self, complete: bool, foreign_seeds: int) -> SpeedMap:
        self._settle_all()
        map_points = tuple(self._map_points[point] for point in self._points if point in self._map_points)
        return SpeedMap(self._question, self._scenario, map_points, complete)

    @property
    def share_done(self) -> float:
        return len(self._map_points) / len(self._points)

    def attempt_at(self, point: tuple[float, float], ledger: Ledger) -> Attempt:
        """A point at its begin: with its probe first where the throw number is small."""
        slow = throw_number(*point) < PROBED
        scenario = _probe(self._scenario, *point) if slow else self._full_scenario(point)
        return _attempt(point, scenario, PROBE_SEEDS if slow else self._question.seeds, ledger, probing=slow)

    def _full_scenario(self, point: tuple[float, float]) -> Scenario:
        return at_point(self._scenario, *point, self._question.seeds)

    def settle(self, attempt: Attempt, ledger: Ledger) -> Attempt | None:
        """Go on with a point as far as its seeds are done; None where that is all of it."""
        while attempt.case.is_done(attempt.effort):
            seeds = attempt.case.seeds(attempt.effort)
            if not (attempt.probing and _moves(self._scenario, attempt.point, attempt.case.scenario, seeds)):
                self._map_points[attempt.point] = _point(attempt.point, seeds)
                ledger.note({"settled": _label(attempt.point)})
                return None
            attempt = _attempt(attempt.point, self._full_scenario(attempt.point), self._question.seeds, ledger)
        return attempt


@dataclass(frozen=True)
class Attempt:
    """A point on its way: the scenario whose seeds are run now, how many of them, and whether that is the probe."""

    point: tuple[float, float]
    case: Case
    effort: Effort
    probing: bool = False


def _attempt(
    point: tuple[float, float], scenario: Scenario, seeds: int, ledger: Ledger, *, probing: bool = False
) -> Attempt:
    identity = identity_of(scenario)
    case = Case(lambda: scenario, _label(point), done=ledger.seeds_of(identity))
    return Attempt(point, case, Effort(seeds), probing)


def _label(point: tuple[float, float]) -> dict[str, float]:
    """A point of the map as the journal names it."""
    return {"frequency_hz": point[0], "amplitude_um": point[1]}


class MapTasks:
    """The seeds of all points that are still to be run, handed out point by point."""

    def __init__(self, plan: MapPlan, remaining: Sequence[tuple[float, float]], ledger: Ledger) -> None:
        self._plan, self._remaining, self._ledger = plan, deque(remaining), ledger
        self._in_progress: dict[tuple[float, float], Attempt] = {}

    def next(self, seeds: int) -> tuple[Attempt, Task] | None:
        for attempt in self._in_progress.values():
            if handed := attempt.case.hand_out(attempt.effort, seeds):
                return attempt, Task(attempt.case.scenario, attempt.case.identity, handed)
        while self._remaining:
            point = self._remaining.popleft()
            trial = self._plan.settle(self._plan.attempt_at(point, self._ledger), self._ledger)
            if trial is not None:
                self._in_progress[point] = trial
                return trial, Task(trial.case.scenario, trial.case.identity, trial.case.hand_out(trial.effort, seeds))
        return None

    def take(self, place: Attempt, done: tuple[SeedValues, ...]) -> None:
        place.case.take(done)
        for seed in done:
            self._ledger.add(place.case.identity, _label(place.point), seed)
        goes_on = self._plan.settle(place, self._ledger)
        if goes_on is None:
            del self._in_progress[place.point]
        else:
            self._in_progress[place.point] = goes_on

    @property
    def share_done(self) -> float:
        return self._plan.share_done


@dataclass(frozen=True, repr=False)
class SpeedMap(Study):
    """Transport speeds over frequency and amplitude.

    Attributes:
        question: what was asked.
        scenario: that was mapped.
        points: of the map, a `MapPoint` each.
        complete: whether all of them are done.
    """

    picture = PICTURE
    question: MapQuestion
    scenario: Scenario
    points: tuple[MapPoint, ...]
    complete: bool

    @property
    def warnings(self) -> list[RepeatedWarning]:
        """What misleads: uncertain inputs, whose values are those of the scenario."""
        return [RepeatedWarning(line, 1, 1) for line in ignored_uncertainty(self.scenario)]

    @property
    def fastest(self) -> MapPoint | None:
        """The largest mean where at least half of the seeds arrive; None where they do at no point.

        The largest of many means is too large on average: check it with fresh seeds.
        """
        believed = [point for point in self.points if point.n and point.n >= MOST_ARRIVE * point.seeds]
        return max(believed, key=lambda point: point.mean, default=None)

    @property
    def heading(self) -> str:
        """Over the picture; a title that names the frequency of the scenario would mislead."""
        return f"Transport speed of {self.scenario.kind_names[0].replace('_', ' ')}"

    def measure(self, name: str | None = None) -> str:
        return SPEED

    def table(self) -> list[Record]:
        return [{name: finite_or_none(value) for name, value in asdict(point).items()} for point in self.points]

    @property
    def size(self) -> str:
        return counted(len(self.points), "point")

    def as_json(self, measure: str | None = None) -> dict[str, Any]:
        return {"points": self.table()}

    def files(self, carried: Callable[[Any], str]) -> dict[str, bytes]:
        return {DATA: csv_bytes([field.name for field in fields(MapPoint)], self.table())}

    def figures(self, measure: str) -> list[Figure]:
        from feeder_sim.plots.speed_map import map_figure

        return [map_figure(self)] if self.points else []

    def plot(self, *, marks: Sequence[tuple[float, float, float]] = (), ax: Axes | None = None) -> Axes:
        """Draw the map, with lines of equal throw number; returns matplotlib axes.

        Args:
            marks: measured points: frequency [Hz], amplitude [um], speed [mm/s].
            ax: matplotlib axes to draw into; default: new ones.

        Raises:
            InputError: no point is done.
        """
        from feeder_sim.plots.speed_map import draw_points

        if not self.points:
            raise InputError("no point is done, there is nothing to draw", key="plot")
        axes = axes_for(ax)
        draw_points(axes, self.points, title=self.heading, marks=marks)
        return axes

    def lines(self, measure: str | None = None) -> list[str]:
        """Where parts are fastest, as far as that can be told, and what it is worth."""
        arrived = [point for point in self.points if point.n]
        failed = sum(point.failed for point in self.points)
        lines = [f"{len(self.points)} points, {len(arrived)} with arrivals, {failed} failed seeds"]
        best = self.fastest
        if best is None:
            return [*lines, "fastest: not told, at no point at least half of the seeds arrive"]
        error = f" +- {best.se:.3f}" if math.isfinite(best.se) else ""
        where = f"{best.frequency_hz:g} Hz, {best.amplitude_um:g} um, n = {best.n} of {best.seeds}"
        lines.append(f"fastest, where at least half of the seeds arrive: {best.mean:.3f}{error} mm/s at {where}")
        return [*lines, LARGEST_OF_MANY] if len(self.points) > 1 else lines

    def _line(self) -> str:
        suffix = "" if self.complete else ", not complete"
        suffix += f", {counted(len(self.warnings), 'warning')}" if self.warnings else ""
        arrived = sum(point.n > 0 for point in self.points)
        return f"SpeedMap: {counted(len(self.points), 'point')}, {arrived} with arrivals{suffix}"


def check_mapped(scenario: Scenario) -> None:
    """Refuse what cannot be mapped over frequency and amplitude.

    Raises:
        InputError: the plate is no strip, there is not one drive by an amplitude, the part does not start at a point,
            or there is a schedule.
    """
    if not isinstance(scenario.plate, Strip):
        problem = f'is "{scenario.plate.kind}", must be "strip" for a map: a standing wave of any frequency'
        raise InputError(problem, key="plate.kind")
    if len(scenario.drive) != 1:
        raise InputError(f"is given {len(scenario.drive)} times, must be once for a map", key="drive")
    if not isinstance(scenario.part[0].start, Start):
        raise InputError(f'is "{scenario.part[0].start.kind}", must be "point" for a map', key="part[0].start.kind")
    if scenario.run.stop != "passage":
        raise InputError(f'is "{scenario.run.stop}", must be "passage" for a map', key="run.stop")
    (drive,) = scenario.drive
    if not (isinstance(drive, Drive) and drive.amplitude_um):
        raise InputError("is 0, must be above 0 for a map, whose durations go by it", key="drive[0].amplitude_um")
    check_drifting(prepare(with_run(scenario, seeds=1)))


def at_point(scenario: Scenario, frequency_hz: float, amplitude_um: float, seeds: int) -> Scenario:
    """The scenario at another frequency and amplitude; start and duration go with them as the module says.

    Raises:
        InputError: the strip has no standing wave of that frequency, or a value is not allowed.
    """
    old, new = _wave(scenario, scenario.drive[0].frequency_hz), _wave(scenario, frequency_hz)
    longer = new.wavelength / old.wavelength
    before, start = scenario.drive[0], scenario.part[0].start
    assert isinstance(start, Start) and isinstance(before, Drive) and before.amplitude_um and scenario.run.duration_s
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


def _strided(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The same points in an order in which neighbours lie far apart."""
    n = len(points)
    step = next((s for s in range(int(0.618 * n) + 1, n) if math.gcd(s, n) == 1), 1)
    return [points[i * step % n] for i in range(n)]


def _probe(scenario: Scenario, frequency_hz: float, amplitude_um: float) -> Scenario:
    """The first seeds of a point for a small part of its duration."""
    full_scenario = at_point(scenario, frequency_hz, amplitude_um, PROBE_SEEDS)
    assert full_scenario.run.duration_s
    return with_run(full_scenario, duration_s=min(PROBE_SHARE * full_scenario.run.duration_s, LONGEST_PROBE_S))


def _moves(scenario: Scenario, point: tuple[float, float], probe: Scenario, seeds: Sequence[SeedValues]) -> bool:
    """Whether the first seeds move so fast that some may arrive in time; those that fell off count as moving."""
    duration, cell = at_point(scenario, *point, PROBE_SEEDS).run.duration_s, prepare(probe).cell
    probe_duration = probe.run.duration_s
    assert cell is not None and duration and probe_duration
    speed = 1e-3 * abs(Statistic.of(seed.values.get(DRIFT, math.nan) for seed in seeds).mean)
    return not (speed * probe_duration < STILL_M or speed * duration < HARDLY * PASSAGE_SHARE * cell.reach)


def throw_number(frequency_hz: float, amplitude_um: float) -> float:
    """Peak acceleration over gravity."""
    return 1e-6 * amplitude_um * (2.0 * math.pi * frequency_hz) ** 2 / GRAVITY


def _point(point: tuple[float, float], seeds: Sequence[SeedValues]) -> MapPoint:
    speed = Statistic.of(seed.values.get(SPEED, math.nan) for seed in seeds)
    failed = sum(bool(seed.failure) or seed.left for seed in seeds)
    return MapPoint(*point, throw_number(*point), speed.mean, speed.se, speed.n, failed, len(seeds))
