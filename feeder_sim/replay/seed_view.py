"""One seed of a run with what its replay is made of: timetable, modal coordinates, colours, kinds of parts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.drive import ModalTerms, modal_terms
from feeder_sim.records.recording import PartRecord, PlateRecord, Recording
from feeder_sim.records.seed import Seed
from feeder_sim.replay.colours import Colour, Colours, colours_of
from feeder_sim.replay.scenery import MM, TIMELINE, Times
from feeder_sim.scenario import Scenario, Start, parse_scenario
from feeder_sim.scene.scene import Guide, build_guide
from feeder_sim.scene.timetable import TimedStage, Timetable, timed, timetable

PERIOD_S = 2.0  # [s] on the slow timeline for one period of the plate
PERIODS = 2  # shown of every stage
PICTURES = 20  # per period


@dataclass(frozen=True)
class SeedView:
    """A seed of a recording, and what the colours of parts stand for.

    Raises:
        InputError: there is no such seed, or nothing of it.
    """

    recording: Recording
    seed: int
    meaning: Colour | None = None

    def __post_init__(self) -> None:
        seeds, file = self.recording.seeds, self.recording.path
        if not 0 <= self.seed < len(seeds):
            raise InputError(f"is {self.seed}, must be 0 to {len(seeds) - 1}", file=file, key="--show-seed")
        if not len(seeds[self.seed]):
            raise InputError(f"seed {self.seed} has no frames yet", file=file)

    @cached_property
    def plate(self) -> PlateRecord:
        """The plate."""
        return self.recording.plate

    @cached_property
    def record(self) -> Seed:
        """All that is recorded of the seed."""
        return self.recording.records[self.seed]

    @cached_property
    def last(self) -> float:
        """Time of the last frame [s]."""
        return float(self.record.frames.time[-1])

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario of the run."""
        return parse_scenario(self.recording.scenario_text, file=self.recording.path)

    @cached_property
    def crowd(self) -> bool:
        """Whether all parts and stages are shown, not the way of one part."""
        return self.scenario.schedule is not None or self.scenario.n_parts > 1

    @cached_property
    def colours(self) -> Colours:
        """Those of the parts."""
        return colours_of(self.scenario, self.meaning, self.recording.parts)

    @cached_property
    def guide(self) -> Guide | None:
        """That of a part which is alone."""
        part = self.scenario.part[0]
        if self.crowd or part.guide is None or not isinstance(part.start, Start):
            return None
        return build_guide(part.guide, part.start.position_mm)

    @cached_property
    def times(self) -> Timetable:
        """When the stages were."""
        frames, stops = self.record.frames, self.record.stops.tolist()
        return timetable(self.scenario, stops, frame_interval=float(frames.time[1]) if len(frames) > 1 else None)

    @cached_property
    def terms(self) -> ModalTerms:
        """Modal coordinates in time."""
        return modal_terms(timed(self.plate.drives, self.times))

    @property
    def stages(self) -> Iterator[tuple[TimedStage, Times]]:
        """The stages that were reached, with their begins."""
        for number, stage in enumerate(self.times.stages):
            if stage.start <= self.last:
                yield stage, {TIMELINE: stage.start, "cycle": stage.cycle, "stage": number}

    @property
    def slow_stages(self) -> list[tuple[float, TimedStage]]:
        """Every different stage that was reached, with its begin on the slow timeline [s]; one part alone has none."""
        different: dict[frozenset[object], TimedStage] = {}
        for stage, _ in self.stages:
            if stage.excitations and self.crowd:
                different.setdefault(frozenset(self.plate.drives[i] for i in stage.excitations), stage)
        return [(PERIODS * PERIOD_S * i, stage) for i, stage in enumerate(different.values())]

    def slow_times(self, stage: TimedStage) -> NDArray[np.float64]:
        """The last times of a stage (n,) [s], which the slow timeline shows."""
        frequency = max(self.plate.drives[i].drive_frequency for i in stage.excitations)
        return min(stage.stop, self.last) + (np.arange(PERIODS * PICTURES) / PICTURES - PERIODS) / frequency


def radius_of(part: PartRecord) -> float:
    """Radius [mm] of the ball around the centre of mass that holds a part."""
    return MM * float(np.linalg.norm(part.vertices, axis=1).max())
