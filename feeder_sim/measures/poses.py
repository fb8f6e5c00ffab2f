"""Poses: which side up the parts of each kind lie, at the end of every stage and when they are picked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.picking import has_picks
from feeder_sim.measures.protocol import FindingsBase, Measure, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.part.stable_poses import NONE
from feeder_sim.records.seed import Cause, Seed, Status, parts_arrived
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene


@dataclass(frozen=True, repr=False)
class PoseShares(FindingsBase):
    """The poses of one kind at the end of one stage, over the seeds; shares are of its parts on the plate.

    Attributes:
        cycle, stage: as in the schedule; without one, the end of the run.
        end_s: time of the end.
        shares: of every pose in the order of its name [1].
        other: share of parts in none of them, as those that lean on others [1].
        changed: parts in another pose than at the end of the stage before, those excepted that came after it.
    """

    cycle: int
    stage: str
    end_s: Statistic
    shares: tuple[Statistic, ...]
    other: Statistic
    changed: Statistic


@dataclass(frozen=True, repr=False)
class KindPoses(FindingsBase):
    """The poses of one kind of parts.

    Attributes:
        kind: its name.
        names, heights_mm: of its poses, and the heights of the centre of mass in them.
        stages: one entry for each end of a stage.
        picked: parts picked in every pose, in the whole run; no value where nothing is to be picked.
        picked_other: parts picked in none of them.
    """

    kind: str
    names: tuple[str, ...]
    heights_mm: tuple[float, ...]
    stages: tuple[PoseShares, ...]
    picked: tuple[Statistic, ...]
    picked_other: Statistic


@dataclass(frozen=True, repr=False)
class PoseFindings(FindingsBase):
    """One entry for each kind of parts that has stable poses."""

    pose_kinds: tuple[KindPoses, ...]


class Poses(Measure[PoseFindings, "SeedPoses"]):
    """Which side up many parts lie."""

    counts = (Status.DONE, Status.LEFT_PLATE)

    def applies(self, prepared: Prepared) -> bool:
        scene = prepared.scene
        many = prepared.scenario.schedule is not None or len(scene.parts) > 1
        flat = prepared.scenario.run.planar or prepared.is_tracked
        return many and not flat and any(table.poses for table in scene.poses)

    def reader(self, prepared: Prepared) -> Callable[[Seed], SeedPoses]:
        scene = prepared.scene
        return lambda seed: SeedPoses(scene, seed)

    def findings(self, prepared: Prepared, readings: Sequence[SeedPoses]) -> PoseFindings:
        scene, names = prepared.scene, prepared.scenario.kind_names
        return PoseFindings(
            tuple(_of_kind(scene, k, name, readings) for k, name in enumerate(names) if scene.poses[k].poses)
        )

    def lines(self, prepared: Prepared, findings: PoseFindings) -> list[str]:
        lines = []
        for kind in findings.pose_kinds:
            last = kind.stages[-1]
            shares = [f"{name} {_percent(share)}" for name, share in zip(kind.names, last.shares, strict=True)]
            if any(share.n for share in last.shares):
                lines.append(labelled(f"{kind.kind} lie", ", ".join([*shares, f"else {_percent(last.other)}"])))
        return lines


def _percent(share: Statistic) -> str:
    interval = f" +- {100.0 * share.se:.0f}" if share.n > 1 else ""
    return f"{100.0 * share.mean:.0f}{interval} %"


class SeedPoses:
    """What is read of a seed: the pose of every part at the end of each stage reached, and at its pick."""

    def __init__(self, scene: Scene, seed: Seed) -> None:
        frames, removals = seed.frames, seed.removals
        stages = scene.stages(seed.stops.tolist())
        self.end = [s.end for s in stages if s.end <= float(frames.time[-1]) + scene.frame_interval]
        rows = np.array([frames.row_at(end) for end in self.end], np.int64)
        self.number: NDArray[np.int64] = scene.pose_numbers(frames.quaternion[rows])
        self.before: NDArray[np.int64] = scene.pose_numbers(frames.quaternion[np.append(0, rows)[:-1]])
        times = np.append(-np.inf, frames.time[rows])
        for n in range(len(rows)):  # a part that came after the stage before has not changed
            came = parts_arrived(seed.arrivals, start=times[n], end=times[n + 1])
            self.before[n, came] = self.number[n, came]
        self.there = np.array([scene.on_plate(frames[slice(row, row + 1)])[0] for row in rows], bool)
        picked = removals.cause == Cause.PICKED
        self.picked = removals.part[picked]
        at = [frames.row_at(time) for time in removals.time[picked]]
        self.picked_number = np.array(
            [scene.pose_numbers(frames.quaternion[row])[part] for row, part in zip(at, self.picked, strict=True)],
            np.int64,
        )


def _of_kind(scene: Scene, kind: int, name: str, seen: Sequence[SeedPoses]) -> KindPoses:
    """Findings about one kind of parts."""
    table, members = scene.poses[kind], scene.kind_of == kind
    stages = []
    for n, stage in enumerate(scene.times.stages):
        reached = [seed for seed in seen if len(seed.end) > n]
        of_kind = [seed.there[n] & members for seed in reached]
        number = [seed.number[n][there] for seed, there in zip(reached, of_kind, strict=True)]
        before = [seed.before[n][there] for seed, there in zip(reached, of_kind, strict=True)]
        stages.append(
            PoseShares(
                cycle=stage.cycle,
                stage=stage.name,
                end_s=Statistic.of(seed.end[n] for seed in reached),
                shares=tuple(_share(number, pose) for pose in range(len(table.poses))),
                other=_share(number, NONE),
                changed=Statistic.of(float((a != b).sum()) for a, b in zip(number, before, strict=True)),
            )
        )
    picked = [seed.picked_number[members[seed.picked]] for seed in seen if has_picks(scene)]
    return KindPoses(
        kind=name,
        names=table.names,
        heights_mm=tuple(1e3 * pose.height for pose in table.poses),
        stages=tuple(stages),
        picked=tuple(Statistic.of(float((n == pose).sum()) for n in picked) for pose in range(len(table.poses))),
        picked_other=Statistic.of(float((n == NONE).sum()) for n in picked),
    )


def _share(numbers: list[NDArray[np.int64]], pose: int) -> Statistic:
    """Share of a pose, over the seeds with parts on the plate."""
    return Statistic.of(float((number == pose).mean()) for number in numbers if len(number))
