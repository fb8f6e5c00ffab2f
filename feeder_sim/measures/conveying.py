"""How fast a tray carries parts: their mean velocity along its line of motion, after the first second.

Of every part the way between two frames counts, that at `SETTLED` and the last one in which it is on the tray.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from feeder_sim.measures.protocol import Found, Measure, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.seed import Seed, Status
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene

SETTLED = 1.0  # [s]; of a shorter run its first half
LEAST_S = 0.1  # on the tray after that


@dataclass(frozen=True, repr=False)
class ConveyingFindings(Found):
    """Findings over the seeds that ran to their end or until all parts had left.

    Attributes:
        conveying_speed_mm_s: along the first stroke of the scenario, else along x; mean over the parts of a seed.
        conveying_across_mm_s: to its left.
    """

    conveying_speed_mm_s: Statistic
    conveying_across_mm_s: Statistic


class Conveying(Measure[ConveyingFindings, tuple[float, float]]):
    """Speed of conveying [m/s] of every seed, along and across."""

    headline = ("conveying_speed_mm_s",)
    counts = (Status.DONE, Status.LEFT_PLATE)

    def applies(self, prepared: Prepared) -> bool:
        return prepared.scenario.plate.kind == "tray"

    def reader(self, prepared: Prepared) -> Callable[[Seed], tuple[float, float]]:
        scene, heading = prepared.scene, heading_of(prepared.scene)
        along = np.array([math.cos(heading), math.sin(heading)])

        def read(seed: Seed) -> tuple[float, float]:
            x, y = mean_velocity(scene, seed)
            return float(along @ (x, y)), float(along @ (y, -x))

        return read

    def findings(self, prepared: Prepared, readings: Sequence[tuple[float, float]]) -> ConveyingFindings:
        return ConveyingFindings(*(Statistic.of(1e3 * seed[i] for seed in readings) for i in range(2)))

    def lines(self, prepared: Prepared, findings: ConveyingFindings) -> list[str]:
        speed, across = findings.conveying_speed_mm_s, findings.conveying_across_mm_s
        if not speed.n:
            return []
        interval = f" +- {speed.se:.2f} (SE), SD {speed.sd:.2f}" if speed.n > 1 else ""
        return [
            labelled(
                "conveying speed",
                f"{speed.mean:.2f} mm/s{interval}, n = {speed.n} seeds; across {across.mean:.2f} mm/s",
            )
        ]


def heading_of(scene: Scene) -> float:
    """Direction [rad] of the first stroke of a scenario that is not upright; 0 without any."""
    strokes = (drive for _, drive in scene.scenario.excitations if drive.stroke_um and abs(drive.angle_deg) != 90.0)
    return math.radians(next((drive.direction_deg for drive in strokes), 0.0))


def mean_velocity(scene: Scene, seed: Seed) -> tuple[float, float]:
    """Mean over the parts of a seed of their velocity along x and y [m/s]; NaN without any that stays long enough."""
    frames = seed.frames
    first = frames.row_at(min(SETTLED, 0.5 * scene.times.duration))
    on_tray = frames.on_plate(scene.surface)[first:] if scene.surface.resting is None else frames.present[first:]
    there = np.flatnonzero(on_tray[0])
    last = first + np.array([_last_in_a_row(on_tray[:, part]) for part in there], np.int64)
    elapsed = frames.time[last] - frames.time[first]
    long = elapsed >= min(LEAST_S, 0.25 * scene.times.duration)
    if not long.any():
        return math.nan, math.nan
    moved = frames.position[last[long], there[long], :2] - frames.position[first, there[long], :2]
    x, y = (moved / elapsed[long, None]).mean(axis=0).tolist()
    return x, y


def _last_in_a_row(there: np.ndarray) -> int:
    """Index of the last of the frames (n,) that a part is there without a break, from the first on."""
    gone = np.flatnonzero(~there)
    return int(gone[0]) - 1 if len(gone) else len(there) - 1
