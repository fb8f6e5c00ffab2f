"""How parts drift.

*Transport speed*: in a cell of the mode the nearest nodal line is a distance d0 away from the antinode. The speed of a
seed is 0.6 d0 divided by the time between the first passages of distance 0.8 d0 and 0.2 d0 from the nodal line.
*Drift velocity*: mean horizontal velocity over the whole recording, averaged over the parts present at its end.
*Highest rise*: largest height of a part's centre above its lowest one, over all parts; the drop at the start counts.
Heights are over the resting surface under the part.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.protocol import FindingsBase, Measure, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plate.surface import Surface
from feeder_sim.records.seed import Seed
from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.cell import PASSAGE_FROM, PASSAGE_TO, Cell
from feeder_sim.scene.prepared import Prepared

AT_ONCE = 200  # distances that are computed


@dataclass(frozen=True, repr=False)
class DriftFindings(FindingsBase):
    """Findings over the seeds that ran to their end; `arrived` is the number of seeds with a transport speed."""

    transport_speed_mm_s: Statistic
    drift_velocity_x_mm_s: Statistic
    drift_velocity_y_mm_s: Statistic
    arrived: int
    highest_rise_mm: Statistic
    antinode_to_node_mm: float | None

    @staticmethod
    def of(
        speeds: Iterable[float], velocities: Iterable[NDArray[np.float64]], rises: Iterable[float], cell: Cell | None
    ) -> DriftFindings:
        """Findings from transport speed [m/s], mean horizontal velocity (2,) [m/s] and highest rise [m] of seeds."""
        speed, velocity = Statistic.of(1e3 * value for value in speeds), [1e3 * value for value in velocities]
        return DriftFindings(
            transport_speed_mm_s=speed,
            drift_velocity_x_mm_s=Statistic.of(x for x, _ in velocity),
            drift_velocity_y_mm_s=Statistic.of(y for _, y in velocity),
            arrived=speed.n,
            highest_rise_mm=Statistic.of(1e3 * rise for rise in rises),
            antinode_to_node_mm=1e3 * cell.reach if cell else None,
        )


@dataclass(frozen=True)
class SeedDrift:
    """What is read of a seed: transport speed [m/s], mean horizontal velocity (2,) [m/s], highest rise [m]."""

    speed: float
    velocity: NDArray[np.float64]
    rise: float


class Drift(Measure[DriftFindings, SeedDrift]):
    """Transport speed, drift velocity and highest rise of a scenario without a schedule or refill."""

    headline = ("transport_speed_mm_s",)
    missing: ClassVar[Mapping[str, str]] = {
        "transport_speed_mm_s": f"no seed passed from {PASSAGE_FROM:g} to {PASSAGE_TO:g} of antinode to node",
        "drift_velocity_x_mm_s": "no part was there at the end of a seed",
    }

    def applies(self, prepared: Prepared) -> bool:
        return prepared.scenario.schedule is None and prepared.scenario.refill is None

    def reader(self, prepared: Prepared) -> Callable[[Seed], SeedDrift]:
        cell, surface, has_heights = prepared.cell, prepared.scene.surface, not prepared.is_tracked

        def read(seed: Seed) -> SeedDrift:
            speed = transport_speed(seed.frames, cell) if cell else math.nan
            rise = highest_rise(seed.frames, surface) if has_heights else math.nan
            return SeedDrift(speed, drift_velocity(seed.frames), rise)

        return read

    def without_value(self, prepared: Prepared, findings: DriftFindings) -> dict[str, str]:
        missing = super().without_value(prepared, findings)
        if prepared.cell is None:  # nothing is measured that could be missing
            del missing["transport_speed_mm_s"]
        return missing

    def findings(self, prepared: Prepared, readings: Sequence[SeedDrift]) -> DriftFindings:
        return DriftFindings.of(
            [seed.speed for seed in readings],
            [seed.velocity for seed in readings],
            [seed.rise for seed in readings],
            prepared.cell,
        )

    def lines(self, prepared: Prepared, findings: DriftFindings) -> list[str]:
        speed, lines = findings.transport_speed_mm_s, []
        if speed.n:
            interval = f" +- {speed.se:.3f} (SE), SD {speed.sd:.3f}" if speed.n > 1 else ""
            text = f"{speed.mean:.3f} mm/s{interval}, n = {speed.n} of {prepared.scenario.run.seeds} seeds"
            lines.append(labelled("transport speed", text))
        x, y = findings.drift_velocity_x_mm_s, findings.drift_velocity_y_mm_s
        if x.n and not any(prepared.scene.guides):
            lines.append(labelled("mean drift", f"x {x.mean:.3f}, y {y.mean:.3f} mm/s"))
            if findings.highest_rise_mm.n:
                lines.append(labelled("highest rise", f"{findings.highest_rise_mm.mean:.3f} mm"))
        return lines


def first_passage(time: NDArray[np.float64], distance: NDArray[np.float64], level: float) -> float:
    """Time [s] when `distance` (n,) first falls to `level`, interpolated between times (n,); NaN if it never does."""
    below = np.flatnonzero(distance <= level)
    if not len(below):
        return math.nan
    i = int(below[0])
    if i == 0:
        return float(time[0])
    fraction = (distance[i - 1] - level) / (distance[i - 1] - distance[i])
    return float(time[i - 1] + fraction * (time[i] - time[i - 1]))


def passage(frames: Frames, cell: Cell, level: float, part: int = 0) -> float:
    """Time [s] at which a part first comes to a fraction of d0, interpolated between frames; NaN if it never does."""
    may = cell.may_pass(frames, level, frames[slice(1)], part)
    for rows in np.split(may, range(AT_ONCE, len(may), AT_ONCE)):
        below = rows[cell.distance_to_node(frames[rows], part) <= level]
        if len(below):
            around = slice(max(0, int(below[0]) - 1), int(below[0]) + 1)
            return first_passage(frames.time[around], cell.distance_to_node(frames[around], part), level)
    return math.nan


def transport_speed(
    frames: Frames, cell: Cell, *, start: float = PASSAGE_FROM, end: float = PASSAGE_TO, part: int = 0
) -> float:
    """Speed [m/s] of one seed between two fractions of d0; NaN if the part did not pass both."""
    if not len(frames) or cell.distance_to_node(frames[slice(1)], part)[0] < start:  # it did not pass the start line
        return math.nan
    duration = passage(frames, cell, end, part) - passage(frames, cell, start, part)
    return (start - end) * cell.reach / duration if duration > 0 else math.nan


def drift_velocity(frames: Frames) -> NDArray[np.float64]:
    """Mean horizontal velocity [m/s] of the parts of one seed that are present at the end, shape (2,)."""
    elapsed, at_end = frames.time[-1] - frames.time[0], frames.present[-1]
    if not elapsed > 0 or not at_end.any():
        return np.full(2, math.nan)
    moved = frames.position[-1, at_end, :2] - frames.position[0, at_end, :2]
    return np.asarray(moved.mean(axis=0) / elapsed)


def highest_rise(frames: Frames, surface: Surface) -> float:
    """Largest height [m] of a part's centre over the resting surface under it, above its lowest recorded one.

    Over the parts of a seed that are there at its end; NaN without any. A part that slides down a tilted tray does not
    rise, nor does one that is carried up.
    """
    place = frames.position[:, frames.present[-1]]
    height = place[..., 2]
    if surface.resting is not None:
        height = height - surface.resting_height(place[..., :2].reshape(-1, 2)).reshape(height.shape)
    return float(np.ptp(height, axis=0).max()) if height.size else math.nan
