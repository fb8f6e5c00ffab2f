"""Drives or schedule of a scenario -> its stages in time, and the intervals in which each excitation acts."""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from feeder_sim.plate.drive import ModalDrive
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.schedule import Pick, Schedule, Settled, Stage

FRAME_AT = 1e-6  # of a frame interval, by which a frame may be before a time that it is at

Planned = tuple[str, Stage, tuple[int, ...]]  # name, table, indices into `Scenario.excitations`


@dataclass(frozen=True)
class TimedStage:
    """One stage of one cycle.

    Attributes:
        name: the one of the scenario, or else one made of its number.
        cycle: from 1; 0 for the stages that prepare the parts.
        number: of the stage in its cycle, from 0.
        start, stop, end: begin of the stage, end of its drives, end of its pause [s].
        excitations: indices into `Scenario.excitations`.
        picks: at the end.
        until: condition that ends the drives before `stop`; None without one.
    """

    name: str
    cycle: int
    number: int
    start: float
    stop: float
    end: float
    excitations: tuple[int, ...]
    picks: tuple[Pick, ...]
    until: Settled | None = None

    @property
    def clearance(self) -> float | None:
        """Largest clearance [m] that a pick at the end asks for; None where none does."""
        return max((1e-3 * pick.clearance_mm for pick in self.picks if pick.clearance_mm is not None), default=None)


@dataclass(frozen=True)
class Occurrence:
    """An interval in which one excitation acts: index into `Scenario.excitations`, start and stop [s]."""

    excitation: int
    start: float
    stop: float


@dataclass(frozen=True)
class Timetable:
    """All stages in order of time, all occurrences, and the duration of the run [s]."""

    stages: tuple[TimedStage, ...]
    occurrences: tuple[Occurrence, ...]
    duration: float


def largest_together(times: Timetable, drives: Sequence[Sequence[ModalDrive]], *, speeds: bool = False) -> float:
    """Largest deflection [m], or speed [m/s], that drives which act at the same time add up to at most.

    `drives` are all that belong to each excitation. Drives that move a mode alike from the same moment on add up as
    phasors, all others may meet at their largest. What still rings after a drive is left out.
    """
    largest = 0.0
    acting: set[Occurrence] = set()
    sets: set[frozenset[Occurrence]] = set()
    changes = [(o.start, True, o) for o in times.occurrences] + [(o.stop, False, o) for o in times.occurrences]
    # Stops come first.
    for _, simultaneous in itertools.groupby(
        sorted(changes, key=lambda change: change[:2]), key=lambda change: change[0]
    ):
        for _, is_start, occurrence in simultaneous:
            (acting.add if is_start else acting.discard)(occurrence)
        sets.add(frozenset(acting))
    for occurrences in sets:
        phasors: dict[tuple[float | None, ...], complex] = {}
        for occurrence in occurrences:
            for drive in drives[occurrence.excitation]:
                oscillator = (drive.shape, drive.natural_frequency, drive.damping_ratio)
                kind = (*oscillator, drive.drive_frequency, occurrence.start)
                amount = drive.largest_speed if speeds else drive.largest
                phasors[kind] = phasors.get(kind, 0.0) + cmath.rect(amount, drive.phase)
        largest = max(largest, sum(abs(amount) for amount in phasors.values()))
    return largest


def timetable(scenario: Scenario, stops: Sequence[float] = (), *, frame_interval: float | None = None) -> Timetable:
    """Lay out a scenario in time; drives without a schedule make one stage.

    Args:
        scenario: has the drives or the schedule.
        stops: times at which the drives of the first stages have stopped [s]; those of the other stages act for as
            long as the schedule says.
        frame_interval: of the run [s]; stages of a sequence end at the first frame after their pause. Without it they
            end with their pause.
    """
    schedule = scenario.schedule
    if schedule is None:
        duration = scenario.run.duration_s
        assert duration is not None  # the scenario's own check
        stage = TimedStage("", 0, 0, 0.0, duration, duration, tuple(range(len(scenario.drive))), (), None)
        stops = [d.start_s + d.duration_s if d.duration_s else math.inf for d in scenario.drive]
        acting = [Occurrence(i, d.start_s, stop) for i, (d, stop) in enumerate(zip(scenario.drive, stops, strict=True))]
        return Timetable((stage,), tuple(acting), duration)
    interval = frame_interval if schedule.sequence is not None else None
    prepare, of_cycle = _planned(schedule)
    stages: list[TimedStage] = []
    _append(stages, prepare, 0, stops, interval)
    for cycle in range(1, schedule.cycles + 1):
        _append(stages, [of_cycle[i] for i in schedule.order], cycle, stops, interval)
    return of_stages(stages)


def of_stages(stages: Sequence[TimedStage]) -> Timetable:
    """The timetable of some stages in order of time; of none it has no duration."""
    occurrences = tuple(Occurrence(i, stage.start, stage.stop) for stage in stages for i in stage.excitations)
    return Timetable(tuple(stages), occurrences, stages[-1].end if stages else 0.0)


def each_once(scenario: Scenario, times: Timetable) -> Timetable:
    """The timetable in which every stage comes once, also those that a sequence leaves out; else the usual times."""
    schedule = scenario.schedule
    if schedule is None or schedule.sequence is None:
        return times
    single_pass = schedule.model_copy(update={"sequence": None, "cycles": 1})
    return timetable(scenario.model_copy(update={"schedule": single_pass}))


def _planned(schedule: Schedule) -> tuple[list[Planned], list[Planned]]:
    """The stages that prepare the parts, and those of a cycle: name, table and excitations of each."""
    groups: tuple[list[Planned], list[Planned]] = [], []
    preparing = tuple(stage.name or f"prepare {i + 1}" for i, stage in enumerate(schedule.prepare))
    first = 0
    for group, names, tables in zip(
        groups, (preparing, schedule.stage_names), (schedule.prepare, schedule.stage), strict=True
    ):
        for name, stage in zip(names, tables, strict=True):
            group.append((name, stage, tuple(range(first, first + len(stage.drive)))))
            first += len(stage.drive)
    return groups


def _append(
    stages: list[TimedStage],
    group: Sequence[Planned],
    cycle: int,
    stops: Sequence[float],
    frame_interval: float | None,
) -> None:
    """Append one pass through a group of stages to the stages of a timetable."""
    for number, (name, stage, driven) in enumerate(group):
        start = stages[-1].end if stages else 0.0
        stop = float(stops[len(stages)]) if len(stages) < len(stops) else start + stage.duration_s
        end = stop + stage.pause_s
        if frame_interval is not None:
            end = math.ceil(end / frame_interval - FRAME_AT) * frame_interval
        stages.append(TimedStage(name, cycle, number, start, stop, end, driven, stage.picks, stage.until))


def timed(drives: Sequence[ModalDrive], times: Timetable) -> list[ModalDrive]:
    """One drive per occurrence, with its start and stop, from one drive per excitation of the scenario."""
    return [replace(drives[o.excitation], start=o.start, stop=o.stop) for o in times.occurrences]
