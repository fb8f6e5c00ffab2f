"""Picks per minute, of each kind and pose, and where the time goes.

The clock has the simulated time of the cycles, and that of the camera and the robot, during which the plate rests.
Stages that prepare the parts do not count. With a refill the first cycle does not either, if there are more: it begins
with parts as the scenario places them, the others with what picks and refills leave.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from feeder_sim.measures.picking import IN_NO_POSE, Picks, pick_stages, picks_by_hand, picks_of, robot_of
from feeder_sim.measures.protocol import FindingsBase, Measure, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.notebook import counted
from feeder_sim.records.seed import Seed, Status
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene

MINUTE = 60.0  # [s]


@dataclass(frozen=True)
class Clock:
    """Time of one seed that counts [s]: drives act, the plate rests, the camera looks, the robot picks."""

    driving: float
    pauses: float
    looks: float
    picks: float

    @property
    def total(self) -> float:
        return self.driving + self.pauses + self.looks + self.picks


@dataclass(frozen=True, repr=False)
class PoseRate(FindingsBase):
    """Picks per minute of one kind in one stable pose; "none" for parts in no pose."""

    pose: str
    picks_per_minute: Statistic


@dataclass(frozen=True, repr=False)
class KindRate(FindingsBase):
    """Picks per minute of one kind; no poses for a kind that has none."""

    kind: str
    picks_per_minute: Statistic
    poses: tuple[PoseRate, ...]


@dataclass(frozen=True, repr=False)
class TimeShares(FindingsBase):
    """Shares of the time on the clock [1], see `Clock`."""

    driving: Statistic
    pauses: Statistic
    looks: Statistic
    picks: Statistic


@dataclass(frozen=True, repr=False)
class RateFindings(FindingsBase):
    """Findings over the seeds that ran to their end.

    Attributes:
        counted_from_cycle: first cycle that counts.
        counted_s: time on the clock.
        picks_per_minute: of all kinds together.
        picks_per_minute_of_kind: of each kind.
        time_shares: where the time goes.
    """

    counted_from_cycle: int
    counted_s: Statistic
    picks_per_minute: Statistic
    picks_per_minute_of_kind: tuple[KindRate, ...]
    time_shares: TimeShares


@dataclass(frozen=True)
class SeedRate:
    """What is read of a seed: its picks, and where its time has gone."""

    picks: Picks
    clock: Clock


ONE_LOAD = "while one load empties"


def one_load(scene: Scene) -> bool:
    """Whether no new parts come, so that picks per minute are those of one load and no rate that lasts."""
    schedule = scene.scenario.schedule
    return scene.scenario.refill is None and not (schedule is not None and schedule.by_hand)


class Rate(Measure[RateFindings, SeedRate]):
    """Picks per minute of a schedule with picks."""

    headline = ("picks_per_minute",)
    missing: ClassVar[Mapping[str, str]] = {"picks_per_minute": "no seed came to the end of a cycle that counts"}

    counts = (Status.DONE, Status.LEFT_PLATE)

    def applies(self, prepared: Prepared) -> bool:
        scene = prepared.scene
        return picks_by_hand(scene) or any(bool(stage.picks) for stage in scene.times.stages if stage.cycle)

    def reader(self, prepared: Prepared) -> Callable[[Seed], SeedRate]:
        scene = prepared.scene

        def read(seed: Seed) -> SeedRate:
            picks = picks_of(scene, seed)
            return SeedRate(picks, clock_of(scene, seed, picks))

        return read

    def findings(self, prepared: Prepared, readings: Sequence[SeedRate]) -> RateFindings:
        scene, picks, clocks = prepared.scene, [seed.picks for seed in readings], [seed.clock for seed in readings]
        first = first_cycle(scene)

        def rate(which: Callable[[Picks], np.ndarray]) -> Statistic:
            """Of those picks of every seed that `which` marks."""
            numbers = (int((which(picked) & (picked.cycle >= first)).sum()) for picked in picks)
            return Statistic.of(_ratio(MINUTE * n, clock.total) for n, clock in zip(numbers, clocks, strict=True))

        return RateFindings(
            counted_from_cycle=first,
            counted_s=Statistic.of(clock.total for clock in clocks),
            picks_per_minute=rate(lambda picked: picked.kind >= 0),
            picks_per_minute_of_kind=tuple(_of_kind(scene, kind, rate) for kind in range(len(scene.kinds))),
            time_shares=TimeShares(
                driving=Statistic.of(_ratio(clock.driving, clock.total) for clock in clocks),
                pauses=Statistic.of(_ratio(clock.pauses, clock.total) for clock in clocks),
                looks=Statistic.of(_ratio(clock.looks, clock.total) for clock in clocks),
                picks=Statistic.of(_ratio(clock.picks, clock.total) for clock in clocks),
            ),
        )

    def lines(self, prepared: Prepared, findings: RateFindings) -> list[str]:
        rate = findings.picks_per_minute
        if not rate.n:
            return []
        interval = f" +- {rate.se:.2f} (SE), SD {rate.sd:.2f}" if rate.n > 1 else ""
        begin = f", from cycle {findings.counted_from_cycle} on" if findings.counted_from_cycle > 1 else ""
        load = f", {ONE_LOAD}" if one_load(prepared.scene) else ""
        lines = [labelled("picks per minute", f"{rate.mean:.2f}{interval}, n = {counted(rate.n, 'seed')}{begin}{load}")]
        for entry in findings.picks_per_minute_of_kind:
            poses = [f"{pose.pose} {pose.picks_per_minute.mean:.2f}" for pose in entry.poses]
            spread = f" +- {entry.picks_per_minute.se:.2f}" if rate.n > 1 else ""
            in_poses = f" (in pose {', '.join(poses)})" if poses else ""
            lines.append(labelled(f"of {entry.kind}", f"{entry.picks_per_minute.mean:.2f}{spread}{in_poses}"))
        shares = [f"{name} {100.0 * share.mean:.0f} %" for name, share in vars(findings.time_shares).items()]
        lines.append(labelled("time", ", ".join(shares)))
        return lines


def first_cycle(scene: Scene) -> int:
    """The first cycle that counts."""
    return 2 if scene.scenario.refill and scene.times.stages[-1].cycle > 1 else 1


def clock_of(scene: Scene, seed: Seed, picks: Picks) -> Clock:
    """Where the time of one seed has gone, in the stages of the cycles that count and that it came to the end of."""
    robot, reached = robot_of(scene), float(seed.frames.time[-1]) + scene.frame_interval
    first = first_cycle(scene)
    stages = [s for s in scene.stages(seed.stops.tolist()) if s.cycle >= first and s.end <= reached]
    driving = sum(stage.stop - stage.start for stage in stages if stage.excitations)
    return Clock(
        driving=driving,
        pauses=sum(stage.end - stage.start for stage in stages) - driving,
        looks=robot.camera_s * sum(stage in stages for stage in pick_stages(scene, seed)),
        picks=robot.pick_s * int((picks.cycle >= first).sum()),
    )


def _of_kind(scene: Scene, kind: int, rate: Callable[[Callable[[Picks], np.ndarray]], Statistic]) -> KindRate:
    """The rate of one kind in all, and in each of its poses."""
    names = scene.poses[kind].names
    return KindRate(
        kind=scene.scenario.kind_names[kind],
        picks_per_minute=rate(lambda picked: picked.kind == kind),
        poses=tuple(
            PoseRate(name, rate(lambda picked, name=name: (picked.kind == kind) & (picked.pose == name)))  # type: ignore[misc]
            for name in ((*names, IN_NO_POSE) if names else ())
        ),
    )


def _ratio(value: float, total: float) -> float:
    return value / total if total > 0.0 else math.nan
