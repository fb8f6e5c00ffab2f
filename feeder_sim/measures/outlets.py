"""Parts that go through outlets: how many, how fast, how many of them right, and jams.

A *jam* is a span of `jam_after_s` or more without any part through, while parts are there. A longer one is one jam.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.picking import is_right
from feeder_sim.measures.protocol import FindingsBase, Measure, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.notebook import counted
from feeder_sim.records.seed import Cause, Seed, Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene


@dataclass(frozen=True, repr=False)
class Throughput(FindingsBase):
    """Of some outlets together, over the seeds that ran to their end.

    Attributes:
        parts_through: parts that went through.
        throughput_per_min: of them per minute of the seed.
        first_through_s: when the first one did [s].
        right_share: share of them of the kind and with the side up that their outlet wants [1]; of outlets that say so.
        jams: spans of `jam_after_s` or more without any part through while parts are there; of outlets that say so.
        first_jam_s: when the first of these was as long [s].
    """

    parts_through: Statistic
    throughput_per_min: Statistic
    first_through_s: Statistic
    right_share: Statistic
    jams: Statistic
    first_jam_s: Statistic


@dataclass(frozen=True, repr=False)
class OutletCounts(Throughput):
    """Of one outlet, by its name."""

    outlet: str


@dataclass(frozen=True, repr=False)
class OutletFindings(Throughput):
    """Of all outlets together; `outlets` are the same of each."""

    outlets: tuple[OutletCounts, ...]


@dataclass(frozen=True)
class SeedOutlets:
    """What is read of a seed.

    Attributes:
        duration: of the seed [s].
        times: when parts went through each outlet [s].
        right: which of them were right; empty where the outlet does not say.
        jams: when each outlet jammed [s].
    """

    duration: float
    times: tuple[NDArray[np.float64], ...]
    right: tuple[NDArray[np.bool_], ...]
    jams: tuple[NDArray[np.float64], ...]


class Outlets(Measure[OutletFindings, SeedOutlets]):
    """Parts through outlets."""

    counts = (Status.DONE, Status.LEFT_PLATE)
    headline = ("throughput_per_min",)
    missing: ClassVar[Mapping[str, str]] = {"first_through_s": "no part went through an outlet"}

    def applies(self, prepared: Prepared) -> bool:
        return bool(prepared.scene.outlets)

    def reader(self, prepared: Prepared) -> Callable[[Seed], SeedOutlets]:
        scene = prepared.scene
        return lambda seed: _read(scene, seed)

    def findings(self, prepared: Prepared, readings: Sequence[SeedOutlets]) -> OutletFindings:
        watched = [table.jam_after_s is not None for table in prepared.scenario.outlets]
        each = (
            OutletCounts(**_counts(readings, slice(i, i + 1), is_watched), outlet=table.name)
            for i, (table, is_watched) in enumerate(zip(prepared.scenario.outlets, watched, strict=True))
        )
        return OutletFindings(**_counts(readings, slice(None), any(watched)), outlets=tuple(each))

    def lines(self, prepared: Prepared, findings: OutletFindings) -> list[str]:
        if not findings.parts_through.n:
            return []
        lines = [labelled(each.outlet, _line(each)) for each in findings.outlets]
        return [*lines, labelled("all outlets", _line(findings))] if len(lines) > 1 else lines


def _line(counts: Throughput) -> str:
    rate = counts.throughput_per_min
    interval = f" +- {rate.se:.1f} (SE)" if rate.n > 1 else ""
    text = f"{counts.parts_through.mean:.1f} parts, {rate.mean:.1f}{interval} per minute"
    if counts.right_share.n:
        text += f", {100.0 * counts.right_share.mean:.0f} % right"
    if counts.jams.n:
        text += f", {counts.jams.mean:.1f} jams"
    return f"{text}, n = {counted(rate.n, 'seed')}"


def _read(scene: Scene, seed: Seed) -> SeedOutlets:
    frames, removals = seed.frames, seed.removals[seed.removals.cause == Cause.OUTLET]
    times, right, jams = [], [], []
    for i, table in enumerate(scene.scenario.outlets):
        through = removals[removals.outlet == i]
        times.append(np.array(through.time))
        says = bool(table.up) or table.part is not None
        rows = [(frames.row_at(time), part) for time, part in zip(through.time, through.part, strict=True) if says]
        right.append(np.array([is_right(scene, table, frames.quaternion[row])[part] for row, part in rows], bool))
        jams.append(jam_times(frames, times[-1], table.jam_after_s or math.inf))
    return SeedOutlets(float(frames.time[-1]), tuple(times), tuple(right), tuple(jams))


def first_jam(scene: Scene, seed: Seed) -> tuple[float, str] | None:
    """When the first outlet of a seed jammed [s], and its name; None where none did."""
    jams = zip(_read(scene, seed).jams, scene.scenario.outlets, strict=True)
    return min(((float(times[0]), table.name) for times, table in jams if len(times)), default=None)


def jam_times(frames: Frames, through: NDArray[np.float64], after: float) -> NDArray[np.float64]:
    """When no part had gone through for `after` [s], while parts were there; a moment for each such span [s].

    Args:
        frames: of a seed.
        through: when parts went through (n,) [s].
        after: as said.
    """
    is_empty = ~frames.present.any(axis=1)
    breaks = np.sort(np.concatenate([frames.time[[0, -1]], frames.time[is_empty], through]))
    return np.asarray(breaks[:-1][np.diff(breaks) >= after] + after)


def _counts(readings: Sequence[SeedOutlets], of: slice, is_watched: bool) -> dict[str, Statistic]:
    """The numbers of some outlets together."""
    times, right, jams = (
        [np.concatenate(getattr(seed, name)[of]) for seed in readings] for name in ("times", "right", "jams")
    )
    minutes = [seed.duration / 60.0 for seed in readings]
    return {
        "parts_through": Statistic.of(float(len(through)) for through in times),
        "throughput_per_min": Statistic.of(len(each) / span for each, span in zip(times, minutes, strict=True)),
        "first_through_s": Statistic.of(float(through.min(initial=math.inf)) for through in times),
        "right_share": Statistic.of(float(seed.mean()) for seed in right if len(seed)),
        "jams": Statistic.of(float(len(seed)) for seed in jams if is_watched),
        "first_jam_s": Statistic.of(float(seed.min(initial=math.inf)) for seed in jams),
    }
