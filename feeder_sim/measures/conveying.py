"""How fast a tray carries parts: their mean velocity along its line of motion, or round its middle.

It is the mean over the time of all stays of parts on the tray, each after its first second: a part that is taken and
comes again with a refill has two.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.protocol import FindingsBase, Measure, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.notebook import counted
from feeder_sim.plate.mode_shapes import Rigid
from feeder_sim.records.seed import Seed, Status
from feeder_sim.scenario import TrayExcitation, excitations_of
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.timetable import FRAME_AT

SETTLED = 1.0  # [s]; of a shorter run its first half
LEAST_S = 0.1  # on the tray after that


@dataclass(frozen=True, repr=False)
class ConveyingFindings(FindingsBase):
    """Findings over the seeds that ran to their end or until all parts had left.

    Attributes:
        conveying_speed_mm_s: along the first stroke of the scenario, else along x; mean over the parts of a seed.
        conveying_across_mm_s: to its left.
    """

    conveying_speed_mm_s: Statistic
    conveying_across_mm_s: Statistic


@dataclass(frozen=True, repr=False)
class CircularFindings(FindingsBase):
    """Findings over the same seeds.

    Attributes:
        circular_conveying_deg_s: round the middle of the tray, counter-clockwise seen from above.
    """

    circular_conveying_deg_s: Statistic


NO_PATH = (
    f"no part stayed on the tray for {LEAST_S:g} s, or a quarter of a shorter run, after the first {SETTLED:g} s or "
    "half of its stay"
)


class Conveying(Measure[ConveyingFindings, tuple[float, float]]):
    """Speed of conveying [m/s] of every seed, along and across."""

    headline = ("conveying_speed_mm_s",)
    counts = (Status.DONE, Status.LEFT_PLATE)
    missing: ClassVar[Mapping[str, str]] = {"conveying_speed_mm_s": NO_PATH}

    def applies(self, prepared: Prepared) -> bool:
        return prepared.scenario.plate.kind == "tray"

    def reader(self, prepared: Prepared) -> Callable[[Seed], tuple[float, float]]:
        scene, heading = prepared.scene, heading_of(prepared.scene)
        along = np.array([math.cos(heading), math.sin(heading)])

        def read(seed: Seed) -> tuple[float, float]:
            x, y = mean_velocity(list(paths_on_tray(scene, seed)))
            return float(along @ (x, y)), float(along @ (y, -x))

        return read

    def findings(self, prepared: Prepared, readings: Sequence[tuple[float, float]]) -> ConveyingFindings:
        return ConveyingFindings(*(Statistic.of(1e3 * seed[i] for seed in readings) for i in range(2)))

    def lines(self, prepared: Prepared, findings: ConveyingFindings) -> list[str]:
        speed, across = findings.conveying_speed_mm_s, findings.conveying_across_mm_s
        if not speed.n:
            return []
        text = f"{speed.mean:.2f} mm/s{_spread(speed)}, n = {counted(speed.n, 'seed')}; across {across.mean:.2f} mm/s"
        return [labelled("conveying speed", text)]


class CircularConveying(Measure[CircularFindings, float]):
    """Rate [rad/s] at which the parts of every seed go round the middle of a tray that a drive turns about z."""

    headline = ("circular_conveying_deg_s",)
    counts = (Status.DONE, Status.LEFT_PLATE)
    missing: ClassVar[Mapping[str, str]] = {"circular_conveying_deg_s": NO_PATH}

    def applies(self, prepared: Prepared) -> bool:
        shapes = [shape for mode in prepared.scene.driven for shape in (mode.shape, *(f.shape for f in mode.followers))]
        return any(isinstance(shape, Rigid) and shape.turn[2] != 0.0 for shape in shapes)

    def reader(self, prepared: Prepared) -> Callable[[Seed], float]:
        return lambda seed: mean_turning(list(paths_on_tray(prepared.scene, seed)))

    def findings(self, prepared: Prepared, readings: Sequence[float]) -> CircularFindings:
        return CircularFindings(Statistic.of(math.degrees(rate) for rate in readings))

    def lines(self, prepared: Prepared, findings: CircularFindings) -> list[str]:
        rate = findings.circular_conveying_deg_s
        text = f"{rate.mean:.2f} degrees/s{_spread(rate)}, counter-clockwise, n = {counted(rate.n, 'seed')}"
        return [labelled("circular", text)] if rate.n else []


def _spread(speed: Statistic) -> str:
    return f" +- {speed.se:.2f} (SE), SD {speed.sd:.2f}" if speed.n > 1 else ""


def heading_of(scene: Scene) -> float:
    """Direction [rad] of the first stroke of a scenario that is not upright; 0 without any."""
    motions = (drive for _, drive in excitations_of(scene.scenario, TrayExcitation))
    along = (drive.direction_deg for drive in motions if drive.stroke_um and abs(drive.angle_deg) != 90.0)
    return math.radians(next(along, 0.0))


def paths_on_tray(scene: Scene, seed: Seed) -> Iterator[NDArray[np.float64]]:
    """The path (n, 3) of every stay of a part on the tray: time [s], x and y [m], frame by frame.

    A stay begins with the run or with the arrival of the part, and ends where the part is taken, leaves the tray or the
    run is over. Its first SETTLED, or its first half if that is shorter, is left out, and so is all of a short stay.
    """
    frames = seed.frames
    scene = scene.stopped(seed.stops.tolist()) if len(seed.stops) else scene
    there, least = scene.on_plate(frames), min(LEAST_S, 0.25 * scene.times.duration)
    for part in range(frames.present.shape[1]):
        events = [
            float(time)
            for rows, after in ((seed.removals, -FRAME_AT), (seed.arrivals, FRAME_AT))
            for time in rows.time[rows.part == part] + after * scene.frame_interval
        ]
        # A part that is taken and comes back between two frames is there in both.
        cuts = set(np.searchsorted(frames.time, events).tolist()) | {0, len(frames)}
        cuts |= set((np.flatnonzero(np.diff(there[:, part])) + 1).tolist())
        for begin, end in itertools.pairwise(sorted(cuts)):
            if not there[begin:end, part].all() or end - begin < 2:
                continue
            span = float(frames.time[end - 1] - frames.time[begin])
            first = frames.row_at(float(frames.time[begin]) + min(SETTLED, 0.5 * span))
            if frames.time[end - 1] - frames.time[first] >= least:
                yield np.column_stack([frames.time[first:end], frames.position[first:end, part, :2]])


def mean_velocity(paths: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """Mean velocity along x and y [m/s] over the time of all paths (n, 3); NaN without any."""
    if not paths:
        return math.nan, math.nan
    elapsed, x, y = np.sum([path[-1] - path[0] for path in paths], axis=0).tolist()
    return x / elapsed, y / elapsed


def mean_turning(paths: Sequence[NDArray[np.float64]]) -> float:
    """Mean rate at which parts go round the middle of the tray [rad/s], by their moment over r^2; NaN without any."""
    moment = spread = 0.0
    for path in paths:
        place, step = 0.5 * (path[1:, 1:] + path[:-1, 1:]), np.diff(path, axis=0)
        moment += float((place[:, 0] * step[:, 2] - place[:, 1] * step[:, 1]).sum())
        spread += float(((place**2).sum(axis=1) * step[:, 0]).sum())
    return moment / spread if spread > 0.0 else math.nan
