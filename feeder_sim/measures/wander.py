"""How parts wander besides their drift: how far their places and headings scatter within `WITHIN` seconds.

*Wander*: root mean square of the horizontal displacement within that time, less the mean one of the part.
*Turning*: root mean square of the turn about the vertical within that time.

Both are over all parts and times of a seed. Places and headings are means over blocks of a fifth of the time. The
square of a displacement is its product with that from `BESIDE` blocks earlier to as many later: no block is in both, so
that the noise of a camera, which is another one in every frame, drops out of the mean.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.drift import passage
from feeder_sim.measures.protocol import FindingsBase, Measure, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.seed import Seed
from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.cell import PASSAGE_TO, Cell
from feeder_sim.scene.prepared import Prepared

WITHIN = 0.5  # [s]
SAME_BLOCK = 1e-2  # of one, by which the times of a camera may be off
BLOCKS, BESIDE = 5, 2  # whose mean places are taken, within that time and beside it
LEAST_S = 2.0 * WITHIN * (1.0 + BESIDE / BLOCKS)  # of a part, for a value


@dataclass(frozen=True, repr=False)
class WanderFindings(FindingsBase):
    """Findings over the seeds that ran to their end; both within half a second."""

    wander_mm: Statistic
    turning_deg: Statistic


class Wander(Measure[WanderFindings, tuple[float, float]]):
    """Root mean square displacement [m] and turn [rad] of the parts of a seed, without a schedule or refill."""

    missing: ClassVar[Mapping[str, str]] = {
        "wander_mm": f"no part was there for {LEAST_S:g} s",
        "turning_deg": f"no part was there for {LEAST_S:g} s, or no angle was seen",
    }

    def applies(self, prepared: Prepared) -> bool:
        scenario = prepared.scenario
        return scenario.schedule is None and scenario.refill is None and scenario.guide is None

    def reader(self, prepared: Prepared) -> Callable[[Seed], tuple[float, float]]:
        ends_at = prepared.cell if prepared.scenario.run.stop == "passage" else None
        return lambda seed: wander(seed.frames if ends_at is None else up_to_passage(seed.frames, ends_at))

    def findings(self, prepared: Prepared, readings: Sequence[tuple[float, float]]) -> WanderFindings:
        return WanderFindings(
            Statistic.of(1e3 * displacement for displacement, _ in readings),
            Statistic.of(math.degrees(turn) for _, turn in readings),
        )

    def lines(self, prepared: Prepared, findings: WanderFindings) -> list[str]:
        place, turn = findings.wander_mm, findings.turning_deg
        if not place.n:
            return []
        turned = f" and {turn.mean:.3g} degrees" if turn.n else ""
        return [labelled("wander", f"{place.mean:.3f} mm{turned} within {WITHIN:g} s")]


def up_to_passage(frames: Frames, cell: Cell) -> Frames:
    """Frames of a seed of one part up to the end of the measured way; a run ends some frames later."""
    end = passage(frames, cell, PASSAGE_TO)
    return frames[slice(frames.row_at(end) + 1)] if math.isfinite(end) else frames


def wander(frames: Frames) -> tuple[float, float]:
    """Root mean square of displacements [m] and of turns [rad] within `WITHIN`; NaN where no part is there so long."""
    displacements, turns = [], []
    for place, heading in _paths(frames):
        moved, around = _displacements(place)
        displacements.append((moved * around).sum(axis=1))
        turns.append((heading[BLOCKS:] - heading[:-BLOCKS]) ** 2)
    if not displacements:
        return math.nan, math.nan
    displacement, turn = (math.sqrt(max(0.0, np.concatenate(squares).mean())) for squares in (displacements, turns))
    return displacement, turn


def _displacements(path: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacements within `WITHIN`, and those from earlier to later, less the mean ones, (n, 2) each."""
    within = path[BESIDE + BLOCKS : -BESIDE] - path[BESIDE : -BESIDE - BLOCKS]
    around = path[BLOCKS + 2 * BESIDE :] - path[: -BLOCKS - 2 * BESIDE]
    return within - within.mean(axis=0), around - around.mean(axis=0)


def _paths(frames: Frames) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Mean place (n, 2) [m] and heading (n,) [rad] of each part that is there long enough, in blocks of time."""
    if len(frames) < 2:
        return
    block = np.floor((frames.time - frames.time[0]) / (WITHIN / BLOCKS) + SAME_BLOCK).astype(int)
    seen = np.isfinite(frames.angular_velocity[..., 2])  # tracks may have no angles
    heading = np.where(seen, headings(frames.quaternion), np.nan)
    for part in range(frames.present.shape[1]):
        there = frames.present[:, part]
        count = np.bincount(block, there)
        whole = np.flatnonzero(count == np.bincount(block))
        whole = whole[:-1] if len(whole) and whole[-1] == block[-1] else whole  # the last block may be cut
        if len(whole) < 2 * (BLOCKS + BESIDE) or whole[-1] - whole[0] + 1 != len(whole):
            continue
        x, y, turn = (
            np.bincount(block, values * there)[whole] / count[whole]
            for values in (*frames.position[:, part, :2].T, heading[:, part])
        )
        yield np.column_stack([x, y]), turn


def headings(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn about the vertical since the first frame [rad], (n, parts), of attitudes (n, parts, 4), w first.

    The turns about z between frames, one after the other: of a part that tumbles there is no other heading.
    """
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    real = w[1:] * w[:-1] + x[1:] * x[:-1] + y[1:] * y[:-1] + z[1:] * z[:-1]
    about_z = z[1:] * w[:-1] - w[1:] * z[:-1] + y[1:] * x[:-1] - x[1:] * y[:-1]
    turn = 2.0 * np.arctan2(about_z, real)
    steps = np.mod(turn + np.pi, 2.0 * np.pi) - np.pi
    return np.concatenate([np.zeros((1, quaternion.shape[1])), np.cumsum(steps, axis=0)])
