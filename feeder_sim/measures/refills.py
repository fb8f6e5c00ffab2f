"""Refills of a run: how many, of how many parts, and what there was no room for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from feeder_sim.measures.picking import picks_by_hand
from feeder_sim.measures.protocol import FindingsBase, Measure, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.notebook import counted
from feeder_sim.records.seed import Cause, Seed, parts_removed
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.refill import refill_count, refill_frames
from feeder_sim.scene.scene import Scene


@dataclass(frozen=True, repr=False)
class RefillFindings(FindingsBase):
    """Findings over the seeds that ran to their end.

    Attributes:
        refills: that brought parts.
        refilled: parts that came with them.
        not_refilled: parts that were wanted and did not come, for want of room or of a free place in the scene.
    """

    refills: Statistic
    refilled: Statistic
    not_refilled: Statistic


@dataclass(frozen=True)
class SeedRefills:
    """What is read of a seed: refills that brought parts, parts that came, parts that were wanted."""

    refills: int
    came: int
    requested: int


class Refills(Measure[RefillFindings, SeedRefills]):
    """Parts that came while a run went on."""

    headline = ("refilled",)

    def applies(self, prepared: Prepared) -> bool:
        return prepared.scenario.refill is not None

    def reader(self, prepared: Prepared) -> Callable[[Seed], SeedRefills]:
        scene = prepared.scene
        return lambda seed: SeedRefills(len(np.unique(seed.arrivals.cycle)), len(seed.arrivals), requested(scene, seed))

    def findings(self, prepared: Prepared, readings: Sequence[SeedRefills]) -> RefillFindings:
        return RefillFindings(
            refills=Statistic.of(float(seed.refills) for seed in readings),
            refilled=Statistic.of(float(seed.came) for seed in readings),
            not_refilled=Statistic.of(float(seed.requested - seed.came) for seed in readings),
        )

    def lines(self, prepared: Prepared, findings: RefillFindings) -> list[str]:
        if not findings.refills.n:
            return []
        text = f"{findings.refilled.mean:.1f} parts in {findings.refills.mean:.1f} refills"
        if findings.not_refilled.mean > 0.0:
            text += f"; {findings.not_refilled.mean:.1f} found no room"
        return [labelled("refilled", f"{text}, n = {counted(findings.refills.n, 'seed')}")]


def requested(scene: Scene, seed: Seed) -> int:
    """How many parts all refills of a seed were to bring; of those by hand nothing but what came is known."""
    if picks_by_hand(scene):
        return len(seed.arrivals)
    frames, number, half = seed.frames, 0, 0.5 * scene.frame_interval
    timed = scene.stopped(seed.stops.tolist()) if len(seed.stops) else scene
    for frame in refill_frames(timed):
        if frame < len(frames):
            remaining = scene.on_plate(frames[slice(frame, frame + 1)])[0]
            time = float(frames.time[frame])
            for cause in (Cause.PICKED, Cause.OUTLET):
                remaining[parts_removed(seed.removals, cause, start=time - half, end=time + half)] = False
            number += refill_count(scene, int(remaining.sum()))
    return number
